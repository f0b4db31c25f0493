"""Text of a submission is harmless once it is cleaned."""

from __future__ import annotations

import random
import time
import unicodedata

import pytest

from lab2_grader.text import clean


@pytest.mark.parametrize(
    ("dirty", "expected"),
    [
        ("plain text", "plain text"),
        ("Grüße, 你好, سلام 🎉", "Grüße, 你好, سلام 🎉"),
        ("family 👨\u200d👩\u200d👧", "family 👨\u200d👩\u200d👧"),
        ("\x1b[31mred\x1b[0m", "red"),
        ("\x1b[2J\x1b[Hcleared", "cleared"),
        ("\x1b]0;title\x07rest", "rest"),
        ("\x1b]8;;http://x\x1b\\link\x1b]8;;\x1b\\", "link"),
        ("\x1b]0;never closed", "0;never closed"),
        ("\x9b31mC1", "C1"),
        ("\x1bPdcs\x1b\\x", "x"),
        ("\x1bcreset", "reset"),
        ("ends in \x1b", "ends in "),
        ("a\nb\tc\r\nd", "a b c  d"),
        ("a\u2028b\u2029c\x85d", "a b c d"),
        ("nul\0bell\x07back\x08del\x7f", "nulbellbackdel"),
        ("\u202egnp.exe\u202c \u2066x\u2069\u200f", "gnp.exe x"),
        ("zero\u200bwidth\ufeff\u00ad", "zerowidth"),
        ("lone \ud800 and \udcff", "lone \ufffd and \ufffd"),
        ("no \uffff character", "no \ufffd character"),
        ("tag\U000e0041s", "tags"),
        ("::error::x <b> =1+1", "::error::x <b> =1+1"),  # escaping is the renderer's
    ],
)
def test_cleaned(dirty: str, expected: str) -> None:
    assert clean(dirty, 100) == expected


def test_length_is_bounded() -> None:
    assert clean("abcdef", 6) == "abcdef"
    assert clean("abcdefg", 6) == "abcde…"
    assert clean("ab", 1) == "…"
    assert len(clean("\x1b[1m" * 1000 + "x" * 1000, 50)) == 50


def test_line_ends_are_kept_when_asked_for() -> None:
    assert clean("a\r\nb\rc\n\x1b[1md\te\u2028f", 100, lines=True) == "a\nb\nc\nd e\nf"


def test_whatever_comes_only_harmless_characters_are_left() -> None:
    draw = random.Random(7)
    alphabet = [
        chr(point) for point in (*range(0x250), 0x061C, *range(0x2000, 0x2070), 0xD800, 0xFEFF, 0xFFFF, 0xE0001)
    ]
    for _ in range(500):
        text = clean("".join(draw.choices(alphabet + ["\x1b[", "\x1b]", "\x9d"] * 20, k=60)), 40)
        assert len(text) <= 40
        text.encode()
        for letter in text:
            assert unicodedata.category(letter) not in ("Cc", "Cs", "Zl", "Zp"), repr(letter)
            assert letter not in "\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
        assert clean(text, 40) == text


@pytest.mark.parametrize("piece", ["\x1b[", "\x1b]0;", "\x1b[0;", "\x1b ", "\u202e", "0;"])
def test_time_grows_with_the_length_only(piece: str) -> None:
    began = time.process_time()
    clean(piece * (2_000_000 // len(piece)), 100)
    clean("\x1b[" + piece * (2_000_000 // len(piece)), 100, lines=True)
    assert time.process_time() - began < 5

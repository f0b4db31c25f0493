"""Addresses are told from paths and shown without secrets; submissions get short, safe, telling names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lab2_grader
from lab2_grader.messages import catalogue
from lab2_grader.submission import address


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("https://github.com/me/lab2", True),
        ("HTTPS://github.com/me/lab2", True),
        ("ssh://git@github.com/me/lab2", True),
        ("file:///home/me/lab2", True),
        ("git@github.com:me/lab2.git", True),
        ("github.com/me/lab2", True),
        ("ext::sh -c x", True),
        ("gopher://x", True),
        ("lab2", False),
        ("./git@github.com:me", False),
        ("/home/me/lab2.zip", False),
        ("-u", False),
        ("", False),
        ("C:\\lab2", False),
        ("..", False),
    ],
)
def test_told_from_paths(source: str, expected: bool) -> None:
    assert address.is_address(source) is expected


def test_an_address_without_its_scheme_gets_one() -> None:
    assert address.checked("github.com/me/lab2") == "https://github.com/me/lab2"
    assert address.checked("git@github.com:me/lab2") == "git@github.com:me/lab2"


@pytest.mark.parametrize(
    ("source", "shown"),
    [
        ("https://u:p@h/x?t=1#f", "https://h/x"),
        ("https://u:p@w@h/x", "https://h/x"),
        ("ssh://git@h:22/x", "ssh://git@h:22/x"),
        ("ssh://me@h/x", "ssh://h/x"),
        ("git@h:x", "git@h:x"),
        ("me@h:x", "h:x"),
        ("https://[broken/x", "https://[broken/x"),
        ("https://me:p@[broken/x", "https://[broken/x"),
        ("../x.git", "../x.git"),
    ],
)
def test_secrets_are_not_shown(source: str, shown: str) -> None:
    assert address.without_secrets(source) == shown


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("https://github.com/sc21abc/lab2.git", "sc21abc-lab2"),
        ("https://github.com/sc21abc/comp3631/", "sc21abc-comp3631"),
        ("git@github.com:sc21abc/lab2", "sc21abc-lab2"),
        ("https://u:p@host/lab2", "lab2"),
        ("file:///home/sc21abc/lab2", "sc21abc"),
    ],
)
def test_names_of_addresses(source: str, name: str) -> None:
    assert address.name_of_address(source) == name


@pytest.mark.parametrize(
    ("path", "suffix", "name"),
    [
        ("/inbox/sc21abc", "", "sc21abc"),
        ("/inbox/sc21abc/lab2", "", "sc21abc"),
        ("/inbox/sc21abc/ros2_ws/src/lab2", "", "sc21abc"),
        ("/inbox/sc21abc/submission.zip", ".zip", "sc21abc"),
        ("/inbox/sc21abc_lab2.tar.gz", ".tar.gz", "sc21abc_lab2"),
        ("/checkout/solution", "", "solution"),
        ("/checkout/lab2_template", "", "lab2_template"),
        ("/home/runner/work/lab2/lab2", "", "lab2"),
        ("/root/lab2", "", "lab2"),
        ("/", "", "submission"),
        ("/x/Zoë O'Brien (1)", "", "Zo-O-Brien-1"),
        ("/x/-rf", "", "rf"),
        ("/x/.hidden", "", "hidden"),
        ("/x/" + "n" * 200, "", "n" * 80),
        ("/x/\x1b[31m", "", "31m"),
        ("/x/你好", "", "submission"),
    ],
)
def test_names_of_paths(path: str, suffix: str, name: str) -> None:
    assert address.name_of_path(Path(path), suffix) == name
    assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,79}", name)


def test_every_refusal_has_its_sentence_and_every_sentence_its_use() -> None:
    code = "".join(path.read_text() for path in Path(lab2_grader.__file__).parent.rglob("*.py"))
    used = set(re.findall(r'refusal\(\s*"([a-z0-9-]+)"', code))
    assert used == set(catalogue().refusal)
    for rule, entry in catalogue().refusal.items():
        assert entry.text.endswith((".", "}")), rule

"""Reads what the grader shows as its readers do (a browser, a Markdown and an XML parser, a terminal, a workflow's log,
a spreadsheet), and says where a text of a submission became more than text."""

from __future__ import annotations

import csv
import io
import json
import re
import unicodedata
from collections.abc import Iterator
from html.parser import HTMLParser
from xml.etree import ElementTree

from markdown_it import MarkdownIt

# What moves a cursor, hides, or reorders: controls but the end of a line, and formatting that cannot be seen. The
# joiners are part of scripts and emoji.
JOINERS = "\u200c\u200d"
WORKFLOW = re.compile(r"^\s*(::[a-z][a-z-]*( .*)?::|##\[|##vso\[)", re.MULTILINE)
FORMULA = "=+-@\t\r\uff1d\uff0b\uff0d\uff20"
CANARY = "canary"
URL_ATTRIBUTES = ("href", "src", "action", "formaction", "xlink:href", "srcset", "data")
OWN_MARKUP = ("script", "style", "svg", "iframe", "object", "embed", "base", "form", "img", "link", "meta")


def shown_harmlessly(name: str, data: bytes) -> None:
    """Check the file *name*, whatever renderer wrote it, by what its name says it is.

    Raises:
        AssertionError: Something of it is more than text.
    """
    text = data.decode()
    _no_controls(name, text)
    kind = name.rsplit(".", 1)[-1]
    check = {"html": _html, "md": _markdown, "xml": _xml, "json": _json, "csv": _csv, "txt": _plain}.get(kind)
    assert check is not None, f"no reader for {name}: add one here"
    check(name, text)


def _no_controls(name: str, text: str) -> None:
    for index, character in enumerate(text) if not text.replace("\n", "").isprintable() else ():
        if character in "\n" + JOINERS:
            continue
        category = unicodedata.category(character)
        around = text[max(0, index - 40) : index + 40]
        assert category not in ("Cc", "Cf", "Cs", "Cn", "Zl", "Zp"), f"{name}: {character!r} in {around!r}"


def _plain(name: str, text: str) -> None:
    assert not (found := WORKFLOW.search(text)), f"{name}: a workflow command: {found and found[0]!r}"


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.problems: list[str] = []
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        for key, value in attributes:
            if key.startswith("on"):
                self.problems.append(f"an event handler on <{tag}>: {key}={value!r}")
            if key in URL_ATTRIBUTES and (CANARY in (value or "") or not _local(value or "")):
                self.problems.append(f"<{tag}> leads to {value!r}")
            if CANARY in key or (tag in OWN_MARKUP and CANARY in (value or "")):
                self.problems.append(f"<{tag}> has {key}={value!r}")

    def handle_endtag(self, tag: str) -> None:
        if tag in self.open:
            while self.open.pop() != tag:
                pass

    def handle_comment(self, data: str) -> None:
        if CANARY in data:
            self.problems.append(f"a comment: {data[:80]!r}")

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("script", "style") and CANARY in data:
            self.problems.append(f"within <{self.open[-1]}>: {data[:80]!r}")
        self.text.append(data)


def _local(address: str) -> bool:
    scheme = re.match(r"\s*([a-zA-Z][a-zA-Z0-9+.-]*):", address)
    return scheme is None or scheme[1].lower() in ("https", "http", "mailto") or address.startswith("data:image/")


def _html(name: str, text: str) -> None:
    tags = _Tags()
    tags.feed(text)
    tags.close()
    assert not tags.problems, f"{name}: {tags.problems[:3]}"


def _markdown(name: str, text: str) -> None:
    _plain(name, text)
    parser = MarkdownIt("commonmark", {"html": True, "linkify": False}).enable(["table", "strikethrough"])
    tokens = parser.parse(text)
    for token in _all(tokens):
        assert token.type not in ("html_block", "html_inline") or CANARY not in token.content, (
            f"{name}: {token.content!r}"
        )
        assert token.type != "image", f"{name}: an image: {token.content!r}"
        for value in token.attrs.values() if token.type == "link_open" else ():
            assert CANARY not in str(value), f"{name}: a link to {value!r}"
    for index, token in enumerate(tokens):
        if token.type == "heading_open":
            assert CANARY not in tokens[index + 1].content, f"{name}: a heading: {tokens[index + 1].content!r}"
    columns: list[int] = []
    for token in tokens:
        if token.type == "tr_open":
            columns.append(0)
        elif token.type in ("td_open", "th_open"):
            columns[-1] += 1
        elif token.type == "table_close":
            assert len(set(columns)) == 1, f"{name}: rows of {columns} cells"
            columns = []


def _all(tokens: list[object]) -> Iterator[object]:
    for token in tokens:
        yield token
        yield from _all(token.children or [])  # type: ignore[attr-defined]


def _xml(name: str, text: str) -> None:
    ElementTree.fromstring(text)
    _plain(name, text)


def _json(name: str, text: str) -> None:
    for value in _strings(json.loads(text)):
        _no_controls(name, value)


def _strings(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield key
            yield from _strings(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _strings(inner)


def _csv(name: str, text: str) -> None:
    rows = list(csv.reader(io.StringIO(text)))
    assert len({len(row) for row in rows}) <= 1, f"{name}: rows of different length"
    for cell in (cell for row in rows for cell in row):
        assert not (CANARY in cell and cell.startswith(tuple(FORMULA))), f"{name}: a formula: {cell!r}"

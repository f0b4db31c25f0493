"""Shows the lab's real files: whole, as a difference between two, and line numbers found by what the line says."""

from __future__ import annotations

import difflib
import functools
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup, escape
from pygments.lexers import PythonLexer, XmlLexer
from pygments.token import Comment, Keyword, Name, Number, String, _TokenType

from lab2_worksheet.errors import SourceError
from lab2_worksheet.places import SOLUTION, TEMPLATE

_CLASSES = (
    (String.Doc, "c"),
    (Comment, "c"),
    (Keyword, "k"),
    (String, "s"),
    (Number, "n"),
    (Name.Function, "f"),
    (Name.Class, "f"),
    (Name.Decorator, "f"),
)


@dataclass(frozen=True)
class Listing:
    """A file of the package as it stands in the repository; `path` is relative to the package."""

    path: str
    text: str

    @property
    def key(self) -> str:
        """The beginning of its lines' ids in the page."""
        return self.path.replace("/", "-").replace(".", "-")

    def line(self, anchor: str) -> int:
        """The number of the one line that contains *anchor*, from 1.

        Raises:
            SourceError: No line does, or several do.
        """
        found = [number for number, line in enumerate(self.text.splitlines(), 1) if anchor in line]
        if len(found) != 1:
            lines = f"lines {', '.join(map(str, found))}" if found else "no line"
            raise SourceError(f"{self.path}: the anchor {anchor!r} must stand in one line; it stands in {lines}.")
        return found[0]


@functools.cache
def template(path: str) -> Listing:
    """A file of the package as handed out.

    Raises:
        SourceError: There is no such file.
    """
    return _listing(TEMPLATE, path)


@functools.cache
def solution(path: str) -> Listing:
    """A file of the finished package. For the staff edition and for the test of the editions alone.

    Raises:
        SourceError: There is no such file.
    """
    return _listing(SOLUTION, path)


def _listing(package: Path, path: str) -> Listing:
    try:
        return Listing(path, (package / path).read_text(encoding="utf-8"))
    except OSError as error:
        raise SourceError(f"{package.name}/{path} cannot be read: {error.strerror}.") from error


def numbered(listing: Listing, *, first: str = "", last: str = "") -> Markup:
    """The listing as a `<pre>` with a number and an id for each line, or the part between two anchors."""
    start = listing.line(first) if first else 1
    end = listing.line(last) if last else len(listing.text.splitlines())
    rows = [
        Markup('<span class="l" id="{0}-L{1}" data-n="{1}">{2}\n</span>').format(listing.key, number, line)
        for number, line in enumerate(_coloured(listing), 1)
        if start <= number <= end
    ]
    return Markup('<pre tabindex="0" role="group" aria-label="Listing of {}"><code>{}</code></pre>').format(
        listing.path, Markup("").join(rows)
    )


def _coloured(listing: Listing) -> list[Markup]:
    """The lines of the listing with a `<span class>` around what has a colour."""
    lexer = XmlLexer() if listing.path.endswith(".xml") else PythonLexer()
    lines = [Markup("")]
    for token, value in lexer.get_tokens(listing.text):
        kind = _class(token)
        for number, part in enumerate(value.split("\n")):
            if number:
                lines.append(Markup(""))
            if part:
                lines[-1] += Markup('<span class="{}">{}</span>').format(kind, part) if kind else escape(part)
    while lines and not lines[-1]:
        lines.pop()
    return lines


def _class(token: _TokenType) -> str:
    return next((name for kind, name in _CLASSES if token in kind), "")


def changed_lines(began_as: str, file: str) -> list[str]:
    """The lines that the solution's *file* adds to the template's *began_as*, stripped."""
    old = template(began_as).text.splitlines() if began_as else []
    new = solution(file).text.splitlines()
    return [line[2:].strip() for line in difflib.ndiff(old, new) if line.startswith("+ ")]


def difference(began_as: str, file: str) -> Markup:
    """What the solution changes in a file of the template, as a `<pre>`; staff edition only."""
    old = template(began_as).text.splitlines() if began_as else []
    new = solution(file).text.splitlines()
    kinds = {"+": "ins", "-": "del", "@": "at"}
    rows = [
        Markup('<span class="{}">{}\n</span>').format(kinds.get(line[:1], "same"), line)
        for line in list(difflib.unified_diff(old, new, n=2, lineterm=""))[2:]
    ]
    return Markup(
        '<figure class="listing diff"><figcaption>{} → {}</figcaption>'
        '<pre tabindex="0" role="group" aria-label="Changes in {}"><code>{}</code></pre></figure>'
    ).format(began_as or "new file", file, file, Markup("").join(rows))

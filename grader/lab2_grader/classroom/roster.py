"""A table of students and the addresses of their repositories. Pure."""

from __future__ import annotations

import csv
import re
from datetime import datetime

from lab2_grader.records import Record, Unknown
from lab2_grader.submission.address import is_address
from lab2_grader.text import clean

# Names of columns as they are seen in the wild, lower case, without blanks, dashes and underscores.
_COLUMNS = {
    "address": ("repository", "repo", "url", "address", "repositoryurl", "repourl", "studentrepositoryurl", "giturl",
                "github", "githuburl", "githubrepository", "repositoryaddress", "clone", "cloneurl", "link"),
    "student": ("username", "user", "login", "studentid", "id", "identifier", "rosteridentifier", "githubusername",
                "student", "studentname", "name", "fullname", "email", "emailaddress"),
    "commit": ("commit", "sha", "revision", "commitid"),
    "before": ("deadline", "before", "due", "duedate"),
}  # fmt: skip
_MARKS = re.compile(r"[\s_\-]+")


class Row(Record, frozen=True):
    """A student and a repository."""

    student: str
    keys: tuple[str, ...]
    address: str
    commit: str
    before: datetime | None
    line: int


def looks_like_one(text: str) -> bool:
    """Whether *text* is such a table: it has a column for addresses, or addresses in one of its columns."""
    rows = _rows(text)
    return bool(rows) and ("address" in _header(rows[0]) or any(is_address(cell.strip()) for cell in rows[0]))


def read(text: str) -> tuple[tuple[Row, ...], tuple[Unknown, ...]]:
    """The rows of the table *text*, and those that are not understood."""
    rows = _rows(text)
    header = _header(rows[0]) if rows else {}
    body = list(enumerate(rows, 1))
    if "address" in header:
        body = body[1:]
    else:  # no header: the address is the column that holds one, the student the first other
        at = next((index for index, cell in enumerate(rows[0]) if is_address(cell.strip())), 0) if rows else 0
        header = {"address": [at], "student": [0 if at else 1]}
    found, unknown = [], []
    for number, cells in body:
        if not any(cell.strip() for cell in cells):
            continue
        values = {
            name: [cells[index].strip() for index in columns if index < len(cells) and cells[index].strip()]
            for name, columns in header.items()
        }
        address, keys = "".join(values["address"][:1]), tuple(values.get("student", ()))
        what = f"line {number}: {clean(', '.join(cells), 120)}"
        try:
            before = _time("".join(values.get("before", ())[:1]))
        except ValueError:
            unknown.append(Unknown(what, "the deadline is no date: write it like 2026-10-23 17:00+01:00"))
            continue
        if not address:
            unknown.append(Unknown(what, "no address of a repository"))
        elif not is_address(address):
            unknown.append(Unknown(what, f"“{clean(address, 80)}” is no address of a repository"))
        else:
            commit = "".join(values.get("commit", ())[:1])
            found.append(Row(keys[0] if keys else "", keys, address, commit, before, number))
    return tuple(found), tuple(unknown)


def _rows(text: str) -> list[list[str]]:
    """The cells of *text*, row by row; none when it is no table, as one with a cell of over 131,072 characters."""
    first = text.split("\n", 1)[0]
    delimiter = max(",;\t", key=first.count)
    try:
        return list(csv.reader(text.splitlines(), delimiter=delimiter))
    except csv.Error:
        return []


def _header(cells: list[str]) -> dict[str, list[int]]:
    """Columns by what they are for; for the student the better known names first."""
    plain = [_MARKS.sub("", cell).lower() for cell in cells]
    found = {
        name: [index for known in names for index, cell in enumerate(plain) if cell == known]
        for name, names in _COLUMNS.items()
    }
    return {name: columns for name, columns in found.items() if columns}


def _time(text: str) -> datetime | None:
    """The time that *text* names, in this machine's time zone when it does not name one; None for an empty text.

    Raises:
        ValueError: It is no time.
    """
    if not text:
        return None
    found = datetime.fromisoformat(text.replace("Z", "+00:00") if text.endswith("Z") else text)
    return found if found.tzinfo else found.astimezone()

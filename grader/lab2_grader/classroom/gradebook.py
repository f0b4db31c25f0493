"""Fills marks into a file that a gradebook gave out, and leaves every other byte as it was.

Minerva (Blackboard Learn): text with commas or tabs, often UTF-16, keyed by `Username`; the column of a mark is headed
`<Title> [Total Pts: <n> Score] |<id>`. Moodle's offline worksheet: keyed by `Identifier`, with `Grade` and `Maximum Grade`.
No header is ever invented: a column that is not there is not made.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from lab2_grader.classroom import summary
from lab2_grader.classroom.summary import guarded
from lab2_grader.errors import UsageError
from lab2_grader.evidence import write_atomically
from lab2_grader.records import ClassLine, Record
from lab2_grader.text import clean

FEEDBACK_LENGTH = 1_000
_BOMS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_TOTAL = re.compile(
    r"(?P<title>.*?)\s*\[Total Pts: (?P<total>\d+(?:[.,]\d+)?)(?: \w+)?\]\s*(?:\|(?P<id>\w+))?", re.DOTALL
)
_KEYS = ("username", "user name", "identifier", "id number", "student id", "email address", "email")
_NAMES = ("full name",)  # two students may bear the same one


class Filled(Record, frozen=True):
    """What was filled in.

    Args:
        cells: How many marks were written.
        column: Title of their column.
        total: What the column's marks are out of, as text.
        without_mark: Students in both whose mark is withheld or whose submission was refused.
        only_in_book: Students in the file for whom there is no result.
        only_in_results: Results that are in no row of the file.
        ambiguous: Students in the file for whom there is more than one result, or whose result another row claims too.
    """

    cells: int
    column: str
    total: str
    without_mark: tuple[str, ...]
    only_in_book: tuple[str, ...]
    only_in_results: tuple[str, ...]
    ambiguous: tuple[str, ...]


class Cell(Record, frozen=True):
    """A cell: what stands in it, and from where to where it stands in the text, quotes included."""

    value: str
    start: int
    end: int
    quoted: bool


def fill(results: Path, download: Path, upload: Path, *, column: str = "", feedback: bool = False) -> Filled:
    """Fill the marks in *results* into a copy of *download*.

    Args:
        results: The folder that `grade-all` wrote.
        download: A file downloaded from Minerva or Moodle.
        upload: Where the filled copy goes.
        column: Title or id of the column, where several could take a mark.
        feedback: Fill the column for feedback too, beside each mark.

    Raises:
        UsageError: A file cannot be read or written, is not of such a kind, or it is not clear which column is meant.
    """
    lines = summary.read(results).lines
    if upload.exists() and download.exists() and upload.samefile(download):
        raise UsageError("The file to upload must be another than the one downloaded: keep that as it is.")
    try:
        raw = download.read_bytes()
    except OSError as error:
        raise UsageError(f"{download} cannot be read: {error.strerror}.") from error
    bom, encoding, text = _decode(raw, download)
    filled, done = _fill(text, lines, column, feedback)
    try:
        written = bom + filled.encode(encoding)
    except UnicodeEncodeError:
        written = bom + filled.encode(encoding, errors="replace")  # only what was filled in can be concerned
    write_atomically(upload, written)
    return done


def _decode(raw: bytes, path: Path) -> tuple[bytes, str, str]:
    """(byte order mark, encoding, text) of *raw*, such that encoding the text gives the same bytes again."""
    for bom, encoding in _BOMS:
        if raw.startswith(bom):
            candidates = [(bom, encoding)]
            break
    else:
        zeros = raw[:200].count(0)
        wide = ["utf-16-le", "utf-16-be"] if raw[:2].endswith(b"\0") else ["utf-16-be", "utf-16-le"]
        candidates = [(b"", encoding) for encoding in ([*wide] if zeros > 20 else ["utf-8", "cp1252", "latin-1"])]
    for bom, encoding in candidates:
        try:
            text = raw[len(bom) :].decode(encoding)
        except UnicodeDecodeError:
            continue
        if bom + text.encode(encoding) == raw:
            return bom, encoding, text
    raise UsageError(f"The encoding of {path} is not one that a gradebook writes (UTF-8, UTF-16, Windows).")


def _fill(text: str, lines: tuple[ClassLine, ...], column: str, feedback: bool) -> tuple[str, Filled]:
    first = text.split("\n", 1)[0]
    delimiter = max("\t,;", key=first.count)
    rows = list(_rows(text, delimiter))
    if not rows:
        raise UsageError("The file is empty. Download it from the gradebook first.")
    header = [cell.value.strip() for cell in rows[0]]
    plain = [name.lower() for name in header]
    keys = [plain.index(name) for name in _KEYS if name in plain]
    names = [plain.index(name) for name in _NAMES if name in plain]
    if not keys and not names:
        raise UsageError(
            f"The file has no column that names the student (Username or Identifier), only: {_shown(header)}."
        )
    mark_at, total_at, total = _mark_column(header, plain, column)
    title = header[mark_at]
    feedback_at = next((plain.index(n) for n in ("feedback to learner", "feedback comments") if n in plain), None)
    if feedback and feedback_at is None:
        raise UsageError(
            "The file has no column for feedback. From Minerva, download the single column with its feedback; "
            "in Moodle, switch feedback comments on."
        )
    claims = _claims(lines, rows[1:], keys) or _claims(lines, rows[1:], names)
    claimed = Counter(line.name for found in claims.values() for line in found)
    without, only_in_book, ambiguous = [], [], []
    edits: list[tuple[Cell, str]] = []
    marks = 0
    for number, row in enumerate(rows[1:]):
        values = [cell.value.strip() for cell in row]
        shown = next((values[at] for at in (*keys, *names) if at < len(values) and values[at]), "")
        if not shown:
            continue
        found = claims.get(number, ())
        if not found:
            only_in_book.append(shown)
            continue
        if len(found) > 1 or claimed[found[0].name] > 1:
            ambiguous.append(shown)
            continue
        line = found[0]
        out_of = _number(values[total_at]) if total_at is not None and total_at < len(values) else total
        if line.score is None or not line.max_score or mark_at >= len(row) or out_of is None:
            without.append(shown)
            continue
        edits.append((row[mark_at], _plain_number(line.score * out_of / line.max_score)))
        marks += 1
        if feedback and feedback_at is not None and feedback_at < len(row):
            edits.append((row[feedback_at], guarded(_feedback(line))))
    pieces, at = [], 0
    for cell, value in sorted(edits, key=lambda edit: edit[0].start):
        pieces += [text[at : cell.start], _written(value, cell.quoted, delimiter)]
        at = cell.end
    filled = "".join([*pieces, text[at:]])
    return filled, Filled(
        cells=marks,
        column=clean(title, 200),
        total="its maximum" if total_at is not None else _plain_number(total or 0),
        without_mark=tuple(clean(name, 100) for name in without),
        only_in_book=tuple(clean(name, 100) for name in only_in_book),
        only_in_results=tuple(line.name for line in lines if line.name not in claimed),
        ambiguous=tuple(clean(name, 100) for name in ambiguous),
    )


def _claims(lines: tuple[ClassLine, ...], rows: list[list[Cell]], columns: list[int]) -> dict[int, list[ClassLine]]:
    """For the number of each row that some result fits, the results that fit its first key in *columns* that any fits."""
    known: dict[str, dict[str, ClassLine]] = {}
    for line in lines:
        for key in (line.name, *line.keys):
            known.setdefault(key.casefold(), {})[line.name] = line
    claims = {}
    for number, row in enumerate(rows):
        keys = [row[at].value.strip().casefold() for at in columns if at < len(row)]
        found = next((known[key] for key in keys if key and key in known), None)
        if found:
            claims[number] = list(found.values())
    return claims


def _mark_column(header: list[str], plain: list[str], wanted: str) -> tuple[int, int | None, float | None]:
    """(column of the mark, column of its maximum or None, the maximum or None)."""
    if "grade" in plain and "maximum grade" in plain:
        return plain.index("grade"), plain.index("maximum grade"), None
    found = []
    for at, name in enumerate(header):
        match = _TOTAL.fullmatch(name)
        if match and (not wanted or wanted in (match["id"], match["title"], name)):
            found.append((at, float(match["total"].replace(",", "."))))
    if not found:
        many = f" called “{wanted}”" if wanted else ""
        raise UsageError(f"The file has no column for marks{many} ([Total Pts: …]), only: {_shown(header)}.")
    worth = [item for item in found if item[1] > 0]
    if len(worth) != 1:
        names = _shown([header[at] for at, _ in found])
        reason = "Several columns could take the mark" if worth else "The column is worth 0 points"
        raise UsageError(
            f"{reason}: {names}. " + ("Name one with --column." if worth else "Give it points in Minerva.")
        )
    return worth[0][0], None, worth[0][1]


def _shown(names: list[str]) -> str:
    return clean("; ".join(names), 500)


def _number(text: str) -> float | None:
    try:
        found = float(text.replace(",", "."))
    except ValueError:
        return None
    return found if found > 0 else None


def _plain_number(value: float) -> str:
    """*value* with at most two decimals, as every gradebook reads it."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _feedback(line: ClassLine) -> str:
    lost = "; ".join(f"{lost.check} (-{lost.points}): {lost.observed}" for lost in line.lost if lost.points)
    return clean(
        f"{line.score} of {line.max_score}. " + (f"Lost: {lost}" if lost else "Everything asked was seen."),
        FEEDBACK_LENGTH,
    )


def _rows(text: str, delimiter: str) -> Iterator[list[Cell]]:
    """The cells of *text*, row by row, each with its place."""
    row: list[Cell] = []
    at, size = 0, len(text)
    while at < size:
        start = at
        quoted = text[at] == '"'
        if quoted:
            at += 1
            while at < size:
                end = text.find('"', at)
                if end < 0:
                    raise UsageError("The file ends within quotes. Download it again.")
                at = end + 1
                if at >= size or text[at] != '"':
                    break
                at += 1
            value = text[start + 1 : at - 1].replace('""', '"')
            start_of_rest = at
        else:
            value, start_of_rest = "", at
        while at < size and text[at] != delimiter and text[at] not in "\r\n":
            at += 1
        value += text[start_of_rest:at]
        row.append(Cell(value, start, at, quoted))
        if at < size and text[at] == delimiter:
            at += 1
            if at == size or text[at] in "\r\n":
                row.append(Cell("", at, at, quoted=False))
            else:
                continue
        yield row
        row = []
        while at < size and text[at] in "\r\n":
            at += 1
    if row:
        yield row


def _written(value: str, quoted: bool, delimiter: str) -> str:
    if quoted or any(mark in value for mark in (delimiter, '"', "\r", "\n")):
        return '"' + value.replace('"', '""') + '"'
    return value

"""Writes the editions to disk."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lab2_worksheet.errors import SourceError
from lab2_worksheet.pages import editions
from lab2_worksheet.places import OUTPUT, TEMPLATE_README

STUDENT_BYTES = 200_000  # the student edition is smaller


@dataclass(frozen=True)
class Written:
    """A file that was written, and its size in bytes."""

    path: Path
    size: int


def build(out: Path = OUTPUT, readme: Path = TEMPLATE_README) -> list[Written]:
    """Build every edition into *out*, and the template's README to *readme*.

    Raises:
        SourceError: A source is wrong, or the student edition is too large.
    """
    made = editions()
    if len(made.student.encode()) >= STUDENT_BYTES:
        raise SourceError(f"The student edition has {len(made.student.encode())} bytes; {STUDENT_BYTES} is too many.")
    out.mkdir(parents=True, exist_ok=True)
    texts = {
        out / "student.html": made.student,
        out / "staff.html": made.staff,
        out / "fragment.html": made.fragment,
        readme: made.readme,
    }
    written = []
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8")
        written.append(Written(path, len(text.encode())))
    return written

"""Pure renderers of a result: one module for each format; none of them reads, writes or prints.

Every renderer is a function of a `Report`, a frozen value with what its audience may see (`view.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import msgspec

from lab2_grader.records import Evidence, Result
from lab2_grader.report.classroom50 import classroom50
from lab2_grader.report.gradescope import gradescope
from lab2_grader.report.html import html
from lab2_grader.report.junit import junit
from lab2_grader.report.markdown import markdown
from lab2_grader.report.view import Audience, Report, report_of

__all__ = ["FORMATS", "NAMES", "RESULT", "Audience", "Report", "as_json", "files", "report_of"]

RESULT = "result.json"
NAMES = ("report.html", "report.md", "junit.xml", "staff.html", RESULT)  # what `files` makes


def as_json(report: Report) -> str:
    """The result itself, indented."""
    return msgspec.json.format(msgspec.json.encode(report.result), indent=2).decode() + "\n"


FORMATS: Mapping[str, Callable[[Report], str]] = {
    "html": html,
    "md": markdown,
    "junit": junit,
    "gradescope": gradescope,
    "classroom50": classroom50,
    "json": as_json,
}


def files(result: Result, evidence: Evidence) -> tuple[tuple[str, bytes], ...]:
    """(name, content) of every file that a result is written to; `staff.html` and `result.json` are not for students."""
    student, staff = report_of(result, evidence), report_of(result, evidence, Audience.STAFF)
    texts = (html(student), markdown(student), junit(student), html(staff), as_json(staff))
    return tuple((name, _bytes(text)) for name, text in zip(NAMES, texts, strict=True))


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "replace")

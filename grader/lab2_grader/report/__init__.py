"""Pure renderers of a result: one module for each format; none of them reads, writes or prints."""

from __future__ import annotations

import msgspec

from lab2_grader.records import Result
from lab2_grader.report.markdown import markdown

RESULT = "result.json"


def files(result: Result) -> tuple[tuple[str, bytes], ...]:
    """(name, content) of every file that a result is written to."""
    return (
        ("report.md", markdown(result).encode()),
        (RESULT, msgspec.json.format(msgspec.json.encode(result), indent=2) + b"\n"),
    )

"""Writes formats.md: every field of what the grader leaves on disk, as the records and their docstrings say it.

Usage: python make_formats.py > formats.md
"""

from __future__ import annotations

import enum
import inspect
import re
from typing import get_type_hints

import msgspec

from lab2_grader import evidence, pipeline, records, report
from lab2_grader.classroom import results, run, summary
from lab2_grader.classroom.records import Stamp

STUDENTS, GITHUB, PROGRAMS, STAFF, RESULT = (f"`{name}`" for name in report.NAMES)
HEAD = f"""# What stands on disk, field by field

Made from the records in `lab2_grader/records.py` and `lab2_grader/evidence.py` by `docs/make_formats.py`; a test holds that it
is up to date. Times within a scene (`at`) are seconds since that scene began. Whatever text comes from a submission has been
cleaned (no control characters) and cut to a bounded length.

A result's folder holds

| file | what it is |
|---|---|
| {RESULT} | the mark: a `Result` |
| {STUDENTS}, {GITHUB}, {PROGRAMS} | the same for students, for GitHub and for other programs |
| {STAFF} | for staff only: it shows what students must not see |
| `{pipeline.EVIDENCE}/{evidence.MANIFEST}` | the `Manifest`: how far the run came, and which scenes there are |
| `{pipeline.EVIDENCE}/{evidence.SUBMISSION}` | a `SubmissionFacts` |
| `{pipeline.EVIDENCE}/{evidence.BUILD}` | a `Build`, once the build has ended |
| `{pipeline.EVIDENCE}/<scene>.jsonl` | what was observed in a scene, one row a line: a JSON array whose first element names the kind of row |

Evidence of another version is refused by name. A class's folder holds

| file | what it is |
|---|---|
| `<name>/` | a result's folder for each submission, named after whose it is |
| `<name>/{results.STAMP}` | a `Stamp` |
| `{summary.PAGE}`, `{summary.CSV}` | the overview for people, and as a table |
| `{summary.JSON}` | the overview for programs: a `ClassSummary` |
| `{run.FAULTS}` | only where the grader itself failed: which submissions it failed on, and how |
"""
PARTS = {
    "The result": (records.Result, records.SubmissionResult, records.ItemResult, records.CheckResult, records.Runtime,
                   records.Seconds, records.Digests),
    "The evidence": (evidence.Manifest, evidence.SceneEntry, records.SubmissionFacts, records.SourceFile,
                     records.GitFacts, records.Build, records.EntryPoint),
    "The rows of a scene": (records.Phase, records.Endpoint, records.Message, records.Line, records.Tick, records.Sent,
                            records.ProcessSeen, records.ProcessGone, records.ProgramEnded, records.Measured,
                            records.Unsupported),
    "The class": (Stamp, records.ClassSummary, records.ClassLine, records.Lost, records.CheckRate, records.CommonFault,
                  records.Unknown),
    "Words": (records.Status, records.Clock, records.SceneName, records.EndedBy, records.ClassState),
}  # fmt: skip


def words(record: type) -> tuple[str, dict[str, str]]:
    """(what *record* is, what each field of it means), from its docstring."""
    text = inspect.getdoc(record) or ""
    about, _, arguments = text.partition("\nArgs:\n")
    found: dict[str, str] = {}
    name = ""
    for line in arguments.splitlines():
        if match := re.match(r"    (\w+): (.*)", line):
            name = match[1]
            found[name] = match[2].strip()
        elif name and line.strip():
            found[name] += " " + line.strip()
    return " ".join(about.split()), found


def described(record: type) -> str:
    """The section of one record, or of one set of words."""
    about, meanings = words(record)
    lines = [f"### `{record.__name__}`", "", about, ""]
    if issubclass(record, enum.Enum):
        return "\n".join([*lines, ", ".join(f"`{member.value}`" for member in record), ""])
    hints = get_type_hints(record)
    lines += ["| field | type | meaning |", "|---|---|---|"]
    if issubclass(record, records.Row):
        lines.append(f"| row | str | `{record.__name__}` |")
    for field in msgspec.structs.fields(record):
        kind = getattr(hints[field.name], "__name__", "") if isinstance(hints[field.name], type) else ""
        kind = kind or str(hints[field.name])
        kind = re.sub(r"[\w]+\.", "", kind).replace("|", "or")
        meaning = meanings.get(field.name, "").replace("|", "\\|")
        meaning = re.sub(r"\w+_SCHEMA", lambda found: getattr(records, found[0]), meaning)
        lines.append(f"| {field.encode_name} | {kind} | {meaning} |")
    return "\n".join([*lines, ""])


def formats() -> str:
    """The whole page."""
    parts = [HEAD]
    for title, kinds in PARTS.items():
        parts += [f"## {title}", "", *(described(kind) for kind in kinds)]
    return "\n".join(parts)


if __name__ == "__main__":
    print(formats(), end="")

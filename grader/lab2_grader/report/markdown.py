"""The result as Markdown, for GitHub's job summary and for people who like plain files.

One table, one row a check, in words. GitHub drops a summary that is too large altogether, so this one is kept small.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from lab2_grader import lab
from lab2_grader.records import CheckResult, Status
from lab2_grader.report.html import sequence_said
from lab2_grader.report.observed import Conversation
from lab2_grader.report.view import Report
from lab2_grader.report.words import STATUS_MARKS, STATUS_WORDS, in_short, left_out, mark
from lab2_grader.sections import section_link

# What could start a tag, a link, code, emphasis, a table cell, a mention, an emoji or a workflow command, and, where it
# stands first, a heading or a list. Underscores within words and colons before blanks mean nothing.
SPECIAL = re.compile(
    r"[\\`*\[\]#|<>~@&$^]|:(?! )|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])|(?<=[wW]{3})\.|^[-+=]|(?<=^\d)[.)]"
)
CODE = re.compile("`([^`]+)`")
BLANKS = re.compile(r"\s+")
BLOCKS = "▁▂▃▄▅▆▇█"
SPARKS = 64
LARGEST = 60_000  # bytes; GitHub's own limit is 1 MiB a step
NOTES = 20


def escape(text: str) -> str:
    """*text* as Markdown that shows it as it is: every character that could mean something is a numeric entity."""
    return SPECIAL.sub(lambda match: f"&#{ord(match[0])};", BLANKS.sub(" ", text))


def prose(text: str) -> str:
    """A sentence of the catalogue as Markdown: escaped, with what stands between backticks as code."""
    parts = CODE.split(text)
    return "".join(f"<code>{escape(part)}</code>" if index % 2 else escape(part) for index, part in enumerate(parts))


def markdown(report: Report) -> str:
    """The report: the mark and the checklist in words, one table of checks, the sequence as a sparkline, notes."""
    text = _markdown(report, full=True)
    return text if len(text.encode("utf-8", "replace")) <= LARGEST else _markdown(report, full=False)


def sparkline(values: Sequence[float | None], width: int = SPARKS) -> str:
    """*values* as a row of blocks from the smallest to the largest; a space where nothing was seen.

    Where there are more values than *width*, each block stands for several and shows the last of them.
    """
    seen = [value for value in values if value is not None]
    if not seen:
        return ""
    low, high = min(seen), max(seen)
    count = min(len(values), width)
    picked = [values[(index + 1) * len(values) // count - 1] for index in range(count)]
    top = len(BLOCKS) - 1
    return "".join(
        " " if v is None else BLOCKS[round(top * (v - low) / (high - low)) if high > low else 0] for v in picked
    )


def _markdown(report: Report, full: bool) -> str:
    result = report.result
    about = [escape(result.submission.name)]
    if result.submission.commit:
        about.append(f"commit <code>{escape(result.submission.commit[:8])}</code>")
    about.append(f"lab2-grader {escape(result.runtime.grader)}")
    lines = [f"# {escape(lab.course().title)}", "", f"## Mark: {mark(result)}", "", prose(in_short(result))]
    if left_out(result):
        lines += ["", prose(left_out(result))]
    lines += ["", " · ".join(about), "", "Checklist:", ""]
    lines += [
        f"- {STATUS_MARKS[item.status]} **{STATUS_WORDS[item.status]}**, {item.points} of {item.max_points}: {escape(item.text)}"
        for item in result.checklist
    ]
    lines += ["", "| Check | Verdict | Points | Asked, seen, and what to try |", "| :--- | :--- | ---: | :--- |"]
    lines += [_row(check, full) for check in result.checks]
    lines += ["", prose(sequence_said(report.sequence))]
    if report.sequence:
        lines += ["", *_sequence(report.sequence)]
    notes = result.notes[:NOTES] if full else result.notes[:3]
    if notes:
        lines += ["", "Notes:", ""] + [f"- {prose(note)}" for note in notes]
        if len(result.notes) > len(notes):
            lines.append(f"- {len(result.notes) - len(notes)} more")
    return "\n".join(lines) + "\n"


def _row(check: CheckResult, full: bool) -> str:
    said = [f"**{prose(check.title)}**"]
    if check.status in (Status.FAIL, Status.PARTIAL):
        said.append(f"Expected: {prose(check.expected)}")
        said.append(f"Observed: {prose(_cut(check.observed, full))}")
        where = f" ({check.file}, line {check.line})" if check.line else ""
        said.append(f"Try: {prose(check.hint)}{escape(where)}")
    elif check.status is not Status.PASS:
        said.append(prose(_cut(check.observed, full)))
    link = section_link(lab.course().worksheet_url, check.section)
    section = f"section {check.section}"
    said.append(f"[{section}]({link})" if link else section)
    verdict = f"{STATUS_MARKS[check.status]} {STATUS_WORDS[check.status]}"
    return f"| `{check.id}` | {verdict} | {check.points} of {check.max_points} | {'<br>'.join(said)} |"


def _cut(text: str, full: bool) -> str:
    return text if full or len(text) <= 200 else text[:199] + "…"


def _sequence(sequence: Conversation) -> list[str]:
    """The sequence in a block of code: what was seen, what was asked, and a mark below the first departure."""
    seen, asked = sparkline(sequence.observed), sparkline(sequence.expected)
    lines = ["```text", f"seen   {seen}", f"asked  {asked}"]
    if sequence.departure is not None and seen:
        at = sequence.departure * len(seen) // len(sequence.observed)
        lines.append(f"       {' ' * at}^ message {sequence.departure + 1}")
    return [*lines, "```"]

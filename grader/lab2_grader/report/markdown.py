"""The result as Markdown, for GitHub's job summary and for people who like plain files."""

from __future__ import annotations

import re

from lab2_grader.records import Result, Status
from lab2_grader.report.words import STATUS_WORDS, mark

# What could start a tag, a link, emphasis, a table cell, a mention or a workflow command.
SPECIAL = re.compile(r"([\\`*_{}\[\]()#+!|<>~@:&$-])")


def escape(text: str) -> str:
    """*text* as Markdown that shows it as it is: every character that could mean something is a numeric entity."""
    return SPECIAL.sub(lambda match: f"&#{ord(match[1])};", text)


def markdown(result: Result) -> str:
    """The report: the mark, the checklist, one row a check, and help for each lost point."""
    name = escape(result.submission.name)
    lines = [f"# Lab 2: {mark(result)}", "", f"Submission {name}, graded by lab2-grader {result.runtime.grader}.", ""]
    lines += ["| Checklist | Verdict | Points |", "| --- | --- | ---: |"]
    for item in result.checklist:
        lines.append(f"| {escape(item.text)} | {STATUS_WORDS[item.status]} | {item.points} of {item.max_points} |")
    lines += ["", "| Check | Verdict | Points | What it asks |", "| --- | --- | ---: | --- |"]
    for check in result.checks:
        verdict = STATUS_WORDS[check.status]
        lines.append(f"| `{check.id}` | {verdict} | {check.points} of {check.max_points} | {escape(check.title)} |")
    lost = [check for check in result.checks if check.status not in (Status.PASS, Status.NOT_ASSESSED)]
    if lost:
        lines += ["", "## What to do next", ""]
    for check in lost:
        lines.append(f"### `{check.id}` (section {check.section}): {STATUS_WORDS[check.status]}")
        lines.append("")
        lines.append(f"- **Expected:** {escape(check.expected)}")
        lines.append(f"- **Observed:** {escape(check.observed)}")
        if check.hint:
            lines.append(f"- **Try:** {escape(check.hint)}")
        lines.append("")
    if result.notes:
        lines += ["", "## Notes", ""] + [f"- {escape(note)}" for note in result.notes]
    return "\n".join(lines).rstrip() + "\n"

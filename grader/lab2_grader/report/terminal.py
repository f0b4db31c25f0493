"""The result as a table for the terminal."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from lab2_grader.records import CheckResult, Result, Status
from lab2_grader.report.words import STATUS_MARKS, STATUS_WORDS, broken, mark

STYLES = {
    Status.PASS: "green",
    Status.PARTIAL: "yellow",
    Status.FAIL: "bold red",
    Status.BLOCKED: "yellow",
    Status.NOT_ASSESSED: "dim",
    Status.INCONCLUSIVE: "bold magenta",
}


def terminal(result: Result) -> RenderableType:
    """What is shown at the end of a grade: the checks by checklist item, help for each lost point, the mark."""
    parts: list[RenderableType] = []
    for item in result.checklist:
        heading = Text(f"{item.text}: {STATUS_WORDS[item.status]}", style="bold")
        if item.max_points:
            heading.append(f" ({item.points} of {item.max_points})")
        parts += [Text(), heading]
        for check in result.checks:
            if check.item == item.item:
                parts += [_headline(check), *_help(check)]
    notes = [Text(f"Note: {broken(note)}", style="dim") for note in result.notes]
    closing = Text.assemble(("Mark: ", "bold"), (mark(result), "bold green" if result.graded else "bold magenta"))
    return Group(*parts, Text(), *notes, *([Text()] if notes else []), closing)


def _headline(check: CheckResult) -> Table:
    row = Table.grid(padding=(0, 1))
    row.add_column(width=16, no_wrap=True)
    row.add_column(width=5, justify="right", no_wrap=True)
    row.add_column(width=20, no_wrap=True)
    row.add_column(overflow="fold")
    verdict = Text(f"  {STATUS_MARKS[check.status]} {STATUS_WORDS[check.status]}", style=STYLES[check.status])
    said = check.observed if check.status in (Status.BLOCKED, Status.NOT_ASSESSED, Status.INCONCLUSIVE) else check.title
    row.add_row(verdict, f"{check.points}/{check.max_points}", check.id, Text(broken(said), style="dim"))
    return row


def _help(check: CheckResult) -> list[RenderableType]:
    """Expected, observed and what to try, for a check that did not pass."""
    if check.status is not Status.FAIL:
        return []
    where = f" ({check.file}, line {check.line})" if check.line else ""
    rows = Table.grid(padding=(0, 1))
    rows.add_column(width=10, no_wrap=True, style="dim")
    rows.add_column(overflow="fold")
    rows.add_row("expected", Text(broken(check.expected)))
    rows.add_row("observed", Text(broken(check.observed)))
    rows.add_row("try", Text(broken(f"{check.hint}{where}")))
    rows.add_row("worksheet", Text(f"section {check.section}"))
    return [Padding(rows, (0, 0, 1, 4))]


def plain(result: Result) -> tuple[str, ...]:
    """The same as lines for a log: each begins with words of ours, whatever a submission said."""
    lines = [f"Mark: {mark(result)}"]
    for check in result.checks:
        line = f"{STATUS_MARKS[check.status]} {check.id}: {STATUS_WORDS[check.status]}, {check.points} of {check.max_points}"
        lines.append(line if check.status is Status.PASS else f"{line}. {check.observed}")
    return (*lines, *(f"Note: {note}" for note in result.notes))

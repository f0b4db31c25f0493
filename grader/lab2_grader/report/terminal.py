"""The result as a table for the terminal."""

from __future__ import annotations

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from lab2_grader.records import CheckResult, Result, Status
from lab2_grader.report.words import STATUS_MARKS, STATUS_WORDS, mark

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
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("Check", no_wrap=True)
    table.add_column("Verdict", no_wrap=True)
    table.add_column("Points", justify="right", no_wrap=True)
    table.add_column("What it asks, and what was seen", overflow="fold")
    for item in result.checklist:
        table.add_row(Text(item.text, style="bold"), "", _points(item.points, item.max_points), "", end_section=False)
        for check in result.checks:
            if check.item == item.item:
                verdict = Text(f"{STATUS_MARKS[check.status]} {STATUS_WORDS[check.status]}", style=STYLES[check.status])
                table.add_row(f"  {check.id}", verdict, _points(check.points, check.max_points), _said(check))
    notes = [Text(f"Note: {note}", style="dim") for note in result.notes]
    closing = Text.assemble(("Mark: ", "bold"), (mark(result), "bold green" if result.graded else "bold magenta"))
    return Group(table, *notes, Text(), closing)


def _points(points: int, of: int) -> Text:
    return Text(f"{points}/{of}", style="" if points == of else "bold")


def _said(check: CheckResult) -> Text:
    if check.status in (Status.PASS, Status.NOT_ASSESSED):
        return Text(check.title if check.status is Status.PASS else check.observed, style="dim")
    if check.status is Status.FAIL:
        where = f" ({check.file}, line {check.line})" if check.line else ""
        return Text.assemble(
            ("expected  ", "dim"),
            f"{check.expected}\n",
            ("observed  ", "dim"),
            f"{check.observed}\n",
            ("try       ", "dim"),
            f"{check.hint}{where} ",
            (f"[{check.section}]", "dim"),
        )
    return Text(check.observed)

"""The overview of a class as one self-contained page: readable without its script, which sorts and filters the table."""

from __future__ import annotations

import functools
from collections import Counter
from urllib.parse import quote

from jinja2 import Environment
from markupsafe import Markup

from lab2_grader.records import CheckRate, ClassLine, ClassState, ClassSummary, Record
from lab2_grader.report.pages import TEMPLATES, environment

STEPS = 10  # bars of the distribution: 0 to 9 %, … 90 to 99 %, and 100 %

STATES = {
    ClassState.GRADED: "graded",
    ClassState.WITHHELD: "not judged",
    ClassState.REFUSED: "refused",
    ClassState.WAITING: "waiting",
}


class Bar(Record, frozen=True):
    """One bar of the distribution; `share` is its length in percent of the longest."""

    label: str
    count: int
    share: float


class Row(Record, frozen=True):
    """One row of the table; numbers are what it is sorted by."""

    line: ClassLine
    link: str
    percent: float | None
    state: str
    attention: str
    group: int


def render(summary: ClassSummary) -> str:
    """The whole page."""
    groups = {name: number for number, names in enumerate(summary.identical, 1) for name in names}
    rows = tuple(_row(line, groups.get(line.name, 0)) for line in summary.lines)
    percents = [row.percent for row in rows if row.percent is not None]
    states = Counter(line.state for line in summary.lines)
    return (
        _environment()
        .get_template("class.html.j2")
        .render(
            summary=summary,
            rows=rows,
            people=[row for row in rows if row.attention],
            bars=_bars(percents),
            graded=len(percents),
            full=sum(percent == 100 for percent in percents),
            median=_median(percents),
            mean=sum(percents) / len(percents) if percents else None,
            states=[(STATES[state], states[state]) for state in ClassState if states[state]],
            waiting=states[ClassState.WAITING],
            checks=sorted(summary.checks, key=_rate),
            rate=_rate,
        )
    )


def _row(line: ClassLine, group: int) -> Row:
    percent = 100 * line.score / line.max_score if line.score is not None and line.max_score else None
    attention = "; ".join(
        filter(None, (line.reason if line.state is not ClassState.GRADED else "", *line.flags, line.note))
    )
    # The name is safe as a folder's; what is a link all the same goes through the rules of addresses.
    return Row(line, quote(line.report), percent, STATES[line.state], attention, group)


def _bars(percents: list[float]) -> tuple[Bar, ...]:
    counts = Counter(min(STEPS, int(percent * STEPS / 100)) for percent in percents)
    longest = max(counts.values(), default=1)
    width = 100 // STEPS
    labels = [f"{step * width} to {step * width + width - 1} %" for step in range(STEPS)] + ["100 %"]
    return tuple(Bar(label, counts[step], 100 * counts[step] / longest) for step, label in enumerate(labels))


def _median(values: list[float]) -> float | None:
    if not values:
        return None
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2


def _rate(check: CheckRate) -> float:
    """Share of a class that passed *check*, in percent; 100 when nobody was judged by it."""
    return 100 * check.passed / check.judged if check.judged else 100.0


@functools.cache
def _environment() -> Environment:
    filling = environment(trim=True)
    own = {name: (TEMPLATES / f"class.{name}").read_text() for name in ("css", "js")}
    filling.globals |= {name: Markup(text) for name, text in own.items()}  # noqa: S704 - files of ours
    return filling

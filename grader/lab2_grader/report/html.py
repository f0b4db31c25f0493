"""The report as one self-contained page: no script, no request, light and dark, for eyes, keyboards and screen readers."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass

from jinja2 import Environment
from markupsafe import Markup, escape

from lab2_grader import lab, messages
from lab2_grader.checks.verdicts import known
from lab2_grader.report.observed import Conversation, Graph, Timeline
from lab2_grader.report.pages import TEMPLATES, environment
from lab2_grader.report.pictures import PICTURE_CSS, Mark, graph_svg, sequence_svg, timeline_svg
from lab2_grader.report.view import Report
from lab2_grader.report.words import STATUS_MARKS, STATUS_WORDS, in_short, left_out, mark
from lab2_grader.sections import section_link, symptom_link

WIDE, NARROW = 760, 350  # CSS pixels
CODE = re.compile("`([^`]+)`")


def html(report: Report) -> str:
    """The whole page."""
    course = lab.course()
    rows = {row.id: row for row in lab.symptoms()}
    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            report=report,
            result=report.result,
            course=course,
            mark=mark(report.result),
            in_short=in_short(report.result),
            left_out=left_out(report.result),
            titles={check.id: check.title for check in report.result.checks},
            symptom=rows.get,
            section_link=functools.partial(section_link, course.worksheet_url),
            symptom_link=functools.partial(symptom_link, course.worksheet_url),
            sequence=_sequence(report.sequence),
            sequence_said=sequence_said(report.sequence),
            asked=_graph(report.asked, "asked", "The ROS graph as asked"),
            seen=_graph(report.seen, "seen", "The ROS graph as it was seen") if report.seen else None,
            graph_said=_graph_said(report.seen),
            timeline=_timeline(report.timeline),
        )
    )


@functools.cache
def _environment() -> Environment:
    filling = environment(trim=False)
    filling.filters |= {"code": code, "instant": instant}
    filling.globals |= {
        "css": Markup((TEMPLATES / "report.css").read_text() + PICTURE_CSS),
        "words": STATUS_WORDS,
        "marks": STATUS_MARKS,
        "say": messages.report,
        "judged": _judged,
    }
    return filling


def code(text: str) -> Markup:
    """*text*, escaped, with what stands between backticks shown as code."""
    return Markup(CODE.sub(r"<code>\1</code>", str(escape(text))))


def instant(iso: str) -> str:
    """An instant in UTC for people: `2026-11-21T07:53:00Z` → `2026-11-21 at 07:53 UTC`."""
    day, _, time = iso.partition("T")
    return f"{day} at {time[:5]} UTC"


def sequence_said(sequence: Conversation | None) -> str:
    """The sequence in a sentence."""
    if sequence is None:
        return messages.report("sequence-none")
    at = sequence.departure
    if at is None:
        return messages.report("sequence-right", topic=sequence.topic, count=sequence.total)
    return messages.report(
        "sequence-departs",
        topic=sequence.topic,
        number=at + 1,
        expected=sequence.expected[at],
        observed=f"{sequence.observed[at]:g}".replace("-", "−"),
    )


def _graph_said(graph: Graph | None) -> str:
    if graph is None:
        return messages.report("graph-none")
    marks = (
        {node.mark for node in graph.nodes}
        | {topic.mark for topic in graph.topics}
        | {edge.mark for edge in graph.edges}
    )
    right = marks <= {Mark.OK}
    return messages.report("graph-right" if right else "graph-differs")


def _judged(check: str) -> str:
    texts = messages.catalogue().check[check]
    return messages.fill(f"{texts.judged} {texts.ruling}", **known(check))


@dataclass(frozen=True)
class _Picture:
    """A picture drawn twice: for a wide page and for a phone, of which one is shown."""

    wide: Markup
    narrow: Markup


def _sequence(sequence: Conversation | None) -> _Picture | None:
    if sequence is None:
        return None

    def drawn(prefix: str, width: int) -> Markup:
        return Markup(
            sequence_svg(
                sequence.observed,
                sequence.expected,
                id_prefix=prefix,
                title=f"Numbers on {sequence.topic}",
                departure=sequence.departure,
                width=width,
            )
        )

    return _Picture(drawn("sequence-wide", WIDE), drawn("sequence-narrow", NARROW))


def _graph(graph: Graph, prefix: str, title: str) -> Markup:
    return Markup(graph_svg(graph.nodes, graph.topics, graph.edges, id_prefix=prefix, title=title))


def _timeline(timeline: Timeline) -> _Picture | None:
    if not timeline.rows:
        return None

    def drawn(prefix: str, width: int) -> Markup:
        return Markup(timeline_svg(timeline.rows, id_prefix=prefix, title="How long it took", width=width))

    return _Picture(drawn("timeline-wide", WIDE), drawn("timeline-narrow", NARROW))

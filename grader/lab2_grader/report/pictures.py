"""Draws the lab's pictures as inline SVG: the ROS graph, a sequence of numbers against the expected one, rows of values.

Pure functions of their arguments, used by the worksheet and by the HTML report. Every picture

- has `role="img"`, a `<title>` and a `<desc>`, so that it is read out in words;
- takes an `id_prefix`, because ids must differ when several pictures stand in one page;
- says nothing by colour alone: a state is also a line style, a symbol and a word;
- is coloured by classes only. A page includes `PICTURE_CSS` once and may override its custom properties;
- escapes every text it is given: names of nodes and topics may come from a submission.

Lengths are in CSS pixels at the picture's natural size. Pictures shrink with their container and never grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from html import escape

PICTURE_CSS = """\
.pic{--pic-ink:#1b1f24;--pic-soft:#57606a;--pic-line:#3b4754;--pic-node:#e8f0fb;--pic-topic:#fff7e0;--pic-paper:#fff;\
--pic-ok:#116329;--pic-bad:#a40e26;--pic-extra:#7a4a00;display:block;max-width:100%;height:auto;margin:0 auto;\
font-family:ui-sans-serif,system-ui,"Segoe UI",Roboto,"Liberation Sans",Arial,sans-serif}
@media (prefers-color-scheme:dark){.pic{--pic-ink:#e6edf3;--pic-soft:#9fb0c0;--pic-line:#a9b8c6;--pic-node:#1b3350;\
--pic-topic:#3a3014;--pic-paper:#12171d;--pic-ok:#6fdd8b;--pic-bad:#ff9a9a;--pic-extra:#f2c063}}
@media print{.pic{--pic-ink:#000;--pic-soft:#333;--pic-line:#000;--pic-node:#fff;--pic-topic:#fff;--pic-paper:#fff;\
--pic-ok:#000;--pic-bad:#000;--pic-extra:#000;break-inside:avoid}}
.pic text{fill:var(--pic-ink);font-size:13px}
.pic .mono{font-family:ui-monospace,"DejaVu Sans Mono","Liberation Mono",Menlo,Consolas,monospace}
.pic .small{font-size:12px}
.pic .soft{fill:var(--pic-soft)}
.pic .box{stroke:var(--pic-line);stroke-width:1.5}
.pic .node{fill:var(--pic-node)}
.pic .topic{fill:var(--pic-topic)}
.pic .edge,.pic .axis,.pic .line{fill:none;stroke:var(--pic-line);stroke-width:1.6}
.pic .axis{stroke-width:1;opacity:.55}
.pic .tip,.pic .dot{fill:var(--pic-line);stroke:none}
.pic .backed{paint-order:stroke;stroke:var(--pic-paper);stroke-width:5px;stroke-linejoin:round}
.pic .expected{fill:none;stroke:var(--pic-soft);stroke-width:1.4;stroke-dasharray:2 4}
.pic .ok.box,.pic .ok.edge,.pic .ok.line{stroke:var(--pic-ok)}
.pic text.ok,.pic .ok.tip,.pic .ok.dot{fill:var(--pic-ok)}
.pic .missing.box,.pic .missing.edge{stroke:var(--pic-bad);stroke-dasharray:6 4;stroke-width:2}
.pic .missing.box{fill:none}
.pic .wrong.box,.pic .wrong.edge,.pic .wrong.line,.pic .ring{stroke:var(--pic-bad);stroke-width:2.5}
.pic .ring{fill:none}
.pic text.missing,.pic text.wrong,.pic .missing.tip,.pic .wrong.tip,.pic .wrong.dot{fill:var(--pic-bad)}
.pic .extra.box,.pic .extra.edge{stroke:var(--pic-extra);stroke-dasharray:1.5 3.5;stroke-linecap:round;stroke-width:2}
.pic text.extra,.pic .extra.tip{fill:var(--pic-extra)}
"""

_MONO = 7.9  # width of a 13 px monospace character, on the wide side
_SANS = 6.6  # mean width of a 12 px character of the sans-serif, on the wide side
_GAP = 18.0
_PAD = 14.0
_MAX_LABEL = 40
_MAX_POINTS = 1500


class Mark(str, Enum):
    """How a part of a picture stands to what was asked. Each is drawn with its own line style, symbol and word."""

    PLAIN = "plain"  # says nothing: a picture that teaches
    OK = "ok"  # as asked; a solid line and a tick
    MISSING = "missing"  # asked for and not there; a dashed outline and a cross
    WRONG = "wrong"  # there, but not as asked; a thick line and an exclamation mark
    EXTRA = "extra"  # there and not asked for; a dotted line and a plus


_SYMBOL = {Mark.PLAIN: "", Mark.OK: "✓ ", Mark.MISSING: "✕ ", Mark.WRONG: "! ", Mark.EXTRA: "+ "}
_WORD = {
    Mark.PLAIN: "",
    Mark.OK: "as asked",
    Mark.MISSING: "missing",
    Mark.WRONG: "not as asked",
    Mark.EXTRA: "not asked for",
}


@dataclass(frozen=True)
class GraphNode:
    """A node of the ROS graph, drawn as a rounded box.

    Args:
        key: What edges call it; unique among the nodes.
        label: What is written in it, usually the node's full name.
        note: A second, smaller line, for example `publisher` or `publishes every 0.5 s`.
        mark: How it stands to what was asked.
    """

    key: str
    label: str
    note: str = ""
    mark: Mark = Mark.PLAIN


@dataclass(frozen=True)
class GraphTopic:
    """A topic of the ROS graph, drawn as a rectangle.

    Args:
        key: What edges call it; unique among the topics.
        label: What is written in it, usually the topic's full name.
        type: Its message type, written below; empty for none.
        note: A third line, for example `did you mean /numeric_chatter?`.
        mark: How it stands to what was asked.
    """

    key: str
    label: str
    type: str = ""
    note: str = ""
    mark: Mark = Mark.PLAIN


@dataclass(frozen=True)
class GraphEdge:
    """A publisher (`publishes=True`, arrow from node to topic) or a subscription (arrow from topic to node).

    Args:
        node: Key of the node.
        topic: Key of the topic.
        publishes: True for a publisher, False for a subscription.
        label: Written beside the arrow; empty for none. A mark other than PLAIN and OK writes its word when empty.
        mark: How it stands to what was asked.
    """

    node: str
    topic: str
    publishes: bool
    label: str = ""
    mark: Mark = Mark.PLAIN


@dataclass(frozen=True)
class Value:
    """One value of a strip, with how it stands to what was asked."""

    text: str
    mark: Mark = Mark.PLAIN


@dataclass(frozen=True)
class Strip:
    """A row of values, oldest first, under a label; `note` stands after the label, `mark` gives its symbol."""

    label: str
    values: tuple[Value, ...]
    note: str = ""
    mark: Mark = Mark.PLAIN


@dataclass(frozen=True)
class Span:
    """A stretch of time with a name, in seconds."""

    name: str
    begin: float
    end: float


@dataclass(frozen=True)
class TimelineRow:
    """What happened under a label, one stretch after another."""

    label: str
    spans: tuple[Span, ...]


# --- the ROS graph ------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Box:
    """A placed box: its outline and the lines written in it, as (class, text)."""

    x: float
    y: float
    width: float
    height: float
    lines: tuple[tuple[str, str], ...]
    shape: str
    mark: Mark

    @property
    def middle(self) -> float:
        return self.x + self.width / 2


def graph_svg(
    nodes: Sequence[GraphNode],
    topics: Sequence[GraphTopic],
    edges: Sequence[GraphEdge],
    *,
    id_prefix: str,
    title: str,
    desc: str = "",
) -> str:
    """The ROS graph, messages flowing downwards: publishing nodes, topics, and the nodes that only listen.

    A node without any edge stands in the last row. A node of the first row that also subscribes gets an arrow upwards.

    Args:
        nodes: The nodes, left to right.
        topics: The topics, left to right.
        edges: Who publishes and subscribes what; an edge whose node or topic is not given is left out.
        id_prefix: Makes the ids of this picture unique in the page; letters, digits, hyphens.
        title: The picture's name, a few words.
        desc: The picture in words; empty to have it made from the graph itself.
    """
    publishing = {edge.node for edge in edges if edge.publishes}
    rows = (
        [(node.key, _node_box(node)) for node in nodes if node.key in publishing],
        [(topic.key, _topic_box(topic)) for topic in topics],
        [(node.key, _node_box(node)) for node in nodes if node.key not in publishing],
    )
    width = max((_row_width(box for _, box in row) for row in rows), default=0.0) + 2 * _PAD
    spread = max(50.0, 44.0 + 8 * max(len(row) for row in rows))
    placed: list[dict[str, _Box]] = []
    y = _PAD
    for row in rows:
        placed.append(_place(row, y, width))
        if row:
            y += max(box.height for _, box in row) + spread
    height = y - spread + _PAD if any(rows) else 2 * _PAD
    first, middle, last = placed
    node_boxes = {**first, **last}

    lines: list[str] = []
    labels: list[str] = []
    for edge in edges:
        node_box, topic_box = node_boxes.get(edge.node), middle.get(edge.topic)
        if node_box is None or topic_box is None:
            continue
        upper, lower = (node_box, topic_box) if edge.node in first else (topic_box, node_box)
        down = edge.publishes or edge.node in last
        drawn, label = _edge(upper, lower, edge, down, edges)
        lines.append(drawn)
        labels.append(label)
    boxes = [_draw(box) for box in (*first.values(), *middle.values(), *last.values())]
    return _svg(
        width, height, id_prefix, title, desc or describe_graph(nodes, topics, edges), [*lines, *boxes, *labels]
    )


def describe_graph(nodes: Sequence[GraphNode], topics: Sequence[GraphTopic], edges: Sequence[GraphEdge]) -> str:
    """The graph in sentences: what each node publishes and subscribes, with every mark as a word."""
    names = {topic.key: topic.label + (f" ({topic.type})" if topic.type else "") for topic in topics}
    sentences = []
    for node in nodes:
        said = []
        for publishes, verb in ((True, "publishes on"), (False, "subscribes to")):
            found = [
                names[edge.topic] + _bracket(edge.mark)
                for edge in edges
                if edge.node == node.key and edge.publishes is publishes and edge.topic in names
            ]
            if found:
                said.append(f"{verb} {_listed(found)}")
        sentences.append(
            f"Node {node.label}{_bracket(node.mark)} {' and '.join(said) or 'has no publisher and no subscription'}."
        )
    sentences += [
        f"Topic {topic.label}: {' '.join(part for part in (_WORD[topic.mark], topic.note) if part)}."
        for topic in topics
        if topic.mark not in (Mark.PLAIN, Mark.OK)
    ]
    return " ".join(sentences)


def _bracket(mark: Mark) -> str:
    return f" [{_WORD[mark]}]" if mark not in (Mark.PLAIN, Mark.OK) else ""


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _short(text: str) -> str:
    """*text*, cut in its middle when it would make the picture too wide."""
    if len(text) <= _MAX_LABEL:
        return text
    return f"{text[: _MAX_LABEL // 2]}…{text[-(_MAX_LABEL // 2 - 1) :]}"


def _node_box(node: GraphNode) -> _Box:
    lines = [("mono", _SYMBOL[node.mark] + _short(node.label))]
    if node.note or node.mark not in (Mark.PLAIN, Mark.OK):
        lines.append(
            ("small " + (node.mark.value if node.mark is not Mark.PLAIN else "soft"), node.note or _WORD[node.mark])
        )
    return _sized(lines, "node", node.mark)


def _topic_box(topic: GraphTopic) -> _Box:
    lines = [("mono", _SYMBOL[topic.mark] + _short(topic.label))]
    if topic.type:
        lines.append(("small soft", _short(topic.type)))
    if topic.note or topic.mark not in (Mark.PLAIN, Mark.OK):
        lines.append(
            ("small " + (topic.mark.value if topic.mark is not Mark.PLAIN else "soft"), topic.note or _WORD[topic.mark])
        )
    return _sized(lines, "topic", topic.mark)


def _sized(lines: list[tuple[str, str]], shape: str, mark: Mark) -> _Box:
    widest = max(len(text) * (_MONO if "mono" in kind else _SANS) for kind, text in lines)
    return _Box(0, 0, round(widest + 2 * _PAD), 16 + 17 * len(lines), tuple(lines), shape, mark)


def _row_width(boxes: Iterable[_Box]) -> float:
    widths = [box.width for box in boxes]
    return sum(widths) + _GAP * max(len(widths) - 1, 0)


def _place(row: Sequence[tuple[str, _Box]], y: float, width: float) -> dict[str, _Box]:
    """The boxes of a row side by side, centred, all as high as the highest."""
    height = max((box.height for _, box in row), default=0.0)
    x = (width - _row_width(box for _, box in row)) / 2
    placed = {}
    for key, box in row:
        placed[key] = _Box(x, y, box.width, height, box.lines, box.shape, box.mark)
        x += box.width + _GAP
    return placed


def _draw(box: _Box) -> str:
    radius = box.height / 2 if box.shape == "node" else 3
    outline = (
        f'<rect class="box {box.shape} {box.mark.value}" x="{box.x:.0f}" y="{box.y:.0f}" '
        f'width="{box.width:.0f}" height="{box.height:.0f}" rx="{min(radius, 24):.0f}"/>'
    )
    drawn = [outline]
    top = box.y + box.height / 2 - 17 * (len(box.lines) - 1) / 2 + 4.5
    for number, (kind, text) in enumerate(box.lines):
        drawn.append(_text(box.middle, top + 17 * number, text, kind, "middle"))
    return "".join(drawn)


def _edge(upper: _Box, lower: _Box, edge: GraphEdge, down: bool, edges: Sequence[GraphEdge]) -> tuple[str, str]:
    """An arrow between two boxes of neighbouring rows, and the text beside it."""
    both = sum(other.node == edge.node and other.topic == edge.topic for other in edges) > 1
    shift = (12 if edge.publishes else -12) if both else 0
    x1, x2 = upper.middle + shift, lower.middle + shift
    # Boxes far apart: leave and arrive at the side that faces the other box, so that arrows do not share one point.
    x1 += max(-upper.width / 4, min(upper.width / 4, (x2 - x1) / 3))
    x2 += max(-lower.width / 4, min(lower.width / 4, (x1 - x2) / 3))
    y1, y2 = upper.y + upper.height, lower.y
    start, end = (y1, y2 - 7) if down else (y1 + 7, y2)
    bend = (y2 - y1) / 2
    path = f"M{x1:.1f} {start:.1f}C{x1:.1f} {y1 + bend:.1f} {x2:.1f} {y2 - bend:.1f} {x2:.1f} {end:.1f}"
    tip = f"M{x2:.1f} {y2:.1f}l-5 -9h10z" if down else f"M{x1:.1f} {y1:.1f}l-5 9h10z"
    word = edge.label or (_WORD[edge.mark] if edge.mark not in (Mark.PLAIN, Mark.OK) else "")
    symbol = _SYMBOL[edge.mark] if edge.mark is not Mark.OK else ""
    label = (
        _text((x1 + x2) / 2, (y1 + y2) / 2 + 4, symbol + word, f"small backed {edge.mark.value}", "middle")
        if word
        else ""
    )
    kind = edge.mark.value
    return f'<path class="edge {kind}" d="{path}"/><path class="tip {kind}" d="{tip}"/>', label


# --- sequences ----------------------------------------------------------------------------------


def first_departure(observed: Sequence[float | None], expected: Sequence[float]) -> int | None:
    """Index of the first observed value that is not the expected one; None when there is none in their common length.

    A gap, where nothing was seen, is no departure.
    """
    pairs = enumerate(zip(observed, expected, strict=False))
    return next((index for index, (seen, asked) in pairs if seen is not None and seen != asked), None)


def sequence_svg(
    observed: Sequence[float | None],
    expected: Sequence[float],
    *,
    id_prefix: str,
    title: str,
    desc: str = "",
    departure: int | None = None,
    width: int = 620,
    height: int = 220,
    what: str = "message",
    key: bool = True,
) -> str:
    """Values in the order they came, against the expected ones, with the first departure ringed and named.

    Only the first 1,500 values are drawn; the picture says so when there are more.

    Args:
        observed: What came, oldest first; None leaves a gap (nothing was seen in that place).
        expected: What should have come; may be longer or shorter. Where several sequences are right, give the one
            that fits what was observed.
        id_prefix: Makes the ids of this picture unique in the page.
        title: The picture's name, a few words.
        desc: The picture in words; empty to have it made from the values.
        departure: Index of the departure to mark; None to mark `first_departure`.
        width: Natural width.
        height: Natural height.
        what: What one value is, for the axis and the words.
        key: Whether the two lines are explained below.
    """
    at = first_departure(observed, expected) if departure is None else departure
    seen, asked = observed[:_MAX_POINTS], expected[:_MAX_POINTS]
    numbers = [value for value in (*seen, *asked) if value is not None]
    low, high = (min(numbers), max(numbers)) if numbers else (0.0, 1.0)
    if low == high:
        high = low + 1
    count = max(len(seen), len(asked), 2)
    left, right, top, bottom = 46.0, width - 14.0, 30.0, height - 40.0

    def x(index: float) -> float:
        return left + (right - left) * index / (count - 1)

    def y(value: float) -> float:
        return bottom - (bottom - top) * (value - low) / (high - low)

    parts = [f'<path class="axis" d="M{left:.0f} {top:.0f}V{bottom:.0f}H{right:.0f}"/>']
    for value in _axis_values(low, high, asked):
        parts.append(f'<path class="axis" d="M{left - 4:.0f} {y(value):.1f}H{right:.0f}"/>')
        parts.append(_text(left - 8, y(value) + 4, _number(value), "small soft", "end"))
    parts.append(_text(left, height - 22, "1", "small soft", "middle"))
    parts.append(_text(right, height - 22, str(count), "small soft", "end"))
    parts.append(_text((left + right) / 2, height - 22, f"{what} number", "small soft", "middle"))
    parts.append(f'<path class="expected" d="{_path(asked, x, y)}"/>')
    parts.append(f'<path class="line" d="{_path(seen, x, y)}"/>')
    if len(seen) <= 60:
        parts += [
            f'<circle class="dot" cx="{x(index):.1f}" cy="{y(value):.1f}" r="3"/>'
            for index, value in enumerate(seen)
            if value is not None
        ]
    if at is not None and at < count:
        there = seen[at] if at < len(seen) else None
        marked = there if there is not None else asked[at] if at < len(asked) else low
        parts.append(f'<path class="edge missing" d="M{x(at):.1f} {top:.0f}V{bottom:.0f}"/>')
        parts.append(f'<circle class="ring" cx="{x(at):.1f}" cy="{y(marked):.1f}" r="7"/>')
        anchor = "start" if x(at) < width * 0.35 else "end" if x(at) > width * 0.65 else "middle"
        parts.append(
            _text(x(at), 18, "! " + _departure_words(observed, expected, at, what), "small backed wrong", anchor)
        )
    if key:
        parts.append(_key(left, height - 5, "line", "observed"))
        parts.append(_key(left + 100, height - 5, "expected", "expected"))
    if len(observed) > _MAX_POINTS:
        parts.append(_text(right, height - 5, f"the first {_MAX_POINTS:,} of {len(observed):,}", "small soft", "end"))
    words = desc or _describe_sequence(observed, expected, at, what)
    return _svg(width, height, id_prefix, title, words, parts)


def _describe_sequence(observed: Sequence[float | None], expected: Sequence[float], at: int | None, what: str) -> str:
    numbers = [value for value in observed if value is not None]
    if not numbers:
        return "Nothing was observed."
    start = (
        f"{len(numbers)} {what}s, from {_number(min(numbers))} to {_number(max(numbers))}, "
        f"beginning {', '.join(_number(value) for value in numbers[:4])}."
    )
    if at is None:
        return f"{start} All are as expected."
    near = ", ".join("nothing" if value is None else _number(value) for value in observed[max(at - 3, 0) : at + 3])
    return f"{start} First departure: {_departure_words(observed, expected, at, what)}. Around it: {near}."


def _departure_words(observed: Sequence[float | None], expected: Sequence[float], at: int, what: str) -> str:
    value = observed[at] if at < len(observed) else None
    got = "nothing" if value is None else _number(value)
    wanted = f", expected {_number(expected[at])}" if at < len(expected) else ""
    return f"{what} {at + 1} is {got}{wanted}"


def _axis_values(low: float, high: float, asked: Sequence[float]) -> list[float]:
    """The few values worth a line: the ends of what is asked, the ends of what was seen, zero; none too close."""
    candidates = [*((max(asked), min(asked)) if asked else ()), high, low, 0.0]
    kept: list[float] = []
    for value in candidates:
        if low <= value <= high and all(abs(value - other) > (high - low) / 9 for other in kept):
            kept.append(value)
    return kept


def _path(values: Sequence[float | None], x: Callable[[float], float], y: Callable[[float], float]) -> str:
    """An SVG path through *values*; None lifts the pen."""
    drawn = []
    lifted = True
    for index, value in enumerate(values):
        if value is None:
            lifted = True
            continue
        drawn.append(f"{'M' if lifted else 'L'}{x(index):.1f} {y(value):.1f}")
        lifted = False
    return "".join(drawn) or "M0 0"


def _key(x: float, y: float, kind: str, text: str) -> str:
    return f'<path class="{kind}" d="M{x:.0f} {y - 4:.0f}h22"/>' + _text(x + 28, y, text, "small soft", "start")


def strip_svg(strips: Sequence[Strip], *, id_prefix: str, title: str, desc: str = "") -> str:
    """Rows of values in boxes, oldest first, each under its label: a few values looked at closely.

    Args:
        strips: The rows, top to bottom.
        id_prefix: Makes the ids of this picture unique in the page.
        title: The picture's name, a few words.
        desc: The picture in words; empty to have it made from the rows.
    """
    cell = max((len(value.text) for strip in strips for value in strip.values), default=1) * _MONO + 16
    wide = max((len(strip.values) for strip in strips), default=0) * cell
    texts = [(_SYMBOL[strip.mark] + strip.label, strip.note) for strip in strips]
    written = max((len(label) * 7.2 + 10 + len(note) * _SANS for label, note in texts), default=0.0)
    width = max(wide, written) + 2 * _PAD
    parts: list[str] = []
    y = 6.0
    for strip, (label, note) in zip(strips, texts, strict=True):
        kind = strip.mark.value
        parts.append(
            f'<text x="{_PAD:.0f}" y="{y + 14:.0f}"><tspan class="{kind}" font-weight="600">{escape(label)}</tspan>'
            + (f'<tspan class="small soft" dx="8">{escape(note)}</tspan>' if note else "")
            + "</text>"
        )
        for number, value in enumerate(strip.values):
            left = _PAD + cell * number
            parts.append(
                f'<rect class="box {value.mark.value}" fill="none" x="{left + 1:.1f}" y="{y + 22:.0f}" '
                f'width="{cell - 3:.1f}" height="28" rx="3"/>'
            )
            parts.append(_text(left + cell / 2, y + 41, value.text, f"mono {value.mark.value}", "middle"))
        y += 66
    made = " ".join(
        f"{strip.label}{_bracket(strip.mark)}: {', '.join(value.text + _bracket(value.mark) for value in strip.values)}."
        for strip in strips
    )
    return _svg(width, y, id_prefix, title, desc or made, parts)


def timeline_svg(rows: Sequence[TimelineRow], *, id_prefix: str, title: str, desc: str = "", width: int = 620) -> str:
    """Rows of stretches of time under one axis of seconds; a stretch too narrow for its name is only named in words.

    Args:
        rows: The rows, top to bottom.
        id_prefix: Makes the ids of this picture unique in the page.
        title: The picture's name, a few words.
        desc: The picture in words; empty to have it made from the rows.
        width: Natural width.
    """
    total = max((row.spans[-1].end for row in rows if row.spans), default=0.0) or 1.0
    left, right = _PAD, width - _PAD

    def x(seconds: float) -> float:
        return left + (right - left) * seconds / total

    parts: list[str] = []
    y = 4.0
    for row in rows:
        whole = row.spans[-1].end - row.spans[0].begin if row.spans else 0.0
        parts.append(
            f'<text x="{_PAD:.0f}" y="{y + 13:.0f}"><tspan font-weight="600">{escape(row.label)}</tspan>'
            f'<tspan class="small soft" dx="8">{whole:.1f} s</tspan></text>'
        )
        for number, span in enumerate(row.spans):
            begin, end = x(span.begin), x(span.end)
            shade = "node" if number % 2 == 0 else "topic"
            parts.append(
                f'<rect class="box {shade}" x="{begin:.1f}" y="{y + 20:.0f}" width="{max(end - begin, 1):.1f}" height="24"/>'
            )
            if len(span.name) * _SANS + 8 < end - begin:
                parts.append(_text((begin + end) / 2, y + 36, span.name, "small", "middle"))
        y += 54
    parts.append(f'<path class="axis" d="M{left:.0f} {y:.0f}H{right:.0f}"/>')
    step = next((step for step in (0.5, 1, 2, 5, 10, 20, 60, 120) if total / step <= 8), 300)
    for tick in range(int(total / step) + 1):
        parts.append(f'<path class="axis" d="M{x(tick * step):.1f} {y:.0f}v5"/>')
        parts.append(_text(x(tick * step), y + 18, f"{tick * step:g} s", "small soft", "middle" if tick else "start"))
    words = desc or " ".join(
        f"{row.label}: {', '.join(f'{span.name} {span.end - span.begin:.1f} s' for span in row.spans)}." for row in rows
    )
    return _svg(width, y + 26, id_prefix, title, words, parts)


# --- shared -------------------------------------------------------------------------------------


def _number(value: float) -> str:
    """A number as people write it: no `.0`, a real minus sign."""
    return f"{value:g}".replace("-", "−")


def _text(x: float, y: float, text: str, kind: str, anchor: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _svg(width: float, height: float, id_prefix: str, title: str, desc: str, parts: Iterable[str]) -> str:
    prefix = escape(id_prefix)
    return (
        f'<svg class="pic" role="img" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" aria-labelledby="{prefix}-title {prefix}-desc">'
        f'<title id="{prefix}-title">{escape(title)}</title><desc id="{prefix}-desc">{escape(desc)}</desc>'
        f"{''.join(part for part in parts if part)}</svg>"
    )

"""Turns evidence into what the pictures draw: the numbers beside the expected ones, the ROS graph, the timeline. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from lab2_grader import lab
from lab2_grader.checks.view import SceneView, View
from lab2_grader.near import nearest
from lab2_grader.records import Endpoint, Evidence, Phase, Scene, SceneName
from lab2_grader.report.pictures import GraphEdge, GraphNode, GraphTopic, Mark, Span, TimelineRow, first_departure

MAX_NUMBERS = 600  # of a sequence that are shown: four returns of the count
MAX_NODES = 8
MAX_TOPICS = 8
TALKER, LISTENER = "asked-talker", "asked-listener"

SCENE_TITLES = {
    SceneName.CONVERSATION: "The launched pair",
    SceneName.LISTENER: "The listener alone",
    SceneName.TALKER: "The talker alone",
    SceneName.ORIGINALS: "The original pair",
}
PHASE_TITLES = {
    "start": "starting",
    "graph": "discovery",
    "period": "finding the period",
    "slow": "slow phase",
    "fast": "fast phase",
    "real-time": "real time",
    "send": "sending",
    "stop": "stopping",
}


@dataclass(frozen=True)
class Conversation:
    """The numbers that were published, in order, beside those that were expected.

    Args:
        topic: On which topic they were seen.
        observed: What came; None where a message was not seen.
        expected: What should have come, as many.
        departure: Index of the first number that is not the expected one; None when there is none.
        total: How many came in all.
    """

    topic: str
    observed: tuple[float | None, ...]
    expected: tuple[int, ...]
    departure: int | None
    total: int


@dataclass(frozen=True)
class Graph:
    """A ROS graph to be drawn."""

    nodes: tuple[GraphNode, ...]
    topics: tuple[GraphTopic, ...]
    edges: tuple[GraphEdge, ...]


@dataclass(frozen=True)
class Timeline:
    """What took how long, in seconds since the build began."""

    rows: tuple[TimelineRow, ...]
    total: float


# --- the sequence -------------------------------------------------------------------------------


def conversation(view: View) -> Conversation | None:
    """The numbers of the talker; None when it published none."""
    messages = [message for message in view.numbers if isinstance(message.data, int | float)]
    if not messages:
        return None
    numbered = [message.number for message in messages]
    observed: list[float | None] = []
    if all(later > earlier for earlier, later in pairwise(numbered)) and numbered[0] > 0:
        for message in messages:
            while len(observed) < min(message.number - 1, MAX_NUMBERS):
                observed.append(None)
            observed.append(float(message.data))  # type: ignore[arg-type]
            if len(observed) >= MAX_NUMBERS:
                break
    else:  # several publishers, or none that counts: in the order in which they came
        observed = [float(message.data) for message in messages]  # type: ignore[arg-type]
    observed = observed[:MAX_NUMBERS]
    expected = expected_numbers(observed)
    return Conversation(
        topic=messages[0].topic,
        observed=tuple(observed),
        expected=expected,
        departure=first_departure(observed, expected),
        total=len(messages),
    )


def expected_numbers(observed: Sequence[float | None]) -> tuple[int, ...]:
    """What should have come in place of *observed*.

    The count returns after the largest number, or just before it where the observed one did: either is right
    (VERDICTS, first row).
    """
    topic = lab.specification().number_topic
    expected: list[int] = []
    following = topic.smallest
    for index, value in enumerate(observed):
        returned_early = value == topic.smallest and following == topic.largest
        if returned_early and (index == 0 or observed[index - 1] in (None, topic.largest - 1)):
            following = topic.smallest
        expected.append(following)
        following = topic.smallest if following >= topic.largest else following + 1
    return tuple(expected)


# --- the graph ----------------------------------------------------------------------------------


def graph_asked() -> Graph:
    """The graph that the worksheet asks for."""
    specification = lab.specification()
    numeric, texts, numbers = specification.numeric, specification.text_topic, specification.number_topic
    topics = (GraphTopic(texts.name, texts.name, texts.type), GraphTopic(numbers.name, numbers.name, numbers.type))
    return Graph(
        nodes=(GraphNode(TALKER, numeric.talker), GraphNode(LISTENER, numeric.listener)),
        topics=topics,
        edges=tuple(GraphEdge(node, topic.key, node == TALKER) for node in (TALKER, LISTENER) for topic in topics),
    )


def graph_observed(view: View) -> Graph | None:
    """The graph of the numeric pair as it was seen, with what is missing drawn in; None when nothing was started."""
    launched = view.scene(SceneName.CONVERSATION)
    scenes: Iterable[SceneView | None] = (launched,)
    if launched is None or not launched.appeared("publisher") or not launched.appeared("subscription"):
        scenes = (launched, view.scene(SceneName.TALKER), view.scene(SceneName.LISTENER))
    played = [scene for scene in scenes if scene is not None]
    if not played:
        return None
    return _ObservedGraph(played).graph()


class _ObservedGraph:
    """Puts together what was seen and what was asked."""

    def __init__(self, scenes: Sequence[SceneView]) -> None:
        self._endpoints = list(
            {
                (endpoint.node, endpoint.kind, endpoint.topic, endpoint.type): endpoint
                for scene in scenes
                for endpoint in scene.endpoints
                if endpoint.event == "appeared"
            }.values()
        )
        self._heard = {message.topic for scene in scenes for message in scene.messages}
        specification = lab.specification()
        self._asked = {
            specification.text_topic.name: specification.text_topic.type,
            specification.number_topic.name: specification.number_topic.type,
        }
        running = {process.executable for scene in scenes for process in scene.seen}
        names = {endpoint.node for endpoint in self._endpoints}
        self._one_name_for_two = len(running) > 1 and len(names) == 1

    def graph(self) -> Graph:
        """The graph."""
        talkers = {self._key(endpoint) for endpoint in self._endpoints if endpoint.kind == "publisher"}
        listeners = {self._key(endpoint) for endpoint in self._endpoints} - talkers
        nodes = [GraphNode(key, self._name(key), mark=Mark.OK) for key in sorted(talkers)[:MAX_NODES]]
        nodes += [GraphNode(key, self._name(key), mark=Mark.OK) for key in sorted(listeners)[:MAX_NODES]]
        topics = {self._topic_key(endpoint): self._topic(endpoint) for endpoint in self._endpoints}
        edges = [self._edge(endpoint) for endpoint in self._endpoints]

        numeric = lab.specification().numeric
        for program, kind, role in (
            (numeric.talker, "publisher", talkers),
            (numeric.listener, "subscription", listeners),
        ):
            missing = [name for name, type_ in self._asked.items() if not self._has(kind, name, type_)]
            if not missing:
                continue
            key = next(iter(sorted(role)), TALKER if kind == "publisher" else LISTENER)
            if not role and kind == "subscription" and talkers and self._subscribes(talkers):
                key = next(iter(sorted(talkers)))
            elif not role:
                nodes.append(GraphNode(key, program, mark=Mark.MISSING))
            for name in missing:
                found = next((topic for topic in topics if topic[0] == name and topic[1] == self._asked[name]), None)
                if found is None:
                    found = (name, self._asked[name])
                    topics[found] = GraphTopic("|".join(found), name, self._asked[name], mark=Mark.MISSING)
                edges.append(GraphEdge(key, "|".join(found), kind == "publisher", mark=Mark.MISSING))
        order = sorted(topics, key=lambda topic: (topic[0] not in self._asked, topic))[:MAX_TOPICS]
        return Graph(tuple(nodes), tuple(topics[topic] for topic in order), tuple(edges))

    def _key(self, endpoint: Endpoint) -> str:
        return f"{endpoint.kind} {endpoint.node}" if self._one_name_for_two else endpoint.node

    def _name(self, key: str) -> str:
        return key.partition(" ")[2] if self._one_name_for_two else key

    def _has(self, kind: str, topic: str, type_: str) -> bool:
        return any((found.kind, found.topic, found.type) == (kind, topic, type_) for found in self._endpoints)

    def _subscribes(self, keys: set[str]) -> bool:
        return any(self._key(found) in keys and found.kind == "subscription" for found in self._endpoints)

    @staticmethod
    def _topic_key(endpoint: Endpoint) -> tuple[str, str]:
        return endpoint.topic, endpoint.type

    def _topic(self, endpoint: Endpoint) -> GraphTopic:
        key = "|".join(self._topic_key(endpoint))
        wanted = self._asked.get(endpoint.topic)
        if wanted == endpoint.type:
            return GraphTopic(key, endpoint.topic, endpoint.type, mark=Mark.OK)
        if wanted is not None:
            return GraphTopic(key, endpoint.topic, endpoint.type, f"asked for: {wanted}", Mark.WRONG)
        unmet = [name for name, type_ in self._asked.items() if not self._has(endpoint.kind, name, type_)]
        meant = nearest(endpoint.topic, unmet)
        if meant:
            return GraphTopic(key, endpoint.topic, endpoint.type, f"asked for: {meant}", Mark.WRONG)
        return GraphTopic(key, endpoint.topic, endpoint.type, mark=Mark.EXTRA)

    def _edge(self, endpoint: Endpoint) -> GraphEdge:
        node, topic = self._key(endpoint), "|".join(self._topic_key(endpoint))
        publishes = endpoint.kind == "publisher"
        if self._topic(endpoint).mark is not Mark.OK:
            return GraphEdge(node, topic, publishes, label=" ")
        if publishes and endpoint.topic not in self._heard:
            return GraphEdge(node, topic, True, "never published", Mark.WRONG)
        if publishes and endpoint.reliability == "best-effort":
            return GraphEdge(node, topic, True, "best effort", Mark.WRONG)
        if not publishes and endpoint.durability == "transient-local":
            return GraphEdge(node, topic, False, "transient local", Mark.WRONG)
        return GraphEdge(node, topic, publishes, mark=Mark.OK)


# --- the timeline -------------------------------------------------------------------------------


def timeline(evidence: Evidence) -> Timeline:
    """How long what took. The scenes play side by side from the end of the build; the talker alone follows the launch."""
    built = evidence.build.seconds if evidence.build else 0.0
    rows = [TimelineRow("Build", (Span("colcon build", 0.0, built),))] if evidence.build else []
    launched = evidence.scene(SceneName.CONVERSATION)
    for scene in evidence.scenes:
        begins = built + (launched.seconds if scene.name is SceneName.TALKER and launched else 0.0)
        rows.append(TimelineRow(SCENE_TITLES[scene.name], _spans(scene, begins)))
    total = max((row.spans[-1].end for row in rows if row.spans), default=0.0)
    return Timeline(tuple(rows), round(total, 2))


def _spans(scene: Scene, begins: float) -> tuple[Span, ...]:
    phases = [event for event in scene.events if isinstance(event, Phase)]
    if not phases:
        return (Span("", begins, begins + scene.seconds),)
    ends = [phase.at for phase in phases[1:]] + [max(scene.seconds, phases[-1].at)]
    starts = [0.0] + [phase.at for phase in phases[1:]]
    return tuple(
        Span(PHASE_TITLES.get(phase.name, phase.name), round(begins + start, 3), round(begins + end, 3))
        for phase, start, end in zip(phases, starts, ends, strict=True)
    )

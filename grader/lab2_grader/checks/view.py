"""What the checks look at: the evidence of one submission, sorted by question. Pure."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable
from functools import cached_property
from typing import Any

from lab2_grader import lab, messages, reading
from lab2_grader.checks.sequence import Sequel, analyse
from lab2_grader.records import (
    Build,
    EndedBy,
    Endpoint,
    Event,
    Evidence,
    Line,
    Measured,
    Message,
    Phase,
    ProcessGone,
    ProcessSeen,
    ProgramEnded,
    Scene,
    SceneName,
    Sent,
    Unsupported,
)
from lab2_grader.stand_in import launched

TRACEBACK = "Traceback (most recent call last):"
# Where C++ code passes on what Python had raised before, by a name and an address that say nothing.
PASSED_ON = "SystemError: <built-in method"
ADDRESS = re.compile(r" at 0x[0-9a-f]+")
ERROR = re.compile(r"[A-Z]\w*(?:Error|Exception): ")
IN_SPIN = re.compile(r'File "[^"]*/rclpy/[^"]*", line \d+, in spin')


class SceneView:
    """One scene, its events sorted by kind.

    Args:
        scene: As it was played.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        kinds: dict[type[Event], list[Any]] = defaultdict(list)
        for event in scene.events:
            kinds[type(event)].append(event)
        self.endpoints: list[Endpoint] = kinds[Endpoint]
        self.messages: list[Message] = kinds[Message]
        self.lines: list[Line] = kinds[Line]
        self.sent: list[Sent] = kinds[Sent]
        self.seen: list[ProcessSeen] = kinds[ProcessSeen]
        self.gone: list[ProcessGone] = kinds[ProcessGone]
        self.unsupported: list[Unsupported] = kinds[Unsupported]
        self.measured: dict[str, float] = {event.name: event.value for event in kinds[Measured]}
        self.phases: dict[str, float] = {event.name: event.at for event in kinds[Phase]}
        self.ended: ProgramEnded | None = kinds[ProgramEnded][-1] if kinds[ProgramEnded] else None

    def appeared(self, kind: str) -> list[Endpoint]:
        """The publishers, or the subscriptions, that appeared."""
        return [endpoint for endpoint in self.endpoints if endpoint.kind == kind and endpoint.event == "appeared"]

    def started(self) -> dict[str, int]:
        """How often each executable was started: those that were seen to run, as often as the launcher says.

        What the launcher says alone is no proof: a launch file can print the same lines.
        """
        announced = self._announced(reading.PROCESS_STARTED)
        running = Counter(process.executable for process in self.seen)
        return {name: announced[name] or running[name] for name in sorted(running)}

    def said_to_have_died(self) -> list[str]:
        """Executables that were never seen, although the launcher says that they started, and then died."""
        started, died = self._announced(reading.PROCESS_STARTED), self._announced(reading.PROCESS_DIED)
        seen = {process.executable for process in self.seen}
        return sorted(name for name in started if name in died and name not in seen)

    def started_besides(self) -> list[str]:
        """Programs that are none of the package's executables, as the launcher says: whoever forges that, harms himself.

        What `ros2 run` starts as a process has been seen under its own name.
        """
        announced = self._announced(reading.PROCESS_STARTED)
        seen = Counter(process.executable for process in self.seen)
        by_hand = sum(count for name, count in seen.items() if name not in announced)
        announced["ros2"] -= min(announced["ros2"], by_hand)
        return sorted(name for name, count in announced.items() if count and name not in seen)

    def _announced(self, pattern: re.Pattern[str]) -> Counter[str]:
        matches = (pattern.match(line.text) for line in self.lines if line.source == "launch")
        return Counter(match[1] for match in matches if match)

    def spoke(self, topic: str, program: str) -> bool:
        """Whether all publishers of *topic* belonged to the executable *program*, as far as that is known."""
        return all(
            endpoint.program in (program, "") for endpoint in self.appeared("publisher") if endpoint.topic == topic
        )

    def heard(self, topic: str, program: str) -> bool:
        """Whether the executable *program* subscribed to *topic*, as far as that is known."""
        mine = [endpoint for endpoint in self.appeared("subscription") if endpoint.topic == topic]
        return any(endpoint.program in (program, "") for endpoint in mine)

    def ended_by_itself(self, executable: str) -> bool:
        """Whether *executable* was running, or was started, and ended before the grader stopped the scene."""
        if self.scene.label and self.ended is not None and self.ended.by is not EndedBy.GRADER:
            return True
        pids = {process.pid for process in self.seen if process.executable == executable}
        if any(gone.pid in pids and gone.by is EndedBy.ITSELF for gone in self.gone):
            return True
        return any(
            (match := reading.PROCESS_DIED.match(line.text)) is not None and match[1] == executable
            for line in self.lines
            if line.source == "launch"
        )

    def lines_of(self, executable: str) -> list[Line]:
        """What *executable* printed."""
        return [line for line in self.lines if line.source == executable]

    @property
    def flooded(self) -> bool:
        """Whether so much was printed that not all of it was kept."""
        return "dropped_lines" in self.measured or "dropped_bytes" in self.measured

    def says(self, source: str, *texts: str) -> bool:
        """Whether one of *texts* stands in what *source* printed."""
        return any(text in line.text for line in self.lines if line.source == source for text in texts)

    def error_of(self, source: str) -> str:
        """The last line of the last traceback that *source* printed, else the last line it printed at all."""
        texts = [line.text for line in self.lines if line.source == source]
        starts = [index for index, text in enumerate(texts) if TRACEBACK in text]
        if starts:
            body = texts[starts[-1] + 1 :]
            closing = next((text for text in body if text and not text.startswith((" ", "\t", "["))), "")
            if closing.startswith(PASSED_ON):
                closing = next((text for text in reversed(texts[: starts[-1]]) if ERROR.match(text)), closing)
            if closing:
                return ADDRESS.sub("", closing)
        limit = self.ended.limit if self.ended is not None else ""
        if limit:
            return messages.phrase("limit", limit=limit)
        return next((reading.said(text) for text in reversed(texts) if text.strip()), messages.phrase("no-error"))

    def died_in_spin(self, source: str) -> bool:
        """Whether the traceback of *source* goes through rclpy's spin: its node was complete, and known to the graph."""
        return any(IN_SPIN.search(line.text) for line in self.lines if line.source == source)

    def place_of_error(self, source: str, package: str) -> tuple[str, int]:
        """(file within the package, line) that the last traceback of *source* names last; ("", 0) when it names none."""
        texts = [line.text for line in self.lines if line.source == source]
        found = [
            match for text in texts if (match := re.search(rf'File "[^"]*/({package}/[\w/]+\.py)", line (\d+)', text))
        ]
        return (found[-1][1], int(found[-1][2])) if found else ("", 0)


class View:
    """The evidence of one submission, with the answers that several checks need."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence = evidence
        self.specification = lab.specification()
        self._scenes = {scene.name: SceneView(scene) for scene in evidence.scenes}

    def scene(self, name: SceneName) -> SceneView | None:
        """That scene, None when it was not played."""
        return self._scenes.get(name)

    def scenes(self) -> tuple[SceneView, ...]:
        """Every scene that was played."""
        return tuple(self._scenes.values())

    @property
    def build(self) -> Build | None:
        """What was built."""
        return self.evidence.build

    def source(self, path: str) -> str:
        """The text of a file of the package; empty when it is not there."""
        return next((file.text for file in self.evidence.submission.sources if file.path == path), "")

    @cached_property
    def talking(self) -> SceneView | None:
        """The scene on which the talker is judged: by itself where it had to be, else the launched pair."""
        return self.scene(SceneName.TALKER) or self.scene(SceneName.CONVERSATION)

    @cached_property
    def pair(self) -> tuple[str, str]:
        """(talker, listener): the executables that a launch file has to start; the worksheet's names where nothing was built."""
        numeric = self.specification.numeric
        if self.build is None:
            return numeric.programs
        return launched(numeric.talker, self.build), launched(numeric.listener, self.build)

    @cached_property
    def talker_name(self) -> str:
        """The executable or module that stood for the talker."""
        label = self.talking.scene.label if self.talking else ""
        return label or self.pair[0]

    @cached_property
    def number_publishers(self) -> list[Endpoint]:
        """Publishers on the topic of numbers."""
        return self._publishers_on(self.specification.number_topic.name)

    @cached_property
    def text_publishers(self) -> list[Endpoint]:
        """Publishers on the topic of texts."""
        return self._publishers_on(self.specification.text_topic.name)

    def _publishers_on(self, topic: str) -> list[Endpoint]:
        return [endpoint for endpoint in self.published if endpoint.topic == topic]

    @cached_property
    def published(self) -> list[Endpoint]:
        """Every publisher of the talker's scene."""
        return self.talking.appeared("publisher") if self.talking else []

    @cached_property
    def stray_number_topic(self) -> str:
        """Where the numbers go instead, when nothing is published on the topic asked for; empty when nowhere."""
        if self.number_publishers:
            return ""
        text_type = self.specification.text_topic.type
        others = [endpoint.topic for endpoint in self.published if endpoint.type != text_type]
        return others[0] if len(set(others)) == 1 else ""

    @cached_property
    def numbers(self) -> list[Message]:
        """What the talker published as its count, wherever it did."""
        topic = self.stray_number_topic or self.specification.number_topic.name
        return [message for message in self.talking.messages if message.topic == topic] if self.talking else []

    @cached_property
    def sequel(self) -> Sequel | None:
        """The numbers taken apart; None when one of them is no whole number."""
        topic = self.specification.number_topic
        return analyse(self.numbers, topic.smallest, topic.largest)

    @cached_property
    def texts(self) -> list[Message]:
        """What the talker published on the topic of texts."""
        topic = self.specification.text_topic.name
        return [message for message in self.talking.messages if message.topic == topic] if self.talking else []


def names(values: Iterable[str]) -> str:
    """*values* as a list for people; the phrase for nothing when there are none."""
    return ", ".join(sorted(set(values))) or messages.phrase("nothing")

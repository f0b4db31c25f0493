"""The observer: a node that sees the graph, hears every topic, and watches the program of the submission."""

from __future__ import annotations

import contextlib
import importlib
import queue
import re
import secrets
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import PurePosixPath
from typing import Any

import msgspec
import rclpy
from rclpy.context import Context
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from lab2_grader import lab, process, process_table
from lab2_grader.observe.output import OutputLines
from lab2_grader.observe.recorder import Recorder
from lab2_grader.records import (
    EndedBy,
    Endpoint,
    Line,
    Measured,
    Message,
    ProcessGone,
    ProcessSeen,
    ProgramEnded,
    Request,
    Unsupported,
)
from lab2_grader.text import clean

HOUSEKEEPING_TOPICS = ("/rosout", "/parameter_events", "/clock")
TYPE_NAME = re.compile(r"^([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)$")
MOST_TYPES = 5  # of one topic that are listened to
QUEUE_DEPTH = 1000  # the observer never loses what it could have heard
GRAPH_SHARE = 5  # at most one part in so many of the observer's time goes into looking at the graph
GRAPH_POLL_SECONDS = 0.02
PROCESS_POLL_SECONDS = 0.1
IDLE_SECONDS = 0.5  # a program that is busy for longer is left alone
QUICK_PROCESS_POLL_SECONDS = 0.04  # until the first message: what dies at once must have been seen
BLIND_SECONDS = 1.0  # between two looks at the processes: what was done meanwhile is not known
UNNAMED = "_NODE_NAME_UNKNOWN_"  # the node of an endpoint whose participant has not said its names yet
UNNAMED_SECONDS = 1.0  # it is waited for so long
PROCESS_ID = slice(4, 6)  # of an identity of Fast DDS (GUID prefix): the low half of the process's own pid
UNSUPPORTED = "[lab2-launcher] unsupported: "

Handle = tuple[str, str, bool, bool]


class Observer:
    """Hears, sees and remembers one scene.

    Args:
        recorder: Where everything observed goes.

    What a scene's script needs to decide what to do next is kept here too: `messages`, `lines`, `endpoints`,
    `ended_executables`.
    """

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self.messages: list[Message] = []
        self._by_topic: dict[str, list[Message]] = {}
        self.lines: list[Line] = []
        self.endpoints: dict[str, Endpoint] = {}
        self._changed_at = 0.0
        self._looked_at = 0.0
        self._unnamed: dict[str, float] = {}  # since when an endpoint has been there without the name of its node
        self._nodes: frozenset[str] = frozenset()
        self.ended: ProgramEnded | None = None
        self._context = Context()
        # Without log files there is nothing that the observer must be able to write.
        rclpy.init(args=["--ros-args", "--disable-external-lib-logs"], context=self._context)
        self.name = f"observer_{secrets.token_hex(6)}"
        self.node = _quiet_node(self.name, self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        # `Executor.wake` does not end a round; something that has a callback does.
        self._news = self.node.create_guard_condition(lambda: None)
        self._executor.add_node(self.node)
        self._subscribed: set[Handle] = set()
        self._types: dict[str, list[str]] = {}  # of each topic, in the order in which they were met
        self._more_nodes: list[Node] = []
        self._heard: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._output: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._program: process.Process | None = None
        self._splitters: dict[str, OutputLines] = {}
        self._processes: dict[int, str] = {}
        self._table: dict[int, process_table.ProcessInfo] = {}
        self._kept: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self.ended_executables: frozenset[str] = frozenset()
        self._next_graph = 0.0
        self._next_processes = 0.0
        self._stopping = False

    # --- the program ------------------------------------------------------------------------

    def start(self, request: Request, label: str) -> None:
        """Start the submission's program; *label* is the executable's name, empty for a launch."""
        line_bytes = lab.limits().resources.line_bytes
        self._splitters = {name: OutputLines(name, label, line_bytes) for name in ("stdout", "stderr")}
        self._label = label
        self.recorder.begin()
        self._program = process.Process(request, on_output=self._on_output)
        self._changed_at = self._looked_at = self.recorder.now()  # on a busy machine that took a while

    def _on_output(self, stream: str, data: bytes) -> None:
        self._output.put((stream, data))
        self._news.trigger()

    def stop(self) -> None:
        """Stop the program and record how it ended."""
        self._look_at_processes()
        self._stopping = True
        if self._program is not None:
            self._program.stop()
            self._program.wait()
        self._drain_output()
        self._note_end()

    def alive(self) -> bool:
        """Whether the program still runs; once it has ended, all it printed has been read."""
        if self.ended is None and self._program is not None and not self._program.running:
            self._drain_output()
            self._note_end()
        return self.ended is None

    def _note_end(self) -> None:
        if self.ended is not None or self._program is None:
            return
        outcome = self._program.wait()
        for splitter in self._splitters.values():
            self._keep(splitter.rest(self.recorder.now()))
        self._look_at_processes()
        by = outcome.ended_by
        self.ended = ProgramEnded(self.recorder.now(), outcome.code, outcome.signal, by, outcome.limit)
        self.recorder.write(self.ended)
        for what, count in (("dropped_bytes", outcome.dropped_bytes), *self._dropped.items()):
            if count:
                self.recorder.write(Measured(self.recorder.now(), what, count))

    def executables(self) -> frozenset[str]:
        """Names of the package's executables that are running now."""
        return frozenset(filter(None, self._processes.values()))

    def held(self, executable: str) -> contextlib.AbstractContextManager[None]:
        """Keep the processes of *executable* from running until the block ends.

        Only once nothing of the program has work to do, so that what it was about to print has been printed.
        """
        idle = self.until(lambda: not process_table.busy(self._table), IDLE_SECONDS)
        return process_table.held([pid for pid, name in self._processes.items() if name == executable and idle])

    def _look_at_processes(self) -> None:
        if self._program is None:
            return
        found = {info.pid: info for info in process_table.tree(self._program.pid)} if self._program.running else {}
        self._table = found
        now = self.recorder.now()
        if process_table.busy(found):
            self._changed_at = now
        elif (blind := now - self._looked_at) > BLIND_SECONDS:  # nobody knows what was done meanwhile
            self._changed_at = min(now, self._changed_at + blind)
        self._looked_at = now
        marker = f"/lib/{lab.specification().package}/"
        for pid, info in found.items():
            if not self._processes.get(pid):  # one that was seen before its exec has the name of its parent yet
                script = next((part for part in info.command[:2] if marker in part), "")
                executable = PurePosixPath(script).name if script else self._module(info.command)
                if executable and self._processes.get(info.parent) == executable:
                    executable = ""  # a child of a node that has not become another program yet, or never will
                self._processes[pid] = executable
                if executable:
                    command = clean(" ".join(info.command), 500)
                    self.recorder.write(ProcessSeen(self.recorder.now(), pid, clean(executable, 100), command))
        for pid in [pid for pid in self._processes if pid not in found and not process_table.alive(pid)]:
            if executable := self._processes.pop(pid):
                self.ended_executables |= {executable}
                by = EndedBy.GRADER if self._stopping else EndedBy.ITSELF
                self.recorder.write(ProcessGone(self.recorder.now(), pid, by))

    def _module(self, command: tuple[str, ...]) -> str:
        """The label of this scene, when *command* runs the module of that name in the place of an executable."""
        is_module = (
            self._label and command[1:2] == ("-c",) and f"{lab.specification().package}.{self._label}" in command
        )
        return self._label if is_module else ""

    def _program_of(self, gid: str) -> str:
        """Which executable of the package the endpoint *gid* belongs to, as `Endpoint.program` has it."""
        number = int.from_bytes(bytes.fromhex(gid)[PROCESS_ID], "little")
        for _ in range(2):  # what was seen of the processes may be older than the endpoint
            pids = [pid for pid, info in self._table.items() if info.inside_pid & 0xFFFF == number]
            owners = {self._executable_of(pid) for pid in pids}
            if len(owners) == 1 and "-" not in owners:
                return owners.pop()
            self._look_at_processes()
        return owners.pop() if len(owners) == 1 else ""

    def _executable_of(self, pid: int) -> str:
        """The executable that *pid* is, or descends from; `-` when there is none."""
        while pid in self._table:
            if name := self._processes.get(pid):
                return name
            pid = self._table[pid].parent
        return "-"

    # --- what it prints ---------------------------------------------------------------------

    def _drain_output(self) -> None:
        now = self.recorder.now()
        while not self._output.empty():
            stream, data = self._output.get()
            self._keep(self._splitters[stream].take(data, now))

    def finish_lines(self) -> None:
        """Take what was printed without an end of line so far as a line."""
        now = self.recorder.now()
        for splitter in self._splitters.values():
            self._keep(splitter.rest(now))

    def _keep(self, lines: list[Line]) -> None:
        for line in lines:
            if line.text.startswith(UNSUPPORTED) and line.source == "launch":
                self.recorder.write(Unsupported(line.at, line.text[len(UNSUPPORTED) :]))
            if self._keeps("lines", "dropped_lines", lab.limits().resources.lines):
                self.lines.append(line)
                self.recorder.write(line)

    def _keeps(self, what: str, dropped: str, limit: int) -> bool:
        """Whether one more of *what* is kept: whoever floods us shall not fill our memory and our disk."""
        self._kept[what] += 1
        if self._kept[what] > limit:
            self._dropped[dropped] += 1
            return False
        return True

    # --- the graph --------------------------------------------------------------------------

    def nodes(self) -> frozenset[str]:
        """Fully qualified names of the other nodes."""
        found = self.node.get_node_names_and_namespaces()
        return frozenset(f"{space.rstrip('/')}/{name}" for name, space in found if name != self.name)

    @property
    def quiet_seconds(self) -> float:
        """For how long nothing has happened: the graph did not change, and no process of the program had work to do.

        Unlike a time on the wall clock, this is not used up while the machine keeps the program waiting, nor while the
        observer itself did not get to look.
        """
        return max(0.0, self._looked_at - self._changed_at)

    def look_at_graph(self) -> None:
        """Record which endpoints came and went, and subscribe to what is published as it is offered."""
        now = self.recorder.now()
        nodes = self.nodes()
        if nodes != self._nodes:
            self._nodes = nodes
            self._changed_at = now
        found: dict[str, Endpoint] = {}
        for topic in self._topics():
            publishers = self.node.get_publishers_info_by_topic(topic)
            subscriptions = self.node.get_subscriptions_info_by_topic(topic) if topic != "/clock" else []
            for kind, infos in (("publisher", publishers), ("subscription", subscriptions)):
                for info in infos:
                    if info.node_name == self.name:
                        continue
                    gid = bytes(info.endpoint_gid).hex()
                    if info.node_name == UNNAMED and now - self._unnamed.setdefault(gid, now) < UNNAMED_SECONDS:
                        self._changed_at = now
                        if gid not in self.endpoints:
                            continue
                    found[gid] = self.endpoints.get(gid) or self._endpoint(now, kind, gid, topic, info)
        for gid, endpoint in found.items():
            if gid not in self.endpoints:
                self.recorder.write(endpoint)
                self._changed_at = now
                if endpoint.kind == "publisher" and endpoint.topic not in HOUSEKEEPING_TOPICS:
                    reliable, lasting = endpoint.reliability == "reliable", endpoint.durability == "transient-local"
                    self.listen(endpoint.topic, endpoint.type, reliable, lasting)
        for gid in self.endpoints.keys() - found.keys():
            gone = self.endpoints[gid]
            self.recorder.write(msgspec.structs.replace(gone, at=now, event="gone"))
            self._changed_at = now
        self.endpoints = found

    def _topics(self) -> list[str]:
        """The topics there are, the lab's own first, and no more of the others than are looked at in a scene."""
        specification = lab.specification()
        own = (specification.number_topic.name, specification.text_topic.name, "/clock")
        found = {topic for topic, _ in self.node.get_topic_names_and_types()} - set(HOUSEKEEPING_TOPICS[:2])
        ordered = [topic for topic in own if topic in found] + sorted(found.difference(own))
        return ordered[: lab.limits().resources.topics]

    def _endpoint(self, now: float, kind: str, gid: str, topic: str, info: Any) -> Endpoint:
        qos = info.qos_profile
        reliable = qos.reliability == ReliabilityPolicy.RELIABLE
        lasting = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        return Endpoint(
            at=now,
            event="appeared",
            kind=kind,
            gid=gid,
            node=clean(f"{info.node_namespace.rstrip('/')}/{info.node_name}", 300),
            topic=clean(topic, 300),
            type=clean(info.topic_type, 200),
            reliability="reliable" if reliable else "best-effort",
            durability="transient-local" if lasting else "volatile",
            program=self._program_of(gid),
        )

    def listen(self, topic: str, type_name: str, reliable: bool = True, lasting: bool = False) -> None:
        """Subscribe to *topic* with that type and quality of service, once; a type that is not here is not heard."""
        # A reliable publisher is heard by the same subscription whether or not it keeps old messages for late comers.
        handle = (topic, type_name, reliable, False if reliable else lasting)
        message_type = message_class(type_name)
        known = self._types.get(topic, [])
        if handle in self._subscribed or message_type is None or (len(known) >= MOST_TYPES and type_name not in known):
            return
        self._subscribed.add(handle)
        qos = QoSProfile(
            depth=QUEUE_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.VOLATILE,
        )

        def heard(message: Any, info: Any) -> None:
            data = getattr(message, "data", None)
            kept = clean(data, 1000) if isinstance(data, str) else data if isinstance(data, int | float) else None
            number = int(info["publication_sequence_number"] or 0)
            self._heard.put(Message(self.recorder.now(), topic, type_name, number, kept))
            self._news.trigger()

        # A name that rclpy does not accept was not made with rclpy: nothing that is asked for is heard there.
        with contextlib.suppress(ValueError, RuntimeError):
            self._node_for(topic, type_name).create_subscription(
                message_type, topic, heard, qos, event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False)
            )

    def _node_for(self, topic: str, type_name: str) -> Node:
        """The node that subscribes to *topic* as that type.

        One participant of the middleware cannot know one topic under two types, so each further type of a topic needs
        a participant of its own, which spins in a thread of its own.
        """
        types = self._types.setdefault(topic, [])
        if type_name not in types:
            types.append(type_name)
        rank = types.index(type_name)
        while len(self._more_nodes) < rank:
            context = Context()
            rclpy.init(args=["--ros-args", "--disable-external-lib-logs"], context=context)
            node = _quiet_node(self.name, context)
            executor = SingleThreadedExecutor(context=context)
            executor.add_node(node)
            threading.Thread(target=executor.spin, name=self.name, daemon=True).start()
            self._more_nodes.append(node)
        return self._more_nodes[rank - 1] if rank else self.node

    def _drain_heard(self) -> None:
        while not self._heard.empty():
            row = self._heard.get()
            if self._keeps(row.topic, "dropped_messages", lab.limits().resources.messages):
                self.messages.append(row)
                self._by_topic.setdefault(row.topic, []).append(row)
                self.recorder.write(row)

    def publisher(self, topic: str, type_name: str) -> Publisher[Any]:
        """A publisher of the observer's own, with the default quality of service."""
        message_type = message_class(type_name)
        assert message_type is not None, type_name
        no_events = PublisherEventCallbacks(use_default_callbacks=False)
        return self.node.create_publisher(message_type, topic, 10, event_callbacks=no_events)

    def messages_on(self, topic: str) -> list[Message]:
        """The messages that came on *topic*."""
        return self._by_topic.get(topic, [])

    # --- waiting ----------------------------------------------------------------------------

    def spin(self, seconds: float) -> None:
        """Let at most one thing happen, waiting no longer than *seconds*; look around when it is time to."""
        self._executor.spin_once(timeout_sec=seconds)
        self._drain_heard()
        self._drain_output()
        now = time.monotonic()
        if now >= self._next_graph:
            self.look_at_graph()
            took = time.monotonic() - now
            self._next_graph = now + max(GRAPH_SHARE * took, GRAPH_POLL_SECONDS * (1 if not self.messages else 10))
        if now >= self._next_processes:
            self._look_at_processes()
            self.recorder.flush()
            self._next_processes = now + (PROCESS_POLL_SECONDS if self.messages else QUICK_PROCESS_POLL_SECONDS)

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait until *condition* holds, for at most *seconds*; whether it does."""
        deadline = time.monotonic() + seconds
        while not condition():
            left = deadline - time.monotonic()
            if left <= 0:
                return False
            self.spin(min(left, GRAPH_POLL_SECONDS))
        return True


def _quiet_node(name: str, context: Context) -> Node:
    """A node with nothing that it is not asked for: whatever an executor has to look after costs it time in every round."""
    return Node(
        name,
        context=context,
        enable_rosout=False,
        start_parameter_services=False,
        parameter_overrides=[Parameter("start_type_description_service", value=False)],
    )


def message_class(type_name: str) -> Any | None:
    """The class of a message type such as `std_msgs/msg/Int8`; None when it is not installed here."""
    match = TYPE_NAME.match(type_name)
    if match is None:
        return None
    try:
        return getattr(importlib.import_module(f"{match[1]}.msg"), match[2], None)
    except ImportError:
        return None

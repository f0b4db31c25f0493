"""Writes what was observed as rosbag2 recordings (MCAP), one for each scene, for `ros2 bag play` and Foxglove.

Beside the messages a recording holds `/clock`, where the grader drove it, and what the nodes printed as `/rosout`.
Needs the library `rosbags` (`pip install "lab2-grader[bag]"`).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lab2_grader import lab
from lab2_grader.errors import UsageError
from lab2_grader.records import Endpoint, Event, Evidence, Line, Message, Scene, Sent, Tick

FORMAT_VERSION = 9  # of metadata.yaml: Jazzy's
CLOCK, LOG = "rosgraph_msgs/msg/Clock", "rcl_interfaces/msg/Log"
NANOSECONDS = 1_000_000_000
INFO = 20  # level of rcl_interfaces/msg/Log
NUMERIC = ("Int", "UInt", "Float")


def write(evidence: Evidence, folder: Path) -> tuple[Path, ...]:
    """Write one recording for each scene of *evidence* below *folder*; the folders that were written.

    Time in a recording is the ROS clock where the grader drove it, so that a conversation plays back at the pace its
    nodes meant; elsewhere it is the time since the scene began.

    Raises:
        UsageError: The library is not installed, or a recording is already there.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise UsageError('Recordings need the library rosbags. Run: pip install "lab2-grader[bag]"') from error
    store = get_typestore(Stores.ROS2_JAZZY)
    written = []
    for scene in evidence.scenes:
        target = folder / scene.name.value
        if target.exists():
            raise UsageError(f"{target} is already there. Remove it, or give another folder.")
        folder.mkdir(parents=True, exist_ok=True)
        with Writer(target, version=FORMAT_VERSION, storage_plugin=StoragePlugin.MCAP) as recording:
            connections: dict[tuple[str, str], Any] = {}
            for at, topic, kind, message in _messages(scene, store):
                if (topic, kind) not in connections:
                    connections[topic, kind] = recording.add_connection(topic, kind, typestore=store)
                recording.write(connections[topic, kind], at, store.serialize_cdr(message, kind))
        written.append(target)
    return tuple(written)


def _messages(scene: Scene, store: Any) -> list[tuple[int, str, str, Any]]:
    """(nanoseconds, topic, type, message) of all that can be recorded of *scene*, in order."""
    moment = _moments(scene)
    types = {event.topic: event.type for event in scene.events if isinstance(event, Endpoint)}
    specification = lab.specification()
    asked = {topic.name: topic.type for topic in (specification.text_topic, specification.number_topic)}
    found: list[tuple[int, str, str, Any]] = []
    for event in scene.events:
        at = moment(event)
        match event:
            case Message():
                found += _data(store, at, event.topic, event.type, event.data)
            case Sent():
                kind = asked.get(event.topic) or types.get(event.topic, "")
                found += _data(store, at, event.topic, kind, event.data)
            case Tick():
                found.append((at, "/clock", CLOCK, store.types[CLOCK](clock=_stamp(store, at))))
            case Line():
                found.append((at, "/rosout", LOG, _log(store, at, event)))
    return sorted(found, key=lambda entry: entry[0])


def _moments(scene: Scene) -> Callable[[Event], int]:
    """When an event happened, in nanoseconds: by the ROS clock when it was driven.

    Between two ticks time goes on as it did for the grader, but never past the later one, so that what a slow machine
    delayed still comes before what followed it.
    """
    ticks = [event for event in scene.events if isinstance(event, Tick)]
    if not ticks or scene.follows_own_clock:
        return lambda event: int(event.at * NANOSECONDS)
    starts = [tick.at for tick in ticks]
    ends = [tick.clock for tick in ticks[1:]] + [math.inf]

    def moment(event: Event) -> int:
        last = bisect_right(starts, event.at) - 1
        if last < 0:
            return 0
        return int(min(ticks[last].clock + (event.at - starts[last]), ends[last]) * NANOSECONDS)

    return moment


def _data(store: Any, at: int, topic: str, kind: str, data: Any) -> list[tuple[int, str, str, Any]]:
    """A message with one field `data`; nothing when it is of another kind."""
    if data is None or kind not in store.types or not kind.startswith("std_msgs/msg/"):
        return []
    name = kind.rsplit("/", 1)[-1]
    if (name == "String" and isinstance(data, str)) or (name.startswith(NUMERIC) and isinstance(data, int | float)):
        return [(at, topic, kind, store.types[kind](data=data))]
    return []


def _stamp(store: Any, at: int) -> Any:
    return store.types["builtin_interfaces/msg/Time"](sec=at // NANOSECONDS, nanosec=at % NANOSECONDS)


def _log(store: Any, at: int, line: Line) -> Any:
    return store.types[LOG](
        stamp=_stamp(store, at), level=INFO, name=line.source, msg=line.text, file="", function="", line=0
    )

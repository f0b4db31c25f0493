"""Picks from the evidence what the verdict of a check rests on, a few lines each: what a person would look at first. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from lab2_grader.checks.view import TRACEBACK, SceneView, View
from lab2_grader.records import EndedBy, Endpoint, Message, Phase, ProcessGone, ProcessSeen, ProgramEnded, SceneName

LINES = 12  # of one extract
BUILD_LINES = 30
STAFF_LINES = 120
WIDTH = 200  # characters of one line
AROUND = 4  # numbers on either side of a place worth looking at
PLACES = 3


@dataclass(frozen=True)
class Extract:
    """A few lines of evidence under a title; `left_out` counts those that are not shown."""

    title: str
    lines: tuple[str, ...]
    left_out: int = 0


def extracts(check: str, view: View) -> tuple[Extract, ...]:
    """What the verdict of *check* rests on; empty when there is nothing to show."""
    found: Iterable[Extract | None]
    match check:
        case "package-builds":
            found = (_build(view),)
        case "entry-points":
            found = (_executables(view),)
        case "talker-type":
            found = (_endpoints(view.talking, "publisher", "Publishers of the talker"), _last_words(view.talking))
        case "talker-start" | "talker-step" | "talker-wrap":
            found = (_numbers(view), _last_words(view.talking))
        case "talker-chatter":
            found = (
                _endpoints(view.talking, "publisher", "Publishers of the talker"),
                _values(view.texts, f"Published on {view.specification.text_topic.name}"),
            )
        case "listener-numeric" | "listener-chatter":
            found = _listening(check, view)
        case "launch-starts" | "launch-only-numeric":
            found = _launching(view.scene(SceneName.CONVERSATION))
        case "launch-conversation":
            found = _conversing(view)
        case "originals-kept":
            found = _launching(view.scene(SceneName.ORIGINALS))
        case "git-pushed" | "git-clean":
            found = (_repository(view),)
        case _:
            found = ()
    return tuple(extract for extract in found if extract is not None and extract.lines)


def staff_extracts(view: View) -> tuple[Extract, ...]:
    """What only staff see: how each scene went, every process, and all that was printed, bounded."""
    found: list[Extract | None] = []
    if view.evidence.faults:
        found.append(_first("Faults of the grader or the machine", view.evidence.faults, STAFF_LINES))
    if view.build is not None:
        found.append(_last("The whole build", view.build.log.splitlines(), STAFF_LINES))
    for scene in view.scenes():
        name = scene.scene.name.value
        found.append(_first(f"How the scene '{name}' went", _course(scene), STAFF_LINES))
        printed = [f"{line.at:8.3f}  {line.source} ({line.stream}): {line.text}" for line in scene.lines]
        found.append(_first(f"All that was printed in the scene '{name}'", printed, STAFF_LINES))
    return tuple(extract for extract in found if extract is not None and extract.lines)


# --- pieces -------------------------------------------------------------------------------------


def _short(line: str) -> str:
    return line if len(line) <= WIDTH else line[: WIDTH - 1] + "…"


def _first(title: str, lines: Sequence[str], keep: int = LINES) -> Extract | None:
    kept = tuple(_short(line) for line in lines[:keep])
    return Extract(title, kept, len(lines) - len(kept)) if kept else None


def _last(title: str, lines: Sequence[str], keep: int = LINES) -> Extract | None:
    kept = tuple(_short(line) for line in lines[-keep:])
    return Extract(title, kept, len(lines) - len(kept)) if kept else None


def _build(view: View) -> Extract | None:
    if view.build is None:
        return None
    if view.build.ok:
        return Extract("colcon build", (f"ended with {view.build.code} after {view.build.seconds:.1f} s",))
    return _last("The end of what colcon build printed", view.build.log.splitlines(), BUILD_LINES)


def _executables(view: View) -> Extract | None:
    if view.build is None or not view.build.ok:
        return None
    targets = {entry.name: entry.target for entry in view.build.entry_points}
    lines = [
        f"{name} = {targets.get(name, '?')}{'   (no such module)' if name in view.build.dangling else ''}"
        for name in view.build.executables
    ]
    return _first("What ros2 pkg executables lists", lines or ["nothing"], 24)


def _endpoints(scene: SceneView | None, kind: str, title: str) -> Extract | None:
    if scene is None:
        return None
    return _first(title, [_endpoint(endpoint) for endpoint in scene.appeared(kind)] or ["none appeared in the graph"])


def _endpoint(endpoint: Endpoint) -> str:
    quality = f"{endpoint.reliability}, {endpoint.durability}"
    return f"{endpoint.topic}  {endpoint.type}  by {endpoint.node}  ({quality})"


def _numbers(view: View) -> Extract | None:
    numbers = view.numbers
    if not numbers:
        return None
    lines = [f"first:  {_row(numbers[: 3 * AROUND])}"]
    for index in _places(numbers):
        near = numbers[max(index - AROUND, 0) : index + AROUND]
        lines.append(f"around message {index + 1}:  {_row(near)}")
    lines.append(f"{len(numbers)} messages in all, the last: {_row(numbers[-1:])}")
    return Extract(f"Numbers on {numbers[0].topic}", tuple(_short(line) for line in lines))


def _places(numbers: Sequence[Message]) -> list[int]:
    """Where the next number is not one more than the last."""
    found = []
    for index, (before, after) in enumerate(pairwise(numbers), start=1):
        if not (isinstance(before.data, int) and isinstance(after.data, int) and after.data == before.data + 1):
            found.append(index)
            if len(found) == PLACES:
                break
    return found


def _row(messages: Sequence[Message]) -> str:
    return "  ".join(str(message.data) for message in messages)


def _values(messages: Sequence[Message], title: str) -> Extract | None:
    lines = [f"message {message.number}: {message.data}" for message in messages]
    return _first(title, lines, 4) if lines else Extract(title, ("nothing",))


def _listening(check: str, view: View) -> tuple[Extract | None, ...]:
    scene = view.scene(SceneName.LISTENER)
    if scene is None:
        return ()
    specification = view.specification
    topic = (specification.number_topic if check == "listener-numeric" else specification.text_topic).name
    sent = [str(message.data) for message in scene.sent if message.topic == topic]
    said = [line.text for line in scene.lines_of(scene.scene.label)]
    return (
        _endpoints(scene, "subscription", "Subscriptions of the listener"),
        _first(f"Sent on {topic}", [", ".join(sent)] if sent else []),
        _first("Printed by the listener", said) or Extract("Printed by the listener", ("nothing",)),
        _last_words(scene),
    )


def _launching(scene: SceneView | None) -> tuple[Extract | None, ...]:
    if scene is None:
        return ()
    said = [line.text for line in scene.lines if line.source == "launch"]
    printed = [f"[{line.source}] {line.text}" for line in scene.lines if line.source != "launch"]
    ended = [f"{name} ended by itself" for name in scene.started() if scene.ended_by_itself(name)]
    return (
        _first("What the launch said", said),
        _first("What its nodes printed", printed),
        _first("Ended early", ended),
    )


def _conversing(view: View) -> tuple[Extract | None, ...]:
    scene = view.scene(SceneName.CONVERSATION)
    if scene is None:
        return ()
    topic, listener = view.specification.number_topic.name, view.specification.numeric.listener
    return (
        _values([message for message in scene.messages if message.topic == topic], f"Published on {topic}"),
        _first("Printed by the launched listener", [line.text for line in scene.lines_of(listener)] or ["nothing"], 6),
        _endpoints(scene, "subscription", "Subscriptions"),
    )


def _last_words(scene: SceneView | None) -> Extract | None:
    """The last traceback of a scene whose nodes ended by themselves; ours ends them with one too, which is not evidence."""
    if scene is None:
        return None
    for source in dict.fromkeys(line.source for line in scene.lines if line.source != "launch"):
        if not scene.ended_by_itself(source):
            continue
        texts = [line.text for line in scene.lines_of(source)]
        starts = [index for index, text in enumerate(texts) if TRACEBACK in text]
        if starts:
            return _last(f"The last words of {source}", texts[starts[-1] :], BUILD_LINES)
    return None


def _repository(view: View) -> Extract | None:
    git = view.evidence.submission.git
    if git is None:
        return None
    lines = [f"commit    {git.commit or 'none'}"]
    lines += [f"remote    {remote}" for remote in git.remotes[:4]]
    lines.append(f"pushed    {'yes' if git.pushed else 'no'}")
    lines += [f"not committed  {path}" for path in git.uncommitted[:8]]
    lines += [f"build product  {path}" for path in git.products[:8]]
    return _first("What the repository says", lines, 24)


def _course(scene: SceneView) -> list[str]:
    """Phases, processes and ends of a scene, in order."""
    played = scene.scene
    lines = [
        f"started with {played.started_with} {played.label}".rstrip() + f", clock {played.clock.value}",
        f"{'complete' if played.complete else 'not complete'} after {played.seconds} s {played.fault}".rstrip(),
    ]
    for event in played.events:
        match event:
            case Phase():
                lines.append(f"{event.at:8.3f}  phase {event.name}")
            case ProcessSeen():
                lines.append(f"{event.at:8.3f}  process {event.pid} {event.executable}: {event.command}")
            case ProcessGone():
                by = "by itself" if event.by is EndedBy.ITSELF else f"by the {event.by.value}"
                lines.append(f"{event.at:8.3f}  process {event.pid} ended {by}")
            case ProgramEnded():
                how = f"code {event.code}" if event.code is not None else f"signal {event.signal}"
                lines.append(
                    f"{event.at:8.3f}  the program ended with {how} (ended by {event.by.value}) {event.limit}".rstrip()
                )
    lines += [f"measured {name} = {value:g}" for name, value in scene.measured.items()]
    lines += [_endpoint(endpoint) for endpoint in scene.endpoints if endpoint.event == "appeared"]
    lines += [f"unsupported by the grader's own launcher: {event.what}" for event in scene.unsupported]
    return lines

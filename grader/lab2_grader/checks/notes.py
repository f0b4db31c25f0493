"""Information without points: what is worth saying of a submission although no check asks for it."""

from __future__ import annotations

from collections import Counter

from lab2_grader import messages
from lab2_grader.checks.view import View
from lab2_grader.records import Evidence, SceneName

PARTICIPANT = 24  # hexadecimal digits of a gid that name the participant (DDSI-RTPS 9.3.1)


def notes(evidence: Evidence) -> tuple[str, ...]:
    """The notes on *evidence*, a sentence each."""
    view = View(evidence)
    return (
        *evidence.faults,
        *([messages.note("isolation-off")] if evidence.runtime.isolation == "off" else []),
        *_period(view),
        *_print(view),
        *_names(view),
        *_stand_ins(view),
        *_limits(view),
        *_dropped(view),
    )


def _period(view: View) -> list[str]:
    scene = view.talking
    if scene is None or not view.numbers:
        return []
    found = []
    if period := scene.measured.get("period_seconds"):
        found.append(messages.note("period", seconds=f"{period:g}"))
    if scene.scene.follows_own_clock:
        found.append(messages.note("own-clock"))
    return found


def _print(view: View) -> list[str]:
    """The logger writes to standard error, print() to standard output; told apart where nothing stands in between."""
    scene = view.scene(SceneName.LISTENER)
    if scene is None or not any(line.stream == "stdout" and line.text.strip() for line in scene.lines):
        return []
    return [messages.note("print", node=scene.scene.label)]


def _names(view: View) -> list[str]:
    """One name for nodes of two processes: the first half of an endpoint's identity is that of its process."""
    scene = view.scene(SceneName.CONVERSATION)
    if scene is None:
        return []
    owners = {
        (endpoint.node, endpoint.gid[:PARTICIPANT]) for endpoint in scene.endpoints if endpoint.event == "appeared"
    }
    shared = [node for node, count in Counter(node for node, _ in owners).items() if count > 1]
    return [messages.note("same-name", node=node) for node in shared[:1]]


def _stand_ins(view: View) -> list[str]:
    numeric = view.specification.numeric
    wanted = {SceneName.TALKER: numeric.talker, SceneName.LISTENER: numeric.listener}
    found = []
    for name, program in wanted.items():
        scene = view.scene(name)
        if scene is not None and (scene.scene.started_with != "executable" or scene.scene.label != program):
            kind, used = scene.scene.started_with, scene.scene.label
            found.append(messages.note("stand-in", name=program, kind=kind, used=used))
    return found


def _limits(view: View) -> list[str]:
    """What was stopped because it used too much, with what to do about it."""
    found = []
    for scene in view.scenes():
        if scene.ended is not None and scene.ended.limit:
            about = messages.limits() | {"scene": scene.scene.name.value, "seconds": round(scene.ended.at)}
            found.append(messages.note(f"limit-{scene.ended.limit}", **about))
        if any("No space left on device" in line.text or "File too large" in line.text for line in scene.lines):
            found.append(messages.note("limit-disk", **messages.limits() | {"scene": scene.scene.name.value}))
    return found


def _dropped(view: View) -> list[str]:
    found = []
    for what, key in (("dropped_bytes", "output"), ("dropped_lines", "lines"), ("dropped_messages", "messages")):
        if dropped := sum(int(scene.measured.get(what, 0)) for scene in view.scenes()):
            found.append(messages.note(key, count=dropped))
    return found

"""What the numeric listener prints when it runs alone (worksheet 6.7.2)."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping

from lab2_grader import messages
from lab2_grader.checks import source
from lab2_grader.checks.verdicts import blocked, failed, inconclusive, no_program, passed
from lab2_grader.checks.view import TRACEBACK, SceneView, View, names
from lab2_grader.near import nearest
from lab2_grader.reading import numbers_in, said
from lab2_grader.records import Endpoint, SceneName, Sent, Verdict

Earlier = Mapping[str, Verdict]

LITERAL = re.compile(r"\{[^{}]*\.data[^{}]*\}")  # what an f-string without its f prints
NOT_ONE_ARGUMENT = "callable with one argument"  # rclpy of a callback that does not take self and a message
AT_START = "at start"
FOLLOWED = 2  # texts that a number followed, at least
NOISE = 64  # so many different numbers that were never sent: whatever is sent would stand among them


def listener_numeric(view: View, earlier: Earlier) -> Verdict:
    """It prints each number that it receives on `/numeric_chatter`."""
    check = "listener-numeric"
    scene = view.scene(SceneName.LISTENER)
    if scene is None:
        return no_program(check, earlier)
    if scene.scene.fault:
        return inconclusive(check, "inconclusive-scene", fault=scene.scene.fault)
    topic = view.specification.number_topic
    sent = _sent(scene, topic.name)
    printed = _numbers_printed(scene)
    missing = [row for row in sent if int(row.data) not in printed.get(row.at, frozenset())]
    everything = frozenset[int]().union(*printed.values())
    strange = everything - {row.data for row in scene.sent if isinstance(row.data, int)}
    if sent and not missing and _death(scene) != topic.name:
        return failed(check, "noise") if len(strange) > NOISE else passed(check)
    if death := _death(scene):
        file, line = scene.place_of_error(scene.scene.label, view.specification.package)
        if death == topic.name:
            return failed(check, "died-on-number", file, line, error=scene.error_of(scene.scene.label))
        if death == AT_START and earlier["entry-points"].message == "indented":
            return blocked(check, "entry-points")
        if death == AT_START and scene.ended is not None and scene.ended.code == 0:
            return failed(check, "ended")
        if death == AT_START:
            error = scene.error_of(scene.scene.label)
            return failed(check, _why_it_died(view, scene, error, line), file, line, error=error)
        return blocked(check, "listener-chatter")
    if wrong := _unsuitable(check, topic.name, topic.type, view, scene):
        return wrong
    if scene.flooded:
        return failed(check, "flood")
    hidden, file, line = source.hidden_log(view, scene.scene.label, topic.name)
    if hidden:
        return failed(check, "hidden", file, line, sent=len(sent), missing=len(missing), hidden=hidden)
    if len(missing) > len(sent) // 2:
        if literal := next((line for line in scene.lines if LITERAL.search(line.text)), None):
            return failed(check, "no-f-string", shown=said(literal.text))
        if len(everything) == 1 and sum(numbers_in(line.text) >= everything for line in scene.lines) > 1:
            return failed(check, "constant", sent=len(sent), shown=next(iter(everything)))
        if strange := _plausible(strange):
            shown = ", ".join(str(number) for number in sorted(strange)[:5])
            numbers = ", ".join(str(row.data) for row in sent[:5])
            return failed(check, "others", sent=numbers, shown=shown, last=_last_line(scene))
    if len(missing) == len(sent):
        return failed(check, "silent", sent=len(sent), shown=_last_line(scene))
    paced = [row for row in sent if row.at >= scene.phases.get("pace", float("inf"))]
    if all(row in paced for row in missing):
        return failed(check, "paced", sent=len(paced), missing=len(missing))
    examples = ", ".join(str(row.data) for row in missing[:5])
    return failed(check, "some", sent=len(sent), missing=len(missing), examples=examples)


def listener_chatter(view: View, earlier: Earlier) -> Verdict:
    """It still receives and prints what comes on `/chatter`."""
    check = "listener-chatter"
    scene = view.scene(SceneName.LISTENER)
    if scene is None:
        return blocked(check, *(earlier["listener-numeric"].because or ("listener-numeric",)))
    if scene.scene.fault:
        return inconclusive(check, "inconclusive-scene", fault=scene.scene.fault)
    topic = view.specification.text_topic
    sent = _sent(scene, topic.name)
    lines = [(line.at, said(line.text)) for line in scene.lines]
    missing = [row for row in sent if not any(at >= row.at and str(row.data) in text for at, text in lines)]
    if sent and (not missing or _with_the_number(scene, sent, missing)):
        return passed(check)
    death = _death(scene)
    if death == topic.name:
        file, line = scene.place_of_error(scene.scene.label, view.specification.package)
        return failed(check, "died", file, line, error=scene.error_of(scene.scene.label))
    if death == AT_START or (death and not missing):
        return blocked(check, "listener-numeric")
    if wrong := _unsuitable(check, topic.name, topic.type, view, scene):
        return wrong
    return failed(check, "silent", sent=len(sent), missing=len(missing), shown=_last_line(scene))


def _sent(scene: SceneView, topic: str) -> list[Sent]:
    """What was sent there once both sides had found each other; before that nothing counts."""
    begin = scene.phases.get(f"send {topic}", float("inf"))
    return [row for row in scene.sent if row.topic == topic and row.at >= begin]


def _with_the_number(scene: SceneView, texts: list[Sent], missing: list[Sent]) -> bool:
    """Whether each text is printed that a number followed: one callback may keep it, and the other print both (VERDICTS)."""
    followed = [row for row, after in itertools.pairwise(scene.sent) if row in texts and after.topic != row.topic]
    return len(followed) >= FOLLOWED and not any(row in missing for row in followed)


def _death(scene: SceneView) -> str:
    """The topic over whose message the listener ended, AT_START when no message had to do with it; empty when it lived."""
    if not scene.ended_by_itself(scene.scene.label):
        return ""
    return scene.sent[-1].topic if _handled_something(scene) else AT_START


def _why_it_died(view: View, scene: SceneView, error: str, line: int) -> str:
    """The fault of a listener that ended with *error* before anything was sent; *line* of its file, 0 for none."""
    if source.is_of_rclpy(view, scene.scene.label, error):
        return "no-super"
    if error.startswith(source.UNREADABLE) and line:
        return "syntax"
    return "arguments" if NOT_ONE_ARGUMENT in error else "died"


def _handled_something(scene: SceneView) -> bool:
    """Whether a message may have ended the listener: one that ends as soon as it is a node can be sent something too."""
    if not scene.sent:
        return False
    lines = scene.lines_of(scene.scene.label)
    if any(TRACEBACK in line.text for line in lines):
        return scene.died_in_spin(scene.scene.label)
    quietly = scene.ended is not None and scene.ended.code == 0
    return not quietly or any(line.at >= scene.sent[0].at for line in lines)


def _numbers_printed(scene: SceneView) -> dict[float, frozenset[int]]:
    """For each message that was sent, the numbers an Int8 can carry that were printed from then on."""
    texts = [str(row.data) for row in scene.sent if isinstance(row.data, str)]
    lines = [(line.at, _plausible(numbers_in(line.text, texts))) for line in scene.lines]
    found: dict[float, frozenset[int]] = {}
    later: set[int] = set()
    for row in sorted(scene.sent, key=lambda row: row.at, reverse=True):
        while lines and lines[-1][0] >= row.at:
            later |= lines.pop()[1]
        found[row.at] = frozenset(later)
    return found


def _plausible(numbers: frozenset[int]) -> frozenset[int]:
    """Those that an Int8 could have carried."""
    return frozenset(number for number in numbers if -128 <= number <= 127)


def _unsuitable(check: str, topic: str, type_name: str, view: View, scene: SceneView) -> Verdict | None:
    """Why the listener could receive nothing on *topic*, as the graph shows it; None when it could."""
    subscriptions = scene.appeared("subscription")
    mine = [endpoint for endpoint in subscriptions if endpoint.topic == topic]
    if not mine:
        others = {endpoint.topic for endpoint in subscriptions if not endpoint.topic.startswith("/parameter")}
        near = _near_subscription(topic, type_name, subscriptions)
        if near:
            file, line = source.written(view, scene.scene.label, near)
            return failed(check, "near-topic", file, line, near=near, near_name=near.lstrip("/"))
        return failed(check, "no-subscription", others=names(others))
    if all(endpoint.type != type_name for endpoint in mine):
        file, line = source.written(view, scene.scene.label, topic)
        return failed(check, "wrong-type", file, line, found=names(endpoint.type for endpoint in mine))
    right = [endpoint for endpoint in mine if endpoint.type == type_name]
    if all(endpoint.durability == "transient-local" for endpoint in right):
        return failed(check, "qos", found=messages.phrase("transient-local"))
    if not any(row.topic == topic for row in scene.sent):  # nobody matched, whatever the reason
        return failed(check, "qos", found=messages.phrase("other-qos"))
    return None


def _near_subscription(topic: str, type_name: str, subscriptions: list[Endpoint]) -> str:
    """The subscription that was probably meant: of the same type, or of nearly the same name."""
    same_type = {endpoint.topic for endpoint in subscriptions if endpoint.type == type_name}
    if len(same_type) == 1:
        return same_type.pop()
    return nearest(topic, (endpoint.topic for endpoint in subscriptions))


def _last_line(scene: SceneView) -> str:
    lines = [said(line.text) for line in scene.lines if line.text.strip()]
    return messages.phrase("last-line", line=lines[-1]) if lines else messages.phrase("no-line")

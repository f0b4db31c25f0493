"""What the numeric talker publishes (worksheet 6.7.1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from lab2_grader.checks import source
from lab2_grader.checks.sequence import Sequel, Step, around
from lab2_grader.checks.verdicts import blocked, failed, inconclusive, no_program, passed
from lab2_grader.checks.view import SceneView, View, names
from lab2_grader.near import nearest
from lab2_grader.records import SceneName, Status, Verdict, renews_publisher

Earlier = Mapping[str, Verdict]

# What Python says when it cannot make the data an int: with the assertions of the message compiled in, and without.
NOT_AN_INT = ("PyLong_Check(field)", "object cannot be interpreted as an integer")
# What Python or rclpy says when the talker dies, and which fault that is.
DEATHS = {
    "Expected <class": "wrong-message",
    "has no setter": "no-setter",
    "incompatible type": "two-types",  # one process cannot know one topic under two types
    "takes 0 positional arguments but 1 was given": "no-self",
}
# Faults of talker-start that leave nothing to count.
NO_NUMBERS = ("silent", "died", "wrong-message", "wrong-data", "no-self")
AT_CREATION = ("ended", "no-setter", "no-super", "two-types", "syntax")
NOT_CALLABLE = "'NoneType' object is not callable"
SILENT_SECONDS = 3.0  # no message for so long before the scene was stopped: it had stopped by itself


def talker_type(view: View, earlier: Earlier) -> Verdict:
    """`/numeric_chatter` carries `std_msgs/msg/Int8`, and a default subscription receives it."""
    check = "talker-type"
    scene = view.talking
    if scene is None:
        return no_program(check, earlier)
    if scene.scene.fault:
        return inconclusive(check, "inconclusive-scene", fault=scene.scene.fault)
    topic = view.specification.number_topic
    publishers = view.number_publishers
    if scene.ended_by_itself(view.talker_name) and not view.numbers and scene.scene.name is SceneName.CONVERSATION:
        return blocked(check, "entry-points")  # there was nothing else that could be run in its place
    if (death := _death(view)) and not _shows_publishers(view):
        if earlier["entry-points"].message == "indented":
            return blocked(check, "entry-points")
        key = death.key if death.key in AT_CREATION else "died"
        return failed(check, key, death.file, death.line, error=death.error, found=death.error, talker=view.talker_name)
    if not publishers:
        return _elsewhere(view)
    types = {endpoint.type for endpoint in publishers}
    if len(types) > 1:
        return failed(check, "two-types", found=names(types))
    if topic.type not in types:
        file, line = source.written(view, view.talker_name, topic.name)
        return failed(check, "wrong-type", file, line, found=names(types))
    if all(endpoint.reliability == "best-effort" for endpoint in publishers):
        return failed(check, "best-effort")
    return passed(check)


class _Death(NamedTuple):
    """How the talker ended before it published a number that anybody meant."""

    key: str
    error: str
    file: str
    line: int


def _death(view: View) -> _Death | None:
    """How the talker ended before its first number; None when it did not."""
    scene, name = view.talking, view.talker_name
    if scene is None or not scene.ended_by_itself(name):
        return None
    aborted = scene.says(name, *NOT_AN_INT) and len(view.numbers) <= 1
    if view.numbers and not aborted:  # what cannot be made an Int8 may be published as a number that nobody meant
        return None
    error = scene.error_of(name)
    if scene.ended is not None and scene.ended.code == 0 and scene.scene.label:
        key = "ended"
    elif aborted:
        key = "wrong-data"
    elif source.is_of_rclpy(view, name, error):
        key = "no-super"
    else:
        key = next((key for text, key in DEATHS.items() if text in error), "died")
    place = scene.place_of_error(name, view.specification.package)
    if error.startswith(source.UNREADABLE) and place[1]:
        key = "syntax"
    return _Death(key, error, *place)


def _shows_publishers(view: View) -> bool:
    """Whether a talker that died had been in the graph for sure, and so shows what it meant to publish.

    One that dies in `__init__` may be seen there for a moment, or not: that must not decide.
    """
    scene, death = view.talking, _death(view)
    if scene is None or death is None or death.key in AT_CREATION:
        return False
    published = death.key in ("wrong-data", "wrong-message") or scene.died_in_spin(view.talker_name)
    return published and bool(view.published)


def _called_too_soon(view: View) -> bool:
    """Whether the timer was given None, for the callback was called in its place: once, perhaps before anybody could hear it."""
    scene, name = view.talking, view.talker_name
    if scene is None or not scene.ended_by_itself(name) or len(view.numbers) > 1:
        return False
    return scene.died_in_spin(name) and NOT_CALLABLE in scene.error_of(name)


def _elsewhere(view: View) -> Verdict:
    check, topic = "talker-type", view.specification.number_topic
    near = view.stray_number_topic or nearest(topic.name, (endpoint.topic for endpoint in view.published))
    if near:
        found = names(endpoint.type for endpoint in view.published if endpoint.topic == near)
        file, line = source.written(view, view.talker_name, near)
        return failed(check, "near-topic", file, line, near=near, found=found, near_name=near.lstrip("/"))
    return failed(check, "no-topic", others=names(endpoint.topic for endpoint in view.published))


def talker_start(view: View, earlier: Earlier) -> Verdict:
    """The count begins at 0."""
    check = "talker-start"
    if not view.numbers and _called_too_soon(view):
        return blocked(check, "talker-step")
    if death := _death(view) if _shows_publishers(view) and _has_numbers(view) else None:
        return failed(check, death.key, death.file, death.line, error=death.error, talker=view.talker_name)
    if stop := _unheard(check, view, earlier):
        return stop
    sequel = view.sequel
    if sequel is None:
        return failed(check, "not-numbers", shown=", ".join(str(message.data) for message in view.numbers[:3]))
    smallest = view.specification.number_topic.smallest
    missed = sequel.first_number - 1
    if missed and not sequel.common_rise:
        return blocked(check, "talker-step") if sequel.irregular else inconclusive(check, "inconclusive-lost")
    first = sequel.values[0] - missed * sequel.common_rise
    if first == smallest:
        return passed(check)
    if renews_publisher(view.number_publishers) and sequel.irregular:
        return blocked(check, "talker-step")
    if not sequel.common_rise and sequel.irregular:
        return failed(check, "no-count", first=first, shown=around(sequel.values, 0))
    file, line = source.early_increment(view)
    return failed(check, "other", file, line, first=first, shown=around(sequel.values, 0))


def talker_step(view: View, earlier: Earlier) -> Verdict:
    """Each number is one more than the last."""
    check = "talker-step"
    if _called_too_soon(view):
        error = view.talking.error_of(view.talker_name) if view.talking else ""
        return failed(check, "called", *source.called_callback(view), error=error, talker=view.talker_name)
    if stop := _uncounted(check, view, earlier):
        return stop
    sequel, scene = view.sequel, view.talking
    assert sequel is not None and scene is not None
    if len(sequel.values) == 1 and scene.ended_by_itself(view.talker_name):
        file, line = scene.place_of_error(view.talker_name, view.specification.package)
        error = scene.error_of(view.talker_name)
        return failed(check, "died", file, line, error=error, shown=str(sequel.values[0]), talker=view.talker_name)
    if len(sequel.values) == 1:
        return failed(check, "once", shown=str(sequel.values[0]))
    irregular = sequel.irregular
    if not irregular:
        return passed(check)
    shown = around(sequel.values, irregular[0].index)
    if renews_publisher(view.number_publishers):
        return failed(check, "publishers", *source.publisher_in_callback(view), shown=shown)
    rise = sequel.common_rise
    if rise == 0 and all(step.difference == 0 for step in irregular) and len(set(sequel.values)) == 1:
        return failed(check, "constant", shown=around(sequel.values, 0))
    if rise < 0:
        return failed(check, "down", shown=shown)
    if rise > 1:
        file, line = source.second_increment(view)
        return failed(check, "by", file, line, step=rise, shown=shown)
    total = len(sequel.rises)
    return failed(check, "irregular", count=len(irregular), total=total, before=irregular[0].before, shown=shown)


def talker_wrap(view: View, earlier: Earlier) -> Verdict:
    """At 127 the count goes back to 0, and it never leaves 0 to 127."""
    check = "talker-wrap"
    if stop := _uncounted(check, view, earlier):
        return stop
    sequel, scene = view.sequel, view.talking
    assert sequel is not None and scene is not None
    topic = view.specification.number_topic
    rise = sequel.common_rise
    if rise < 1:
        return blocked(check, "talker-step")
    if sequel.stays:
        return failed(check, "stuck", shown=around(sequel.values, sequel.stays[0].index))
    wrong = next((step for step in sequel.returns if not _returns_well(step, rise, view)), None)
    outside = next((i for i, v in enumerate(sequel.values) if not topic.smallest <= v <= topic.largest), None)
    if wrong and (outside is None or outside >= wrong.index):
        # In steps of two a count can jump over the number at which it would be set back.
        skipped = rise > 1 and wrong.after != topic.smallest
        return blocked(check, "talker-step") if skipped else _bad_return(wrong, sequel, view)
    if outside is not None:
        key = "too-large" if sequel.values[outside] > topic.largest else "negative"
        return failed(check, key, shown=around(sequel.values, outside))
    if sequel.returns:
        return passed(check)
    return _never_returned(sequel, view, scene)


def _returns_well(step: Step, rise: int, view: View) -> bool:
    """Back to the smallest number, from the largest or the one before; with a rise of n, from one of the last n."""
    topic = view.specification.number_topic
    return step.after == topic.smallest and topic.largest - max(rise, 2) < step.before <= topic.largest


def _bad_return(step: Step, sequel: Sequel, view: View) -> Verdict:
    check, topic = "talker-wrap", view.specification.number_topic
    shown = around(sequel.values, step.index)
    if step.after == -topic.largest - 1:
        late = topic.smallest in sequel.values[step.index + 1 : step.index + 2]
        return failed(check, "late" if late else "overflow", next=step.after, shown=shown)
    if step.before > topic.largest:
        return failed(check, "too-large", shown=shown)
    file, line = source.wrap_comparison(view)
    if step.after == topic.smallest:
        return failed(check, "returns-at", file, line, last=step.before, shown=shown)
    return failed(check, "returns-to", file, line, last=step.before, next=step.after, shown=shown)


def _never_returned(sequel: Sequel, view: View, scene: SceneView) -> Verdict:
    check, last = "talker-wrap", sequel.values[-1]
    if scene.ended_by_itself(view.talker_name):
        file, line = scene.place_of_error(view.talker_name, view.specification.package)
        return failed(
            check, "died", file, line, last=last, error=scene.error_of(view.talker_name), talker=view.talker_name
        )
    silent = scene.phases.get("stop", 0.0) - view.numbers[-1].at
    if silent > max(SILENT_SECONDS, 2.5 * scene.measured.get("period_seconds", 0.0)):
        return failed(check, "silent", last=last)
    return inconclusive(check, "inconclusive-time")


def talker_chatter(view: View, earlier: Earlier) -> Verdict:
    """The same node still publishes String messages on `/chatter`."""
    check = "talker-chatter"
    scene = view.talking
    if scene is None:
        return blocked(check, *(earlier["talker-type"].because or ("talker-type",)))
    if scene.scene.fault:
        return inconclusive(check, "inconclusive-scene", fault=scene.scene.fault)
    topic = view.specification.text_topic
    publishers = [endpoint for endpoint in view.text_publishers if endpoint.type == topic.type]
    if any(message.type == topic.type for message in view.texts):
        if all(endpoint.reliability == "best-effort" for endpoint in publishers):
            return failed(check, "best-effort")
        return passed(check)
    if earlier["talker-type"].status is Status.BLOCKED:
        return blocked(check, *earlier["talker-type"].because)
    if _death(view) and not _shows_publishers(view):
        return blocked(check, "talker-type")
    if publishers and earlier["talker-start"].message in NO_NUMBERS:
        return blocked(check, "talker-start")
    if publishers:
        nodes = {endpoint.node for endpoint in publishers}
        if view.number_publishers and nodes.isdisjoint(endpoint.node for endpoint in view.number_publishers):
            return failed(check, "other-node", node=names(nodes))
        if overwritten := source.overwritten_publisher(view):
            attribute, file, line = overwritten
            return failed(check, "overwritten", file, line, attribute=attribute)
        return failed(check, "silent")
    if view.text_publishers:
        return failed(check, "wrong-type", found=names(endpoint.type for endpoint in view.text_publishers))
    if near := next((endpoint.topic for endpoint in view.published if endpoint.type == topic.type), ""):
        return failed(check, "near-topic", near=near)
    return failed(check, "removed")


def _uncounted(check: str, view: View, earlier: Earlier) -> Verdict | None:
    """Why nothing can be said of how the count goes on; None when whole numbers were heard."""
    if stop := _unheard(check, view, earlier):
        return stop
    return None if view.sequel is not None and view.sequel.values else blocked(check, "talker-start")


def _has_numbers(view: View) -> bool:
    """Whether the talker has a publisher for numbers, there or elsewhere."""
    return bool(view.number_publishers or view.stray_number_topic)


def _unheard(check: str, view: View, earlier: Earlier) -> Verdict | None:
    """Why nothing can be said of the count; None when numbers were heard."""
    base, start = earlier["talker-type"], earlier.get("talker-start")
    if base.status is Status.INCONCLUSIVE and view.talking and view.talking.scene.fault:
        return inconclusive(check, "inconclusive-scene", fault=view.talking.scene.fault)
    if start is not None and start.message in NO_NUMBERS:
        return blocked(check, "talker-start")
    if start is not None and start.because == ("talker-step",) and not view.numbers:
        return blocked(check, "talker-step")
    if view.numbers:
        return None
    if base.status is not Status.PASS:
        return blocked(check, *(base.because or ("talker-type",)))
    return failed(check, "silent")

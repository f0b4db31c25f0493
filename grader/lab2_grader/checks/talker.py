"""What the numeric talker publishes (worksheet 6.7.1)."""

from __future__ import annotations

from collections.abc import Mapping

from lab2_grader.checks import source
from lab2_grader.checks.sequence import Sequel, Step, around
from lab2_grader.checks.verdicts import blocked, failed, inconclusive, no_program, passed
from lab2_grader.checks.view import SceneView, View, names
from lab2_grader.near import nearest
from lab2_grader.records import SceneName, Status, Verdict

Earlier = Mapping[str, Verdict]

# What Python says when it cannot make the data an int: with the assertions of the message compiled in, and without.
NOT_AN_INT = ("PyLong_Check(field)", "object cannot be interpreted as an integer")
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
    died = scene.ended_by_itself(view.talker_name)
    error = scene.error_of(view.talker_name)
    if died and not view.numbers and scene.scene.name is SceneName.CONVERSATION:
        return blocked(check, "entry-points")  # there was nothing else that could be run in its place
    if died and len(view.numbers) <= 1 and scene.says(view.talker_name, *NOT_AN_INT):
        # What cannot be made an Int8 aborts the process, or is published as a number that nobody meant.
        file, line = scene.place_of_error(view.talker_name, view.specification.package)
        return failed(check, "wrong-data", file, line, error=error, talker=view.talker_name)
    if died and not view.numbers:
        if scene.ended is not None and scene.ended.code == 0 and scene.scene.label:
            return failed(check, "ended", talker=view.talker_name)
        key = "died"
        if publishers and "TypeError" in error:
            key = "wrong-message"
        elif "has no setter" in error:
            key = "no-setter"
        elif "incompatible type" in error:  # one process cannot know one topic under two types
            key = "two-types"
        file, line = scene.place_of_error(view.talker_name, view.specification.package)
        return failed(check, key, file, line, error=error, found=error, talker=view.talker_name)
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
    file, line = source.early_increment(view)
    return failed(check, "other", file, line, first=first, shown=around(sequel.values, 0))


def talker_step(view: View, earlier: Earlier) -> Verdict:
    """Each number is one more than the last."""
    check = "talker-step"
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
        return failed(check, "overflow", next=step.after, shown=shown)
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
    if earlier["talker-type"].message in ("died", "ended", "wrong-message", "no-setter", "two-types"):
        return blocked(check, "talker-type")
    if publishers and earlier["talker-start"].message == "silent":
        return blocked(check, "talker-start")
    if publishers:
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


def _unheard(check: str, view: View, earlier: Earlier) -> Verdict | None:
    """Why nothing can be said of the count; None when numbers were heard."""
    base = earlier["talker-type"]
    if base.status is Status.INCONCLUSIVE:
        return inconclusive(check, "inconclusive-scene", fault=view.talking.scene.fault if view.talking else "")
    if view.numbers and base.message != "wrong-data":
        return None
    if base.status in (Status.FAIL, Status.BLOCKED):
        return blocked(check, *(base.because or ("talker-type",)))
    if check == "talker-start":
        return failed(check, "silent")
    return blocked(check, "talker-start")

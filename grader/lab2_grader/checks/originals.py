"""Whether what was handed out still works (worksheet 6.7)."""

from __future__ import annotations

from collections.abc import Mapping

from lab2_grader import lab
from lab2_grader.checks.launch import launch_error, our_fault
from lab2_grader.checks.verdicts import blocked, failed, passed
from lab2_grader.checks.view import View, names
from lab2_grader.records import SceneName, Verdict

Earlier = Mapping[str, Verdict]

MOST_TEXTS = 50  # looked at, however many there were


def originals_kept(view: View, earlier: Earlier) -> Verdict:
    """`talker`, `listener` and `chatter.py` still work."""
    check, scene, build = "originals-kept", view.scene(SceneName.ORIGINALS), view.build
    original, topic = view.specification.original, view.specification.text_topic
    assert build is not None
    if scene is None:
        where = f"launch/{original.launch_file}"
        return failed(check, "not-installed", where=where) if view.source(where) else failed(check, "no-launch")
    if fault := our_fault(check, scene):
        return fault
    pair = original.programs
    started = scene.started()
    missing = [name for name in pair if name not in started]
    if not missing and not scene.spoke(topic.name, original.talker):
        return failed(check, "strangers")
    texts = [message for message in scene.messages if message.topic == topic.name and message.type == topic.type][
        :MOST_TEXTS
    ]
    printed = [
        message
        for message in texts
        if any(str(message.data) in line.text for line in scene.lines_of(original.listener))
    ]
    wanted = lab.limits().originals.messages
    if len(printed) >= wanted and not missing:
        return passed(check)
    if any(name not in build.executables or name in build.dangling for name in pair):
        return blocked(check, "entry-points")
    if missing:
        error = launch_error(scene)
        return (
            failed(check, "launch-error", error=error)
            if error
            else failed(check, "not-started", missing=names(missing))
        )
    for name in pair:
        if scene.ended_by_itself(name):
            return failed(check, "died", name=name, error=scene.error_of(name))
    return failed(check, "listener-silent" if len(texts) >= wanted else "talker-silent")

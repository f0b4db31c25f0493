"""What the launch file starts, and whether the launched pair talks (worksheet 6.7.3 and 6.7.5)."""

from __future__ import annotations

import re
from collections.abc import Mapping

from lab2_grader import lab, messages
from lab2_grader.checks import source
from lab2_grader.checks.talker import NO_NUMBERS
from lab2_grader.checks.verdicts import blocked, failed, inconclusive, passed
from lab2_grader.checks.view import SceneView, View, names
from lab2_grader.near import nearest
from lab2_grader.reading import numbers_in, said
from lab2_grader.records import Message, SceneName, Status, Verdict

Earlier = Mapping[str, Verdict]

CAUGHT = re.compile(r"Caught (?:multiple exceptions?|exception) .*?: ?(.*)$")
NO_EXECUTABLE = re.compile(r"executable '([^']*)' not found on the libexec directory")
NO_PACKAGE = re.compile(r"""[Pp]ackage ['"][^'"]*['"] not found""")
# What a launch says when its file is wrong in a common way, and which fault that is.
COMMON_ERRORS = {
    "required keyword-only argument: 'executable'": "no-executable-argument",
    "generate_launch_description": "no-function",
    "'NoneType' object has no attribute 'get_launch_arguments": "no-return",
}
ONLY_ONE = ("died", "called", "once")  # faults of talker-step after a single number: it is luck whether others hear it
NEARBY, NEARBY_PER_MESSAGE = 100, 2  # lines that can belong to a message: so many, and so many for each before it
# Faults of an entry point that does not lead to its program.
MISLED = ("dangling", "wrong-module", "misplaced", "function", "no-function", "class", "indented")
# Faults of a listener whose lines do not answer what it receives.
NOT_WHAT_IT_RECEIVES = ("silent", "constant", "others", "noise", "no-f-string", "paced")
QUEUE_FULL = 8  # numbers that wait for a listener whose queue holds ten, as in the worksheet: others may be lost by now
ENOUGH_ANSWERS = 8  # of the slow dozen; the first few may be lost while the pair still discovers each other


def launch_starts(view: View, earlier: Earlier) -> Verdict:
    """`ros2 launch lab2 numeric_chatter.py` starts `numeric_talker` and `numeric_listener`."""
    check, scene = "launch-starts", view.scene(SceneName.CONVERSATION)
    if scene is None:
        return _no_launch_file(view)
    if fault := our_fault(check, scene):
        return fault
    numeric = view.specification.numeric
    build = view.build
    assert build is not None
    started = scene.started()
    missing = [name for name, own in zip(numeric.programs, view.pair, strict=True) if own not in started]
    if not missing:
        return passed(check)
    if unseen := [name for name in missing if name in scene.said_to_have_died()]:
        return inconclusive(check, "inconclusive-unseen", name=names(unseen))
    error = launch_error(scene)
    if asked := NO_EXECUTABLE.search(error):
        if asked[1] in numeric.programs:
            return blocked(check, "entry-points")
        file, line = source.written_in(view, _launch_source(view), asked[1])
        return failed(check, "no-executable", file, line, asked=asked[1], found=names(build.executables))
    if any(name not in build.executables for name in missing) and earlier["entry-points"].status is Status.FAIL:
        return blocked(check, "entry-points")
    if NO_PACKAGE.search(error):
        return failed(check, "wrong-package", error=error)
    if error:
        key = next((key for text, key in COMMON_ERRORS.items() if text in error), "raised")
        return failed(check, key, error=error)
    if not started:
        return failed(check, "nothing")
    file, line = source.condition_of(view, _launch_source(view), missing[0])
    if line:
        return failed(check, "condition", file, line, missing=names(missing))
    return failed(check, "others", started=names(started), missing=names(missing))


def _no_launch_file(view: View) -> Verdict:
    check, wanted = "launch-starts", view.specification.numeric.launch_file
    build = view.build
    assert build is not None
    sources = [file.path for file in view.evidence.submission.sources]
    if where := next((path for path in sources if path.rsplit("/", 1)[-1] == wanted), ""):
        return failed(check, "not-installed", where=where)
    installed = [path.rsplit("/", 1)[-1] for path in build.launch_files]
    stem = wanted.removesuffix(".py")
    candidates = {name.split(".")[0].removesuffix("_launch"): name for name in installed}
    taken = (view.specification.original.launch_file.removesuffix(".py"),)
    near = candidates.get(stem) or candidates.get(nearest(stem, candidates, taken), "")
    return failed(check, "near", near=near) if near else failed(check, "missing")


def launch_only_numeric(view: View, earlier: Earlier) -> Verdict:
    """The launch file starts nothing but the numeric pair."""
    check, scene = "launch-only-numeric", view.scene(SceneName.CONVERSATION)
    if scene is None:
        return blocked(check, "launch-starts")
    if fault := our_fault(check, scene):
        return fault
    started = scene.started()
    others = [name for name in (*started, *scene.started_besides()) if name not in view.pair]
    if others:
        file, line = source.written_in(view, _launch_source(view), others[0])
        return failed(check, "others", file, line, others=names(others))
    if not started or launch_error(scene):
        return blocked(check, *(earlier["launch-starts"].because or ("launch-starts",)))
    # Two of one in the place of the other is one fault, and launch-starts has it.
    twice = [name for name in view.pair if started.get(name, 0) > 1 and not _respawned(scene, name)]
    if twice and all(name in started for name in view.pair):
        return failed(check, "twice", others=names(twice))
    return passed(check)


def launch_conversation(view: View, earlier: Earlier) -> Verdict:
    """In the launched pair, what the talker says comes out of the listener."""
    check, scene = "launch-conversation", view.scene(SceneName.CONVERSATION)
    starts = earlier["launch-starts"]
    if starts.status is Status.INCONCLUSIVE and scene is not None and (fault := our_fault(check, scene)):
        return fault
    if starts.status is Status.BLOCKED:
        return blocked(check, *starts.because)
    if scene is None or starts.status is not Status.PASS:
        return blocked(check, "launch-starts")
    if earlier["talker-step"].message in ONLY_ONE:
        return blocked(check, "talker-step")
    if earlier["talker-start"].message == "wrong-data":
        return blocked(check, "talker-start")  # whatever number went out, nobody meant it
    spoken = _spoken(view, scene)
    printed = _printed(view, scene, spoken)
    answered = [message for message in spoken if message.data in printed]
    listener = earlier["listener-numeric"]
    topic = view.specification.number_topic.name
    talker, own_listener = view.pair
    theirs = scene.spoke(topic, talker) and scene.heard(topic, own_listener)
    if theirs and _is_conversation(spoken, answered) and listener.message not in NOT_WHAT_IT_RECEIVES:
        return passed(check)
    if earlier["entry-points"].message in MISLED:
        return blocked(check, "entry-points")
    if not scene.spoke(topic, talker):
        speakers = {endpoint.program for endpoint in scene.appeared("publisher") if endpoint.topic == topic} - {talker}
        others = names("another process" if program == "-" else program for program in speakers)
        return failed(check, "strangers", others=others)
    for cause in ("talker-type", "talker-start", "listener-numeric"):
        silent_start = cause != "talker-start" or earlier[cause].message in (*NO_NUMBERS, "not-numbers")
        if earlier[cause].status is not Status.PASS and silent_start:
            return blocked(check, *(earlier[cause].because or (cause,)))
    if earlier["talker-step"].message == "publishers":
        return blocked(check, "talker-step")
    dead = next((name for name in ((own_listener,) if spoken else view.pair) if scene.ended_by_itself(name)), "")
    if dead:
        file, line = scene.place_of_error(dead, view.specification.package)
        return failed(check, "died", file, line, name=dead, error=scene.error_of(dead))
    if not spoken:
        return failed(check, "nothing", elsewhere=_elsewhere(view, scene))
    if scene.flooded:
        return failed(check, "flood")
    if answered and _fell_behind(scene, topic, printed):
        return inconclusive(check, "inconclusive-behind")
    file, line = source.unfinished_print(view, own_listener)
    if line and not answered:
        return failed(check, "unfinished", file, line, count=len(spoken))
    shown = ", ".join(str(message.data) for message in spoken[:5]) + (" …" if len(spoken) > 5 else "")
    return failed(check, "silent", shown=shown, printed=len(answered), count=len(spoken))


def _elsewhere(view: View, scene: SceneView) -> str:
    """Where the launched talker's numbers went instead, as the end of a sentence."""
    topic = view.specification.number_topic
    others = {endpoint.topic for endpoint in scene.appeared("publisher") if endpoint.type == topic.type} - {topic.name}
    return messages.phrase("elsewhere", topics=names(others)) if others else ""


def _spoken(view: View, scene: SceneView) -> list[Message]:
    """The numbers of the slow dozen; without one (the talker stopped before), all there were.

    No more than were asked for: what came between the last answer and full speed may have been missed, rightly.
    """
    ticks = lab.limits().conversation.slow_ticks
    slow, fast = scene.phases.get("slow", 0.0), scene.phases.get("fast", float("inf"))
    topic = view.specification.number_topic.name
    numbers = [message for message in scene.messages if message.topic == topic and isinstance(message.data, int)]
    return ([message for message in numbers if slow <= message.at < fast] or numbers)[:ticks]


def _fell_behind(scene: SceneView, topic: str, printed: Mapping[int, float]) -> bool:
    """Whether the listener was so late with a number that its queue may have lost others; never when the clock waits for it."""
    if "real-time" not in scene.phases:
        return False
    numbers = [message for message in scene.messages if message.topic == topic]
    waiting = (
        sum(other.at <= printed[message.data] for other in numbers[index + 1 :])
        for index, message in enumerate(numbers)
        if isinstance(message.data, int) and message.data in printed
    )
    return any(count >= QUEUE_FULL for count in waiting)


def _printed(view: View, scene: SceneView, spoken: list[Message]) -> dict[int, float]:
    """The numbers that the listener printed while the *spoken* ones came, other than as part of a greeting, and when first.

    Lines and messages reach the grader on different ways and in no sure order, so lines are counted, not timed.
    """
    topic = view.specification.text_topic.name
    talker, listener = view.pair
    sources = {line.source for line in scene.lines}
    # Processes that a launch file starts with `ros2 run` are all labelled `ros2`.
    sources = {listener} if listener in sources else sources - {"launch", talker}
    enough = NEARBY + NEARBY_PER_MESSAGE * (scene.messages.index(spoken[-1]) + 1 if spoken else 0)
    texts = {str(other.data) for other in scene.messages[:enough] if other.topic == topic}
    lines = [(line.at, said(line.text)) for line in scene.lines if line.source in sources][:enough]
    found: dict[int, float] = {}
    for at, line in reversed(lines):
        found |= dict.fromkeys(numbers_in(line, [text for text in texts if text and text in line]), at)
    return found


def _is_conversation(spoken: list[Message], answered: list[Message]) -> bool:
    """All that was said was answered, except for what was said before the first answer."""
    if not answered or len(answered) < min(ENOUGH_ANSWERS, len(spoken)):
        return False
    return answered == spoken[spoken.index(answered[0]) :]


def our_fault(check: str, scene: SceneView) -> Verdict | None:
    """Why nothing can be said of a launch: it uses what the grader cannot play, or the grader failed; None when neither."""
    if scene.unsupported:
        return inconclusive(check, "inconclusive-unsupported", what=scene.unsupported[0].what)
    if scene.scene.fault:
        return inconclusive(check, "inconclusive-scene", fault=scene.scene.fault)
    return None


def _launch_source(view: View) -> str:
    """The launch file within the package."""
    return f"launch/{view.specification.numeric.launch_file}"


def launch_error(scene: SceneView) -> str:
    """What the launch says went wrong with the launch file; empty when nothing did."""
    own = [line.text for line in scene.lines if line.source == "launch"]
    for index, text in enumerate(own):
        if match := CAUGHT.search(text):
            inner = CAUGHT.search(
                match[1]
            )  # an exception that says which others were caught, each on a line of its own
            error = inner[1] if inner else match[1]
            return error or next(iter(own[index + 1 :]), text).strip().removeprefix("- ")
    if scene.ended is not None and scene.ended.code not in (0, None):
        return scene.error_of("launch")
    return ""


def _respawned(scene: SceneView, name: str) -> bool:
    """Whether the launcher started *name* again after it had ended, as `respawn` asks for."""
    return scene.ended_by_itself(name)

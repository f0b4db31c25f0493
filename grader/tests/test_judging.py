"""Checks on recorded evidence, as it is and with one thing changed: no ROS, no processes, no time."""

from __future__ import annotations

import tarfile
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
import zoo_builder
from record_evidence import DATA, RECORDED
from zoo_runner import complaints

from lab2_grader import checks, evidence, lab, score
from lab2_grader.reading import numbers_in
from lab2_grader.records import (
    EndedBy,
    Endpoint,
    Event,
    Evidence,
    Line,
    Measured,
    Message,
    Phase,
    Scene,
    SceneName,
    Sent,
    Status,
    Unsupported,
    Verdict,
)
from lab2_grader.tar import take_out


def recorded(name: str, folder: Path) -> Evidence:
    """The recorded evidence of an animal, unpacked below *folder*."""
    target = folder / name
    if not target.exists():
        with tarfile.open(DATA / f"{name}.tar.xz") as archive:
            for member in archive:
                take_out(archive, member, target)
    return evidence.read(target)


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("evidence")


@pytest.fixture(scope="session")
def solution(folder: Path) -> Evidence:
    return recorded("solution", folder)


def verdicts(observed: Evidence) -> dict[str, Verdict]:
    return {verdict.check: verdict for verdict in checks.judge(observed)}


def with_build(observed: Evidence, **changes: object) -> Evidence:
    assert observed.build is not None
    build = msgspec.structs.replace(observed.build, **changes)
    return msgspec.structs.replace(observed, build=build, scenes=())


def with_scene(observed: Evidence, name: SceneName, change: Callable[[Scene], Scene | None]) -> Evidence:
    changed = [change(scene) if scene.name is name else scene for scene in observed.scenes]
    return msgspec.structs.replace(observed, scenes=tuple(scene for scene in changed if scene is not None))


def with_events(observed: Evidence, name: SceneName, keep: Callable[[Event], Event | None]) -> Evidence:
    def change(scene: Scene) -> Scene:
        return msgspec.structs.replace(
            scene, events=tuple(e for event in scene.events if (e := keep(event)) is not None)
        )

    return with_scene(observed, name, change)


# --- as recorded --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", RECORDED)
def test_recorded_evidence_is_judged_as_its_animal(name: str, folder: Path) -> None:
    observed = recorded(name, folder)
    assert not complaints(zoo_builder.animals()[name], checks.judge(observed))
    assert checks.judge(observed) == checks.judge(recorded(name, folder))
    packed = (DATA / f"{name}.tar.xz").stat().st_size
    assert packed < 100_000


def test_every_lost_point_has_words(folder: Path) -> None:
    for name in RECORDED:
        for verdict in checks.judge(recorded(name, folder)):
            assert verdict.expected
            if verdict.status not in (Status.PASS, Status.NOT_ASSESSED):
                assert verdict.observed
                assert verdict.hint or verdict.status is not Status.FAIL
                assert "{" not in verdict.observed + verdict.hint or verdict.message in (
                    "silent",
                    "no-f-string",
                    "hidden",
                )


# --- faults that no animal shows ------------------------------------------------------------------------

LIMITS = ("processes", "memory", "cpu", "file", "disk", "install", "files")
BUILDS: dict[tuple[str, str], dict[str, object]] = {
    ("package-builds", "time"): {"ok": False, "code": None, "ended_by": EndedBy.DEADLINE, "seconds": 120.0},
    ("package-builds", "nothing-installed"): {"ok": False, "code": 0, "executables": (), "modules": ()},
} | {
    ("package-builds", f"limit-{limit}"): {"ok": False, "code": None, "ended_by": EndedBy.LIMIT, "limit": limit}
    for limit in LIMITS
}
FLOODED = {
    ("launch-conversation", "flood"): SceneName.CONVERSATION,
    ("listener-numeric", "flood"): SceneName.LISTENER,
}
BY_HAND = (
    *BUILDS,
    *FLOODED,
    ("talker-step", "called"),
    ("talker-step", "publishers"),
    ("launch-conversation", "strangers"),
    ("originals-kept", "strangers"),
)


@pytest.mark.parametrize(("check", "key"), BUILDS)
def test_builds_that_no_animal_waits_for(check: str, key: str, solution: Evidence) -> None:
    found = verdicts(with_build(solution, **BUILDS[check, key]))
    assert (found[check].status, found[check].message) == (Status.FAIL, key)
    others = {found[name].status for name in zoo_builder.CHECKS if name != check and not name.startswith("git")}
    assert others == {Status.BLOCKED}
    assert all(v.because == ("package-builds",) for v in found.values() if v.status is Status.BLOCKED)


@pytest.mark.parametrize(
    ("check", "scene"), [("launch-conversation", SceneName.CONVERSATION), ("originals-kept", SceneName.ORIGINALS)]
)
def test_what_another_process_says_is_not_theirs(check: str, scene: SceneName, solution: Evidence) -> None:
    def strange(event: Event) -> Event:
        return msgspec.structs.replace(event, program="-") if isinstance(event, Endpoint) else event

    found = verdicts(with_events(solution, scene, strange))
    assert (found[check].status, found[check].message) == (Status.FAIL, "strangers")


@pytest.mark.parametrize(
    ("name", "late", "expected"),
    [
        ("sleep-loop-fast", 60.0, (Status.INCONCLUSIVE, "inconclusive-behind")),
        ("sleep-loop-fast", 0.0, (Status.FAIL, "silent")),
        ("solution", 60.0, (Status.FAIL, "silent")),  # in lock-step nothing is sent before the answer to the last
    ],
)
def test_a_number_that_a_busy_machine_may_have_lost_costs_nothing(
    name: str, late: float, expected: tuple[Status, str], folder: Path
) -> None:
    def without_twelve(event: Event) -> Event | None:
        if not isinstance(event, Line) or event.source != "numeric_listener":
            return event
        lost = numbers_in(event.text) == {12} and "World" not in event.text
        return None if lost else msgspec.structs.replace(event, at=event.at + late)

    found = verdicts(with_events(recorded(name, folder), SceneName.CONVERSATION, without_twelve))["launch-conversation"]
    assert (found.status, found.message) == expected


@pytest.mark.parametrize("heard", [True, False])
def test_a_callback_that_was_called_too_soon_is_named_whether_its_number_was_heard_or_not(
    heard: bool, folder: Path
) -> None:
    """create_timer(…, self.timer_callback()) publishes while the node is made, perhaps before anybody can hear it."""

    def called(event: Event) -> Event | None:
        if isinstance(event, Line) and event.text.startswith("AttributeError"):
            return msgspec.structs.replace(event, text="TypeError: 'NoneType' object is not callable")
        return None if isinstance(event, Message) and not heard else event

    observed = with_events(recorded("talker-dies-after-the-first", folder), SceneName.CONVERSATION, called)
    together = observed.scene(SceneName.CONVERSATION)
    assert together is not None
    if not heard:  # then the talker is played alone, too
        alone = msgspec.structs.replace(
            together, name=SceneName.TALKER, started_with="executable", label="numeric_talker"
        )
        observed = msgspec.structs.replace(observed, scenes=(*observed.scenes, alone))
    found = verdicts(observed)
    assert (found["talker-step"].status, found["talker-step"].message) == (Status.FAIL, "called")
    assert found["talker-type"].status is Status.PASS
    assert found["talker-start"].status is (Status.PASS if heard else Status.BLOCKED)
    assert found["talker-wrap"].because == ("talker-step",)
    if not heard:
        assert found["talker-start"].because == found["launch-conversation"].because == ("talker-step",)


@pytest.mark.parametrize("name", ["listener-does-not-spin", "listener-without-super"])
def test_what_was_sent_to_a_listener_that_was_ending_is_not_what_ended_it(name: str, folder: Path) -> None:
    """On a slow machine its subscription is matched, and something sent, before its process is gone."""
    observed = recorded(name, folder)
    scene = observed.scene(SceneName.LISTENER)
    assert scene is not None and not any(isinstance(event, Sent) for event in scene.events)
    texts = lab.specification().text_topic.name
    at = next(event.at for event in reversed(scene.events) if isinstance(event, Line | Phase))
    late = with_scene(
        observed,
        SceneName.LISTENER,
        lambda scene: msgspec.structs.replace(scene, events=(*scene.events, Sent(at + 0.001, texts, "0417"))),
    )
    assert verdicts(late) == verdicts(observed)


@pytest.mark.parametrize("smallest_first", [True, False])
def test_a_publisher_made_anew_in_each_callback_is_named(smallest_first: bool, folder: Path) -> None:
    """What arrives then, and in which order, is luck; no animal can have it."""
    observed = recorded("random-from-the-first", folder)
    scene = observed.scene(SceneName.CONVERSATION)
    assert scene is not None
    topic = lab.specification().number_topic.name
    one = next(e for e in scene.events if isinstance(e, Endpoint) and (e.kind, e.topic) == ("publisher", topic))
    more = tuple(msgspec.structs.replace(one, gid=one.gid[:-4] + end) for end in ("1603", "1703", "1803"))

    def renewed(scene: Scene) -> Scene:
        first = next(e for e in scene.events if isinstance(e, Message) and e.topic == topic)
        changed = msgspec.structs.replace(first, data=0) if smallest_first else first
        events = (changed if event is first else event for event in scene.events)
        return msgspec.structs.replace(scene, events=(*events, *more))

    found = verdicts(with_scene(observed, SceneName.CONVERSATION, renewed))
    assert (found["talker-step"].status, found["talker-step"].message) == (Status.FAIL, "publishers")
    assert "once, in __init__" in found["talker-step"].hint
    assert found["talker-start"].status is (Status.PASS if smallest_first else Status.BLOCKED)
    assert found["talker-wrap"].because == ("talker-step",)


@pytest.mark.parametrize(("check", "key"), FLOODED)
def test_what_drowned_in_a_flood_is_said_to_have(check: str, key: str, solution: Evidence) -> None:
    scene = FLOODED[check, key]

    def without_answers(event: Event) -> Event | None:
        return None if isinstance(event, Line) and event.source == "numeric_listener" else event

    silent = with_events(solution, scene, without_answers)
    assert verdicts(silent)[check].message == "silent"
    dropped = Measured(9.0, "dropped_lines", 100_000)
    flooded = with_scene(silent, scene, lambda scene: msgspec.structs.replace(scene, events=(*scene.events, dropped)))
    assert (verdicts(flooded)[check].status, verdicts(flooded)[check].message) == (Status.FAIL, key)


# --- whose fault it is ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(SceneName))
def test_a_fault_of_ours_in_a_scene_withholds_the_mark(name: SceneName, solution: Evidence) -> None:
    together = solution.scene(SceneName.CONVERSATION)
    assert together is not None
    if name is SceneName.TALKER:  # played alone only where the launched pair does not show it: it says the same here
        alone = msgspec.structs.replace(together, name=name, started_with="executable", label="numeric_talker")
        solution = msgspec.structs.replace(solution, scenes=(*solution.scenes, alone))
    assert {verdict.status for verdict in checks.judge(solution)} <= {Status.PASS, Status.NOT_ASSESSED}
    faulty = with_scene(solution, name, lambda scene: msgspec.structs.replace(scene, complete=False, fault="It broke."))
    found = checks.judge(faulty)
    assert Status.INCONCLUSIVE in {verdict.status for verdict in found}
    assert Status.FAIL not in {verdict.status for verdict in found}
    result = score.score(faulty, found, lab.rubric(), "")
    assert (result.graded, result.score) == (False, None)
    assert any("not the student's fault" in note for note in result.notes)


def test_a_fault_of_ours_before_the_build_withholds_the_mark(solution: Evidence) -> None:
    found = verdicts(msgspec.structs.replace(solution, build=None, scenes=(), faults=("No colcon.",)))
    assert {v.status for n, v in found.items() if not n.startswith("git")} == {Status.INCONCLUSIVE}


@pytest.mark.parametrize(
    ("error", "python", "status"),
    [
        ("SyntaxError: f-string: expecting '}'", "3.11.2", Status.INCONCLUSIVE),
        ("SyntaxError: f-string: expecting '}'", "3.12.3", Status.FAIL),
        ("SyntaxError: f-string: expecting '}'", "", Status.FAIL),  # evidence from before it was recorded
        (
            "ImportError: cannot import name 'override' from 'typing' (/usr/lib/typing.py)",
            "3.10.12",
            Status.INCONCLUSIVE,
        ),
        ("AttributeError: module 'itertools' has no attribute 'batched'", "3.11.2", Status.INCONCLUSIVE),
        ("ImportError: cannot import name 'Int9' from 'std_msgs.msg'", "3.11.2", Status.FAIL),
        ("ImportError: cannot import name 'UTC' from 'lab2.clock'", "3.11.2", Status.FAIL),
        ("AttributeError: 'NumericListener' object has no attribute 'timeout'", "3.11.2", Status.FAIL),
        ("SyntaxError: invalid syntax", "3.11.2", Status.FAIL),
    ],
)
def test_what_only_an_older_python_refuses_is_not_the_student_s_fault(
    error: str, python: str, status: Status, folder: Path
) -> None:
    def died(event: Event) -> Event:
        is_error = isinstance(event, Line) and event.text.startswith("AttributeError")
        return msgspec.structs.replace(event, text=error) if is_error else event

    observed = with_events(recorded("listener-without-super", folder), SceneName.LISTENER, died)
    assert observed.build is not None
    observed = msgspec.structs.replace(observed, build=msgspec.structs.replace(observed.build, python=python))
    found = verdicts(observed)["listener-numeric"]
    assert found.status is status
    assert error.split("(")[0].strip() in found.observed


def test_what_our_launcher_does_not_know_is_ours(solution: Evidence) -> None:
    def unknown(scene: Scene) -> Scene:
        kept = tuple(event for event in scene.events if isinstance(event, Phase))
        return msgspec.structs.replace(scene, events=(*kept, Unsupported(1.0, "launch.actions.Frobnicate")))

    found = verdicts(with_scene(solution, SceneName.CONVERSATION, unknown))
    for name in ("launch-starts", "launch-only-numeric", "launch-conversation"):
        assert found[name].status is Status.INCONCLUSIVE, name
        assert "Frobnicate" in found[name].observed
    observed = with_scene(solution, SceneName.CONVERSATION, unknown)
    withheld = score.score(observed, (*found.values(),), lab.rubric(), "").notes[0]
    assert "where ROS 2 is sourced, it can be judged" in withheld
    assert "again" not in withheld


def test_too_slow_to_wrap_is_not_the_talker_s_fault(solution: Evidence) -> None:
    scene = solution.scene(SceneName.CONVERSATION)
    assert scene is not None
    last = max(e.at for e in scene.events if isinstance(e, Message) and e.topic == "/numeric_chatter" and e.data == 100)

    def until_then(event: Event) -> Event | None:
        if isinstance(event, Phase) and event.name == "stop":
            return Phase(last + 0.1, "stop")
        return event if event.at <= last and not (isinstance(event, Message) and event.number > 101) else None

    found = verdicts(with_events(solution, SceneName.CONVERSATION, until_then))
    assert found["talker-wrap"].status is Status.INCONCLUSIVE
    assert found["talker-step"].status is Status.PASS


@pytest.mark.parametrize("missed", [1, 5, 40])
def test_messages_lost_before_discovery_cost_nothing(missed: int, solution: Evidence) -> None:
    def lost(event: Event) -> Event | None:
        return None if isinstance(event, Message) and event.number <= missed else event

    found = verdicts(with_events(solution, SceneName.CONVERSATION, lost))
    for name in ("talker-start", "talker-step", "talker-wrap", "talker-chatter"):
        assert found[name].status is Status.PASS, found[name]


def test_lines_and_messages_may_come_in_any_order(solution: Evidence) -> None:
    """A slow observer reads what was printed before it takes in what was published, or long after."""
    for shift in (-3.0, 3.0):

        def moved(event: Event, shift: float = shift) -> Event:
            return msgspec.structs.replace(event, at=event.at + shift) if isinstance(event, Line) else event

        found = verdicts(with_events(solution, SceneName.CONVERSATION, moved))
        assert found["launch-conversation"].status is Status.PASS


# --- independence -----------------------------------------------------------------------------------------


def test_without_its_scene_a_check_blames_what_is_missing(solution: Evidence) -> None:
    sources = tuple(file for file in solution.submission.sources if file.path != "launch/chatter.py")
    without = with_scene(solution, SceneName.ORIGINALS, lambda scene: None)
    without = msgspec.structs.replace(without, submission=msgspec.structs.replace(without.submission, sources=sources))
    found = verdicts(without)
    assert found["originals-kept"].message == "no-launch"
    assert {v.status for n, v in found.items() if n != "originals-kept" and not n.startswith("git")} == {Status.PASS}


def test_a_listener_that_prints_other_numbers_besides_passes(solution: Evidence) -> None:
    def wordy(event: Event) -> Event:
        return (
            msgspec.structs.replace(event, text=f"{event.text} (of 127, message 7)")
            if isinstance(event, Line)
            else event
        )

    assert verdicts(with_events(solution, SceneName.LISTENER, wordy))["listener-numeric"].status is Status.PASS


def test_a_text_in_the_place_of_the_number_does_not_pass(solution: Evidence) -> None:
    def mute(event: Event) -> Event | None:
        return None if isinstance(event, Line) and "number" in event.text else event

    found = verdicts(with_events(solution, SceneName.LISTENER, mute))
    assert (found["listener-numeric"].status, found["listener-numeric"].message) == (Status.FAIL, "silent")
    assert found["listener-chatter"].status is Status.PASS


def test_the_period_is_a_note_and_no_verdict(solution: Evidence) -> None:
    def slow(event: Event) -> Event:
        return msgspec.structs.replace(event, value=7.5) if isinstance(event, Measured) else event

    result = score.score(solution, checks.judge(solution), lab.rubric(), "")
    other = with_events(solution, SceneName.CONVERSATION, slow)
    assert score.score(other, checks.judge(other), lab.rubric(), "").score == result.score
    scene = solution.scene(SceneName.CONVERSATION)
    assert scene is not None
    *_, period = (e.value for e in scene.events if isinstance(e, Measured) and e.name == "period_seconds")
    assert any(f"{period:g} s" in note for note in result.notes)


def test_a_burst_has_no_period_to_speak_of(solution: Evidence) -> None:
    def at_once(event: Event) -> Event:
        is_period = isinstance(event, Measured) and event.name == "period_seconds"
        return msgspec.structs.replace(event, value=0.0) if is_period else event

    observed = with_events(solution, SceneName.CONVERSATION, at_once)
    assert not any(
        "about every" in note for note in score.score(observed, (*checks.judge(observed),), lab.rubric(), "").notes
    )


def test_where_the_numbers_went_instead_is_said(folder: Path) -> None:
    found = verdicts(recorded("launch-moves-the-talker", folder))["launch-conversation"]
    assert found.message == "nothing"
    assert "/numbers" in found.observed

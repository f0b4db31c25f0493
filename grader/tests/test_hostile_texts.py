"""Text of a submission stays text, in every place where it is shown and for every reader.

The evidence of a real grade is given each hostile text (`hostile/texts.toml`) in one place after the other, judged, and
shown by every renderer there is; a new renderer is covered as soon as it is in `report`.
"""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Callable
from pathlib import Path

import hostile_builder
import msgspec
import pytest
from readers import CANARY, WORKFLOW, shown_harmlessly
from rich.console import Console

from lab2_grader import checks, evidence, lab, report
from lab2_grader.records import Endpoint, Evidence, Line, Message, Result, Scene, SceneName, SourceFile, Unsupported
from lab2_grader.report.terminal import terminal
from lab2_grader.score import score
from lab2_grader.text import clean

TEXTS = hostile_builder.texts()
Place = Callable[[Evidence, str], Evidence]
replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def observed(solution_graded: tuple[Result, Path]) -> Evidence:
    return evidence.read(solution_graded[1] / "evidence")


def _scene(found: Evidence, name: SceneName, change: Callable[[Scene], Scene]) -> Evidence:
    return replace(found, scenes=tuple(change(scene) if scene.name is name else scene for scene in found.scenes))


def _events(kind: type, change: Callable) -> Callable[[Scene], Scene]:
    return lambda scene: replace(
        scene, events=tuple(change(event) if isinstance(event, kind) else event for event in scene.events)
    )


def _build_log(found: Evidence, text: str) -> Evidence:
    assert found.build is not None
    return replace(found, build=replace(found.build, ok=False, code=1, log=f"RuntimeError: {clean(text, 2000)}"))


def _build_log_bare(found: Evidence, text: str) -> Evidence:
    assert found.build is not None
    return replace(found, build=replace(found.build, ok=False, code=1, log=clean(text, 2000)))


def _executables(found: Evidence, text: str) -> Evidence:
    assert found.build is not None
    named = (clean(text, 100), "talker", "listener")
    return replace(found, build=replace(found.build, executables=named, modules=named))


def _launch_files(found: Evidence, text: str) -> Evidence:
    assert found.build is not None
    scenes = tuple(scene for scene in found.scenes if scene.name is not SceneName.CONVERSATION)
    sources = (SourceFile(f"{clean(text, 100)}/numeric_chatter.py", text), *found.submission.sources)
    named = replace(found.build, launch_files=(f"launch/{clean(text, 100)}",))
    return replace(found, scenes=scenes, build=named, submission=replace(found.submission, sources=sources))


def _lines(found: Evidence, text: str) -> Evidence:
    change = _events(Line, lambda line: replace(line, text=clean(text, 4000)))
    return _scene(found, SceneName.LISTENER, change)


def _traceback(found: Evidence, text: str) -> Evidence:
    def died(scene: Scene) -> Scene:
        last = scene.events[-1].at
        told = [
            Line(
                last,
                "launch",
                "stderr",
                "[ERROR] [launch]: Caught exception in launch (see debug for traceback): " + clean(text, 3000),
            ),
        ]
        kept = [event for event in scene.events if type(event).__name__ not in ("ProcessSeen", "Line")]
        return replace(scene, events=(*kept, *told))

    return _scene(found, SceneName.CONVERSATION, died)


def _topics(found: Evidence, text: str) -> Evidence:
    shown = clean(text, 300)
    change = _events(Endpoint, lambda one: replace(one, topic=f"/{shown}", type=shown, node=f"/{shown}"))
    return _scene(_scene(found, SceneName.CONVERSATION, change), SceneName.LISTENER, change)


def _nodes(found: Evidence, text: str) -> Evidence:
    change = _events(Endpoint, lambda one: replace(one, node=f"/{clean(text, 300)}"))
    return _scene(found, SceneName.CONVERSATION, change)


def _messages(found: Evidence, text: str) -> Evidence:
    change = _events(Message, lambda one: replace(one, data=clean(text, 1000)))
    return _scene(found, SceneName.CONVERSATION, change)


def _unsupported(found: Evidence, text: str) -> Evidence:
    change = lambda scene: replace(scene, events=(*scene.events, Unsupported(1.0, clean(text, 300))))  # noqa: E731
    return _scene(found, SceneName.CONVERSATION, change)


def _faults(found: Evidence, text: str) -> Evidence:
    return _scene(
        replace(found, faults=(clean(text, 300),)), SceneName.LISTENER, lambda s: replace(s, fault=clean(text, 300))
    )


def _git(found: Evidence, text: str) -> Evidence:
    from lab2_grader.records import GitFacts

    shown = clean(text, 200)
    facts = GitFacts("0" * 40, (shown,), (), (shown,), pushed=False, products=(shown,), products_count=3)
    return replace(found, submission=replace(found.submission, git=facts))


def _git_uncommitted(found: Evidence, text: str) -> Evidence:
    from lab2_grader.records import GitFacts

    shown, package = clean(text, 200), lab.specification().package
    work = (f"{package}/numeric_talker.py", f"{package}/numeric_listener.py", "launch/numeric_chatter.py")
    facts = GitFacts("0" * 40, (f"https://x/{shown}",), work, (shown,), pushed=False, products=(), products_count=0)
    return replace(found, submission=replace(found.submission, git=facts))


def _name(found: Evidence, text: str) -> Evidence:
    shown = clean(text, 200)
    return replace(found, submission=replace(found.submission, name=shown, source=shown, package_path=shown))


PLACES: dict[str, Place] = {
    "error of the build": _build_log,
    "bare log of the build": _build_log_bare,
    "names of executables and modules": _executables,
    "names of launch files": _launch_files,
    "lines that are printed": _lines,
    "error of the launch": _traceback,
    "names of topics and types": _topics,
    "names of nodes": _nodes,
    "messages": _messages,
    "what the launcher does not know": _unsupported,
    "faults": _faults,
    "git": _git,
    "git, uncommitted": _git_uncommitted,
    "name of the submission": _name,
}

# Places that do not cover each other up, so that one report shows a text in all of them.
TOGETHER = (
    ("error of the build", "git", "name of the submission"),
    ("bare log of the build", "git, uncommitted"),
    ("lines that are printed", "error of the launch", "names of executables and modules", "git"),
    ("names of topics and types", "messages", "names of launch files", "git, uncommitted"),
    ("names of nodes", "messages", "what the launcher does not know", "name of the submission"),
    ("faults", "git"),
)


def _shown(found: Evidence) -> tuple[Result, dict[str, str]]:
    result = score(found, checks.judge(found), lab.rubric(), "0" * 64)
    return result, {name: data.decode() for name, data in report.files(result, found)}


@pytest.mark.parametrize("place", PLACES)
def test_the_place_is_one_that_is_shown(place: str, observed: Evidence) -> None:
    """Without this the next test could not fail."""
    _, files = _shown(PLACES[place](observed, CANARY))
    assert any(CANARY in text for text in files.values())


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text.name)
def test_text_stays_text(text: hostile_builder.Text, observed: Evidence) -> None:
    assert {place for places in TOGETHER for place in places} == set(PLACES)
    for places in TOGETHER:
        found = functools.reduce(lambda so_far, place: PLACES[place](so_far, text.text), places, observed)
        result, files = _shown(found)
        for name, data in files.items():
            shown_harmlessly(name, data.encode())
        console = Console(file=io.StringIO(), width=60, highlight=False)
        console.print(terminal(result))
        printed = console.file.getvalue()  # type: ignore[attr-defined]
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]", printed)
        assert not (command := WORKFLOW.search(printed)), command
        assert "##[" not in printed  # an old workflow command counts anywhere in a line


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text.name)
def test_clean_text_is_clean(text: hostile_builder.Text) -> None:
    once = clean(text.text, 300)
    assert clean(once, 300) == once
    assert len(once) <= 300
    assert CANARY in once or "nary" in once
    assert not re.search("[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\u200b\u2028\u2029\ufeff]", once)


@pytest.mark.parametrize("start", ["\x1b]", "\x9d", "\x90", "\x1b[", "\x9b0", "\x1b", "[", "-1"])
def test_cleaning_takes_no_longer_for_hostile_text(start: str) -> None:
    """Time grows with the length of the text, not with its square."""
    import time

    began = time.perf_counter()
    clean(start * 200_000, 100)
    assert time.perf_counter() - began < 2

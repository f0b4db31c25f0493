"""Every animal of the zoo goes through the real pipeline and gets its exact verdicts."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
import zoo_builder
from zoo_builder import CHECKS, GIT_CHECKS, Animal
from zoo_runner import Zoo, complaints

from lab2_grader import checks, evidence, pipeline, ros, submission
from lab2_grader.errors import UsageError
from lab2_grader.pipeline import Means
from lab2_grader.records import Clock, Result, Status

SINGLE, PAIRS, REPOSITORIES = zoo_builder.animals(), zoo_builder.pairs(), zoo_builder.repositories()
ANIMALS = SINGLE | PAIRS


NORMAL = frozenset(msgspec.toml.decode((zoo_builder.HERE / "zoo_normal.toml").read_bytes())["normal"])


def _parameters(animals: dict[str, Animal]) -> list[object]:
    return [pytest.param(name, marks=[] if name in NORMAL else [pytest.mark.slow]) for name in animals]


# --- the zoo itself ---------------------------------------------------------------------------------


def test_the_normal_run_is_of_the_zoo() -> None:
    assert ANIMALS.keys() >= NORMAL


def test_the_zoo_is_large_enough() -> None:
    assert sum(animal.right for animal in SINGLE.values()) >= 25
    assert sum(not animal.right for animal in SINGLE.values()) >= 45
    assert len(PAIRS) >= 20


@pytest.mark.parametrize("check", CHECKS)
def test_every_check_is_failed_by_two_and_passed_by_others(check: str) -> None:
    inhabitants = [*SINGLE.values(), *REPOSITORIES.values()]
    statuses = [inhabitant.statuses()[check] for inhabitant in inhabitants]
    assert statuses.count("fail") >= 2
    assert statuses.count("pass") >= (2 if check in GIT_CHECKS else 25)


@pytest.mark.parametrize("name", [name for name in ANIMALS if name != "solution"])
def test_every_animal_differs_from_the_solution(name: str, tmp_path: Path) -> None:
    built, plain = ANIMALS[name].build(tmp_path / "one"), SINGLE["solution"].build(tmp_path / "other")

    def content(folder: Path) -> dict[Path, bytes]:
        return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    assert content(built) != content(plain)


def test_an_edit_that_does_not_fit_is_an_error(tmp_path: Path) -> None:
    for text in ("this stands nowhere", "self"):
        animal = Animal("no-such", "", (zoo_builder.Edit(file="talker", find=text),))
        with pytest.raises(ValueError, match="no-such"):
            animal.build(tmp_path / text)
        shutil.rmtree(tmp_path / text)


# --- its verdicts -----------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def real_time_zoo(
    request: pytest.FixtureRequest, means: Means, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Zoo]:
    """The same in real time; many at once, because they do little but wait."""
    wanted = _asked_for(request, test_real_time_agrees.__name__)
    in_real_time = msgspec.structs.replace(means, clock=Clock.REAL_TIME)
    with Zoo(in_real_time, tmp_path_factory.mktemp("real"), [ANIMALS[name] for name in wanted], at_once=8) as zoo:
        yield zoo


@pytest.fixture(scope="session")
def zoo(
    request: pytest.FixtureRequest, means: Means, tmp_path_factory: pytest.TempPathFactory, real_time_zoo: Zoo
) -> Iterator[Zoo]:
    """The animals that this run of the tests asks for, being graded side by side; those in real time wait meanwhile."""
    tests = (test_gets_its_verdicts, test_the_period_is_said_as_it_was_written)
    wanted = dict.fromkeys(name for test in tests for name in _asked_for(request, test.__name__))
    with Zoo(means, tmp_path_factory.mktemp("zoo"), [ANIMALS[name] for name in wanted]) as zoo:
        yield zoo


def _asked_for(request: pytest.FixtureRequest, test: str) -> list[str]:
    items = [item for item in request.session.items if isinstance(item, pytest.Function) and item.originalname == test]
    return [item.callspec.params["name"] for item in items]


@pytest.mark.parametrize("name", _parameters(ANIMALS))
def test_gets_its_verdicts(zoo: Zoo, name: str) -> None:
    result = zoo.result(name)
    assert not complaints(ANIMALS[name], result.checks)
    assert result.score == sum(c.max_points for c in result.checks if c.status is Status.PASS)


@pytest.mark.parametrize(
    ("name", "seconds"), [("solution", "0.5"), ("period-of-a-tenth", "0.1"), ("period-of-two-seconds", "2")]
)
def test_the_period_is_said_as_it_was_written(zoo: Zoo, name: str, seconds: str) -> None:
    """A busy machine answers late; it may then say nothing of the period, but nothing that is not so."""
    said = [note for note in zoo.result(name).notes if "about every" in note]
    assert said in ([], [f"The numeric talker publishes about every {seconds} s."])


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if a.agrees else [pytest.mark.slow]) for name, a in SINGLE.items()]
)
def test_real_time_agrees(real_time_zoo: Zoo, name: str) -> None:
    assert not complaints(ANIMALS[name], real_time_zoo.result(name).checks)


def test_the_other_ros_agrees(means: Means, tmp_path: Path) -> None:
    """Sourced ROS with the real `ros2 launch`, or wheels with our launcher: whichever the other tests do not use."""
    try:
        other = msgspec.structs.replace(means, ros=ros.find("wheels" if means.ros.kind == "sourced" else "sourced"))
    except UsageError as error:
        pytest.skip(f"only one ROS is here: {error}")
    animals = [animal for animal in SINGLE.values() if animal.under_load]
    with Zoo(other, tmp_path, animals) as zoo:
        for animal in animals:
            assert not complaints(animal, zoo.result(animal.name).checks), animal.name


@pytest.mark.parametrize("name", REPOSITORIES)
def test_repository_gets_its_verdicts(name: str, solution_graded: tuple[Result, Path], tmp_path: Path) -> None:
    repository = REPOSITORIES[name]
    taken = submission.take(str(repository.build(tmp_path)), tmp_path / "package")
    of_solution = evidence.read(solution_graded[1] / pipeline.EVIDENCE)
    verdicts = checks.judge(msgspec.structs.replace(of_solution, submission=taken.facts))
    assert not complaints(repository, verdicts)


def test_repository_goes_through_the_whole_pipeline(means: Means, tmp_path: Path) -> None:
    repository = REPOSITORIES["fresh-history"]
    result, _ = pipeline.grade(str(repository.build(tmp_path)), tmp_path / "out", means, lambda doing: None)
    assert not complaints(repository, result.checks)
    assert (result.score, result.max_score) == (100, 100)

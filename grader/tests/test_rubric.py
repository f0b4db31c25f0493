"""A rubric of one's own is taken when it fits the lab, and refused with the line when it does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lab2_grader import lab
from lab2_grader.cli import main
from lab2_grader.errors import UsageError

POINTS = {check.id: f"points = {check.points}" for check in lab.rubric().check}
OWN = (lab.FACTS / "rubric.toml").read_text(encoding="utf-8")


def line_of(text: str, *marks: str) -> int:
    """The line of the last of *marks*, each looked for after the one before."""
    at = 0
    for mark in marks:
        at = text.index(mark, at)
    return text.count("\n", 0, at) + 1


def replaced(old: str, new: str, after: str = "") -> Callable[[str], str]:
    def change(text: str) -> str:
        start = text.index(after)
        assert old in text[start:]
        return text[:start] + text[start:].replace(old, new, 1)

    return change


@pytest.fixture
def refused(tmp_path: Path) -> Callable[[str], str]:
    def try_it(text: str) -> str:
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(UsageError) as caught:
            lab.rubric(path)
        return str(caught.value)

    return try_it


def test_other_points_are_taken(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(replaced(POINTS["package-builds"], "points = 25", 'id = "package-builds"')(OWN), encoding="utf-8")
    assert next(check.points for check in lab.rubric(path).check if check.id == "package-builds") == 25
    assert [check.id for check in lab.rubric(path).check] == [check.id for check in lab.rubric().check]


@pytest.mark.parametrize(
    ("change", "at", "says"),
    [
        (replaced("entry-points", "entry-point"), ('id = "entry-point"',), "there is no check entry-point. There are:"),
        (replaced('"entry-points"', '"package-builds"'), (POINTS["package-builds"], '"package-builds"'), "a second time"),
        (replaced(POINTS["entry-points"], "points = 7.5", "entry-points"), ("entry-points", "points = 7.5"), "Expected `int`"),
        (replaced(POINTS["entry-points"], 'points = "8"', "entry-points"), ("entry-points", 'points = "8"'), "Expected `int`"),
        (replaced(POINTS["entry-points"], "points = -8", "entry-points"), ("entry-points", "points = -8"), "-8 points"),
        (replaced(POINTS["entry-points"] + "\n", "", "entry-points"), ('id = "entry-points"',), "missing required field `points`"),
        (replaced('item = "exercise"', 'item = "exercises"', "package-builds"), ('item = "exercises"',), "no checklist item"),
        (lambda text: text + '\n[[checklist]]\nitem = "essay"\ntext = "x"\n', ('item = "essay"',), "no check gives points"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_with_its_line(
    change: Callable[[str], str], at: tuple[str, ...], says: str, refused: Callable[[str], str]
) -> None:
    text = change(OWN)
    told = refused(text)
    line = line_of(text, *at)
    if "missing" in says:
        line -= 1  # the table's header
    assert says in told
    assert f"line {line}" in told


def test_a_check_that_is_left_out_is_named(refused: Callable[[str], str]) -> None:
    start = OWN.index("[[check]]", OWN.index('id = "git-pushed"'))
    assert "lacks the check git-clean" in refused(OWN[:start])


def test_the_command_refuses_it_and_overwrites_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rubric, folder = tmp_path / "mine.toml", tmp_path / "results"
    rubric.write_text(OWN.replace("entry-points", "entry"), encoding="utf-8")
    (folder / "evidence").mkdir(parents=True)
    (folder / "result.json").write_text("as it was")
    assert main(["rescore", str(folder), "--rubric", str(rubric)]) == 2
    assert "there is no check entry" in capsys.readouterr().err
    assert (folder / "result.json").read_text() == "as it was"

"""Judges the recorded evidence of one submission or a whole class again, and says whose mark changed and why."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from lab2_grader import pipeline, process
from lab2_grader.classroom import results, summary
from lab2_grader.classroom.pool import cores
from lab2_grader.errors import Lab2Error, UsageError
from lab2_grader.lab import Rubric
from lab2_grader.records import ClassState, Record, Result

WORTH_A_POOL = 50  # submissions: starting processes takes as long as judging so many
AT_A_TIME = 20  # submissions handed to a process


class Change(Record, frozen=True):
    """A mark that is another now; `why` names each check that counts differently."""

    name: str
    was: str
    now: str
    why: tuple[str, ...]


class Remarked(Record, frozen=True):
    """What judging again came to; `failed` are (name, reason) of those whose evidence could not be judged."""

    count: int
    changes: tuple[Change, ...]
    failed: tuple[tuple[str, str], ...]


def rescore(root: Path, rubric: Rubric) -> Remarked:
    """Judge what is recorded in *root* again: a result's folder, or a folder of such folders.

    All are judged before the first is written, so that an interruption leaves either mark, and never half a class
    without the table of changes. Reports are written where the result is another one now; the others stand.

    Raises:
        UsageError: There is no evidence in *root*, or somebody else is writing there.
    """
    if (root / pipeline.EVIDENCE).is_dir():
        return _rescore([root], rubric)
    folders = sorted(path.parent for path in root.glob(f"*/{pipeline.EVIDENCE}"))
    if not folders:
        raise UsageError(f"There is no evidence in {root}. Give a folder that `grade` or `grade-all` wrote.")
    with results.locked(root):
        done = _rescore(folders, rubric)
        if (root / summary.JSON).is_file():
            _sum_up(root, rubric)
        return done


def _rescore(folders: list[Path], rubric: Rubric) -> Remarked:
    judged = partial(_judged, rubric=rubric)
    if len(folders) < WORTH_A_POOL:
        return _written(map(judged, folders))
    return _written(process.spread(judged, folders, cores(), AT_A_TIME))


def _judged(folder: Path, rubric: Rubric) -> tuple[Path, Result | None, Change | None, str]:
    """(folder, the result where it is another one now, how the mark changed, why it could not be judged)."""
    try:
        result = pipeline.rescore(folder, rubric)
    except Lab2Error as error:
        return folder, None, None, str(error)
    if results.stands(folder, result):
        return folder, None, None, ""
    return folder, result, _change(folder.name, results.result(folder), result), ""


def _written(judged: Iterable[tuple[Path, Result | None, Change | None, str]]) -> Remarked:
    rows = list(judged)
    for folder, result, _, _ in rows:
        if result is not None:
            pipeline.write_reports(folder, result)
    failed = tuple((folder.name, why) for folder, _, _, why in rows if why)
    changes = tuple(change for _, _, change, _ in rows if change is not None)
    return Remarked(len(rows) - len(failed), changes, failed)


def _change(name: str, old: Result | None, new: Result) -> Change | None:
    was, now = _mark(old), _mark(new)
    if was == now:
        return None
    before = {check.id: check for check in old.checks} if old else {}
    why = []
    for check in new.checks:
        earlier = before.pop(check.id, None)
        if earlier is None:
            why.append(f"{check.id} is new")
        elif earlier.status is not check.status:
            why.append(f"{check.id} was {earlier.status.value}, is {check.status.value}")
        elif (earlier.points, earlier.max_points) != (check.points, check.max_points):
            why.append(
                f"{check.id} ({check.status.value}) counted {earlier.points} of {earlier.max_points}, "
                f"counts {check.points} of {check.max_points}"
            )
    why += [f"{check} is gone" for check in before]
    return Change(name, was, now, tuple(why))


def _mark(result: Result | None) -> str:
    if result is None:
        return "none"
    return f"{result.score} of {result.max_score}" if result.graded else "withheld"


def _sum_up(root: Path, rubric: Rubric) -> None:
    """Bring the summary of the class up to date with the results."""
    old = summary.read(root)
    lines, found = [], []
    for line in old.lines:
        folder = root / line.name
        result, stamp = results.result(folder), results.stamp(folder)
        if line.state in (ClassState.GRADED, ClassState.WITHHELD) and result is not None and stamp is not None:
            found.append(result)
            lines.append(summary.line_of(line.name, result, stamp, folder))
        else:
            lines.append(line)
    summary.write(root, summary.summarise(lines, found, rubric, old.unknown))

"""Faults that only an older Python finds than the one of the lab's ROS distribution: the machine's, not the student's."""

from __future__ import annotations

import re

from lab2_grader import lab
from lab2_grader.checks.verdicts import inconclusive
from lab2_grader.checks.view import View
from lab2_grader.records import Status, Verdict

# Names of the standard library since Python 3.11 and 3.12 ("What's New in Python").
NEWER = (
    *("StrEnum", "ReprEnum", "verify", "UTC", "Self", "Never", "LiteralString", "assert_never", "assert_type"),
    *("reveal_type", "TaskGroup", "Runner", "timeout", "Barrier", "chdir", "tomllib", "getencoding"),
    *("override", "TypeAliasType", "batched", "sumprod", "Buffer"),
)
# What may stand in an f-string, and its very syntax, grew with Python 3.12 (PEP 701).
FSTRING = "SyntaxError: f-string"
MISSED = ("cannot import name", "has no attribute", "No module named")
ONLY_OLDER = re.compile(f"{FSTRING}|(?:{'|'.join(MISSED)}) '(?:{'|'.join(NEWER)})'")


def excused(view: View, verdict: Verdict) -> Verdict:
    """*verdict*, or why there can be none: what it holds against the submission may be right in the lab's Python.

    The same submission gets the same verdicts wherever it is graded (VERDICTS, general rule 4).
    """
    wanted, build = lab.course().ros_python, view.build
    if verdict.status is not Status.FAIL or build is None or not ONLY_OLDER.search(verdict.observed):
        return verdict
    if not build.python or _version(build.python) >= _version(wanted):
        return verdict
    return inconclusive(
        verdict.check, "inconclusive-python", observed=verdict.observed, python=build.python, wanted=wanted
    )


def _version(text: str) -> tuple[int, int]:
    major, minor = text.split(".")[:2]
    return int(major), int(minor)

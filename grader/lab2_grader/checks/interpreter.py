"""Faults that only an older Python finds than the one of the lab's ROS distribution: the machine's, not the student's."""

from __future__ import annotations

import re

from lab2_grader import lab
from lab2_grader.checks.verdicts import inconclusive
from lab2_grader.checks.view import View
from lab2_grader.records import Status, Verdict

# Names that the standard library has since Python 3.11 or 3.12 ("What's New in Python"), by module.
NEWER = {
    "asyncio": ("Barrier", "Runner", "TaskGroup", "timeout"),
    "collections.abc": ("Buffer",),
    "contextlib": ("chdir",),
    "datetime": ("UTC",),
    "enum": ("ReprEnum", "StrEnum", "verify"),
    "itertools": ("batched",),
    "locale": ("getencoding",),
    "math": ("sumprod",),
    "typing": (
        *("LiteralString", "Never", "Self", "TypeAliasType"),
        *("assert_never", "assert_type", "override", "reveal_type"),
    ),
}
NEWER_MODULE = "No module named 'tomllib'"
# What may stand in an f-string, and its very syntax, grew with Python 3.12 (PEP 701).
FSTRING = "SyntaxError: f-string"


def _missed(module: str, names: tuple[str, ...]) -> str:
    name = "|".join(names)
    return f"cannot import name '({name})' from '{module}'|module '{module}' has no attribute '({name})'"


ONLY_OLDER = re.compile("|".join((FSTRING, NEWER_MODULE, *(_missed(*entry) for entry in NEWER.items()))))


def excused(view: View, verdict: Verdict) -> Verdict:
    """*verdict*, or why there can be none: what it holds against the submission may be right in the lab's Python.

    The same submission gets the same verdicts wherever it is graded (VERDICTS, general rule 4).
    """
    build = view.build
    if verdict.status is not Status.FAIL or build is None or not ONLY_OLDER.search(verdict.observed):
        return verdict
    wanted = lab.course().ros_python
    if not build.python or _version(build.python) >= _version(wanted):
        return verdict
    return inconclusive(
        verdict.check, "inconclusive-python", observed=verdict.observed, python=build.python, wanted=wanted
    )


def _version(text: str) -> tuple[int, int]:
    major, minor = text.split(".")[:2]
    return int(major), int(minor)

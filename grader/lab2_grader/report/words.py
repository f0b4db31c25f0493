"""Words that several renderers share."""

from __future__ import annotations

from lab2_grader import messages
from lab2_grader.records import Result, Status

STATUS_WORDS = {
    Status.PASS: "passed",
    Status.PARTIAL: "partly",
    Status.FAIL: "not yet",
    Status.BLOCKED: "blocked",
    Status.NOT_ASSESSED: "not assessed",
    Status.INCONCLUSIVE: "not judged",
}

STATUS_MARKS = {
    Status.PASS: "✓",
    Status.PARTIAL: "◐",
    Status.FAIL: "✗",
    Status.BLOCKED: "–",
    Status.NOT_ASSESSED: "·",
    Status.INCONCLUSIVE: "?",
}


def broken(text: str) -> str:
    """*text* with both forms of GitHub's workflow commands broken, wherever in it they stand."""
    return text.replace("##", "# #").replace("::", ": :")


def mark(result: Result) -> str:
    """The mark in words: `92 of 100`, or that it is withheld."""
    return f"{result.score} of {result.max_score}" if result.graded else "withheld"


def in_short(result: Result) -> str:
    """The result in a sentence: all done, how much is left, or why there is no mark."""
    if not result.graded:
        return messages.report("withheld")
    left = sum(check.status in (Status.FAIL, Status.PARTIAL) for check in result.checks)
    waiting = sum(check.status is Status.BLOCKED for check in result.checks)
    if left == 0:
        return messages.report("all-passed")
    said = messages.report("one-to-do") if left == 1 else messages.report("to-do", count=left)
    return f"{said} {messages.report('waits', count=waiting)}" if waiting else said


def left_out(result: Result) -> str:
    """That some points could not be assessed; empty when all could."""
    whole = sum(check.max_points for check in result.checks)
    missing = whole - result.max_score
    return messages.report("reduced", points=missing, whole=whole) if missing else ""

"""Words that several renderers share."""

from __future__ import annotations

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


def mark(result: Result) -> str:
    """The mark in words: `92 of 100`, or that it is withheld."""
    return f"{result.score} of {result.max_score}" if result.graded else "withheld"

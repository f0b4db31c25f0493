"""The result as Gradescope's `results.json` (`gradescope/autograder_samples`: documentation of the output format).

The file must stand from the start: on a timeout Gradescope shows what is there, or nothing. Its `status` knows passed and
failed only; a check that was not assessed or not judged is shown for information, without points.
"""

from __future__ import annotations

import json
from typing import Any

from lab2_grader import lab, messages
from lab2_grader.records import CheckResult, Status
from lab2_grader.report.view import Report
from lab2_grader.report.words import STATUS_WORDS, in_short, left_out, mark

WITHOUT_POINTS = (Status.NOT_ASSESSED, Status.INCONCLUSIVE)


def gradescope(report: Report, total: float | None = None, stage: str = "") -> str:
    """`results.json`.

    Args:
        report: The report, the student's.
        total: Points that the assignment has in Gradescope; None when unknown: the score is then left as it is.
        stage: The stage that grading has come to when it is not over; empty at the end.
    """
    result = report.result
    score, said = 0.0, [in_short(result)]
    if stage:
        said = [unfinished(stage)]
    elif result.graded and result.score is not None:
        score = float(result.score)
        said.append(left_out(result))
        if total is not None and total != result.max_score and result.max_score:
            score = round(result.score * total / result.max_score, 2)
            said.append(
                messages.report(
                    "scaled", score=result.score, max_score=result.max_score, shown=f"{score:g}", total=f"{total:g}"
                )
            )
    else:
        said = [messages.report("withheld-gradescope", why=next(iter(result.notes), ""))]
    numbers = _numbers(result.checks)
    output = {
        "score": score,
        "execution_time": round(result.seconds.total, 2),
        "output": "\n\n".join(filter(None, (*said, *(f"Note: {note}" for note in result.notes)))),
        "output_format": "text",
        "test_output_format": "text",
        "test_name_format": "text",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "tests": [_test(check, numbers[check.id], result.graded and not stage) for check in result.checks],
        "extra_data": {
            "graded": result.graded and not stage,
            "mark": mark(result),
            "grader": result.runtime.grader,
            "submission": result.submission.sha256,
        },
    }
    return json.dumps(output, indent=2, ensure_ascii=False) + "\n"


def begun(stage: str) -> str:
    """`results.json` from before there is any result."""
    return said(unfinished(stage))


def said(text: str) -> str:
    """`results.json` that says *text* and gives no points: a refused submission, or a fault of ours."""
    output = {"score": 0.0, "output": text, "output_format": "text", "stdout_visibility": "hidden", "tests": []}
    return json.dumps(output, indent=2, ensure_ascii=False) + "\n"


def unfinished(stage: str) -> str:
    """That grading had only come to *stage*."""
    course = lab.course()
    return messages.report("partial", stage=stage, contact=course.contact_name, email=course.contact_email)


def _numbers(checks: tuple[CheckResult, ...]) -> dict[str, str]:
    """`2.1`: the first check of the second checklist item."""
    items: dict[str, list[str]] = {}
    for check in checks:
        items.setdefault(check.item, []).append(check.id)
    return {
        check: f"{first}.{second}"
        for first, ids in enumerate(items.values(), start=1)
        for second, check in enumerate(ids, start=1)
    }


def _test(check: CheckResult, number: str, scored: bool) -> dict[str, Any]:
    lines = [f"{STATUS_WORDS[check.status]} (worksheet section {check.section})"]
    if check.status is not Status.PASS:
        lines += [f"{name}: {text}" for name, text in _help(check) if text]
    test: dict[str, Any] = {
        "name": check.title,
        "number": number,
        "output": "\n".join(lines),
        "tags": [check.item],
        "visibility": "visible",
        "extra_data": {"id": check.id, "status": check.status.value},
    }
    if scored and check.status not in WITHOUT_POINTS:
        test["score"] = check.points
        test["max_score"] = check.max_points
        test["status"] = "passed" if check.status is Status.PASS else "failed"
    return test


def _help(check: CheckResult) -> tuple[tuple[str, str], ...]:
    return (("Expected", check.expected), ("Observed", check.observed), ("Try", check.hint))

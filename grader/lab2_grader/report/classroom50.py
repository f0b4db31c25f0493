"""The result as Classroom 50's `result.json` (`foundation50/classroom50`: wiki, Advanced Autograding)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from lab2_grader.records import Status
from lab2_grader.report.view import Report
from lab2_grader.report.words import STATUS_WORDS

SCHEMA = "classroom50/result/v1"


@dataclass(frozen=True)
class Assignment:
    """What Classroom 50 tells its autograders in the environment, by the keys of its `result.json`."""

    classroom: str = ""
    assignment: str = ""
    submission: str = ""
    commit: str = ""
    release: str = ""
    review: str = ""

    @classmethod
    def told(cls, environment: Mapping[str, str]) -> Assignment:
        """What the variables of Classroom 50 say."""
        names = ("CLASSROOM", "ASSIGNMENT", "SUBMISSION_TAG", "COMMIT_URL", "RELEASE_URL", "REVIEW_URL")
        return cls(*(environment.get(name, "") for name in names))


def classroom50(report: Report, assignment: Assignment | None = None) -> str:
    """`result.json` for the top of the student's repository.

    `datetime` is when the commit was made, so that it does not move when the same commit is graded again. A mark that is
    withheld has no place in this format: the caller must not write the file then, and end with a code that says so.

    Args:
        report: The report, the student's.
        assignment: What Classroom 50 said of the assignment.
    """
    result, assignment = report.result, assignment or Assignment()
    output = {
        "schema": SCHEMA,
        "classroom": assignment.classroom,
        "assignment": assignment.assignment,
        "submission": assignment.submission,
        "commit": assignment.commit or result.submission.commit or "",
        "release": assignment.release,
        "review": assignment.review,
        "datetime": report.committed or report.began,
        "score": result.score or 0,
        "max-score": result.max_score,
        "tests": [
            {
                "test-name": check.title,
                "passed": check.status is Status.PASS,
                "score": check.points,
                "max-score": check.max_points,
                "id": check.id,
                "status": STATUS_WORDS[check.status],
                "expected": check.expected,
                "observed": check.observed,
                "hint": check.hint,
                "section": check.section,
            }
            for check in result.checks
            if check.status is not Status.NOT_ASSESSED
        ],
    }
    return json.dumps(output, indent=2, ensure_ascii=False) + "\n"

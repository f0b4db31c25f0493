"""What a renderer gets: one frozen value with everything it may show to its audience, and nothing else.

What only staff may see is taken out here, before any renderer runs, so that no renderer can let it slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import msgspec

from lab2_grader.checks.view import View
from lab2_grader.records import CheckResult, Evidence, Result, Status
from lab2_grader.report.extracts import Extract, extracts, staff_extracts
from lab2_grader.report.observed import (
    Conversation,
    Graph,
    Timeline,
    conversation,
    graph_asked,
    graph_observed,
    timeline,
)

HELD_BACK = (Status.FAIL, Status.PARTIAL, Status.INCONCLUSIVE)


class Audience(str, Enum):
    """Who reads a report."""

    STUDENT = "student"
    STAFF = "staff"


@dataclass(frozen=True)
class Report:
    """A result with what is shown of its evidence.

    Args:
        audience: Who reads it.
        result: What was judged; for students without where the submission was taken from and without signature.
        began: When the submission was graded, ISO 8601; empty when that was not recorded.
        committed: When the graded commit was made, ISO 8601; empty when there is none.
        package_path: Where the package is, relative to the top of the submission; "." for the top.
        package_files: Those files of the package that are known, relative to it.
        sequence: The numbers beside the expected ones; None when none were published.
        asked: The ROS graph as the worksheet asks for it.
        seen: The ROS graph as it was observed; None when nothing ran.
        timeline: How long what took.
        extracts: (check id, what its verdict rests on).
        behind: What only staff see of the evidence; empty for students.
    """

    audience: Audience
    result: Result
    began: str
    committed: str
    package_path: str
    package_files: tuple[str, ...]
    sequence: Conversation | None
    asked: Graph
    seen: Graph | None
    timeline: Timeline
    extracts: tuple[tuple[str, tuple[Extract, ...]], ...]
    behind: tuple[Extract, ...]

    @property
    def for_staff(self) -> bool:
        """Whether staff reads it."""
        return self.audience is Audience.STAFF

    @property
    def to_do(self) -> tuple[CheckResult, ...]:
        """The checks that did not earn their points and wait for no other."""
        return tuple(check for check in self.result.checks if check.status in HELD_BACK)

    @property
    def waiting(self) -> tuple[CheckResult, ...]:
        """The checks that another one blocks."""
        return tuple(check for check in self.result.checks if check.status is Status.BLOCKED)

    @property
    def passed(self) -> tuple[CheckResult, ...]:
        """The checks that passed."""
        return tuple(check for check in self.result.checks if check.status is Status.PASS)

    @property
    def not_assessed(self) -> tuple[CheckResult, ...]:
        """The checks that there was nothing to judge by."""
        return tuple(check for check in self.result.checks if check.status is Status.NOT_ASSESSED)

    def evidence_of(self, check: str) -> tuple[Extract, ...]:
        """What the verdict of *check* rests on."""
        return next((found for name, found in self.extracts if name == check), ())


def report_of(result: Result, evidence: Evidence, audience: Audience = Audience.STUDENT) -> Report:
    """The report of *result* for *audience*, with what *evidence* has to show."""
    view = View(evidence)
    staff = audience is Audience.STAFF
    if not staff:
        hidden = msgspec.structs.replace(result.submission, source="")
        result = msgspec.structs.replace(result, submission=hidden, signature="")
    facts = evidence.submission
    return Report(
        audience=audience,
        result=result,
        began=evidence.began,
        committed=facts.git.committed if facts.git else "",
        package_path=facts.package_path,
        package_files=tuple(file.path for file in facts.sources),
        sequence=conversation(view),
        asked=graph_asked(),
        seen=graph_observed(view),
        timeline=timeline(evidence),
        extracts=tuple((check.id, extracts(check.id, view)) for check in result.checks),
        behind=staff_extracts(view) if staff else (),
    )

"""Verdicts and rubric make a score, or withhold it and say why. Pure."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import msgspec

from lab2_grader import messages
from lab2_grader.checks.notes import notes
from lab2_grader.lab import Rubric
from lab2_grader.records import (
    RESULT_SCHEMA,
    CheckResult,
    Digests,
    Evidence,
    ItemResult,
    Result,
    Status,
    SubmissionResult,
    Verdict,
)


def rubric_digest(rubric: Rubric) -> str:
    """SHA-256 of the rubric's content, hexadecimal; comments and layout of its file do not matter."""
    return hashlib.sha256(msgspec.json.encode(rubric)).hexdigest()


def score(evidence: Evidence, verdicts: Sequence[Verdict], rubric: Rubric, evidence_digest: str) -> Result:
    """The result of one submission.

    A passed check earns its points. What was not assessed is taken out of the maximum. One inconclusive check withholds
    the mark (DESIGN section 3).

    Args:
        evidence: What was observed.
        verdicts: One for each check of the rubric.
        rubric: What each check is worth.
        evidence_digest: SHA-256 of the evidence on disk, hexadecimal.
    """
    found = {verdict.check: verdict for verdict in verdicts}
    checks = tuple(
        _check_result(found[check.id], check.item, check.title, check.section, check.points) for check in rubric.check
    )
    items = tuple(
        _item_result(item.item, item.text, [check for check in checks if check.item == item.item])
        for item in rubric.checklist
    )
    inconclusive = [check for check in checks if check.status is Status.INCONCLUSIVE]
    graded = not inconclusive
    # One cause withholds many checks: it is said once, with the first of them.
    first = {check.observed: check.id for check in reversed(inconclusive)}
    reasons = tuple(f"{first[why]} {why}" for why in reversed(first))
    sourced = {check.message for check in inconclusive} == {"inconclusive-unsupported"}
    what_next = messages.phrase("grade-sourced" if sourced else "grade-again")
    withheld = (messages.status("withheld", why="; ".join(reasons[:3]), next=what_next),) if reasons else ()
    facts = evidence.submission
    return Result(
        schema=RESULT_SCHEMA,
        submission=SubmissionResult(facts.name, facts.source, facts.sha256, facts.commit),
        graded=graded,
        score=sum(check.points for check in checks) if graded else None,
        max_score=sum(check.max_points for check in checks if check.status is not Status.NOT_ASSESSED),
        checklist=items,
        checks=checks,
        notes=withheld + notes(evidence),
        runtime=evidence.runtime,
        seconds=evidence.seconds,
        digests=Digests(facts.sha256, evidence_digest, rubric_digest(rubric)),
    )


def _check_result(verdict: Verdict, item: str, title: str, section: str, points: int) -> CheckResult:
    return CheckResult(
        id=verdict.check,
        item=item,
        title=title,
        status=verdict.status,
        points=points if verdict.status is Status.PASS else 0,
        max_points=points,
        expected=verdict.expected,
        observed=verdict.observed,
        hint=verdict.hint,
        section=section,
        message=verdict.message,
        symptom=verdict.symptom,
        because=verdict.because,
        file=verdict.file,
        line=verdict.line,
    )


def _item_result(item: str, text: str, checks: Sequence[CheckResult]) -> ItemResult:
    judged = [check for check in checks if check.status is not Status.NOT_ASSESSED]
    return ItemResult(
        item=item,
        text=text,
        status=_item_status([check.status for check in judged]),
        points=sum(check.points for check in judged),
        max_points=sum(check.max_points for check in judged),
    )


def _item_status(statuses: Sequence[Status]) -> Status:
    """One status for several checks: pass when all pass, partial when some do, blocked when nothing but that is left."""
    if not statuses:
        return Status.NOT_ASSESSED
    if Status.INCONCLUSIVE in statuses:
        return Status.INCONCLUSIVE
    if all(status is Status.PASS for status in statuses):
        return Status.PASS
    if Status.PASS in statuses:
        return Status.PARTIAL
    return Status.BLOCKED if all(status is Status.BLOCKED for status in statuses) else Status.FAIL

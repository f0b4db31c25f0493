"""What a class comes to: one line a submission, how each check went, what needs a person. Pure but for reading results."""

from __future__ import annotations

import csv
import io
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from lab2_grader import __version__, decoding, lab
from lab2_grader.classroom.records import Stamp
from lab2_grader.classroom.work import code_digest
from lab2_grader.errors import UsageError
from lab2_grader.evidence import pretty, write_atomically
from lab2_grader.lab import Rubric
from lab2_grader.records import (
    CLASS_SCHEMA,
    CheckRate,
    ClassLine,
    ClassState,
    ClassSummary,
    CommonFault,
    Lost,
    Result,
    Status,
    Unknown,
)
from lab2_grader.report import class_page
from lab2_grader.score import rubric_digest

JSON, CSV, PAGE = "summary.json", "summary.csv", "index.html"
REPORTS = ("report.html", "report.md")
COMMONEST = 3  # faults named for each check


def line_of(name: str, result: Result, known: Stamp, folder: Path) -> ClassLine:
    """The line of the submission *name*, whose result lies in *folder*."""
    inconclusive = [check for check in result.checks if check.status is Status.INCONCLUSIVE]
    reason = ""
    if not result.graded:
        reason = "; ".join(dict.fromkeys(f"{check.id} {check.observed}" for check in inconclusive[:2])) or "not judged"
    report = next((report for report in REPORTS if (folder / report).is_file()), "")
    return ClassLine(
        name=name,
        student=known.student,
        keys=known.keys,
        state=ClassState.GRADED if result.graded else ClassState.WITHHELD,
        score=result.score,
        max_score=result.max_score,
        reason=reason,
        lost=tuple(
            Lost(check.id, check.status.value, check.max_points - check.points, check.message, check.observed)
            for check in result.checks
            if check.status not in (Status.PASS, Status.NOT_ASSESSED)
        ),
        not_assessed=tuple(check.id for check in result.checks if check.status is Status.NOT_ASSESSED),
        flags=known.flags,
        note=known.note,
        shown=known.shown,
        commit=result.submission.commit,
        sha256=result.submission.sha256,
        seconds=result.seconds.total,
        attempts=known.attempts,
        report=f"{name}/{report}" if report else "",
    )


def summarise(
    lines: Iterable[ClassLine], results: Iterable[Result], rubric: Rubric, unknown: Sequence[Unknown]
) -> ClassSummary:
    """The summary of a class.

    Args:
        lines: One for each submission.
        results: Those that there are, of the same submissions.
        rubric: By which they were judged.
        unknown: What in the inbox was not understood.
    """
    lines = tuple(sorted(lines, key=lambda line: line.name.lower()))
    return ClassSummary(
        schema=CLASS_SCHEMA,
        title=lab.course().title,
        grader=__version__,
        code=code_digest(),
        rubric=rubric_digest(rubric),
        max_score=sum(check.points for check in rubric.check),
        lines=lines,
        checks=_rates(results, rubric),
        identical=_identical(lines),
        unknown=tuple(unknown),
    )


def _rates(results: Iterable[Result], rubric: Rubric) -> tuple[CheckRate, ...]:
    passed: Counter[str] = Counter()
    judged: Counter[str] = Counter()
    faults: dict[str, Counter[str]] = defaultdict(Counter)
    examples: dict[tuple[str, str], str] = {}
    for result in results:
        if not result.graded:
            continue
        for check in result.checks:
            if check.status is Status.NOT_ASSESSED:
                continue
            judged[check.id] += 1
            passed[check.id] += check.status is Status.PASS
            if check.status is not Status.PASS:
                fault = check.message or ", ".join(check.because) or check.status.value
                fault = f"blocked by {fault}" if check.status is Status.BLOCKED else fault
                faults[check.id][fault] += 1
                examples.setdefault((check.id, fault), check.observed)
    return tuple(
        CheckRate(
            check.id,
            check.title,
            check.section,
            passed[check.id],
            judged[check.id],
            tuple(
                CommonFault(fault, count, examples[check.id, fault])
                for fault, count in faults[check.id].most_common(COMMONEST)
            ),
        )
        for check in rubric.check
    )


def _identical(lines: Sequence[ClassLine]) -> tuple[tuple[str, ...], ...]:
    groups: dict[str, list[str]] = defaultdict(list)
    for line in lines:
        if line.sha256:
            groups[line.sha256].append(line.name)
    return tuple(sorted(tuple(names) for names in groups.values() if len(names) > 1))


def guarded(text: str) -> str:
    """*text* as a spreadsheet shows it and does not reckon it: what could start a formula gets a quote in front."""
    return f"'{text}" if text.lstrip(" ")[:1] in ("=", "+", "-", "@", "\t", "\r", "\n", "|", "%") else text


def table(summary: ClassSummary) -> str:
    """`summary.csv`."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    checks = [check.id for check in summary.checks]
    writer.writerow(["name", "student", "state", "score", "max_score", "reason", "flags", "note", "commit", "sha256",
                     *checks])  # fmt: skip
    for line in summary.lines:
        known = dict.fromkeys(line.not_assessed, Status.NOT_ASSESSED.value)
        known |= {lost.check: lost.status for lost in line.lost}
        verdicts = [known.get(check, "pass" if line.state is ClassState.GRADED else "") for check in checks]
        score = "" if line.score is None else str(line.score)
        texts = (line.reason, "; ".join(line.flags), line.note, line.commit or "", line.sha256)
        writer.writerow(
            [guarded(line.name), guarded(line.student), line.state.value, score, str(line.max_score or ""),
             *(guarded(text) for text in texts), *verdicts]
        )  # fmt: skip
    return out.getvalue()


def write(out: Path, summary: ClassSummary) -> None:
    """Write the summary in its three forms, each whole or not at all."""
    write_atomically(out / CSV, b"\xef\xbb\xbf" + table(summary).encode())
    write_atomically(out / PAGE, class_page.render(summary).encode())
    write_atomically(out / JSON, pretty(summary))


def read(out: Path) -> ClassSummary:
    """The summary in *out*.

    Raises:
        UsageError: There is none, or it is of another version.
    """
    path = out / JSON
    try:
        return decoding.from_json(path.read_bytes(), ClassSummary)
    except OSError as error:
        raise UsageError(f"There is no summary of a class at {path}. Give a folder that `grade-all` wrote.") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} is damaged or of another version: {error}. Run `grade-all` again.") from error

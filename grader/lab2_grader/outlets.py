"""Where a grade must say something whatever becomes of it: the job of a GitHub workflow, and Gradescope.

An outlet is told when grading begins, when a stage begins, when there is a result, and when there is none. It writes the
files that its reader looks for and returns what is to be printed; it prints nothing itself.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import msgspec

from lab2_grader import decoding, lab, messages
from lab2_grader.errors import RefusedError, UsageError
from lab2_grader.evidence import write_atomically
from lab2_grader.records import Evidence, Result
from lab2_grader.report import Report, github, report_of
from lab2_grader.report.gradescope import begun, gradescope, said
from lab2_grader.report.markdown import markdown, prose

SUMMARY_BYTES = 1_000_000  # GitHub's own limit for one step is 1 MiB, over which all is lost


class Outlet(Protocol):
    """Somebody who is told how a grade goes; each call returns the lines to print."""

    def began(self) -> tuple[str, ...]:
        """Grading begins; nothing is known yet."""
        ...

    def stage(self, result: Result, evidence: Evidence, name: str) -> tuple[str, ...]:
        """The stage *name* begins, with the result as it would stand if nothing more came; empty at the end."""
        ...

    def failed(self, error: Exception) -> tuple[str, ...]:
        """There is no result, because of *error*."""
        ...


def why_not(error: Exception) -> str:
    """Why there is no result, as a sentence for the student."""
    course = lab.course()
    if isinstance(error, RefusedError | UsageError):
        return messages.report("refused", why=str(error))
    why = str(error) if isinstance(error, Exception) and error.__class__.__module__.startswith("lab2_grader") else ""
    return messages.report(
        "fault",
        why=why or messages.report("crashed"),
        contact=course.contact_name,
        email=course.contact_email,
    )


class GithubJob:
    """A step of a GitHub workflow: the job's summary, annotations, and the step's outputs.

    Args:
        submission: What is graded, as it was given.
        environment: Where GitHub says what goes where (`GITHUB_STEP_SUMMARY`, `GITHUB_OUTPUT`, `GITHUB_WORKSPACE`).
    """

    def __init__(self, submission: str, environment: Mapping[str, str] = os.environ) -> None:
        self._summary = environment.get("GITHUB_STEP_SUMMARY", "")
        self._output = environment.get("GITHUB_OUTPUT", "")
        self._below = _below(submission, environment.get("GITHUB_WORKSPACE", ""))

    def began(self) -> tuple[str, ...]:
        """Nothing is said yet: a summary cannot be taken back."""
        return ()

    def stage(self, result: Result, evidence: Evidence, name: str) -> tuple[str, ...]:
        """At the end: the summary, the outputs, the annotations."""
        if name:
            return ()
        report = report_of(result, evidence)
        self._write_summary(markdown(report))
        self._write_outputs(report)
        return github.workflow_commands(report, self._below, errors=lab.course().fail_workflow_on_lost_points)

    def failed(self, error: Exception) -> tuple[str, ...]:
        """A summary and one annotation that say why."""
        why = why_not(error)
        title = github.course_title()
        self._write_summary(f"# {prose(title)}\n\n{prose(why)}\n")
        self._append(self._output, "graded=false\nscore=\nmax_score=\n")
        return (github.command("error", title, why),)

    def _write_summary(self, text: str) -> None:
        data = text.encode("utf-8", "replace")
        if len(data) <= SUMMARY_BYTES:
            self._append(self._summary, text)

    def _write_outputs(self, report: Report) -> None:
        result = report.result
        score = "" if result.score is None else str(result.score)
        self._append(
            self._output, f"graded={str(result.graded).lower()}\nscore={score}\nmax_score={result.max_score}\n"
        )

    @staticmethod
    def _append(path: str, text: str) -> None:
        if path:
            with Path(path).open("a", encoding="utf-8", errors="replace") as file:
                file.write(text)


class Gradescope:
    """Gradescope's folder: `results/results.json` stands from the start and is written again after every stage.

    Args:
        folder: The folder of the harness, `/autograder` there.
    """

    def __init__(self, folder: Path) -> None:
        self._results = folder / "results" / "results.json"
        self._total = _total_points(folder / "submission_metadata.json")

    def began(self) -> tuple[str, ...]:
        """The first file, which says that grading has begun."""
        self._write(begun(messages.report("begun")))
        return ()

    def stage(self, result: Result, evidence: Evidence, name: str) -> tuple[str, ...]:
        """The file as it stands now."""
        self._write(gradescope(report_of(result, evidence), self._total, name))
        return ()

    def failed(self, error: Exception) -> tuple[str, ...]:
        """The file that says why there is no mark."""
        self._write(said(why_not(error)))
        return ()

    def _write(self, text: str) -> None:
        write_atomically(self._results, text.encode("utf-8", "replace"))


class _Assignment(msgspec.Struct):
    total_points: str | float | None = None


class _Metadata(msgspec.Struct):
    assignment: _Assignment = msgspec.field(default_factory=_Assignment)


def _total_points(path: Path) -> float | None:
    """What the assignment is worth in Gradescope; None when its metadata do not say."""
    try:
        return float(decoding.from_json(path.read_bytes(), _Metadata).assignment.total_points or "") or None
    except (OSError, ValueError, msgspec.DecodeError):
        return None


def _below(submission: str, workspace: str) -> str:
    """Where the submission is below the checkout, for paths that GitHub understands; empty for its top, or elsewhere."""
    top, folder = Path(workspace or ".").resolve(), Path(submission).resolve()
    return folder.relative_to(top).as_posix() if folder.is_relative_to(top) and folder != top else ""

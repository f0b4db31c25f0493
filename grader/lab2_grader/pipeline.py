"""The stages in order, on one screen: submission → build → scenes → evidence → checks → score → reports."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path

import msgspec

from lab2_grader import (
    __version__,
    checks,
    decoding,
    evidence,
    messages,
    process,
    provenance,
    report,
    ros,
    sandbox,
    submission,
)
from lab2_grader.build import build
from lab2_grader.errors import FaultError, UsageError
from lab2_grader.lab import Rubric
from lab2_grader.records import (
    Build,
    Clock,
    Evidence,
    Record,
    Result,
    Runtime,
    Scene,
    Seconds,
    Submission,
    SubmissionFacts,
)
from lab2_grader.ros import Ros
from lab2_grader.score import score
from lab2_grader.stage import Stage, entry

EVIDENCE = "evidence"

Progress = Callable[[str], None]
Publish = Callable[[Result, Evidence, str], None]


class Means(Record, frozen=True):
    """With what submissions are graded.

    Args:
        ros: Which ROS.
        isolation: Whether there are walls.
        rubric: What the checks are worth.
        clock: How the numeric pair's clock is driven.
    """

    ros: Ros
    isolation: sandbox.Isolation
    rubric: Rubric
    clock: Clock = Clock.TIME_LAPSE

    @property
    def runtime(self) -> Runtime:
        """As the evidence names it."""
        return Runtime(self.ros.kind, self.ros.distro, self.clock.value, self.isolation.name, __version__)


def _to_nobody(result: Result, observed: Evidence, stage: str) -> None:
    """The default of `publish`."""


def grade(
    source: str, out: Path | Callable[[str], Path], means: Means, progress: Progress, publish: Publish = _to_nobody
) -> tuple[Result, Path]:
    """Grade one submission.

    Args:
        source: A folder, an archive, or the address of a git repository.
        out: Where the result goes, or what makes that of the submission's name.
        means: With what.
        progress: Told in a few words what begins.
        publish: Given the result as far as it stands, its evidence, and the stage that begins (empty at the end), whenever
            a stage ends: for whoever must show something although the run may be killed.

    Returns:
        The result and the folder that holds it.

    Raises:
        RefusedError: The submission breaks a rule; nothing was written.
        UsageError: There is no such submission, or the folder for the result cannot be used.
        FaultError: The machine failed before the submission was taken over.
    """
    began = time.monotonic()
    with process.temporary_directory() as scratch:
        progress("taking the submission over")
        taken = submission.take(source, scratch / "package")
        folder = out(taken.facts.name) if callable(out) else out
        return grade_taken(taken, scratch, folder, means, progress, began, publish), folder


def grade_taken(
    taken: Submission,
    scratch: Path,
    folder: Path,
    means: Means,
    progress: Progress,
    began: float | None = None,
    publish: Publish = _to_nobody,
) -> Result:
    """Grade a submission that was taken over already.

    Args:
        taken: The package and what is known of it.
        scratch: A private folder, to be removed by the caller.
        folder: Where the result goes.
        means: With what.
        progress: Told in a few words what begins.
        began: When the work on it began, on the monotonic clock; None for now.
        publish: As for `grade`.

    Raises:
        UsageError: The folder for the result cannot be written to.
        FaultError: There is no room for the result.
    """
    ros.byte_compile()
    record = _Recorder(folder, means, taken.facts, time.monotonic() if began is None else began, publish)
    try:
        (scratch / "build").mkdir()
        with Stage(means.ros, means.isolation, record.writer, scratch, means.clock) as stage:
            record.stage("build")
            progress("building with colcon")
            built = build(taken, scratch / "build", means.ros, means.isolation)
            record.built(built)
            if built.ok:
                record.stage("scenes")
                progress("launching, listening, talking")
                record.played(stage.play(built, scratch / "build"))
    except FaultError as fault:
        record.failed(fault)
    progress("judging")
    return record.finish()


def rescore(folder: Path, rubric: Rubric) -> Result:
    """Judge the evidence in *folder* again; needs no ROS.

    Raises:
        UsageError: The evidence is not there, damaged, or of another version.
    """
    observed = evidence.read(folder / EVIDENCE)
    return provenance.sign(score(observed, checks.judge(observed), rubric, evidence.digest(folder / EVIDENCE)))


def read(folder: Path) -> tuple[Result, Evidence]:
    """The result in *folder* as it was judged, and its evidence.

    Raises:
        UsageError: Either is not there, damaged, or of another version.
    """
    path = folder / report.RESULT
    try:
        result = decoding.from_json(path.read_bytes(), Result)
    except OSError as error:
        raise UsageError(f"There is no result at {path} ({error.strerror}). Grade the submission first.") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} is damaged: {error}. Grade the submission again.") from error
    return result, evidence.read(folder / EVIDENCE)


def write_reports(folder: Path, result: Result) -> None:
    """Write every report of *result* to *folder*, which holds its evidence; each whole or not at all."""
    for name, data in report.files(result, evidence.read(folder / EVIDENCE)):
        evidence.write_atomically(folder / name, data)


class _Recorder:
    """Keeps what has been observed so far on disk, so that a run that is killed still says how far it came."""

    def __init__(self, folder: Path, means: Means, facts: SubmissionFacts, began: float, publish: Publish) -> None:
        self._folder = folder
        self._means = means
        self._began = began
        self._began_at = datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
        self._publish = publish
        self._facts = facts
        self._build: Build | None = None
        self._scenes: tuple[Scene, ...] = ()
        self._faults: tuple[str, ...] = ()
        self._runtime = means.runtime
        self._run_seconds = 0.0
        for path in (folder / name for name in report.NAMES):  # an earlier run's: they do not speak for this one
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise evidence.cannot_write(path, error) from error
        self.writer = evidence.Writer(folder / EVIDENCE)
        self.writer.submission(facts)
        self.stage("submission")

    def stage(self, name: str) -> None:
        """The stage *name* begins: leave a result that says that grading stopped here, should it."""
        self._stage_began = time.monotonic()
        self._write_manifest(finished=False)
        stopped = (*self._faults, messages.status("interrupted", stage=name))
        partial = self._evidence(stopped)
        result = score(partial, checks.judge(partial), self._means.rubric, "")
        result = msgspec.structs.replace(result, graded=False, score=None)
        evidence.write_atomically(self._folder / report.RESULT, evidence.pretty(result))
        self._publish(result, partial, name)

    def built(self, built: Build) -> None:
        """The build has ended."""
        self._build = built
        self.writer.build(built)

    def played(self, scenes: tuple[Scene, ...]) -> None:
        """The scenes have ended."""
        self._scenes = scenes
        self._run_seconds = time.monotonic() - self._stage_began
        if any(scene.follows_own_clock for scene in scenes):
            self._runtime = msgspec.structs.replace(self._runtime, clock=Clock.REAL_TIME.value)

    def failed(self, fault: FaultError) -> None:
        """Something of ours failed."""
        self._faults = (*self._faults, str(fault))

    def finish(self) -> Result:
        """Close the evidence, judge it as it stands on disk, and write the reports."""
        self._write_manifest(finished=True)
        result = rescore(self._folder, self._means.rubric)
        write_reports(self._folder, result)
        self._publish(result, evidence.read(self._folder / EVIDENCE), "")
        return result

    def _seconds(self) -> Seconds:
        build_seconds = self._build.seconds if self._build else 0.0
        total = time.monotonic() - self._began
        return Seconds(round(build_seconds, 2), round(self._run_seconds, 2), round(total, 2))

    def _evidence(self, faults: tuple[str, ...]) -> Evidence:
        return Evidence(self._facts, self._build, self._scenes, self._runtime, faults, self._seconds(), self._began_at)

    def _write_manifest(self, finished: bool) -> None:
        entries = tuple(entry(scene) for scene in self._scenes)
        self.writer.manifest(self._runtime, self._seconds(), self._faults, entries, finished, self._began_at)


def results_folder(results: Path, name: str) -> Path:
    """Where the result of the submission *name* goes below *results*."""
    return results / (Path(name).name or "submission")

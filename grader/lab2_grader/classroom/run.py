"""Grades a class: looks into the inbox, takes over, hands out, keeps, tries again, sums up."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable
from contextlib import nullcontext, suppress
from datetime import datetime
from pathlib import Path
from typing import Protocol

import msgspec

from lab2_grader import decoding, process, submission
from lab2_grader.classroom import inbox, pool, results, summary, work
from lab2_grader.classroom.cluster import Cluster
from lab2_grader.classroom.pool import StoppedError
from lab2_grader.classroom.records import Entry, Graded, Inbox, Stamp, Task
from lab2_grader.errors import FaultError, RefusedError, UsageError
from lab2_grader.lab import Rubric
from lab2_grader.records import ClassLine, ClassState, ClassSummary, Clock, Record, Result, SubmissionFacts

TRIES_MORE = 2  # for an inconclusive submission, at the end, alone
SUMMARY_EVERY_SECONDS = 20.0
FAULTS = "faults.log"

Perform = Callable[[bytes, Callable[[str], None]], bytes]


class Order(Record, frozen=True):
    """What is to be graded, and how.

    Args:
        inbox: Where the submissions are.
        out: Where the results go.
        rubric: What the checks are worth.
        clock: How the numeric pair's clock is driven.
        ros: Which ROS: `auto`, `sourced` or `wheels`.
        isolation: False to let submissions run with one's own rights.
        jobs: Submissions at once; 0 for what the machine carries.
        before: Deadline for repositories that have none of their own.
        scheduler: Address of a Dask scheduler; empty to grade here.
    """

    inbox: str
    out: str
    rubric: Rubric
    clock: Clock = Clock.TIME_LAPSE
    ros: str = "auto"
    isolation: bool = True
    jobs: int = 0
    before: datetime | None = None
    scheduler: str = ""


class Watcher(Protocol):
    """Is told how a class goes on; called from several threads."""

    def total(self, entries: int, unknown: int) -> None:
        """So many submissions are to be graded, so many things were not understood."""

    def begins(self, name: str, doing: str) -> None:
        """What is being done with the submission *name*."""

    def ended(self, line: ClassLine, *, before: bool) -> None:
        """What became of a submission; *before*: it had been graded in an earlier call."""

    def again(self, names: tuple[str, ...]) -> None:
        """These were inconclusive and are tried once more, one by one."""


def grade_class(order: Order, watch: Watcher) -> ClassSummary:
    """Grade a class; what was graded before and has not changed is not graded again.

    Raises:
        UsageError: There is no such inbox, the results are being written by somebody else, or the cluster does not fit.
        FaultError: Submissions cannot be isolated here, or there is no ROS.
        KeyboardInterrupt: It was interrupted; what was finished is kept, and the next call goes on.
    """
    if not order.inbox:
        raise UsageError("No inbox was named. Name the folder, the download or the table of the class.")
    out = Path(order.out)
    found = inbox.look(Path(order.inbox), out, order.before)
    with results.locked(out):
        if order.scheduler:
            cluster = Cluster(order.scheduler)
            try:
                cluster.check(order.ros, isolation=order.isolation)
                run = _Run(order, out, watch, cluster.perform, cluster.stop)
                return run.all(found, order.jobs or cluster.lanes, None)
            finally:
                cluster.close()
        work.means_of(order.rubric, order.clock, order.ros, isolation=order.isolation)  # raises what is missing
        jobs = order.jobs or pool.default_jobs()
        gate = None if order.jobs else pool.Gate(jobs)
        lanes = jobs if gate is None else jobs * pool.LANES_FOR_EACH_JOB
        return _Run(order, out, watch, work.perform, pool.kill_all).all(found, lanes, gate)


class _Run:
    """One call."""

    def __init__(self, order: Order, out: Path, watch: Watcher, perform: Perform, stop: Callable[[], None]) -> None:
        self._order = order
        self._out = out
        self._watch = watch
        self._perform = perform
        self._stop = stop
        self._lines: dict[str, ClassLine] = {}
        self._attempts: dict[str, int] = {}
        self._lanes: pool.Lanes[Entry, ClassLine]

    def all(self, found: Inbox, lanes: int, gate: pool.Gate | None) -> ClassSummary:
        """Grade every entry, then those that were inconclusive once more and once more, alone."""
        self._unknown = found.unknown
        self._lines = {entry.name: _line(entry, ClassState.WAITING, "not graded yet") for entry in found.entries}
        self._watch.total(len(found.entries), len(found.unknown))
        try:
            self._round(found.entries, lanes, gate)
            for _ in range(TRIES_MORE):
                again = tuple(e for e in found.entries if self._lines[e.name].state is ClassState.WITHHELD)
                if again:
                    self._watch.again(tuple(entry.name for entry in again))
                    self._round(again, 1, None)
        finally:
            self._write_summary()
        return self._summary

    def _round(self, entries: Iterable[Entry], count: int, gate: pool.Gate | None) -> None:
        def step(entry: Entry) -> ClassLine:
            with gate.admission(lanes.stopping) if gate else nullcontext():
                return self._one(entry)

        lanes: pool.Lanes[Entry, ClassLine] = pool.Lanes(count, step)
        self._lanes = lanes
        written = time.monotonic()
        for line in lanes.run(tuple(entries), self._stop):
            self._lines[line.name] = line
            if time.monotonic() - written > SUMMARY_EVERY_SECONDS:
                self._write_summary()
                written = time.monotonic()

    def _write_summary(self) -> None:
        kept = [self._out / line.name for line in self._lines.values() if line.report]
        found = [result for folder in kept if (result := results.result(folder)) is not None]
        self._summary = summary.summarise(self._lines.values(), found, self._order.rubric, self._unknown)
        summary.write(self._out, self._summary)

    # --- one submission, in a lane -----------------------------------------------------------

    def _one(self, entry: Entry) -> ClassLine:
        before = False
        try:
            try:
                line, before = self._graded(entry)
            except RefusedError as error:
                results.discard(self._out, entry.name)
                line = _line(entry, ClassState.REFUSED, str(error))
        except (FaultError, UsageError, OSError) as error:
            self._unless_stopped(error)
            line = _line(entry, ClassState.WITHHELD, str(error))
        except StoppedError:
            raise
        except Exception as error:  # one submission never stops the class
            self._unless_stopped(error)
            self._log(entry.name)
            reason = f"the grader itself failed ({type(error).__name__}); see {FAULTS}"
            line = _line(entry, ClassState.WITHHELD, reason)
        line = msgspec.structs.replace(line, attempts=max(line.attempts, self._attempts.get(entry.name, 0)))
        self._watch.ended(line, before=before)
        return line

    def _unless_stopped(self, error: Exception) -> None:
        """When the class is being stopped, whatever goes wrong goes wrong because of it."""
        if self._lanes.stopping.is_set():
            raise StoppedError from error

    def _doing(self, name: str) -> Callable[[str], None]:
        def doing(text: str) -> None:
            if self._lanes.stopping.is_set():
                raise StoppedError
            self._watch.begins(name, text)

        return doing

    def _graded(self, entry: Entry) -> tuple[ClassLine, bool]:
        """(the line of *entry*, whether it had been graded before)."""
        order, doing = self._order, self._doing(entry.name)
        results.check_free(self._out, entry.name)
        doing("taking it over")
        with process.temporary_directory() as scratch:
            source = inbox.fetch(entry, scratch)
            package = scratch / "package"
            taken = submission.take(source, package, commit=entry.commit or None, before=entry.before)
            facts = msgspec.structs.replace(taken.facts, name=entry.name, source=entry.shown)
            key = results.key_of(facts, order.clock, order.ros, isolation=order.isolation)
            known = self._known(entry, key, facts)
            if known is not None:
                return known, True
            packed = work.pack(package)
        task = Task(facts, packed, order.rubric, order.clock, order.ros, order.isolation, work.code_digest())
        attempts = self._attempts[entry.name] = self._attempts.get(entry.name, 0) + 1
        graded = decoding.from_msgpack(self._perform(msgspec.msgpack.encode(task), doing), Graded)
        if self._lanes.stopping.is_set():
            raise StoppedError
        if not graded.result:
            raise FaultError(graded.fault)
        stamp = Stamp(key, entry.student, entry.keys, entry.shown, entry.note, graded.flags, attempts)
        result = results.keep(self._out, entry.name, graded.result, stamp)
        return summary.line_of(entry.name, result, stamp, self._out / entry.name), False

    def _known(self, entry: Entry, key: str, facts: SubmissionFacts) -> ClassLine | None:
        """The line of a result that is there and up to date."""
        folder = self._out / facts.name
        result: Result | None = results.current(folder, key, self._order.rubric)
        stamp = results.stamp(folder)
        if result is None or stamp is None:
            return None
        now = msgspec.structs.replace(stamp, student=entry.student, keys=entry.keys, shown=entry.shown, note=entry.note)
        if now != stamp:
            results.restamp(folder, now)
        return summary.line_of(entry.name, result, now, folder)

    def _log(self, name: str) -> None:
        told = f"{name}\n{traceback.format_exc()}\n"
        with suppress(OSError), (self._out / FAULTS).open("a", encoding="utf-8", errors="backslashreplace") as file:
            file.write(told)


def _line(entry: Entry, state: ClassState, reason: str) -> ClassLine:
    """A line without a result."""
    return ClassLine(
        name=entry.name,
        student=entry.student,
        keys=entry.keys,
        state=state,
        reason=reason,
        note=entry.note,
        shown=entry.shown,
    )

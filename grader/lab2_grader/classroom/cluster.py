"""The workers of a Dask cluster: submissions go to them as bytes, results come back as bytes; no disk is shared."""

from __future__ import annotations

import contextlib
import time
from concurrent.futures import CancelledError
from typing import Any

import msgspec

from lab2_grader import decoding
from lab2_grader.classroom import work
from lab2_grader.classroom.pool import StoppedError
from lab2_grader.classroom.records import Graded
from lab2_grader.classroom.work import Doing, Version
from lab2_grader.errors import FaultError, UsageError
from lab2_grader.lab import rubric as own_rubric
from lab2_grader.score import rubric_digest

CONNECT_SECONDS = 15
NO_WORKER_SECONDS = 60.0
LOOK_SECONDS = 2.0
WAITING_FOR_EACH_THREAD = 2  # submissions on their way, so that no worker waits for the next


class Cluster:
    """A Dask scheduler with its workers.

    Args:
        address: Of the scheduler, for example `tcp://192.0.2.7:8786`.

    Raises:
        UsageError: Dask is not installed here, or nobody answers at *address*.
    """

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError as error:
            raise UsageError("Dask is not installed here. Run: pip install 'lab2-grader[dask]'") from error
        self._distributed: Any = distributed
        try:
            self._client: Any = self._distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError(f"No Dask scheduler answers at {address}: {error}") from error
        self._stopping = False

    def check(self, wanted_ros: str, *, isolation: bool) -> None:
        """Compare every worker with this machine: grader, facts, rubric, ROS, isolation.

        A rubric of one's own travels with each submission, so that only the lab's has to be compared.

        Raises:
            UsageError: There are no workers, or one would grade differently; the text names it.
        """
        answers: dict[str, bytes] = self._client.run(work.version, wanted_ros, on_error="return")
        if not answers:
            raise UsageError("The cluster has no workers yet. Start one: dask worker <address of the scheduler>")
        own_digest = rubric_digest(own_rubric())
        for worker, answer in answers.items():
            if not isinstance(answer, bytes):
                raise UsageError(f"The worker {worker} cannot grade: {answer}")
            found = decoding.from_json(answer, Version)
            for what, theirs, ours in (
                ("grader", found.code, work.code_digest()),
                ("rubric", found.rubric, own_digest),
            ):
                if theirs != ours:
                    raise UsageError(
                        f"The worker {worker} has another {what} than this machine ({found.grader}, {theirs[:12]} "
                        f"instead of {ours[:12]}). Install the same version everywhere."
                    )
            if found.isolation and isolation:
                raise UsageError(
                    f"The worker {worker} cannot isolate submissions: {found.isolation}. On it, run: {found.mend}"
                )
            if not found.ros.startswith(("wheels ", "sourced ")):
                raise UsageError(f"The worker {worker} has no ROS: {found.ros}")
        # The submissions of a worker that is lost are done once more, not four times: one of them may be why.
        self._client.run_on_scheduler(_redo_once)

    @property
    def lanes(self) -> int:
        """How many submissions to have on their way at once."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
        return max(1, WAITING_FOR_EACH_THREAD * sum(int(worker["nthreads"]) for worker in workers))

    def perform(self, task: bytes, doing: Doing) -> bytes:
        """Let a worker grade *task*: `work.perform` elsewhere.

        Raises:
            FaultError: The scheduler is gone, or there have been no workers for a minute.
            StoppedError: The class was interrupted.
        """
        doing("on the cluster")
        future = self._client.submit(work.perform, task, pure=False)
        workers_seen = time.monotonic()
        try:
            while True:
                try:
                    graded: bytes = future.result(timeout=LOOK_SECONDS)
                except (TimeoutError, self._distributed.TimeoutError):
                    if self._client.scheduler_info(n_workers=-1)["workers"]:
                        workers_seen = time.monotonic()
                    elif time.monotonic() - workers_seen > NO_WORKER_SECONDS:
                        raise FaultError("The cluster has had no workers for a minute.") from None
                else:
                    return graded
        except self._distributed.KilledWorker as error:
            lost = Graded(b"", fault=f"Two workers were lost while they graded it ({error}).")
            return msgspec.msgpack.encode(lost)
        except (CancelledError, OSError) as error:
            if self._stopping:
                raise StoppedError from error
            raise FaultError(f"The cluster was lost: {error}.") from error
        finally:
            with contextlib.suppress(Exception):
                future.release()

    def stop(self) -> None:
        """Give up what is on its way."""
        if not self._stopping:
            self._stopping = True
            with contextlib.suppress(OSError, TimeoutError):
                self._client.close(timeout=5)

    close = stop


def _redo_once(dask_scheduler: Any = None) -> None:
    """Run on the scheduler, which passes itself."""
    dask_scheduler.allowed_failures = 1

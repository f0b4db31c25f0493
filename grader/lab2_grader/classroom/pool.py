"""Lanes that work through a class side by side, as many as the machine carries, and stop at once when told to."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Generic, TypeVar

from lab2_grader import process_table

MEMORY_EACH = 900_000_000  # bytes that one submission may need at its height: eight ROS processes and a build
LANES_FOR_EACH_JOB = 4  # submissions at once that wait in real time do not need a core each
IDLE_ENOUGH = 0.25  # of the machine, for one more than the jobs
EXTRA_EVERY_SECONDS = 2.0  # by then the last one that was let in shows in how busy the machine is
LOOK_SECONDS = 0.25
KEPT = "lab2-cleaner"  # removes a temporary directory: not to be killed with the rest

Item = TypeVar("Item")
Made = TypeVar("Made")


class StoppedError(Exception):
    """The class was interrupted; what was being graded is given up."""


def cores() -> int:
    """Processors that this process may use, those of its container's quota at most."""
    found = len(os.sched_getaffinity(0))
    with contextlib.suppress(OSError, ValueError):
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text().split()[:2]
        found = min(found, max(1, round(int(quota) / int(period))))
    return found


def memory_free() -> int:
    """Bytes of memory that can be had without swapping, those of the container's limit at most."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    free = next((int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:")), 2 * MEMORY_EACH)
    with contextlib.suppress(OSError, ValueError):
        limit = int(Path("/sys/fs/cgroup/memory.max").read_text())
        free = min(free, limit - int(Path("/sys/fs/cgroup/memory.current").read_text()))
    return free


def default_jobs() -> int:
    """Submissions graded side by side: one more than the cores, for each waits now and then; fewer where memory is short."""
    return max(1, min(cores() + 1, memory_free() // MEMORY_EACH))


class Gate:
    """Lets *jobs* submissions work at a time, and more while the machine is idle all the same.

    A submission that has to be watched in real time waits for a minute and hardly computes: others go on beside it.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._inside = 0
        self._lock = threading.Lock()
        self._busy, self._total = ticks()
        self._looked = time.monotonic()

    @contextlib.contextmanager
    def admission(self, stopping: threading.Event) -> Iterator[None]:
        """Wait until there is room, work, and make room.

        Raises:
            StoppedError: The class was interrupted meanwhile.
        """
        while not self._enter():
            if stopping.wait(LOOK_SECONDS):
                raise StoppedError
        try:
            yield
        finally:
            with self._lock:
                self._inside -= 1

    def _enter(self) -> bool:
        with self._lock:
            allowed = self._inside < self._jobs or self._has_room()
            self._inside += allowed
            return allowed

    def _has_room(self) -> bool:
        now = time.monotonic()
        if now - self._looked < EXTRA_EVERY_SECONDS:
            return False
        busy, total = ticks()
        idle = 1 - (busy - self._busy) / max(1, total - self._total)
        self._busy, self._total, self._looked = busy, total, now
        return idle > IDLE_ENOUGH and memory_free() > 2 * MEMORY_EACH


def ticks() -> tuple[int, int]:
    """(busy, all) processor time of the machine since it started, in the kernel's ticks."""
    values = [int(value) for value in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    return sum(values) - values[3] - values[4], sum(values)


class Lanes(Generic[Item, Made]):
    """Threads that take one item after the other.

    Each thread outlives whatever it starts: bubblewrap kills what it confines when the thread that started it ends.

    Args:
        count: How many.
        step: What is done with an item; it must ask `stopping` now and then and raise `StoppedError`.
    """

    def __init__(self, count: int, step: Callable[[Item], Made]) -> None:
        self._count = count
        self._step = step
        self.stopping = threading.Event()

    def run(self, items: Sequence[Item], stop: Callable[[], None]) -> Iterator[Made]:
        """What becomes of each item, as it comes.

        Args:
            items: What to do, in this order.
            stop: Called again and again, when the caller gives up, until every lane has stopped.
        """
        todo: queue.SimpleQueue[Item] = queue.SimpleQueue()
        done: queue.SimpleQueue[tuple[Made | None, BaseException | None]] = queue.SimpleQueue()
        for item in items:
            todo.put(item)

        def lane() -> None:
            while not self.stopping.is_set():
                try:
                    item = todo.get_nowait()
                except queue.Empty:
                    return
                try:
                    done.put((self._step(item), None))
                except BaseException as error:  # handed over to the caller's thread
                    done.put((None, error))

        threads = [threading.Thread(target=lane, name=f"lane-{n}") for n in range(min(self._count, len(items)))]
        try:
            for thread in threads:
                thread.start()
            for _ in items:
                made, error = done.get()
                if error is not None:
                    raise error
                assert made is not None
                yield made
        finally:
            self.stopping.set()
            while any(thread.is_alive() for thread in threads):
                stop()
                for thread in threads:
                    thread.join(0.05)
            self.stopping.clear()


def kill_all() -> None:
    """Kill everything that this process has started, directly or not, but for what tidies up behind it."""
    for info in process_table.tree(os.getpid()):
        if info.pid != os.getpid() and KEPT not in info.command:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(info.pid, signal.SIGKILL)

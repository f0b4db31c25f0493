"""The machine's process table (`proc(5)`): who descends from whom, what each uses, and signals that meet no other."""

from __future__ import annotations

import contextlib
import functools
import os
import resource
import signal
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

PAGE_BYTES = resource.getpagesize()
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")


class ProcessInfo:
    """A line of the process table: `pid`, `parent` and `command` (its arguments).

    `inside_pid` is the number by which it knows itself, in its own pid namespace.
    """

    __slots__ = ("command", "inside_pid", "parent", "pid")

    def __init__(self, pid: int, inside_pid: int, parent: int, command: tuple[str, ...]) -> None:
        self.pid = pid
        self.inside_pid = inside_pid
        self.parent = parent
        self.command = command


class Stat:
    """What the kernel counts of one process."""

    __slots__ = ("_fields", "parent")

    def __init__(self, fields: list[bytes]) -> None:
        self.parent = int(fields[1])
        self._fields = fields

    @property
    def cpu_seconds(self) -> float:
        """Processor time, with that of its children that have ended."""
        return sum(map(int, self._fields[11:15])) / CLOCK_TICKS

    @property
    def threads(self) -> int:
        """How many threads it has."""
        return int(self._fields[17])

    @property
    def resident(self) -> int:
        """Memory in use, in bytes."""
        return int(self._fields[21]) * PAGE_BYTES

    @property
    def started(self) -> int:
        """When, in ticks since the machine was: tells it from another that is given its number later."""
        return int(self._fields[19])


def stat(pid: int) -> Stat | None:
    """What is counted of *pid*, or None when it is gone or a zombie."""
    try:  # every scene and every build asks this of every process ten times a second: no objects around three calls
        descriptor = os.open(f"/proc/{pid}/stat", os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        text = os.read(descriptor, 1_024)
    except OSError:
        return None
    finally:
        os.close(descriptor)
    fields = text[text.rindex(b")") + 2 :].split()
    if fields[0] in (b"Z", b"X"):
        return None
    return Stat(fields)


def descendants(root: int) -> dict[int, Stat]:
    """*root* and all its living descendants, with what `stat` says of each."""
    table: dict[int, Stat] = {}
    children: dict[int, list[int]] = {}
    for name in os.listdir("/proc"):
        if name[0] in "123456789" and (found := stat(int(name))) is not None:
            table[int(name)] = found
            children.setdefault(found.parent, []).append(int(name))
    tree: dict[int, Stat] = {}
    pending = [root]
    while pending:
        pid = pending.pop()
        if pid in table and pid not in tree:
            tree[pid] = table[pid]
        pending.extend(children.pop(pid, ()))
    return tree


@functools.cache
def _lists_children() -> bool:
    """Whether the kernel lists the children of a thread (`CONFIG_PROC_CHILDREN`)."""
    return Path(f"/proc/self/task/{threading.get_native_id()}/children").exists()


def walk(root: int) -> dict[int, Stat]:
    """As `descendants`, from child to child: quicker, but a child may be passed over while a sibling of it ends."""
    if not _lists_children():
        return descendants(root)
    tree: dict[int, Stat] = {}
    pending = [root]
    while pending:
        pid = pending.pop()
        if pid in tree or (found := stat(pid)) is None:
            continue
        tree[pid] = found
        with contextlib.suppress(OSError):
            for thread in os.listdir(f"/proc/{pid}/task"):
                with open(f"/proc/{pid}/task/{thread}/children", "rb") as children:  # noqa: PTH123
                    pending += map(int, children.read().split())
    return tree


def alive(pid: int) -> bool:
    """Whether *pid* is a living process."""
    return stat(pid) is not None


def signal_same(pid: int, number: signal.Signals, seen: Stat) -> None:
    """Signal *pid*, if it still is the process that was *seen*: numbers are given again, here and on busy machines soon."""
    try:
        descriptor = os.pidfd_open(pid)
    except OSError:
        return
    try:
        now = stat(pid)
        if now is not None and now.started == seen.started:
            signal.pidfd_send_signal(descriptor, number)
    except OSError:
        pass
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def held(pids: Iterable[int]) -> Iterator[None]:
    """Keep the processes *pids* from running until the block ends."""
    seen = [(pid, found) for pid in pids if (found := stat(pid)) is not None]
    try:
        for pid, found in seen:
            signal_same(pid, signal.SIGSTOP, found)
        yield
    finally:
        for pid, found in seen:
            signal_same(pid, signal.SIGCONT, found)


def tree(root: int) -> tuple[ProcessInfo, ...]:
    """The living processes below and including *root*, by pid, each with its arguments."""
    found = []
    for pid, counted in sorted(walk(root).items()):
        try:
            raw = Path(f"/proc/{pid}/cmdline").read_bytes()
            status = Path(f"/proc/{pid}/status").read_bytes()
        except OSError:
            continue
        command = tuple(part.decode(errors="replace") for part in raw.rstrip(b"\0").split(b"\0"))
        numbers = next((line for line in status.splitlines() if line.startswith(b"NSpid:")), b"").split()
        inside = int(numbers[-1]) if len(numbers) > 1 else pid
        found.append(ProcessInfo(pid, inside, counted.parent, command))
    return tuple(found)


def busy(pids: Iterable[int]) -> bool:
    """Whether a thread of one of the processes *pids* runs, or waits for a processor or a disk."""
    for pid in pids:
        with contextlib.suppress(OSError):
            for thread in Path(f"/proc/{pid}/task").iterdir():
                text = (thread / "stat").read_bytes()
                if text[text.rindex(b")") + 2 :][:1] in (b"R", b"D"):
                    return True
    return False

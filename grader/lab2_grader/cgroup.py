"""Control groups: limits that the kernel keeps for a whole tree of processes, where this machine lets us have them.

A group is made below the one that this process is in itself, so that nothing of the machine's own order is changed:
version 1 as root, version 2 wherever an ancestor that we may write to hands out `memory` and `pids` (a user's session
under systemd, a container that was given its own). Elsewhere there is none, and `process.py` watches the tree instead.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

from lab2_grader.records import Limits, Record

NEEDED = ("memory", "pids")
WANTED = (*NEEDED, "cpuacct")
MOUNTS = Path("/proc/self/mounts")
OWN = Path("/proc/self/cgroup")
REMOVE_SECONDS = 15.0  # on an overloaded machine the killed take their time to go
PREFIX = "lab2-"

# The process puts itself into the group before it becomes the program, so that nothing of it is ever outside.
ENTER = (
    'n=$1; shift; while [ "$n" -gt 0 ]; do echo $$ > "$1/cgroup.procs" || exit 125; shift; n=$((n-1)); done; exec "$@"'
)


class Base(Record, frozen=True):
    """Where groups can be made.

    Args:
        version: 1 or 2.
        folders: The folder of each controller; of version 2 there is one for all.
    """

    version: int
    folders: tuple[tuple[str, str], ...]

    def paths(self) -> tuple[str, ...]:
        """The folders, each once."""
        return tuple(dict.fromkeys(path for _, path in self.folders))


def candidates() -> Iterator[Base]:
    """Where groups might be made here; whether a process can really be put there is for the caller to try."""
    for find in (_version_1, _version_2):
        with contextlib.suppress(OSError, ValueError):
            if (found := find()) is not None:
                yield found


def _mounted() -> Iterator[tuple[str, str, str]]:
    """(type, mount point, options) of what is mounted as a control group."""
    for line in MOUNTS.read_text().splitlines():
        _, point, kind, options, *_ = line.split(" ")
        if kind in ("cgroup", "cgroup2"):
            yield kind, point.replace("\\040", " "), options


def _own_groups() -> dict[str, str]:
    """The path of our own group by controller; version 2 under the empty name.

    Of an observer, which is in a group that the grader made, it is the one that the grader is in: groups stand side by
    side, so that what a submission uses is not the observer's.
    """
    groups: dict[str, str] = {}
    for line in OWN.read_text().splitlines():
        _, names, path = line.split(":", 2)
        above, _, last = path.rpartition("/")
        groups |= dict.fromkeys(names.split(","), above or "/" if last.startswith(PREFIX) else path)
    return groups


def _version_1() -> Base | None:
    own = _own_groups()
    folders: dict[str, str] = {}
    for kind, point, options in _mounted():
        for name in WANTED:
            if kind == "cgroup" and name in options.split(",") and name in own:
                inside = Path(point, own[name].lstrip("/"))
                folders[name] = str(inside if inside.is_dir() else Path(point))
    return Base(1, tuple(folders.items())) if all(name in folders for name in NEEDED) else None


def _version_2() -> Base | None:
    own = _own_groups().get("")
    point = next((Path(point) for kind, point, _ in _mounted() if kind == "cgroup2"), None)
    if own is None or point is None:
        return None
    inside = point / own.lstrip("/")
    for folder in (inside, *inside.parents):
        if not folder.is_relative_to(point):
            return None
        with contextlib.suppress(OSError):
            handed_out = (folder / "cgroup.subtree_control").read_text().split()
            if all(name in handed_out for name in NEEDED) and os.access(folder / "cgroup.procs", os.W_OK):
                return Base(2, (("", str(folder)),))
    return None


class Group:
    """One group: made, entered by a program, watched, emptied and removed.

    Args:
        where: Below what.
        name: Its name; begins with `PREFIX`.
    """

    def __init__(self, where: Base, name: str) -> None:
        self._version = where.version
        self._folders = {controller: Path(path, name) for controller, path in where.folders}
        self._limits = Limits(seconds=0)

    def _folder(self, controller: str) -> Path:
        return self._folders[controller if self._version == 1 else ""]

    def make(self, limits: Limits) -> None:
        """Make it, with the processes and the memory of *limits*.

        Raises:
            OSError: The kernel does not let us.
        """
        self._limits = limits
        for folder in self._folders.values():
            folder.mkdir(exist_ok=True)
        if limits.processes:
            (self._folder("pids") / "pids.max").write_text(str(limits.processes))
        if limits.memory_bytes:
            memory = self._folder("memory")
            name = "memory.limit_in_bytes" if self._version == 1 else "memory.max"
            (memory / name).write_text(str(limits.memory_bytes))
            with contextlib.suppress(OSError):  # where there is no swap there is no such file
                swap = (
                    ("memory.memsw.limit_in_bytes", limits.memory_bytes)
                    if self._version == 1
                    else ("memory.swap.max", 0)
                )
                (memory / swap[0]).write_text(str(swap[1]))

    def wrap(self, argv: tuple[str, ...]) -> tuple[str, ...]:
        """*argv* with the entry into this group before it."""
        folders = [str(folder) for folder in dict.fromkeys(self._folders.values())]
        return ("sh", "-c", ENTER, "enter", str(len(folders)), *folders, *argv)

    def struck(self) -> str:
        """Which limit the kernel had to enforce so far: `memory`, `processes`, or empty."""
        control = "memory.oom_control" if self._version == 1 else "memory.events"
        if self._limits.memory_bytes and _count(self._folder("memory") / control, "oom_kill"):
            return "memory"
        if self._limits.processes and _count(self._folder("pids") / "pids.events", "max"):
            return "processes"
        return ""

    def cpu_seconds(self) -> float:
        """Time on processors that the whole tree has used so far, also of those that have ended."""
        with contextlib.suppress(OSError, ValueError):
            if self._version == 2:
                return _count(self._folder("cpu") / "cpu.stat", "usage_usec") / 1e6
            if "cpuacct" in self._folders:
                return int((self._folder("cpuacct") / "cpuacct.usage").read_text()) / 1e9
        return 0.0

    def kill(self) -> None:
        """SIGKILL to all that is in it; nothing in it can start anything new meanwhile."""
        folder = self._folder("pids")
        with contextlib.suppress(OSError):
            (folder / "pids.max").write_text("0")
        with contextlib.suppress(OSError):
            (folder / "cgroup.kill").write_text("1")
        for pid in self._pids(folder):
            self._kill(folder, pid)

    def _kill(self, folder: Path, pid: int) -> None:
        """SIGKILL to *pid*, if it still is in the group once it is held: its number may have been given to another."""
        try:
            descriptor = os.pidfd_open(pid)
        except OSError:
            return
        try:
            if pid in self._pids(folder):
                signal.pidfd_send_signal(descriptor, signal.SIGKILL)
        except OSError:
            pass
        finally:
            os.close(descriptor)

    @staticmethod
    def _pids(folder: Path) -> list[int]:
        try:
            return [int(line) for line in (folder / "cgroup.procs").read_text().split()]
        except OSError:
            return []

    def remove(self) -> None:
        """Kill what is left in it and remove it; a group that is gone already does not mind."""
        deadline = time.monotonic() + REMOVE_SECONDS
        left = list(dict.fromkeys(self._folders.values()))
        while left and time.monotonic() < deadline:
            self.kill()
            left = [folder for folder in left if not _removed(folder)]
            if left:
                time.sleep(0.005)


def _removed(folder: Path) -> bool:
    try:
        folder.rmdir()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return True


def _count(path: Path, name: str) -> int:
    try:
        lines = path.read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.split()[:1] == [name]), 0)


def sweep(where: Base, beginning: str) -> None:
    """Remove the groups whose names begin so: those of a process that was killed before it could itself."""
    names = {path.name for folder in where.paths() for path in Path(folder).glob(f"{beginning}*")}
    for name in names:
        Group(where, name).remove()

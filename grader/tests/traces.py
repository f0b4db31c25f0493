"""What a run of the grader could leave behind on this machine: processes, mounts, sockets, files and control groups."""

from __future__ import annotations

import os
import time
from pathlib import Path

from lab2_grader import cgroup, process

GONE_SECONDS = 1.0  # a second later nothing may be left
MARK = process.MARK.encode() + b"="


def processes(run: str = "") -> list[str]:
    """Living processes that carry the mark of a run of the grader; *run* is the beginning of its name."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            variables = (entry / "environ").read_bytes().split(b"\0")
            state = (entry / "stat").read_text().rsplit(")", 1)[1].split()[0]
            command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if state not in "ZX" and any(variable.startswith(MARK + run.encode()) for variable in variables):
            found.append(f"{entry.name}: {command[:200]}")
    return found


def processes_naming(path: str) -> list[str]:
    """Living processes that have *path* in their arguments or stand below it."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                where = os.readlink(entry / "cwd")
            except OSError:
                continue
            if path in command or where.startswith(path):
                found.append(f"{entry.name}: {command[:200]}")
    return found


def files(temporary: Path) -> list[str]:
    """What is in the folder of temporary files, in shared memory, and among the control groups."""
    base = process.control_groups()
    groups = [path for folder in (base.paths() if base else ()) for path in Path(folder).glob(f"{cgroup.PREFIX}*")]
    own = [path for path in groups if path.name.startswith(f"{cgroup.PREFIX}{os.getpid()}.")]
    return sorted(str(path) for path in [*temporary.iterdir(), *own])


def mounts() -> list[str]:
    """What is mounted."""
    return Path("/proc/self/mounts").read_text().splitlines()


def soon_empty(look: object, seconds: float = GONE_SECONDS) -> list[str]:
    """What *look* still finds after at most *seconds*; it is asked again until it finds nothing."""
    deadline = time.monotonic() + seconds
    while True:
        left: list[str] = look()  # type: ignore[operator]
        if not left or time.monotonic() > deadline:
            return left
        time.sleep(0.02)

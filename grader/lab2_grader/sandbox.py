"""Wraps a request in bubblewrap, so that what it runs sees little and reaches nothing.

Two walls, one inside the other (DESIGN section 6). `private_network` gives the grader's own observer a network with
nothing but a loopback. `confine` puts a submission's processes into namespaces of their own, with a read-only system,
private scratch space, and none of the grader's files but those that ROS needs. Without bubblewrap both return the
request as it is, and `protections_off` says what that leaves open.
"""

from __future__ import annotations

import functools
import os
import platform
import shutil
import sys
from pathlib import Path

import msgspec

from lab2_grader import lab, process
from lab2_grader.errors import FaultError
from lab2_grader.records import Limits, Record, Request

HOME = "/home/student"
WORKSPACE = "/ws"

# The first thing that happens inside: without it a failure was that of the walls, never of what stands within.
ANNOUNCEMENT = "[lab2-grader] inside"
ANNOUNCE = """
[ -e "$1" ] || command -v "$1" >/dev/null || { echo "$1 is not found inside it" >&2; exit 127; }
shift
printf "%s\\n" "$0" >&2
exec "$@"
"""

SYSTEM_FILES = (
    "/etc/alternatives",
    "/etc/ld.so.cache",
    "/etc/ld.so.conf",
    "/etc/ld.so.conf.d",
    "/etc/localtime",
    "/etc/nsswitch.conf",
    "/etc/passwd",
    "/etc/group",
)


class Isolation(Record, frozen=True):
    """Whether submissions are isolated; `reason` says why not, `mend` which command changes that."""

    on: bool
    reason: str = ""
    mend: str = ""

    @property
    def name(self) -> str:
        """As `result.json` names it."""
        return "bubblewrap" if self.on else "off"


class Mount(Record, frozen=True):
    """A host path shown read-only inside; `inside` is empty when it is shown under its own name."""

    host: str
    inside: str = ""


@functools.cache
def probe() -> Isolation:
    """Whether bubblewrap is here and the kernel lets it do what both walls need; tried, not guessed."""
    if shutil.which("bwrap") is None:
        return Isolation(False, "bubblewrap is not installed", "sudo apt-get install bubblewrap")
    nested = Request(("true",), process.environment("PATH"), "/", Limits(seconds=10))
    try:
        outcome = process.run(private_network(confine(nested, (), Isolation(True)), Isolation(True)))
        said = outcome.stderr.decode(errors="replace").strip()
        works, why = outcome.code == 0, said.splitlines()[-1] if said else f"exit code {outcome.code}"
    except FaultError as fault:
        works, why = False, str(fault)
    if works:
        return Isolation(True)
    mend = "sudo sysctl -w kernel.apparmor_restrict_unprivileged_userns=0"
    return Isolation(False, f"bubblewrap does not work here ({why.rstrip('.')})", mend)


def private_network(request: Request, isolation: Isolation) -> Request:
    """The outer wall: *request* sees the whole system read-only and a network of its own with only a loopback."""
    if not isolation.on:
        return request
    argv = (
        *("bwrap", "--die-with-parent", "--new-session", "--unshare-net", "--unshare-ipc"),
        # The machine's own /proc, writable: the kernel lets the inner wall mount a /proc only where this one is
        # untouched, and the inner wall's user map is written through it. Only the observer runs here.
        *("--ro-bind", "/", "/", "--bind", "/proc", "/proc", "--dev", "/dev"),
        *_control_groups(),
        *("--chdir", request.cwd, "--", *request.argv),
    )
    return msgspec.structs.replace(request, argv=argv, cwd="/")


def _control_groups() -> tuple[str, ...]:
    """What lets the observer keep the limits of what it starts; the inner wall shows nothing of it."""
    base = process.control_groups()
    return tuple(part for path in base.paths() for part in ("--bind", path, path)) if base else ()


def confine(
    request: Request,
    mounts: tuple[Mount, ...],
    isolation: Isolation,
    network: bool = True,
    workspace_bytes: int = 0,
    needs: str = process.PYTHON,
) -> Request:
    """The inner wall: *request* sees the system's programs, *mounts* and private scratch space, and nothing else.

    Args:
        request: What the submission runs; its `cwd` must exist inside.
        mounts: What it may read besides the system.
        isolation: Whether walls can be had.
        network: Whether it shares the network of whoever starts it (the observer's private one).
        workspace_bytes: Size of a writable `WORKSPACE` of its own; 0 for none.
        needs: The program or file of ours that must be found inside; that it is not is a fault of the machine.
    """
    if not isolation.on:
        return request
    scratch = str(lab.limits().resources.scratch_bytes)
    argv = [
        *("bwrap", "--die-with-parent", "--new-session", "--unshare-user", "--unshare-pid", "--unshare-ipc"),
        *("--unshare-uts", "--unshare-cgroup-try", "--hostname", "lab2", "--cap-drop", "ALL"),
        *_no_further_namespaces(),
        # A submission that is run by root has root's user id outside, which is enough to write below /proc/sys.
        *("--ro-bind", "/usr", "/usr", "--proc", "/proc", "--remount-ro", "/proc", "--dev", "/dev"),
        *("--size", scratch, "--tmpfs", "/dev/shm", "--size", scratch, "--tmpfs", "/tmp"),
        *("--size", scratch, "--tmpfs", HOME, "--remount-ro", "/dev"),
    ]
    if not network:
        argv.append("--unshare-net")
    if workspace_bytes:
        argv += ["--size", str(workspace_bytes), "--tmpfs", WORKSPACE]
    for name in ("/bin", "/sbin", "/lib", "/lib32", "/lib64"):
        if Path(name).is_symlink():
            argv += ["--symlink", str(Path(name).readlink()), name]
        elif Path(name).is_dir():
            argv += ["--ro-bind", name, name]
    for name in SYSTEM_FILES:
        argv += ["--ro-bind-try", name, name]
    hidden = own_files()
    # What is shown of a hidden folder all the same: the launcher, of a grader that pip installed.
    shown = [mount for mount in mounts if any(Path(mount.host).is_relative_to(path) for path in hidden)]
    for mount in (*interpreter_mounts(), *(mount for mount in mounts if mount not in shown)):
        argv += ["--ro-bind", mount.host, mount.inside or mount.host]
    for path in hidden:
        argv += ["--tmpfs", path]
    for mount in shown:
        argv += ["--ro-bind", mount.host, mount.inside or mount.host]
    for path in hidden:
        argv += ["--remount-ro", path]
    argv += ["--remount-ro", "/", "--chdir", request.cwd, "--"]
    argv += ["sh", "-c", ANNOUNCE, ANNOUNCEMENT, needs, *_few_processes(request.limits), *request.argv]
    return msgspec.structs.replace(request, argv=tuple(argv), cwd="/", announces=ANNOUNCEMENT)


@functools.cache
def _no_further_namespaces() -> tuple[str, ...]:
    """Keeps a submission from making namespaces of its own, where this bubblewrap can (0.8 and later)."""
    outcome = process.run(Request(("bwrap", "--help"), process.environment("PATH"), "/", Limits(seconds=10)))
    return ("--disable-userns",) if b"--disable-userns" in outcome.stdout + outcome.stderr else ()


def _few_processes(limits: Limits) -> tuple[str, ...]:
    """The kernel's own limit of processes for an ordinary user without control groups.

    Since Linux 5.14 it counts those of one user namespace apart, so that it is this submission's alone. It is set a
    little above the limit, so that whoever watches the tree sees it struck. For root it does not count.
    """
    release = tuple(int(part) for part in platform.release().split("-")[0].split(".")[:2] if part.isdigit())
    if not limits.processes or process.control_groups() or os.geteuid() == 0 or release < (5, 14):
        return ()
    return ("prlimit", f"--nproc={limits.processes + 16}", "--")


def limits_kept_by() -> str:
    """By what means memory and processes of a submission are limited here, as a sentence for people."""
    base = process.control_groups()
    if base:
        return f"Memory, processors and processes of a submission are limited by the kernel (control groups, version {base.version})."
    processes = (
        "the kernel (a limit of its user namespace)"
        if _few_processes(Limits(0, processes=1))
        else "the grader, which looks ten times a second"
    )
    return (
        f"No control group can be made here: processes are limited by {processes}, memory and processors by the grader, "
        "which looks ten times a second and does not see files in memory."
    )


@functools.cache
def interpreter_mounts() -> tuple[Mount, ...]:
    """The running Python, when it stands outside /usr (a virtual environment, pyenv)."""
    prefixes = {sys.prefix, sys.base_prefix, os.path.realpath(sys.base_prefix)}
    return tuple(Mount(prefix) for prefix in sorted(prefixes) if not Path(prefix).is_relative_to("/usr"))


@functools.cache
def own_files() -> tuple[str, ...]:
    """The grader's own package, where it is installed inside a prefix that submissions are shown."""
    package = Path(__file__).parent
    shown = any(package.is_relative_to(mount.host) for mount in interpreter_mounts())
    return (str(package),) if shown or package.is_relative_to("/usr") else ()


def protections_off(isolation: Isolation) -> str:
    """What is not protected without the walls, as a sentence; empty when they stand."""
    if isolation.on:
        return ""
    return (
        f"Isolation is off: {isolation.reason}. The submission ran with your rights: it could read your files, "
        "use your network and change this result. Grade only your own code like this."
    )

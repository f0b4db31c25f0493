"""Builds a submission with `colcon build` in a throwaway workspace and says what was installed.

The workspace lives in the sandbox and is gone with it; what colcon installed comes out as an archive on standard
output, and is unpacked by rule (no links out, bounded size). Building runs the submission's `setup.py`, so it is as
hostile as everything else.
"""

from __future__ import annotations

import ast
import configparser
import errno
import functools
import io
import platform
import shutil
import sys
import tarfile
from pathlib import Path, PurePosixPath

from lab2_grader import lab, process, sandbox
from lab2_grader.errors import FaultError
from lab2_grader.records import Build, EndedBy, EntryPoint, Outcome, Request, Submission
from lab2_grader.ros import Ros
from lab2_grader.tar import take_out
from lab2_grader.text import clean

LOG_BYTES = 20_000  # the end of what the build printed is kept
ENTRY_POINTS_BYTES = 100_000
LIMITS_IN_LOG = {"No space left on device": "disk", "File too large": "file", "File size limit exceeded": "file"}
OURS = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EMFILE, errno.ENFILE, errno.EROFS)  # no archive is at fault
PACKAGE_INSIDE = "/package"
LAUNCH_SUFFIXES = (".py", ".xml", ".yaml", ".yml")

# The whole build: a clean workspace with nothing but the package, built without symlinks, then handed out.
SCRIPT = """
set -e
mkdir -p "$1/src" && cd "$1"
cp -R "$2" "src/$3"
set +e
colcon build --packages-select "$3" --event-handlers console_direct+ console_cohesion- 1>&2
code=$?
[ -d install ] && tar -cf - install
exit $code
"""

# A package that builds wherever colcon works: when a submission does not build, it says whose fault that is.
PROOF = "build_proof"


def build(submission: Submission, into: Path, ros: Ros, isolation: sandbox.Isolation) -> Build:
    """Build *submission* and unpack what was installed below *into*.

    Raises:
        FaultError: colcon is not there or does not build anything, or the machine failed: its disk is full, say.
    """
    package = lab.specification().package
    outcome, printed = _colcon(submission.package_dir, package, into, ros, isolation)
    lines = printed.end.decode(errors="replace").splitlines()
    log = "\n".join(clean(line, 2_000) for line in lines)
    limit = outcome.limit or printed.limit or (_unpack(printed.archive, into) if printed.archive else "")
    if not limit and outcome.code != 0:
        limit = next((name for text, name in LIMITS_IN_LOG.items() if text in log), "")
        if limit and not isolation.on:  # there is no disk of its own that it could have filled
            _prove(ros, isolation)
    ended_by = EndedBy.LIMIT if limit and outcome.ended_by is EndedBy.ITSELF else outcome.ended_by
    prefix = into / "install" / package
    ok = outcome.code == 0 and not limit and prefix.is_dir()
    if outcome.code != 0 and ended_by is EndedBy.ITSELF:
        _prove(ros, isolation)
    return Build(
        ok=ok,
        code=outcome.code,
        ended_by=ended_by,
        limit=limit,
        seconds=outcome.seconds,
        log=log,
        executables=_names(prefix / "lib" / package) if ok else (),
        entry_points=_entry_points(prefix) if ok else (),
        modules=_modules(prefix, package) if ok else (),
        launch_files=_launch_files(prefix / "share" / package) if ok else (),
        dangling=_dangling(prefix, package) if ok else (),
        python=platform.python_version(),
    )


def _colcon(
    package_dir: str, package: str, into: Path, ros: Ros, isolation: sandbox.Isolation
) -> tuple[Outcome, _Printed]:
    """Build the package in *package_dir* where it does no harm (below *into* when there are no walls)."""
    limits = lab.limits()
    workspace, source = (sandbox.WORKSPACE, PACKAGE_INSIDE) if isolation.on else (str(into), package_dir)
    environment = ros.environment(sandbox.HOME if isolation.on else str(into))
    if shutil.which("colcon", path=dict(environment)["PATH"]) is None:
        raise FaultError(
            "colcon is not installed where the grader looks for it. Run `make setup`, or "
            "`pip install colcon-common-extensions 'setuptools<80'` beside the grader.",
            "build",
        )
    request = Request(
        argv=("sh", "-c", SCRIPT, "build", workspace, source, package),
        env=environment,
        cwd="/",
        limits=limits.resources.limits(limits.build.seconds, limits.build.install_bytes + limits.build.output_bytes),
    )
    mounts = (sandbox.Mount(package_dir, PACKAGE_INSIDE), *(sandbox.Mount(path) for path in ros.reads()))
    confined = sandbox.confine(
        request, mounts, isolation, network=False, workspace_bytes=limits.build.disk_bytes, needs="colcon"
    )
    printed = _Printed(limits.build.install_bytes)
    return process.run(confined, printed), printed


@functools.cache
def _prove(ros: Ros, isolation: sandbox.Isolation) -> None:
    """Build a package that is known to build, once with each ROS: a submission pays only for what is its own.

    Raises:
        FaultError: It does not build either.
    """
    with process.temporary_directory() as name:
        outcome, printed = _colcon(str(Path(__file__).with_name(PROOF)), PROOF, Path(name), ros, isolation)
    if outcome.code != 0:
        lines = printed.end.decode(errors="replace").strip().splitlines()
        said = clean(lines[-1], 300) if lines else f"exit code {outcome.code}"
        raise FaultError(f"colcon does not build anything on this machine ({said}). Run `make setup`.", "build")


class _Printed:
    """Takes what the build prints: the archive on one stream, as far as it is allowed to be large, and the end of the log.

    Args:
        archive_bytes: How large the archive may be.
    """

    def __init__(self, archive_bytes: int) -> None:
        self._archive_bytes = archive_bytes
        self.archive = bytearray()
        self.end = b""
        self.limit = ""

    def __call__(self, stream: str, data: bytes) -> None:
        if stream == "stderr":
            self.end = (self.end + data)[-LOG_BYTES:]
        elif len(self.archive) + len(data) <= self._archive_bytes:
            self.archive += data
        else:
            self.limit = "install"


def _unpack(archive: bytes | bytearray, into: Path) -> str:
    """Unpack what the build handed out; the limit that it breaks (`install`, `files`), else empty.

    The submission could have written the archive itself, so nothing of it is believed: no compression, no holes, no
    more than what is expected, nothing outside the folder. What is no such archive ends where it stops being one.
    """
    limits = lab.limits()
    count = total = 0
    try:
        with tarfile.open(fileobj=io.BytesIO(archive), mode="r:") as members:
            for member in members:
                count += 1
                total += member.size
                if count > limits.build.files:
                    return "files"
                if total > limits.build.install_bytes or member.issparse():
                    return "install"
                if PurePosixPath(member.name).parts[:1] == ("install",):
                    take_out(members, member, into)
    except (tarfile.TarError, ValueError):
        return "install"
    except OSError as error:
        if error.errno in OURS:
            raise FaultError(f"What was built could not be unpacked: {error.strerror}.", "build") from error
        return "install"
    return ""


def _names(folder: Path) -> tuple[str, ...]:
    if not folder.is_dir():
        return ()
    return tuple(sorted(clean(p.name, 100) for p in folder.iterdir() if p.is_file() and p.stat().st_mode & 0o111))


def _site_packages(prefix: Path) -> Path:
    return prefix / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"


def _entry_points(prefix: Path) -> tuple[EntryPoint, ...]:
    found = []
    for path in sorted(_site_packages(prefix).glob("*-info/entry_points.txt")):
        parser = configparser.RawConfigParser(delimiters=("=",), strict=False)
        parser.optionxform = str  # type: ignore[assignment,method-assign]
        try:
            with path.open(encoding="utf-8", errors="replace") as file:
                parser.read_string(file.read(ENTRY_POINTS_BYTES))
        except configparser.Error:
            continue
        if parser.has_section("console_scripts"):
            items = parser.items("console_scripts")
            found += [EntryPoint(clean(name, 100), clean(target or "", 200)) for name, target in items]
    return tuple(found)


def _modules(prefix: Path, package: str) -> tuple[str, ...]:
    folder = _site_packages(prefix) / package
    return tuple(sorted(clean(path.stem, 100) for path in folder.glob("*.py")))


def _dangling(prefix: Path, package: str) -> tuple[str, ...]:
    """Executables whose entry point names a module below the package that is not there."""
    found = []
    for point in _entry_points(prefix):
        module = point.target.split(":")[0].strip()
        path = _site_packages(prefix).joinpath(*module.split("."))
        own = module.split(".")[0] == package or point.name in lab.specification().programs
        if own and not (path.is_dir() or path.with_name(f"{path.name}.py").is_file()):
            found.append(point.name)
    return tuple(sorted(found))


def without_function(build: Build, installed: Path) -> frozenset[str]:
    """Executables whose entry point names no function that its module defines, as far as its syntax tree tells.

    Args:
        build: What was built.
        installed: Where it was unpacked.
    """
    prefix = installed / "install" / lab.specification().package
    found = set()
    for point in build.entry_points:
        module, _, function = (part.strip() for part in point.target.partition(":"))
        path = _site_packages(prefix).joinpath(*module.split(".")).with_suffix(".py")
        if path.is_file() and not _defines(path, function.split(".")[0]):
            found.add(point.name)
    return frozenset(found)


def _defines(path: Path, name: str) -> bool:
    """Whether the module at *path* gives *name* a meaning at its top; true when that cannot be told."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return True
    pending: list[ast.AST] = [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id == name:
            return True
        if isinstance(node, ast.alias) and (node.asname or node.name) in (name, "*"):
            return True
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name == name:
            return True
        # What stands in a function or a class is not at the top.
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            pending += ast.iter_child_nodes(node)
    return False


def _launch_files(share: Path) -> tuple[str, ...]:
    if not share.is_dir():
        return ()
    found = (p for p in share.rglob("*") if p.is_file() and p.suffix in LAUNCH_SUFFIXES)
    return tuple(sorted(clean(str(p.relative_to(share)), 200) for p in found)[:100])

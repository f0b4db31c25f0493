"""The unit of work: a submission as bytes goes in, its result as bytes comes out. What runs on every worker.

No disk is shared: the package travels as a tar, and so does the folder of the result.
"""

from __future__ import annotations

import functools
import hashlib
import io
import tarfile
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from lab2_grader import __version__, decoding, evidence, lab, pipeline, process, ros, sandbox
from lab2_grader.classroom.records import Graded, Task
from lab2_grader.errors import FaultError, Lab2Error
from lab2_grader.lab import Rubric
from lab2_grader.records import Clock, EndedBy, Evidence, ProgramEnded, Record, Submission
from lab2_grader.score import rubric_digest
from lab2_grader.tar import take_out

Doing = Callable[[str], None]


class Version(Record, frozen=True):
    """With what a worker would grade.

    Args:
        grader: Version of the grader.
        code: Digest of its code and facts.
        rubric: SHA-256 of its own rubric.
        ros: Which ROS it would use, or why it has none.
        isolation: Empty when submissions are isolated there, else why not.
        mend: The command that would change that.
    """

    grader: str
    code: str
    rubric: str
    ros: str
    isolation: str
    mend: str


@functools.cache
def code_digest() -> str:
    """SHA-256 over the names and contents of the grader's modules, templates and facts, hexadecimal."""
    top = Path(__file__).parent.parent
    total = hashlib.sha256()
    for path in sorted(top.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            total.update(f"{path.relative_to(top).as_posix()}\0{path.stat().st_size}\0".encode())
            total.update(path.read_bytes())
    return total.hexdigest()


def version(wanted_ros: str = "auto") -> bytes:
    """The `Version` of this process, as JSON."""
    try:
        found = ros.find(wanted_ros)
        which = f"{found.kind} {found.distro}"
    except Lab2Error as error:
        which = str(error)
    walls = sandbox.probe()
    return msgspec.json.encode(
        Version(
            __version__,
            code_digest(),
            rubric_digest(lab.rubric()),
            which,
            "" if walls.on else walls.reason or "it is switched off",
            walls.mend,
        )
    )


def pack(folder: Path) -> bytes:
    """The regular files below *folder* as a tar, the same bytes for the same files."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and not path.is_symlink():
                info = tarfile.TarInfo(path.relative_to(folder).as_posix())
                info.size = path.stat().st_size
                info.mode = 0o755 if path.stat().st_mode & 0o100 else 0o644
                with path.open("rb") as file:
                    archive.addfile(info, file)
    return buffer.getvalue()


def unpack(data: bytes, folder: Path) -> None:
    """Unpack what `pack` made into *folder*."""
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        for member in archive:
            take_out(archive, member, folder)


def perform(task: bytes, doing: Doing = lambda _: None) -> bytes:
    """Grade one submission.

    Args:
        task: A `Task` in msgpack.
        doing: Told in a few words what begins.

    Returns:
        A `Graded` in msgpack; faults of the grader or the machine are told in it, not raised.
    """
    try:
        graded = _perform(decoding.from_msgpack(task, Task), doing)
    except (Lab2Error, OSError, MemoryError, msgspec.MsgspecError) as error:
        graded = Graded(b"", fault=str(error) or type(error).__name__)
    return msgspec.msgpack.encode(graded)


def _perform(task: Task, doing: Doing) -> Graded:
    if task.code != code_digest():
        raise FaultError("The worker has another version of the grader than the machine that hands out the work.")
    began = time.monotonic()
    process.become_reaper()
    means = means_of(task.rubric, task.clock, task.ros, isolation=task.isolation)
    with process.temporary_directory() as scratch:
        package, folder = scratch / "package", scratch / "result"
        package.mkdir()
        unpack(task.package, package)
        taken = Submission(task.facts, str(package))
        pipeline.grade_taken(taken, scratch, folder, means, doing, began)
        flags = struck(evidence.read(folder / pipeline.EVIDENCE))
        return Graded(pack(folder), flags)


def means_of(rubric: Rubric, clock: Clock, wanted_ros: str, *, isolation: bool) -> pipeline.Means:
    """With what this process grades.

    Raises:
        FaultError: There is no isolation here although it is asked for, or no ROS.
    """
    walls = sandbox.probe() if isolation else sandbox.Isolation(False, "it was switched off")
    if isolation and not walls.on:
        raise FaultError(
            f"Submissions cannot be isolated here: {walls.reason}. To mend it: {walls.mend} "
            "(or, for submissions that you trust with your files and your network, ISOLATION=off)."
        )
    return pipeline.Means(ros.find(wanted_ros), walls, rubric, clock)


def struck(observed: Evidence) -> tuple[str, ...]:
    """Limits that the submission struck, which honest work does not: something for a person to look at."""
    found = []
    built = observed.build
    if built is not None and built.ended_by in (EndedBy.LIMIT, EndedBy.DEADLINE):
        found.append(f"the build struck the limit on {built.limit or 'time'}")
    for scene in observed.scenes:
        found += [
            f"the scene “{scene.name.value}” struck the limit on {event.limit or 'time'}"
            for event in scene.events
            if isinstance(event, ProgramEnded) and event.by in (EndedBy.LIMIT, EndedBy.DEADLINE)
        ]
    return tuple(found)

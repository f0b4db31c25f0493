"""The folder of a class's results: locked while it is written, each result whole or not there, known to be up to date or not.

results/
  <name>/          a result as `grade` writes it, and class.json (Stamp)
  index.html       the overview, with summary.csv and summary.json beside it
  .lock            held while a class is graded or marked again
  .incoming/       results that are being put in place; of no use to anybody
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec

from lab2_grader import decoding, evidence, pipeline, report
from lab2_grader.classroom.records import Stamp
from lab2_grader.classroom.work import code_digest, unpack
from lab2_grader.errors import UsageError
from lab2_grader.lab import Rubric
from lab2_grader.records import Clock, Result, SubmissionFacts
from lab2_grader.score import rubric_digest

STAMP = "class.json"
LOCK = ".lock"
INCOMING = ".incoming"


@contextlib.contextmanager
def locked(out: Path) -> Iterator[None]:
    """Hold the folder of results *out*; the lock goes with the process, however that ends.

    Raises:
        UsageError: Somebody else holds it, or it cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        file = (out / LOCK).open("a+")
    except OSError as error:
        raise UsageError(f"{out} cannot be written: {error.strerror}.") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.seek(0)
            raise UsageError(
                f"{out} is being written by another lab2-grader (process {file.read(20).strip() or 'unknown'}). "
                "Wait for it, or give another folder with --out."
            ) from None
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        shutil.rmtree(out / INCOMING, ignore_errors=True)
        yield


def key_of(facts: SubmissionFacts, clock: Clock, ros: str, *, isolation: bool) -> str:
    """Digest of all that a result's evidence depends on: what was handed in, how it is run, the grader's code and facts.

    Args:
        facts: What is known of the submission; where it came from does not matter.
        clock: How the numeric pair's clock is driven.
        ros: Which ROS was asked for: `auto`, `sourced` or `wheels`.
        isolation: False when it ran with the caller's rights, and could have changed its own result.
    """
    same = msgspec.structs.replace(facts, source="")
    total = hashlib.sha256(msgspec.json.encode(same))
    total.update(f"\0{clock.value}\0{ros}\0{isolation}\0{code_digest()}".encode())
    return total.hexdigest()


def stamp(folder: Path) -> Stamp | None:
    """The stamp of the result in *folder*; None when there is none."""
    try:
        return decoding.from_json((folder / STAMP).read_bytes(), Stamp)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError):
        return None


def restamp(folder: Path, known: Stamp) -> None:
    """Say anew whose the result in *folder* is."""
    evidence.write_atomically(folder / STAMP, evidence.pretty(known))


def result(folder: Path) -> Result | None:
    """The result in *folder*; None when there is none that can be read."""
    try:
        return decoding.from_json((folder / report.RESULT).read_bytes(), Result)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError):
        return None


def stands(folder: Path, result: Result) -> bool:
    """Whether exactly *result* is written in *folder*, with its reports."""
    try:
        written = (folder / report.RESULT).read_bytes()
    except OSError:
        return False
    return written == evidence.pretty(result) and all((folder / name).is_file() for name in report.NAMES)


def current(folder: Path, key: str, rubric: Rubric) -> Result | None:
    """The result in *folder* when it is that of *key*, whole, and has a mark; judged again when only the rubric changed."""
    known, found = stamp(folder), result(folder)
    if known is None or found is None or known.key != key or not found.graded:
        return None
    try:
        if evidence.digest(folder / pipeline.EVIDENCE) != found.digests.evidence:
            return None
    except OSError:
        return None
    if found.digests.rubric != rubric_digest(rubric):
        with contextlib.suppress(UsageError):
            found = pipeline.rescore(folder, rubric)
            pipeline.write_reports(folder, found)
            return found
        return None
    return found


def keep(out: Path, name: str, data: bytes, known: Stamp) -> Result:
    """Put the result *data* in place as *name*, instead of an earlier one; all of it or, when killed, nothing.

    Raises:
        OSError: The folder of results cannot be written.
        UsageError: What came from the worker is no result.
    """
    draft = out / INCOMING / name
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    unpack(data, draft)
    (draft / STAMP).write_bytes(evidence.pretty(known))
    found = result(draft)
    if found is None:
        raise UsageError(f"What the worker gave back for {name} is no result.")
    for path in draft.rglob("*"):
        _to_disk(path)
    discard(out, name)
    draft.rename(out / name)
    _to_disk(out)
    return found


def check_free(out: Path, name: str) -> None:
    """See that nothing but an earlier result stands where the result *name* goes.

    Raises:
        UsageError: Something else does.
    """
    folder = out / name
    if os.path.lexists(folder) and not (folder / STAMP).exists() and not (folder / pipeline.EVIDENCE).is_dir():
        raise UsageError(f"{folder} is in the way and no result of this grader. Move it, or give another --out.")


def discard(out: Path, name: str) -> None:
    """Remove the result *name*, at once as far as anybody can see; a folder that is no result is left alone.

    Raises:
        UsageError: Something else of that name is in the way.
    """
    check_free(out, name)
    folder = out / name
    if not os.path.lexists(folder):
        return
    old = out / INCOMING / f"{name}.old"
    shutil.rmtree(old, ignore_errors=True)
    old.parent.mkdir(exist_ok=True)
    folder.rename(old)
    shutil.rmtree(old)


def _to_disk(path: Path) -> None:
    """See that *path* survives a loss of power."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

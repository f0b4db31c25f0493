"""Takes a submission over: a folder, an archive or a git address becomes one clean package, or is refused by rule."""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from lab2_grader import process
from lab2_grader.errors import FaultError, UsageError
from lab2_grader.messages import refusal
from lab2_grader.records import GitFacts, Submission, SubmissionFacts
from lab2_grader.submission import address as addresses
from lab2_grader.submission import package, repository
from lab2_grader.submission.archive import SUFFIXES, unpack
from lab2_grader.submission.clone import take_commit
from lab2_grader.text import clean

__all__ = ["take"]

_SOURCE_LENGTH = 300


def take(source: str, into: Path, *, commit: str | None = None, before: datetime | None = None) -> Submission:
    """Take the submission *source* over into *into*.

    Args:
        source: A folder (the package, or a workspace or repository that holds it; its files as they are now), an archive,
            or the address of a git repository (the tip of its default branch).
        into: A folder that is empty or not there; becomes the clean copy of the package.
        commit: Of an address, the commit to take instead.
        before: Of an address, take the last commit of the default branch (or before *commit*) not later than this.

    Raises:
        RefusedError: The submission breaks a rule.
        UsageError: There is no such file or folder, or the arguments do not go together.
        FaultError: The machine does not let us: no space, no permission, no git, no network.
    """
    is_address = addresses.is_address(source) and not os.path.lexists(source)
    if not is_address and (commit is not None or before is not None):
        raise UsageError("A commit or a deadline can be asked for only with the address of a repository.")
    with _workplace(into) as scratch:
        if is_address:
            return _from_address(source, into, scratch, commit, before)
        if not source:
            raise UsageError("No submission was named.")
        path = Path(source).expanduser()
        try:
            mode = path.stat().st_mode
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise UsageError(f"{clean(source, _SOURCE_LENGTH)} cannot be graded: {why}.") from error
        if stat.S_ISDIR(mode):
            return _from_folder(path, into, scratch)
        if stat.S_ISREG(mode):
            return _from_archive(path, into, scratch)
        raise UsageError(f"{clean(source, _SOURCE_LENGTH)} is neither a folder nor a file.")


@contextmanager
def _workplace(into: Path) -> Iterator[Path]:
    """A private folder for what is needed on the way; *into* is removed again when anything is raised."""
    try:
        into.mkdir(parents=True, exist_ok=True)
        if any(into.iterdir()):
            raise UsageError(f"{into} is not empty.")
        with process.temporary_directory() as scratch:
            try:
                yield scratch
            except BaseException:
                shutil.rmtree(into, ignore_errors=True)
                raise
    except OSError as error:  # reading the submission raises refusals; what is left is ours
        raise FaultError(f"The submission could not be taken over: {error}.", "submission") from error


def _from_folder(path: Path, into: Path, scratch: Path) -> Submission:
    top = path.resolve()
    if not os.access(top, os.R_OK | os.X_OK):
        raise refusal("unreadable", path=str(path))
    avoid = frozenset({package.inode(into), package.inode(scratch)})
    found = package.survey(top, avoid)
    name = addresses.name_of_path(top)
    if not found.names and not found.ignored and len(found.archives) == 1:
        return _from_inner(top / found.archives[0], name, str(path), into, scratch)
    where = package.choose(found)
    files = package.copy(top, where, into, avoid)
    facts = repository.facts(top, where, into, files, scratch / "git")
    return _submission(name, str(path), into, where, files, facts)


def _from_archive(path: Path, into: Path, scratch: Path) -> Submission:
    suffix = next(
        (suffix for suffix in sorted(SUFFIXES, key=len, reverse=True) if path.name.lower().endswith(suffix)), ""
    )
    name = addresses.name_of_path(path.resolve(), suffix)
    top = scratch / "archive"
    unpack(path, top)
    found = package.survey(top)
    if not found.names and not found.ignored and len(found.archives) == 1:
        return _from_inner(top / found.archives[0], name, str(path), into, scratch)
    where = package.choose(found)
    return _submission(name, str(path), into, where, package.copy(top, where, into), None)


def _from_inner(archive: Path, name: str, source: str, into: Path, scratch: Path) -> Submission:
    """Open the one archive in a folder or archive without a package: one level down, and no further."""
    top = scratch / "inner"
    unpack(archive, top)
    found = package.survey(top)
    if not found.names and len(found.archives) == 1:
        raise refusal("archive-nested", name=found.archives[0])
    where = package.choose(found)
    return _submission(name, source, into, where, package.copy(top, where, into), None)


def _from_address(source: str, into: Path, scratch: Path, commit: str | None, before: datetime | None) -> Submission:
    address = addresses.checked(source)
    clone = take_commit(address, scratch / "git", commit, before)
    found = package.survey(clone.folder)
    if not found.names and clone.tree.submodules:
        raise refusal("package-is-submodule", path=clone.tree.submodules[0])
    where = package.choose(found)
    files = package.copy(clone.folder, where, into)
    shown = addresses.without_secrets(address)
    facts = repository.facts_of(clone, address, where)
    return _submission(addresses.name_of_address(address), shown, into, where, files, facts)


def _submission(
    name: str, source: str, into: Path, where: str, files: tuple[str, ...], git: GitFacts | None
) -> Submission:
    facts = SubmissionFacts(
        name=name,
        source=clean(source, _SOURCE_LENGTH),
        sha256=package.digest(into, files),
        commit=git.commit if git else None,
        package_path=clean(where, _SOURCE_LENGTH),
        git=git,
        sources=package.sources(into, files),
    )
    return Submission(facts=facts, package_dir=str(into.resolve()))

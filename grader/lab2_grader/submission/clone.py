"""Takes a commit from the address of a repository: its files as they were committed, from the object database.

No check-out is made, and no filters, attributes or submodules are obeyed: git writes a tar of the commit, which is unpacked
like any stranger's archive.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from lab2_grader import lab
from lab2_grader.errors import FaultError, UsageError
from lab2_grader.messages import refusal
from lab2_grader.records import EndedBy
from lab2_grader.submission.address import local_path, without_secrets
from lab2_grader.submission.archive import LinksOut, unpack
from lab2_grader.submission.bounds import Destination
from lab2_grader.submission.git import Git, Tree, borrow, list_tree, tar_headers, text
from lab2_grader.text import clean

_COMMIT = re.compile("[0-9a-fA-F]{4,64}")
_UNREACHABLE = re.compile(
    "could not resolve|connection (?:refused|timed out|reset)|network is unreachable|no route to host|failed to connect|"
    "couldn't connect|temporary failure|operation timed out|certificate|ssl connection|gnutls|returned error: (?:5|429)|"
    "host key verification failed|ssh: not found",
    re.IGNORECASE,
)
_NOT_FOUND = re.compile(
    "not found|could not read (?:username|password)|authentication failed|permission denied|access denied|"
    "returned error: 4|does not appear to be a git repository",
    re.IGNORECASE,
)
# `index-pack` is killed silently by the limit on the size of a file; over a broken pack it would say why before.
_TOO_LARGE = re.compile(
    r"file too large|signal 25|\A(?:warning:.*\n)*fatal: fetch-pack: invalid index-pack output\s*\Z", re.IGNORECASE
)


@dataclass(frozen=True)
class Clone:
    """A commit taken from an address, made at the time `committed` (ISO 8601, or empty), its files in `folder`."""

    folder: Path
    commit: str
    committed: str
    tree: Tree


def take_commit(address: str, scratch: Path, commit: str | None, before: datetime | None) -> Clone:
    """Take a commit from *address*: the tip of its default branch, *commit*, or the last one *before* a deadline.

    Args:
        address: As `address.checked` gives it.
        scratch: A new folder of ours.
        commit: An id, at least four digits of it.
        before: A deadline with its time zone, by the times that the commits themselves bear.

    Raises:
        RefusedError: There is no such repository or commit, it is too large, or took too long.
        UsageError: *commit* or *before* is not what it should be.
        FaultError: The address cannot be reached from here.
    """
    if commit is not None and not _COMMIT.fullmatch(commit):
        raise UsageError(f"“{clean(commit, 80)}” is no commit id: give its hexadecimal digits.")
    if before is not None and before.tzinfo is None:
        raise UsageError("The deadline has no time zone.")
    git = Git(scratch)
    path = local_path(address)
    if path is None:
        _clone(git, address, history=commit is not None or before is not None)
    elif not any(borrow(folder, git) for folder in (path / ".git", path)):
        raise refusal("no-repository", address=without_secrets(address))
    found = _find_commit(git, address, commit, before)
    tree = list_tree(git, found)
    if tree is None:
        raise refusal("repository-unreadable", address=without_secrets(address))
    intake = lab.limits().intake
    if len(tree.blobs) > intake.members:
        raise refusal("too-many-files", limit=intake.members)
    if sum(blob.size for blob in tree.blobs) > intake.unpacked_bytes:
        raise refusal("too-large", limit=intake.unpacked_bytes // 1_000_000)
    _write_out(git, found, tree, address)
    return Clone(scratch / "commit", found, git.committed(found), tree)


def _write_out(git: Git, commit: str, tree: Tree, address: str) -> None:
    """Write the files of *commit* into the folder `commit`, as they were committed."""
    tar, folder = git.scratch / "commit.tar", git.scratch / "commit"
    if not tree.blobs:
        Destination(folder)
        return
    made = git.run("archive", "--format=tar", f"--output={tar}", commit)
    if made.code != 0:
        raise refusal("repository-unreadable", address=without_secrets(address))
    unpack(tar, folder, LinksOut.DROPPED, largest=lab.limits().intake.unpacked_bytes + tar_headers())


def _clone(git: Git, address: str, history: bool) -> None:
    """Clone *address*; of the default branch the tip alone unless *history* is asked for, then all branches whole."""
    intake = lab.limits().intake
    extent = ("--no-single-branch",) if history else ("--depth=1", "--single-branch")
    outcome = git.run(
        "clone", "--quiet", "--bare", "--template=", "--no-tags", "--no-local", "--no-recurse-submodules", *extent,
        "--", address, str(git.folder),
    )  # fmt: skip
    if outcome.code == 0:
        git.attribute_nothing()
        return
    said = text(outcome.stderr)
    shown = without_secrets(address)
    if _TOO_LARGE.search(said) or outcome.ended_by is EndedBy.LIMIT:
        raise refusal("repository-too-large", address=shown, limit=intake.unpacked_bytes // 1_000_000)
    if "Remote branch HEAD not found" in said:
        raise refusal("repository-empty", address=shown)
    said = clean(re.sub(r"://[^/\s]*@", "://", said), 300)
    if _UNREACHABLE.search(said):
        raise FaultError(f"{shown} cannot be reached from here: {said}", "submission")
    if _NOT_FOUND.search(said):
        raise refusal("repository-not-found", address=shown)
    raise refusal("clone-failed", address=shown, detail=said)


def _find_commit(git: Git, address: str, commit: str | None, before: datetime | None) -> str:
    """The full id of the commit that is asked for."""
    shown = without_secrets(address)
    start = f"{commit}^{{commit}}" if commit else "HEAD^{commit}"
    found = git.lines("rev-parse", "--verify", "--quiet", start)
    if not found or (commit and not found[0].startswith(commit.lower())):  # a branch may bear such a name
        raise (
            refusal("no-such-commit", address=shown, commit=commit)
            if commit
            else refusal("repository-empty", address=shown)
        )
    if before is None:
        return found[0]
    last = git.lines("rev-list", "--first-parent", "--max-count=1", f"--before={int(before.timestamp())}", found[0])
    if not last:
        raise refusal("no-commit-before", address=shown, before=f"{before:%d %B %Y at %H:%M %Z}")
    return last[0]

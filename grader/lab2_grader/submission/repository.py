"""Reads what a repository says of itself: what is committed, what is not, and whether it was pushed.

What is not committed is found by hashing the files ourselves, so that no filter is needed. All of it can be made up by
whoever made the repository: that a branch was pushed is what it claims, not what its server says.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from lab2_grader import lab
from lab2_grader.records import GitFacts
from lab2_grader.submission import products
from lab2_grader.submission.address import without_secrets
from lab2_grader.submission.clone import Clone
from lab2_grader.submission.git import LISTING_BYTES, Blob, Git, Tree, borrow, is_folder, list_tree, settings_of, text
from lab2_grader.text import clean

_LISTED = 20  # files named in the facts
_NAME_LENGTH = 200
_REGULAR_MODES = ("100644", "100755", "100664")


def facts(top: Path, package_path: str, package: Path, files: tuple[str, ...], scratch: Path) -> GitFacts | None:
    """What the repository in *top* says of itself; None when *top* is not the top folder of one that can be read.

    Args:
        top: The submission as given, its files as they are now.
        package_path: The package, relative to *top*.
        package: The clean copy of the package.
        files: The files of that copy.
        scratch: A new folder of ours.

    Raises:
        RefusedError: Reading it took too long.
        FaultError: git was ended before it could answer.
    """
    if not is_folder(top / ".git"):
        return None
    git = Git(scratch)
    if not borrow(top / ".git", git):
        return None
    settings = settings_of(top / ".git", git) or {}
    addresses = [value for key, values in settings.items() if key.startswith("remote.") for value in values]
    remotes = tuple(dict.fromkeys(without_secrets(address) for address in addresses))[:_LISTED]
    commit = next(iter(git.lines("rev-parse", "--verify", "--quiet", "HEAD") or ()), None)
    tree = Tree((), ()) if commit is None else list_tree(git, commit)
    if tree is None:
        return None
    branches = git.lines("for-each-ref", f"--contains={commit}", "--count=1", "refs/remotes") if commit else None
    paths = [blob.path for blob in tree.blobs]
    made = products.committed(paths, package_path)
    return GitFacts(
        commit=commit,
        remotes=remotes,
        committed_work=_committed_work(paths, package_path),
        uncommitted=_uncommitted(git, top, tree, package_path, package, files),
        pushed=bool(branches),
        products=tuple(clean(path, _NAME_LENGTH) for path in made[:_LISTED]),
        products_count=len(made),
        committed=git.committed(commit) if commit else "",
        submodule=clean(_submodule(tree, package_path), _NAME_LENGTH),
    )


def facts_of(clone: Clone, address: str, package_path: str) -> GitFacts:
    """The facts of a commit taken from *address*: it is there, so it was pushed, and nothing else was looked at."""
    paths = [blob.path for blob in clone.tree.blobs]
    made = products.committed(paths, package_path)
    return GitFacts(
        commit=clone.commit,
        remotes=(without_secrets(address),),
        committed_work=_committed_work(paths, package_path),
        uncommitted=(),
        pushed=True,
        products=tuple(clean(path, _NAME_LENGTH) for path in made[:_LISTED]),
        products_count=len(made),
        committed=clone.committed,
    )


def _prefix(package_path: str) -> str:
    return "" if package_path == "." else package_path + "/"


def _committed_work(paths: Iterable[str], package_path: str) -> tuple[str, ...]:
    """Those files of the exercise that are among *paths*, relative to the package."""
    held = frozenset(paths)
    return tuple(path for path in lab.specification().work if _prefix(package_path) + path in held)


def _submodule(tree: Tree, package_path: str) -> str:
    """The link of *tree* to another repository behind which the package lies; empty when there is none."""
    return next((path for path in tree.submodules if f"{package_path}/".startswith(f"{path}/")), "")


def _uncommitted(
    git: Git, top: Path, tree: Tree, package_path: str, package: Path, files: tuple[str, ...]
) -> tuple[str, ...]:
    """The files of the package that are not in *tree* as they are now: changed, new and not ignored, or deleted."""
    prefix = _prefix(package_path)
    held = {blob.path: blob for blob in tree.blobs if blob.mode in _REGULAR_MODES}
    new = [name for name in files if prefix + name not in held]
    changed = [name for name in files if prefix + name in held and not _is_same(package / name, held[prefix + name])]
    deleted = [
        path.removeprefix(prefix) for path in held if path.startswith(prefix) and not os.path.lexists(top / path)
    ]
    if new:
        visible = _not_ignored(git, top, package_path)
        new = [name for name in new if _is_visible(prefix + name, visible)]
    names = sorted({*new, *changed, *deleted})
    return tuple(clean(name, _NAME_LENGTH) for name in names[:_LISTED])


def _is_same(file: Path, blob: Blob) -> bool:
    """*file* has the content of *blob*, as it is or with the line ends that git gives text files."""
    algorithm = "sha1" if len(blob.oid) == 40 else "sha256"
    content = file.read_bytes()
    for variant in (content, content.replace(b"\r\n", b"\n")):
        total = hashlib.new(algorithm, b"blob %d\0" % len(variant), usedforsecurity=False)
        total.update(variant)
        if total.hexdigest() == blob.oid:
            return True
    return False


def _not_ignored(git: Git, top: Path, package_path: str) -> frozenset[str]:
    """The files of the package that no `.gitignore` hides; a repository inside is a name with a slash at its end."""
    within = () if package_path == "." else ("--", f":(top,literal){package_path}")
    listing = git.ask(
        "ls-files", "--others", "--exclude-standard", "-z", *within, keep=LISTING_BYTES, work_tree=top.resolve()
    )
    return frozenset(text(listing.stdout).split("\0"))


def _is_visible(path: str, visible: frozenset[str]) -> bool:
    parts = path.split("/")
    return path in visible or any("/".join(parts[:depth]) + "/" in visible for depth in range(1, len(parts)))

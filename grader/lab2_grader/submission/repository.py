"""Reads and clones git repositories that strangers made, without ever running anything of theirs.

A repository's own configuration, hooks, attributes and filters can run commands. None of them is used: git is only ever
given a bare repository of ours, with our configuration, whose objects are borrowed from theirs. Files are taken from the
object database as they were committed: no check-out, no filters, no submodules. What is not committed is found by hashing
the files ourselves.

What a repository says of itself can be made up by whoever made it: that a branch was pushed is what it claims, not what its
server says.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from lab2_grader import lab, process
from lab2_grader.errors import FaultError, UsageError
from lab2_grader.messages import refusal
from lab2_grader.records import EndedBy, GitFacts, Limits, Outcome, Request
from lab2_grader.submission import products
from lab2_grader.submission.address import local_path, without_secrets
from lab2_grader.submission.archive import LinksOut, unpack
from lab2_grader.submission.bounds import Destination
from lab2_grader.text import clean

_LISTED = 20  # files named in the facts
_NAME_LENGTH = 200
_CONFIG_BYTES = 1_000_000
_REFS_BYTES = 10_000_000
_LISTING_BYTES = 16_000_000
_LOG_BYTES = 100_000
_REGULAR_MODES = ("100644", "100755", "100664")
_COMMIT = re.compile("[0-9a-fA-F]{4,64}")
_INSTANT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:Z|[+-]\d\d:\d\d)")

# Ours, given with every call. `info/attributes` below does the same for what attributes can ask for.
_CONFIGURATION = (
    "core.hooksPath=/dev/null",
    "core.fsmonitor=false",
    "core.untrackedCache=false",
    "core.commitGraph=false",
    "core.multiPackIndex=false",
    "core.bigFileThreshold=20m",
    "core.attributesFile=/dev/null",
    "core.excludesFile=/dev/null",
    "credential.helper=",
    "gc.auto=0",
    "maintenance.auto=false",
    "submodule.recurse=false",
    "fetch.recurseSubmodules=false",
    "transfer.bundleURI=false",
    "protocol.ext.allow=never",
    "advice.detachedHead=false",
)
_ATTRIBUTES = "* -filter -text -eol -ident -working-tree-encoding -export-ignore -export-subst -diff -merge\n"
_INHERITED = (
    "PATH",
    "SSH_AUTH_SOCK",
    "http_proxy",
    "https_proxy",
    "HTTP_PROXY",
    "HTTPS_PROXY",
    "ALL_PROXY",
    "NO_PROXY",
    "no_proxy",
    "SSL_CERT_FILE",
    "SSL_CERT_DIR",
    "GIT_SSL_CAINFO",
)
_UNREACHABLE = re.compile(
    "could not resolve|connection (?:refused|timed out|reset)|network is unreachable|no route to host|failed to connect|"
    "couldn't connect|temporary failure|operation timed out|certificate|ssl connection|gnutls|proxy",
    re.IGNORECASE,
)
_TOO_LARGE = re.compile("file too large|signal 25", re.IGNORECASE)


@dataclass(frozen=True)
class Blob:
    """A file of a commit; `oid` is the id of its content."""

    mode: str
    oid: str
    size: int
    path: str


@dataclass(frozen=True)
class Tree:
    """The files of a commit, and the folders that are only links to other repositories."""

    blobs: tuple[Blob, ...]
    submodules: tuple[str, ...]


@dataclass(frozen=True)
class Clone:
    """A commit taken from an address, its files in `folder`; `committed` is when it was made, ISO 8601."""

    folder: Path
    commit: str
    tree: Tree
    committed: str = ""


class _Git:
    """Runs git on a bare repository of ours.

    Args:
        scratch: A folder of ours for all that git needs.
    """

    def __init__(self, scratch: Path) -> None:
        self.scratch = scratch
        self.folder = scratch / "repository.git"
        program = shutil.which("git")
        if program is None:
            raise FaultError("git is not installed.", "submission")
        self._program = program
        try:
            (scratch / "home").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FaultError(f"{scratch} cannot be written: {error.strerror}.", "submission") from error

    def run(self, *arguments: str, keep: int = _LOG_BYTES, work_tree: Path | None = None) -> Outcome:
        """Run git.

        Args:
            arguments: The subcommand and what it is told.
            keep: Bytes of its output to keep.
            work_tree: The folder with the files, for the one command that looks at any.

        Raises:
            RefusedError: It took too long.
        """
        intake, resources = lab.limits().intake, lab.limits().resources
        argv = [self._program, "--no-pager", f"--git-dir={self.folder}"]
        if work_tree is not None:
            argv.append(f"--work-tree={work_tree}")
        for setting in _CONFIGURATION:
            argv += ["-c", setting]
        outcome = process.run(
            Request(
                argv=(*argv, *arguments),
                env=self._environment(),
                cwd=str(work_tree or self.scratch),
                limits=Limits(
                    seconds=intake.clone_seconds,
                    output_bytes=keep,
                    processes=0,
                    memory_bytes=resources.memory_bytes,
                    file_bytes=intake.unpacked_bytes + _tar_headers(),
                ),
            )
        )
        if outcome.ended_by is EndedBy.DEADLINE:
            raise refusal("repository-timeout", seconds=intake.clone_seconds)
        return outcome

    def _environment(self) -> tuple[tuple[str, str], ...]:
        """Nothing of the caller's git, nothing that asks questions, and only the transports that run no command."""
        own = {name: os.environ[name] for name in _INHERITED if name in os.environ}
        own |= {
            "HOME": str(self.scratch / "home"),
            "XDG_CONFIG_HOME": str(self.scratch / "home"),
            "LC_ALL": "C.UTF-8",
            "GIT_CONFIG_NOSYSTEM": "1",
            "GIT_CONFIG_SYSTEM": "/dev/null",
            "GIT_CONFIG_GLOBAL": "/dev/null",
            "GIT_ATTR_NOSYSTEM": "1",
            "GIT_ALLOW_PROTOCOL": "https:http:ssh",
            "GIT_TERMINAL_PROMPT": "0",
            "GIT_SSH_COMMAND": "ssh -oBatchMode=yes -oStrictHostKeyChecking=accept-new",
            "GIT_NO_REPLACE_OBJECTS": "1",
            "GIT_NO_LAZY_FETCH": "1",
            "GIT_OPTIONAL_LOCKS": "0",
            "GIT_LFS_SKIP_SMUDGE": "1",
        }
        return tuple(own.items())

    def lines(self, *arguments: str) -> list[str] | None:
        """The lines that git prints; None when it fails."""
        outcome = self.run(*arguments)
        return _text(outcome.stdout).splitlines() if outcome.code == 0 else None

    def attribute_nothing(self) -> None:
        """Turn off whatever attributes can ask for, in this repository."""
        (self.folder / "info").mkdir(parents=True, exist_ok=True)
        (self.folder / "info" / "attributes").write_text(_ATTRIBUTES)


def _text(output: bytes) -> str:
    return output.decode("utf-8", "surrogateescape")


# --- a repository on this machine ----------------------------------------------------------------


def _borrow(theirs: Path, git: _Git) -> bool:
    """Make *git*'s repository one with their objects and a copy of their branches, and none of their configuration.

    Args:
        theirs: A `.git` folder, or a bare repository.
        git: Ours, not made yet.

    Returns:
        Whether *theirs* is a whole repository of its own: no work tree of another, nothing borrowed from elsewhere.
    """
    objects = theirs / "objects"
    if any(not _is_folder(folder) for folder in (theirs, objects, theirs / "refs")) or not _is_file(theirs / "HEAD"):
        return False
    if (
        os.path.lexists(objects / "info" / "alternates")
        or os.path.lexists(theirs / "commondir")
        or "\n" in str(objects)
    ):
        return False
    settings = _settings(theirs, git)
    if settings is None or settings.get("extensions.refstorage", ["files"]) != ["files"]:
        return False
    object_format = settings.get("extensions.objectformat", ["sha1"])[-1]
    if object_format not in ("sha1", "sha256"):
        return False
    # Given and made with our settings alone; `init` would run nothing, and its template is empty.
    made = git.run("init", "--quiet", "--bare", "--template=", f"--object-format={object_format}")
    if made.code != 0:
        raise FaultError(f"git could not make a repository: {clean(_text(made.stderr), 300)}", "submission")
    git.attribute_nothing()
    (git.folder / "objects" / "info").mkdir(exist_ok=True)
    (git.folder / "objects" / "info" / "alternates").write_text(f"{objects.resolve()}\n", errors="surrogateescape")
    _copy_refs(theirs, git.folder)
    return True


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _is_file(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False


def _settings(theirs: Path, git: _Git) -> dict[str, list[str]] | None:
    """What their configuration says of remotes and extensions; as data, with no file that it includes."""
    path = theirs / "config"
    if not os.path.lexists(path):
        return {}
    if not _is_file(path) or path.stat().st_size > _CONFIG_BYTES:
        return None
    pattern = r"^(remote\..*\.(url|pushurl)|extensions\..*)$"
    found = git.run("config", f"--file={path.absolute()}", "--no-includes", "--null", "--get-regexp", pattern)
    if found.code not in (0, 1):  # 1: nothing there
        return None
    settings: dict[str, list[str]] = {}
    for item in _text(found.stdout).split("\0"):
        key, _, value = item.partition("\n")
        settings.setdefault(key, []).append(value)
    return settings


def _copy_refs(theirs: Path, ours: Path) -> None:
    """Copy the branches, regular files only and never more than anyone has."""
    room = _REFS_BYTES
    names = [Path(name) for name in ("HEAD", "packed-refs", "shallow")]
    for folder, folders, files in os.walk(theirs / "refs"):
        folders.sort()
        names += [Path(folder, name).relative_to(theirs) for name in sorted(files)]
        if len(names) > lab.limits().intake.members:
            break
    for name in names:
        source = theirs / name
        if not _is_file(source) or (size := source.stat().st_size) > room:
            continue
        room -= size + 4096
        try:
            content = source.read_bytes()
        except OSError:
            continue
        (ours / name).parent.mkdir(parents=True, exist_ok=True)
        (ours / name).write_bytes(content)


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
    """
    if not _is_folder(top / ".git"):
        return None
    git = _Git(scratch)
    if not _borrow(top / ".git", git):
        return None
    settings = _settings(top / ".git", git) or {}
    addresses = [value for key, values in settings.items() if key.startswith("remote.") for value in values]
    remotes = tuple(dict.fromkeys(without_secrets(address) for address in addresses))[:_LISTED]
    commit = next(iter(git.lines("rev-parse", "--verify", "--quiet", "HEAD") or ()), None)
    tree = Tree((), ()) if commit is None else _tree(git, commit)
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
        committed=_committed_at(git, commit),
    )


def _tree(git: _Git, commit: str) -> Tree | None:
    """The files of *commit*; None when its objects cannot be read.

    Raises:
        RefusedError: They are too many.
    """
    listing = git.run("ls-tree", "-r", "-z", "-l", "--full-tree", commit, keep=_LISTING_BYTES)
    if listing.dropped_bytes:
        raise refusal("too-many-files", limit=lab.limits().intake.members)
    if listing.code != 0:
        return None
    blobs, submodules = [], []
    for line in _text(listing.stdout).split("\0")[:-1]:
        described, _, path = line.partition("\t")
        mode, kind, oid, size = described.split()
        if kind == "blob":
            blobs.append(Blob(mode, oid, int(size), path))
        else:
            submodules.append(path)
    return Tree(tuple(blobs), tuple(submodules))


def _prefix(package_path: str) -> str:
    return "" if package_path == "." else package_path + "/"


def _committed_work(paths: Iterable[str], package_path: str) -> tuple[str, ...]:
    """Those files of the exercise that are among *paths*, relative to the package."""
    asked = lab.specification()
    work = (
        f"{asked.package}/{asked.numeric.talker}.py",
        f"{asked.package}/{asked.numeric.listener}.py",
        f"launch/{asked.numeric.launch_file}",
    )
    held = frozenset(paths)
    return tuple(path for path in work if _prefix(package_path) + path in held)


def _uncommitted(
    git: _Git, top: Path, tree: Tree, package_path: str, package: Path, files: tuple[str, ...]
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


def _not_ignored(git: _Git, top: Path, package_path: str) -> frozenset[str]:
    """The files of the package that no `.gitignore` hides; a repository inside is a name with a slash at its end."""
    listing = git.run(
        "ls-files", "--others", "--exclude-standard", "-z", "--", f":(top,literal){package_path}",
        keep=_LISTING_BYTES,
        work_tree=top.resolve(),
    )  # fmt: skip
    return frozenset(_text(listing.stdout).split("\0"))


def _is_visible(path: str, visible: frozenset[str]) -> bool:
    parts = path.split("/")
    return path in visible or any("/".join(parts[:depth]) + "/" in visible for depth in range(1, len(parts)))


# --- a repository at an address ------------------------------------------------------------------


def take(address: str, scratch: Path, commit: str | None, before: datetime | None) -> Clone:
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
    git = _Git(scratch)
    path = local_path(address)
    if path is None:
        _clone(git, address, history=commit is not None or before is not None)
    elif not any(_borrow(folder, git) for folder in (path / ".git", path)):
        raise refusal("no-repository", address=without_secrets(address))
    found = _find_commit(git, address, commit, before)
    tree = _tree(git, found)
    if tree is None:
        raise refusal("repository-unreadable", address=without_secrets(address))
    intake = lab.limits().intake
    if len(tree.blobs) > intake.members:
        raise refusal("too-many-files", limit=intake.members)
    if sum(blob.size for blob in tree.blobs) > intake.unpacked_bytes:
        raise refusal("too-large", limit=intake.unpacked_bytes // 1_000_000)
    _write_out(git, found, tree, address)
    return Clone(scratch / "commit", found, tree, _committed_at(git, found))


def _committed_at(git: _Git, commit: str | None) -> str:
    """When *commit* was made, as it says itself: ISO 8601 with its time zone; empty when there is none."""
    found = git.lines("show", "--no-patch", "--format=%cI", commit) if commit else None
    return next((line for line in found or () if _INSTANT.fullmatch(line)), "")


def _tar_headers() -> int:
    """How many bytes the headers of a tar may need beside the files themselves."""
    return lab.limits().intake.members * 4_096


def _write_out(git: _Git, commit: str, tree: Tree, address: str) -> None:
    """Write the files of *commit* into the folder `commit`, as they were committed."""
    tar, folder = git.scratch / "commit.tar", git.scratch / "commit"
    if not tree.blobs:
        Destination(folder)
        return
    made = git.run("archive", "--format=tar", f"--output={tar}", commit)
    if made.code != 0:
        raise refusal("repository-unreadable", address=without_secrets(address))
    unpack(tar, folder, LinksOut.DROPPED, largest=lab.limits().intake.unpacked_bytes + _tar_headers())


def _clone(git: _Git, address: str, history: bool) -> None:
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
    said = _text(outcome.stderr)
    shown = without_secrets(address)
    if _TOO_LARGE.search(said) or outcome.ended_by is EndedBy.LIMIT:
        raise refusal("repository-too-large", address=shown, limit=intake.unpacked_bytes // 1_000_000)
    if "Remote branch HEAD not found" in said:
        raise refusal("repository-empty", address=shown)
    said = clean(re.sub(r"://[^/\s]*@", "://", said), 300)
    if _UNREACHABLE.search(said):
        raise FaultError(f"{shown} cannot be reached from here: {said}", "submission")
    raise refusal("clone-failed", address=shown, detail=said)


def _find_commit(git: _Git, address: str, commit: str | None, before: datetime | None) -> str:
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

"""Runs git on repositories that strangers made, without ever running anything of theirs.

A repository's own configuration, hooks, attributes and filters can run commands. None of them is used: git is only ever
given a bare repository of ours, with our configuration, whose objects are borrowed from theirs.
"""

from __future__ import annotations

import os
import shutil
import stat
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from lab2_grader import lab, process
from lab2_grader.errors import FaultError
from lab2_grader.messages import refusal
from lab2_grader.records import EndedBy, Limits, Outcome, Request
from lab2_grader.text import clean

_CONFIG_BYTES = 1_000_000
_REFS_BYTES = 10_000_000
_LOG_BYTES = 100_000
LISTING_BYTES = 16_000_000  # of a list of files

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


class Git:
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
                    file_bytes=intake.unpacked_bytes + tar_headers(),
                ),
            )
        )
        if outcome.ended_by is EndedBy.DEADLINE:
            raise refusal("repository-timeout", seconds=round(intake.clone_seconds))
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

    def ask(self, *arguments: str, keep: int = _LOG_BYTES, work_tree: Path | None = None) -> Outcome:
        """Run git and hear its answer, which may be a no; as `run` otherwise.

        Raises:
            RefusedError: It took too long.
            FaultError: It was ended before it could answer.
        """
        outcome = self.run(*arguments, keep=keep, work_tree=work_tree)
        if outcome.code is None:
            why = f"the limit on {outcome.limit}" if outcome.limit else f"signal {outcome.signal}"
            raise FaultError(f"git was ended by {why} while it read the repository.", "submission")
        return outcome

    def lines(self, *arguments: str) -> list[str] | None:
        """The lines that git answers; None when the answer is no. Raises as `ask` does."""
        outcome = self.ask(*arguments)
        return text(outcome.stdout).splitlines() if outcome.code == 0 else None

    def committed(self, commit: str) -> str:
        """When *commit* was made, as it says itself: ISO 8601 with its time zone, or empty when it says nothing of the kind."""
        said = "".join(self.lines("log", "--max-count=1", "--format=%cI", commit) or ())
        try:
            return datetime.fromisoformat(said.replace("Z", "+00:00")).isoformat()
        except ValueError:
            return ""

    def attribute_nothing(self) -> None:
        """Turn off whatever attributes can ask for, in this repository."""
        (self.folder / "info").mkdir(parents=True, exist_ok=True)
        (self.folder / "info" / "attributes").write_text(_ATTRIBUTES)


def text(output: bytes) -> str:
    """What git printed; bytes that are no UTF-8 survive, as they do in the names of files."""
    return output.decode("utf-8", "surrogateescape")


def borrow(theirs: Path, git: Git) -> bool:
    """Make *git*'s repository one with their objects and a copy of their branches, and none of their configuration.

    Args:
        theirs: A `.git` folder, or a bare repository.
        git: Ours, not made yet.

    Returns:
        Whether *theirs* is a whole repository of its own: no work tree of another, nothing borrowed from elsewhere.
    """
    objects = theirs / "objects"
    if any(not is_folder(folder) for folder in (theirs, objects, theirs / "refs")) or not _is_file(theirs / "HEAD"):
        return False
    if (
        os.path.lexists(objects / "info" / "alternates")
        or os.path.lexists(theirs / "commondir")
        or "\n" in str(objects)
    ):
        return False
    settings = settings_of(theirs, git)
    if settings is None or settings.get("extensions.refstorage", ["files"]) != ["files"]:
        return False
    object_format = settings.get("extensions.objectformat", ["sha1"])[-1]
    if object_format not in ("sha1", "sha256"):
        return False
    made = git.run("init", "--quiet", "--bare", "--template=", f"--object-format={object_format}")
    if made.code != 0:
        raise FaultError(f"git could not make a repository: {clean(text(made.stderr), 300)}", "submission")
    git.attribute_nothing()
    (git.folder / "objects" / "info").mkdir(exist_ok=True)
    (git.folder / "objects" / "info" / "alternates").write_text(f"{objects.resolve()}\n", errors="surrogateescape")
    _copy_refs(theirs, git.folder)
    return True


def is_folder(path: Path) -> bool:
    """*path* is a folder and not a link to one."""
    return path.is_dir() and not path.is_symlink()


def _is_file(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False


def settings_of(theirs: Path, git: Git) -> dict[str, list[str]] | None:
    """What their configuration says of remotes and extensions; as data, with no file that it includes."""
    path = theirs / "config"
    if not os.path.lexists(path):
        return {}
    if not _is_file(path) or path.stat().st_size > _CONFIG_BYTES:
        return None
    pattern = r"^(remote\..*\.(url|pushurl)|extensions\..*)$"
    found = git.ask("config", f"--file={path.absolute()}", "--no-includes", "--null", "--get-regexp", pattern)
    if found.code not in (0, 1):  # 1: nothing there
        return None
    settings: dict[str, list[str]] = {}
    for item in text(found.stdout).split("\0"):
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


def list_tree(git: Git, commit: str) -> Tree | None:
    """The files of *commit*; None when its objects cannot be read.

    Raises:
        RefusedError: They are too many, or git took too long.
        FaultError: git was ended before it could answer.
    """
    listing = git.ask("ls-tree", "-r", "-z", "-l", "--full-tree", commit, keep=LISTING_BYTES)
    if listing.dropped_bytes:
        raise refusal("too-many-files", limit=lab.limits().intake.members)
    if listing.code != 0:
        return None
    blobs, submodules = [], []
    for line in text(listing.stdout).split("\0")[:-1]:
        described, _, path = line.partition("\t")
        mode, kind, oid, size = described.split()
        if kind == "blob":
            blobs.append(Blob(mode, oid, int(size), path))
        else:
            submodules.append(path)
    return Tree(tuple(blobs), tuple(submodules))


def tar_headers() -> int:
    """How many bytes the headers of a tar may need beside the files themselves."""
    return lab.limits().intake.members * 4_096

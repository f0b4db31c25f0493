"""Reads the zoo (`zoo/*.toml`) and builds its animals: packages that differ from `solution/` by a few small edits."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
from pathlib import Path

import msgspec

from lab2_grader import lab

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ZOO = HERE / "zoo"

# Short names of the files that most edits concern.
FILES = {
    "talker": "lab2/numeric_talker.py",
    "listener": "lab2/numeric_listener.py",
    "launch": "launch/numeric_chatter.py",
    "setup": "setup.py",
}
CHECKS = tuple(check.id for check in lab.rubric().check)
GIT_CHECKS = ("git-pushed", "git-clean")


class Edit(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One change to the package; exactly one of the ways.

    Args:
        file: Of which file, by its path or its short name.
        find: A text that must stand in it exactly once; `replace` takes its place.
        replace: See `find`.
        text: The whole new content.
        encoding: With `text`, or alone: write the file in that encoding (`utf-8-sig` puts a BOM before it).
        crlf: Turn the file's line ends into CR LF.
        delete: Remove the file or folder.
        move: Its new path.
        copy: Path of a copy.
    """

    file: str
    find: str = ""
    replace: str = ""
    text: str | None = None
    encoding: str = ""
    crlf: bool = False
    delete: bool = False
    move: str = ""
    copy: str = ""

    def apply(self, package: Path) -> None:
        """Change *package*.

        Raises:
            ValueError: What is to be replaced does not stand there exactly once.
        """
        path = package / FILES.get(self.file, self.file)
        if self.text is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(self.text, encoding=self.encoding or "utf-8")
        elif self.find:
            content = path.read_text()
            if content.count(self.find) != 1:
                raise ValueError(f"{self.file} has {content.count(self.find)} times: {self.find!r}")
            path.write_text(content.replace(self.find, self.replace))
        elif self.encoding:
            path.write_text(path.read_text(), encoding=self.encoding)
        elif self.crlf:
            path.write_bytes(path.read_bytes().replace(b"\r\n", b"\n").replace(b"\n", b"\r\n"))
        elif self.delete:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        elif self.move or self.copy:
            target = package / FILES.get(self.move or self.copy, self.move or self.copy)
            target.parent.mkdir(parents=True, exist_ok=True)
            (shutil.move if self.move else shutil.copy)(path, target)
        else:
            raise ValueError(f"the edit of {self.file} does nothing")


class Animal(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A submission and its verdicts, given as what differs from "everything passes".

    Args:
        name: Unique.
        about: What is special about it, in one line.
        edits: What is changed in a copy of `solution/`, in order.
        fails: Check → key of the fault in the catalogue, and a fragment of the hint.
        blocked: Check → the check because of which.
        blocks_all: The check because of which all others are blocked, for what does not build.
        within: Folder of the submission in which the package lies; `.` for its top.
        beside: Further files of the submission, outside the package.
        slow: Takes more than a few seconds of real time: left to `make test-slow`.
        agrees: Also run in real time in the normal test run.
        under_load: One of those that `make stress` runs.
    """

    name: str
    about: str
    edits: tuple[Edit, ...] = ()
    fails: dict[str, tuple[str, str]] = {}
    blocked: dict[str, str] = {}
    blocks_all: str = ""
    within: str = "."
    beside: dict[str, str] = {}
    slow: bool = False
    agrees: bool = False
    under_load: bool = False

    @property
    def right(self) -> bool:
        """Whether it gets full marks."""
        return not self.fails and not self.blocked

    def statuses(self) -> dict[str, str]:
        """The expected status of each check; for a folder, git is not assessed."""
        usual = "blocked" if self.blocks_all else "pass"
        expected = {check: "not-assessed" if check in GIT_CHECKS else usual for check in CHECKS}
        return expected | dict.fromkeys(self.blocked, "blocked") | dict.fromkeys(self.fails, "fail")

    def build(self, folder: Path) -> Path:
        """Make the submission in the empty *folder*, and return it."""
        package = folder / self.within
        shutil.copytree(ROOT / "solution", package, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
        for name, text in self.beside.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        for edit in self.edits:
            try:
                edit.apply(package)
            except (ValueError, OSError) as error:
                raise ValueError(f"animal {self.name}: {error}") from error
        return folder


class Pair(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Two animals in one: its verdicts are the union of theirs.

    Args:
        of: Names of two wrong animals whose edits do not touch the same place.
    """

    of: tuple[str, str]


class Repository(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The solution in a git repository, and what becomes of the two checks that look at it.

    Args:
        name: Unique.
        about: What is special about it, in one line.
        script: Shell commands, run in the package's folder; `$OWN` and `$COURSE` are remotes.
        fails: As of an animal.
        not_assessed: Checks for which there is nothing to judge.
    """

    name: str
    about: str
    script: str
    fails: dict[str, tuple[str, str]] = {}
    not_assessed: tuple[str, ...] = ()

    def statuses(self) -> dict[str, str]:
        """The expected status of each check."""
        expected = dict.fromkeys(CHECKS, "pass") | dict.fromkeys(self.fails, "fail")
        return expected | dict.fromkeys(self.not_assessed, "not-assessed")

    def build(self, folder: Path) -> Path:
        """Make the repository below the empty *folder*, and return its own folder."""
        package, own = folder / "lab2", folder / "own.git"
        shutil.copytree(ROOT / "solution", package, ignore=shutil.ignore_patterns("__pycache__"))
        environment = {
            "PATH": os.environ["PATH"],
            "HOME": str(folder),
            "GIT_CONFIG_NOSYSTEM": "1",
            **dict.fromkeys(("GIT_AUTHOR_NAME", "GIT_COMMITTER_NAME"), "A Student"),
            **dict.fromkeys(("GIT_AUTHOR_EMAIL", "GIT_COMMITTER_EMAIL"), "student@example.com"),
            "OWN": str(own),
            "COURSE": lab.course().template_clone_url,
        }
        subprocess.run(["git", "init", "--quiet", "--bare", str(own)], check=True, env=environment)
        subprocess.run(["sh", "-eu", "-c", self.script], check=True, env=environment, cwd=package)
        return package


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    animal: tuple[Animal, ...] = ()
    pair: tuple[Pair, ...] = ()
    repository: tuple[Repository, ...] = ()


@functools.cache
def _files() -> tuple[_File, ...]:
    return tuple(msgspec.toml.decode(path.read_bytes(), type=_File) for path in sorted(ZOO.glob("*.toml")))


@functools.cache
def animals() -> dict[str, Animal]:
    """Every single animal by name."""
    found: dict[str, Animal] = {}
    for animal in (animal for file in _files() for animal in file.animal):
        if animal.name in found:
            raise ValueError(f"two animals are called {animal.name}")
        found[animal.name] = animal
    return found


@functools.cache
def repositories() -> dict[str, Repository]:
    """Every repository by name."""
    return {repository.name: repository for file in _files() for repository in file.repository}


@functools.cache
def pairs() -> dict[str, Animal]:
    """Every combination of two faults by name, `one+other`."""
    return {combined.name: combined for file in _files() for pair in file.pair for combined in [_combine(pair)]}


def _combine(pair: Pair) -> Animal:
    """Both edits; a check that fails in one of them fails, one that is only blocked stays blocked."""
    one, other = (animals()[name] for name in pair.of)
    fails = one.fails | other.fails
    # Where both block a check, whichever is looked at first is named.
    blocked = {
        check: " or ".join(filter(None, (one.blocked.get(check), other.blocked.get(check))))
        for check in one.blocked | other.blocked
        if check not in fails
    }
    return Animal(
        name=f"{one.name}+{other.name}",
        about=f"{one.about}; {other.about}",
        edits=one.edits + other.edits,
        fails=fails,
        blocked=blocked,
        slow=one.slow or other.slow,
    )

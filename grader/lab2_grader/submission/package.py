"""Finds the one package in a folder by its `package.xml`, copies it out clean, and reads what is recorded of it.

How the package is found
    As colcon finds it: a folder with a `package.xml` is a package and is not searched further; a folder with a
    `COLCON_IGNORE` is passed over. A copy of the package inside the package is therefore part of it, as it is for colcon;
    two packages beside each other are refused. Build products are never searched.

The digest of a submission
    SHA-256 over, for each file of the clean copy in the order of the bytes of its path: the path's length in bytes, a colon,
    the path (UTF-8, `/` between its parts), the content's length in bytes, a colon, the content. Lengths are decimal. Modes,
    times and empty folders do not count; build products and caches are not in the copy.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from lab2_grader import lab
from lab2_grader.errors import RefusedError
from lab2_grader.messages import refusal
from lab2_grader.records import SourceFile
from lab2_grader.submission import products
from lab2_grader.submission.archive import SUFFIXES
from lab2_grader.submission.bounds import CHUNK, Bounds, Destination

MANIFEST = "package.xml"

_DEPTH = 8  # folders below the top that are searched; `home/me/ros2_ws/src/lab2` in an archive is 5
_IGNORE_MARKS = frozenset({"COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE"})  # those that colcon knows
_MANIFEST_BYTES = 200_000
_SOURCE_FILES = 60  # kept for hints
_SETTINGS = ("setup.py", "setup.cfg", MANIFEST)
_NAMED_AT_MOST = 5  # in a sentence

Inode = tuple[int, int]


@dataclass
class Survey:
    """What was found while looking for packages; paths are relative to the top, `.` for the top itself."""

    names: dict[str, str] = field(default_factory=dict)  # folder of each package -> its name
    broken: dict[str, str] = field(default_factory=dict)  # folder of each unreadable package.xml -> why
    ignored: list[str] = field(default_factory=list)  # packages behind a COLCON_IGNORE
    setups: list[str] = field(default_factory=list)  # folders with a setup.py and no package.xml
    archives: list[str] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)
    files: int = 0


def inode(path: Path) -> Inode:
    """What identifies the folder *path* whatever its name."""
    status = path.stat()
    return status.st_dev, status.st_ino


def survey(top: Path, avoid: frozenset[Inode] = frozenset()) -> Survey:
    """Look through *top* for packages, never following a link.

    Args:
        top: A folder.
        avoid: Folders that are not the submission's although they may lie in it: where the copy is made.

    Raises:
        RefusedError: It holds too many files.
    """
    found, bounds = Survey(), Bounds()
    folders = [(top, "", 0)]
    while folders:
        folder, path, depth = folders.pop()
        try:
            entries = _entries(folder, bounds)
        except OSError:
            found.unreadable.append(path or ".")
            continue
        children = {entry.name for entry in entries}
        if path and products.is_left_out_for(folder.name, children):
            continue
        if children & _IGNORE_MARKS:
            if MANIFEST in children:
                found.ignored.append(path or ".")
            continue
        manifest = regular(top, folder / MANIFEST)
        if manifest:
            try:
                name = package_name(manifest)
            except (ValueError, OSError) as error:
                found.broken[path or "."] = str(error)
            else:
                found.names[path or "."] = name
                if name == lab.specification().package:
                    continue
        elif "setup.py" in children:
            found.setups.append(path or ".")
        for entry in reversed(entries):
            below = f"{path}/{entry.name}" if path else entry.name
            if products.is_left_out(entry.name):
                continue
            if entry.is_dir(follow_symlinks=False):
                if depth < _DEPTH and entry.name not in products.COLCON and not _is_one_of(entry, avoid):
                    folders.append((folder / entry.name, below, depth + 1))
            else:
                found.files += 1
                if entry.name.lower().endswith(SUFFIXES) and entry.is_file(follow_symlinks=False):
                    found.archives.append(below)
    return found


def _entries(folder: Path, bounds: Bounds) -> list[os.DirEntry[str]]:
    """What *folder* holds, each counted, in the order of the names."""
    entries = []
    with os.scandir(folder) as listing:
        for entry in listing:
            bounds.member()
            entries.append(entry)
    return sorted(entries, key=lambda entry: entry.name)


def _is_one_of(entry: os.DirEntry[str], inodes: frozenset[Inode]) -> bool:
    """*entry* is one of the folders *inodes*."""
    try:
        status = entry.stat(follow_symlinks=False)
    except OSError:
        return False
    return (status.st_dev, status.st_ino) in inodes


def regular(top: Path, path: Path) -> Path | None:
    """The regular file at *path*, or at the end of the link there when that lies in *top*; else None."""
    try:
        if path.is_symlink():
            path = path.resolve(strict=True)
            inside = path.relative_to(top.resolve())
            if any(products.is_left_out(part) for part in inside.parts):
                return None
        return path if stat.S_ISREG(path.lstat().st_mode) else None
    except (OSError, ValueError, RuntimeError):  # nothing there; not in top; round in circles
        return None


def package_name(manifest: Path) -> str:
    """The `<name>` in a `package.xml`.

    Raises:
        ValueError: It is no `package.xml`: the text says why. Declarations of entities are refused, so that nothing is
            expanded or fetched.
        OSError: It cannot be read.
    """
    content = _read(manifest, _MANIFEST_BYTES + 1)
    if len(content) > _MANIFEST_BYTES:
        raise ValueError("it is too large")
    path: list[str] = []
    names: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        path.append(tag)
        if path == ["package", "name"]:
            names.append("")

    def end(tag: str) -> None:
        path.pop()

    def text(data: str) -> None:
        if path == ["package", "name"]:
            names[-1] += data

    def entity(*declaration: object) -> None:
        raise ValueError("it declares entities")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise ValueError(f"line {error.lineno}: {expat.ErrorString(error.code)}") from error
    if len(names) != 1 or not names[0].strip():
        raise ValueError("it has no <name>" if not names else "it does not have exactly one <name>")
    return names[0].strip()


def choose(found: Survey) -> str:
    """Where the package is, relative to the top.

    Raises:
        RefusedError: There is none, or more than one; the text says what there is instead.
    """
    wanted = lab.specification().package
    here = [path for path, name in found.names.items() if name == wanted]
    if len(here) > 1:
        raise refusal("two-packages", package=wanted, paths=_listed(sorted(here)))
    if here:
        return here[0]
    raise _no_package(found, wanted)


def _no_package(found: Survey, wanted: str) -> RefusedError:
    """Why there is no package, by what comes nearest to one."""
    if found.ignored:
        return refusal("package-ignored", package=wanted, path=found.ignored[0])
    near = {path: name for path, name in found.names.items() if _is_near(name, wanted)}
    if near:
        path, name = next(iter(near.items()))
        return refusal("package-misnamed", package=wanted, path=_below(path, MANIFEST), name=name)
    if found.broken:
        path, detail = next(iter(found.broken.items()))
        return refusal("package-xml", package=wanted, path=_below(path, MANIFEST), detail=detail)
    if found.names:
        others = _listed([f"{name} ({_below(path, MANIFEST)})" for path, name in found.names.items()])
        return refusal("other-packages", package=wanted, others=others)
    if found.setups:
        return refusal("no-package-xml", package=wanted, path=_below(found.setups[0], "setup.py"))
    if found.archives:
        return refusal("archives-inside", package=wanted, archives=_listed(sorted(found.archives)))
    if found.unreadable:
        return refusal("unreadable", path=found.unreadable[0])
    if not found.files:
        return refusal("empty", package=wanted)
    return refusal("no-package", package=wanted, files=found.files)


def _is_near(name: str, wanted: str) -> bool:
    """*name* was most likely meant to be *wanted*; that of another lab, with another number, was not."""
    plain = "".join(letter for letter in name.casefold() if letter.isalnum())
    same_number = re.findall("[0-9]+", plain) == re.findall("[0-9]+", wanted)
    return wanted in plain or (same_number and difflib.SequenceMatcher(None, plain, wanted).ratio() >= 0.75)


def _below(folder: str, name: str) -> str:
    return name if folder == "." else f"{folder}/{name}"


def _listed(items: list[str]) -> str:
    more = len(items) - _NAMED_AT_MOST
    return ", ".join(items[:_NAMED_AT_MOST]) + (f" and {more} more" if more > 0 else "")


# --- taking it over ------------------------------------------------------------------------------


def copy(top: Path, path: str, into: Path, avoid: frozenset[Inode] = frozenset()) -> tuple[str, ...]:
    """Copy the package at *path* below *top* into the empty folder *into*.

    Regular files and folders only. A link to a file that lies in *top* becomes a copy of it; all other links, pipes, sockets
    and devices are passed over, and so are build products, caches and version control.

    Returns:
        The files, relative to *into*, in the order of the bytes of their paths.

    Raises:
        RefusedError: It is too large, has too many files, a name that cannot be, or a file that cannot be read.
        FaultError: The copy cannot be written.
    """
    package, bounds, destination = top / path, Bounds(), Destination(into)
    folders = [(package, "")]
    while folders:
        folder, below = folders.pop()
        try:
            entries = _entries(folder, bounds)
        except OSError as error:
            raise refusal("unreadable", path=below or path) from error
        if below and products.is_left_out_for(folder.name, {entry.name for entry in entries}):
            continue
        destination.folder(below)
        for entry in entries:
            name = f"{below}/{entry.name}" if below else entry.name
            if products.is_left_out(entry.name):
                continue
            if entry.is_dir(follow_symlinks=False):
                if not (below == "" and entry.name in products.COLCON) and not _is_one_of(entry, avoid):
                    bounds.check_name(name)
                    folders.append((folder / entry.name, name))
                continue
            source = regular(top, folder / entry.name)
            if source:
                bounds.check_name(name)
                _copy_file(source, name, destination, bounds)
    return tuple(sorted(destination.files, key=str.encode))


def _copy_file(source: Path, name: str, destination: Destination, bounds: Bounds) -> None:
    """Copy one file; a hole in it counts like any byte."""
    try:
        descriptor = os.open(source, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise refusal("unreadable", path=name) from error
    with open(descriptor, "rb", buffering=0) as reader:
        status = os.fstat(descriptor)
        bounds.expect(status.st_size)
        try:
            destination.file(name, bounds.counted(reader), bool(status.st_mode & stat.S_IXUSR))
        except OSError as error:
            raise refusal("unreadable", path=name) from error


def digest(package: Path, files: tuple[str, ...]) -> str:
    """The digest of a clean copy as the head of this module defines it, hexadecimal."""
    total = hashlib.sha256()
    for name in files:
        file = package / name
        total.update(f"{len(name.encode())}:{name}{file.stat().st_size}:".encode())
        with file.open("rb") as source:
            while piece := source.read(CHUNK):
                total.update(piece)
    return total.hexdigest()


def sources(package: Path, files: tuple[str, ...]) -> tuple[SourceFile, ...]:
    """The settings and Python files of a clean copy, those nearest to its top first; larger ones than allowed are left out."""
    limit = lab.limits().intake.source_file_bytes
    wanted = [name for name in _SETTINGS if name in files]
    wanted += sorted(
        (name for name in files if name.endswith(".py") and name not in _SETTINGS),
        key=lambda name: (name.count("/"), name),
    )
    return tuple(_sources(package, wanted[:_SOURCE_FILES], limit))


def _sources(package: Path, names: list[str], limit: int) -> Iterator[SourceFile]:
    for name in names:
        content = _read(package / name, limit + 1)
        if len(content) <= limit:
            yield SourceFile(name, content.decode("utf-8-sig", "replace"))


def _read(path: Path, size: int) -> bytes:
    """The first *size* bytes of *path*."""
    with path.open("rb") as source:
        return source.read(size)

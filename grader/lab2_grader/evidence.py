"""The record on disk of all that was observed: written while a submission runs, read-only afterwards, versioned.

    evidence/
      manifest.json        Manifest: schema, runtime, seconds, faults, and what is known of each scene
      submission.json      SubmissionFacts
      build.json           Build, once the build has ended
      <scene>.jsonl        what an observer saw, one `Event` a line, as it happened

Every field is documented where it is declared, in `records.py`.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
from pathlib import Path
from typing import TypeVar

import msgspec

from lab2_grader import decoding
from lab2_grader.errors import FaultError, Lab2Error, UsageError
from lab2_grader.records import (
    EVIDENCE_SCHEMA,
    Build,
    Clock,
    Event,
    Evidence,
    Record,
    Runtime,
    Scene,
    SceneName,
    Seconds,
    SubmissionFacts,
)

MANIFEST = "manifest.json"
SUBMISSION = "submission.json"
BUILD = "build.json"

T = TypeVar("T")


class SceneEntry(Record, frozen=True):
    """What the manifest says of a scene; its events are in a file of their own. Fields as in `Scene`.

    Args:
        name: Which scene.
        started_with: `launch`, `executable` or `module`.
        label: The executable or module that ran by itself; empty for a launch.
        clock: How its clock was driven.
        complete: The observer came to the end of its script.
        fault: Why it did not, in a sentence; else empty.
        seconds: How long the scene took.
    """

    name: SceneName
    started_with: str
    label: str
    clock: Clock
    complete: bool
    fault: str
    seconds: float


class Manifest(Record, frozen=True):
    """The table of contents of a folder of evidence; `finished` is false while the submission is still being run.

    Args:
        schema: Always `EVIDENCE_SCHEMA`.
        finished: False while the submission is still being run.
        runtime: With what it is run.
        seconds: How long the stages took.
        faults: What failed on the grader's or the machine's side, in sentences.
        scenes: The scenes that were played.
        began: When the grading began, UTC, ISO 8601.
    """

    schema: str
    finished: bool
    runtime: Runtime
    seconds: Seconds
    faults: tuple[str, ...]
    scenes: tuple[SceneEntry, ...]
    began: str = ""


class _Version(msgspec.Struct, frozen=True):
    schema: str = ""


def write_atomically(path: Path, data: bytes) -> None:
    """Write *data* so that a reader finds either the old file or the whole new one.

    Raises:
        UsageError: The folder may not be written to.
        FaultError: The disk is full, or fails.
    """
    draft = path.with_name(f".{path.name}.{os.getpid()}.draft")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft.write_bytes(data)
        draft.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            draft.unlink(missing_ok=True)
        raise cannot_write(path, error) from error


def cannot_write(path: Path, error: OSError) -> Lab2Error:
    """Whose fault it is that *path* could not be written: the caller's who chose the folder, or the machine's."""
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.EEXIST):
        return UsageError(f"{path} cannot be written ({error.strerror}). Choose another place for it with --out.")
    return FaultError(f"{path} could not be written ({error.strerror}). Make room for it and try again.")


def pretty(record: Record) -> bytes:
    """*record* as indented JSON with a newline at the end."""
    return msgspec.json.format(msgspec.json.encode(record), indent=2) + b"\n"


class Writer:
    """Puts evidence on disk as it comes.

    Args:
        folder: Where to; what an earlier run left there is removed.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for old in folder.iterdir():
                if old.suffix in (".json", ".jsonl", ".draft"):
                    old.unlink()
        except OSError as error:
            raise cannot_write(folder, error) from error

    def submission(self, facts: SubmissionFacts) -> None:
        """Record what was handed in."""
        write_atomically(self.folder / SUBMISSION, pretty(facts))

    def build(self, build: Build) -> None:
        """Record what the build made of it."""
        write_atomically(self.folder / BUILD, pretty(build))

    def scene_path(self, name: SceneName) -> Path:
        """The file to which the events of that scene go."""
        return self.folder / f"{name.value}.jsonl"

    def manifest(
        self,
        runtime: Runtime,
        seconds: Seconds,
        faults: tuple[str, ...],
        scenes: tuple[SceneEntry, ...],
        finished: bool,
        began: str = "",
    ) -> None:
        """Record how far the run has come."""
        manifest = Manifest(EVIDENCE_SCHEMA, finished, runtime, seconds, faults, scenes, began)
        write_atomically(self.folder / MANIFEST, pretty(manifest))


def events(raw: bytes) -> tuple[Event, ...]:
    """The events of one scene's file; a last line that was cut off in the writing is left out.

    Raises:
        msgspec.DecodeError: A whole line is not an event.
    """
    whole = raw[: raw.rfind(b"\n") + 1].rstrip(b"\n")
    return decoding.from_json(b"[" + whole.replace(b"\n", b",") + b"]", tuple[Event, ...])


def read(folder: Path) -> Evidence:
    """The evidence in *folder*.

    Raises:
        UsageError: It is missing, incomplete, damaged or of another version; the text names the file.
    """
    manifest_bytes = _bytes(folder / MANIFEST)
    version = _decode(folder / MANIFEST, manifest_bytes, _Version).schema
    if version != EVIDENCE_SCHEMA:
        raise UsageError(
            f"The evidence in {folder} is of version {version or 'unknown'}; this grader reads {EVIDENCE_SCHEMA}. "
            "Grade the submission again."
        )
    manifest = _decode(folder / MANIFEST, manifest_bytes, Manifest)
    if not manifest.finished:
        raise UsageError(f"The evidence in {folder} is of a run that was interrupted. Grade the submission again.")
    facts = _decode(folder / SUBMISSION, _bytes(folder / SUBMISSION), SubmissionFacts)
    build_path = folder / BUILD
    build = _decode(build_path, _bytes(build_path), Build) if build_path.exists() or manifest.scenes else None
    scenes = tuple(_scene(folder, entry) for entry in manifest.scenes)
    return Evidence(facts, build, scenes, manifest.runtime, manifest.faults, manifest.seconds, manifest.began)


def digest(folder: Path) -> str:
    """SHA-256 over the names and contents of the evidence in *folder*, hexadecimal."""
    total = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        if path.suffix in (".json", ".jsonl"):
            total.update(f"{path.name}\0{path.stat().st_size}\0".encode())
            total.update(path.read_bytes())
    return total.hexdigest()


def _scene(folder: Path, entry: SceneEntry) -> Scene:
    path = folder / f"{entry.name.value}.jsonl"
    raw = _bytes(path)
    try:
        found = events(raw)
    except msgspec.DecodeError as error:
        raise UsageError(f"{path} is damaged: {error}. Grade the submission again.") from error
    if entry.complete and not raw.endswith(b"\n"):
        raise UsageError(f"{path} is cut short. Grade the submission again.")
    return Scene(
        entry.name,
        entry.started_with,
        entry.label,
        entry.clock,
        entry.complete,
        entry.fault,
        entry.seconds,
        found,
    )


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"There is no evidence at {path} ({error.strerror}). Grade the submission again.") from error


def _decode(path: Path, raw: bytes, kind: type[T]) -> T:
    try:
        return decoding.from_json(raw, kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} is damaged: {error}. Grade the submission again.") from error

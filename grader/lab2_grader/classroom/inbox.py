"""Recognises what an inbox holds: folders and archives, a download from Minerva or Moodle, a table of repositories.

Nothing is unpacked here but names and texts: files are fetched one submission at a time, when its turn comes.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import IO

import msgspec

from lab2_grader import lab
from lab2_grader.classroom import minerva, moodle, roster
from lab2_grader.classroom.records import Entry, Inbox, Part
from lab2_grader.errors import UsageError
from lab2_grader.messages import refusal
from lab2_grader.records import Unknown
from lab2_grader.submission.address import is_address, name_of_address, safe_name, without_secrets
from lab2_grader.submission.archive import SUFFIXES, member_path, zip_names
from lab2_grader.submission.bounds import Bounds, Destination
from lab2_grader.text import clean

TEXT_BYTES = 200_000  # of a text that comes with a submission
TABLE_BYTES = 5_000_000
PASSED_OVER = frozenset({"__MACOSX", ".DS_Store", "Thumbs.db", "desktop.ini", ".git", ".gitignore"})
# Names of files in the folder of results, so that no submission's folder can bear them.
RESERVED = frozenset({"index.html", "summary.csv", "summary.json", "faults.log"})

_MALFORMED = (zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError, ValueError, EOFError, KeyError)

Found = tuple[list[Entry], list[Unknown]]


def look(inbox: Path, out: Path, before: datetime | None = None) -> Inbox:
    """What *inbox* holds.

    Args:
        inbox: A folder, a download as a zip, or a table of students and repositories.
        out: The folder of results, which is none of the submissions although it may lie in the inbox.
        before: The deadline for repositories that have none of their own.

    Raises:
        UsageError: It cannot be read, or is not a class at all.
    """
    try:
        if inbox.is_dir():
            entries, unknown = _folder(inbox, out)
        elif inbox.is_file():
            recognised = _download(inbox) or _table(inbox)
            if recognised is None:
                raise UsageError(
                    f"{inbox} is neither a download of submissions from Minerva or Moodle nor a table of repositories. "
                    "Give one of those, or a folder that holds one folder or archive for each student."
                )
            entries, unknown = recognised
        else:
            raise UsageError(f"There is no inbox at {inbox}.")
    except OSError as error:
        raise UsageError(f"{error.filename or inbox} cannot be read: {error.strerror or error}.") from error
    if before is not None:
        entries = [
            msgspec.structs.replace(entry, before=before) if _is_remote(entry) and entry.before is None else entry
            for entry in entries
        ]
    if not entries and not unknown:
        raise UsageError(f"There is nothing in {inbox}.")
    return Inbox(tuple(_named_apart(entries)), tuple(unknown))


def _is_remote(entry: Entry) -> bool:
    return bool(entry.source) and is_address(entry.source)


def _named_apart(entries: Iterable[Entry]) -> Iterator[Entry]:
    """The entries in the order of their names, each name made the only one of its kind, letter case aside."""
    taken = {name.lower() for name in RESERVED}
    for entry in sorted(entries, key=lambda entry: (entry.name.lower(), entry.shown)):
        name, number = entry.name, 1
        while name.lower() in taken:
            number += 1
            name = f"{entry.name}-{number}"
        taken.add(name.lower())
        note = f"there is more than one submission named {entry.name}" if number > 1 else ""
        notes = "; ".join(filter(None, (entry.note, note)))
        yield msgspec.structs.replace(entry, name=name, note=notes)


# --- a folder -------------------------------------------------------------------------------------


def _folder(inbox: Path, out: Path) -> Found:
    if (inbox / "package.xml").is_file():
        raise UsageError(f"{inbox} is one submission. Grade it with: lab2-grader grade {inbox}")
    files: list[Path] = []
    folders: list[Path] = []
    for path in sorted(inbox.iterdir()):
        if path.name in PASSED_OVER or path.name.startswith("._") or path.resolve() == out.resolve():
            continue
        (folders if path.is_dir() else files).append(path)
    parts = [Part(str(path), "", path.name) for path in files]
    entries, unknown, rest = _minerva(parts, _read_part, inbox.name)
    below = [
        Part(str(path), "", f"{folder.name}/{path.relative_to(folder).as_posix()}")
        for folder in folders
        if moodle.member_name(folder.name)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink()
    ]
    from_moodle, unknown_too, rest = _moodle([*below, *rest], _read_part, inbox.name)
    entries += from_moodle
    unknown += unknown_too
    for folder in folders:
        if moodle.member_name(folder.name):
            continue
        if not any(folder.iterdir()):
            unknown.append(Unknown(folder.name, "the folder is empty"))
        else:
            entries.append(_plain(folder, folder.name))
    paths = [Path(part.place) for part in rest]
    archives = [path for path in paths if _suffix(path.name) and path.is_file()]
    downloads = _downloads(archives) if not entries else []
    for found in downloads:
        entries += found[0]
        unknown += found[1]
    if not downloads:
        entries += [_plain(path, path.name[: -len(_suffix(path.name))]) for path in archives]
    for path in sorted(set(paths).difference(archives)):
        table = _table(path) if path.is_file() else None
        if table is not None:
            entries += table[0]
            unknown += table[1]
        else:
            unknown.append(Unknown(clean(path.name, 200), "neither a folder nor an archive (.zip, .tar.gz)"))
    return entries, unknown


def _downloads(archives: list[Path]) -> list[Found]:
    """What *archives* hold when each is a download; else nothing: one student's archive may not speak for another."""
    downloads = []
    for path in archives:
        if (found := _download(path)) is None:
            return []
        downloads.append(found)
    return downloads


def _plain(path: Path, name: str) -> Entry:
    shown = clean(name, 200)
    return Entry(safe_name(name), shown, (shown,), str(path), clean(path.name, 200))


def _suffix(name: str) -> str:
    fitting = (suffix for suffix in SUFFIXES if name.lower().endswith(suffix))
    return max(fitting, key=len, default="")


# --- a download as a zip --------------------------------------------------------------------------


def _download(path: Path) -> Found | None:
    """What the download *path* holds; None when it is none."""
    names = zip_names(path) if path.suffix.lower() == ".zip" else None
    if names is None:
        return None
    wanted = [name for name in names if not PASSED_OVER.intersection(name.split("/"))]
    parts = [Part(str(path), name, name) for name in wanted]
    for recognise in (_minerva, _moodle):
        entries, unknown, rest = recognise(parts, _read_part, path.name)
        if entries:
            unknown += [
                Unknown(f"{path.name}: {clean(part.path, 200)}", "its name is not one that such a download has")
                for part in rest
            ]
            return entries, unknown
    return None


ReadPart = Callable[[Part], bytes]


def _read_part(part: Part) -> bytes:
    """The beginning of a file that was handed in."""
    with _opened(part) as file:
        return file.read(TEXT_BYTES)


def _minerva(parts: Iterable[Part], read: ReadPart, where: str) -> tuple[list[Entry], list[Unknown], list[Part]]:
    """The submissions of a download from Minerva among *parts*, the newest attempt of each user; and the other parts."""
    attempts: dict[tuple[str, str], list[Part]] = {}
    texts: dict[tuple[str, str], Part] = {}
    rest = []
    for part in parts:
        name = minerva.member_name(PurePosixPath(part.path).name)
        if name is None:
            rest.append(part)
            continue
        key = (name.head, name.time)
        attempts.setdefault(key, [])
        if name.original:
            attempts[key].append(Part(part.place, part.member, name.original))
        else:
            texts[key] = part
    newest: dict[str, tuple[str, str]] = {}
    users: dict[str, minerva.Text | None] = {}
    unknown = []
    for head, time in sorted(attempts, key=lambda key: key[1]):
        try:
            text = minerva.read_text(read(texts[head, time])) if (head, time) in texts else None
        except (OSError, *_MALFORMED) as error:
            text = None
            unknown.append(Unknown(f"{where}: {clean(texts[head, time].path, 200)}", f"cannot be read: {error}"))
        user = minerva.user_of(head, text)
        newest[user], users[user] = (head, time), text
    entries = []
    for user, key in newest.items():
        entry = _attempt(user, users[user], tuple(attempts[key]), f"{where}: {clean('_attempt_'.join(key), 200)}")
        if isinstance(entry, Entry):
            entries.append(entry)
        else:
            unknown.append(entry)
    return entries, unknown, rest


def _attempt(user: str, text: minerva.Text | None, parts: tuple[Part, ...], shown: str) -> Entry | Unknown:
    student = clean(text.name if text and text.name else user, 200)
    keys = tuple(dict.fromkeys((clean(user, 200), student)))
    missing = [name for name in (text.files if text else ()) if minerva.member_name(name) is None]
    promised = len(text.files) - len(missing) if text else 0
    note = "files that its text names are not in the download" if promised > len(parts) else ""
    pasted = minerva.addresses(text.field) if text else ()
    entry = Entry(safe_name(user), student, keys, "", shown, parts, note=note)
    return _with_address(entry, pasted, "the submission has neither a file nor the address of a repository")


def _with_address(entry: Entry, pasted: tuple[str, ...], nothing: str) -> Entry | Unknown:
    """*entry* by its archive, by the one address that was pasted, or by its loose files, in this order."""
    if any(_suffix(part.path) for part in entry.parts):
        return entry
    if len(pasted) == 1:
        shown = f"{entry.shown}: {without_secrets(pasted[0])}"
        return msgspec.structs.replace(entry, source=pasted[0], parts=(), shown=shown)
    if not entry.parts:
        several = f"several addresses were pasted: {clean(', '.join(pasted), 300)}" if pasted else nothing
        return Unknown(f"{entry.student} ({entry.name})", several)
    return entry


def _moodle(parts: Iterable[Part], read: ReadPart, where: str) -> tuple[list[Entry], list[Unknown], list[Part]]:
    """The submissions of a download from Moodle among *parts*, and the other parts."""
    files: dict[tuple[str, str], list[Part]] = {}
    pasted: dict[tuple[str, str], list[str]] = {}
    rest, unknown = [], []
    for part in parts:
        pieces = part.path.split("/")
        at, name = next(
            ((index, found) for index, piece in enumerate(pieces) if (found := moodle.member_name(piece))), (0, None)
        )
        if name is None or ".." in pieces or part.path.startswith("/"):
            rest.append(part)
            continue
        key = (name.student, name.participant)
        files.setdefault(key, [])
        if name.online_text:
            try:
                pasted.setdefault(key, []).extend(minerva.addresses(read(part).decode("utf-8", errors="replace")))
            except (OSError, *_MALFORMED) as error:
                unknown.append(Unknown(f"{where}: {clean(part.path, 200)}", f"cannot be read: {error}"))
            continue
        path = "/".join(filter(None, (name.rest, *pieces[at + 1 :])))
        files[key].append(Part(part.place, part.member, path or "submission"))
    entries = []
    for (student, participant), taken in files.items():
        shown = clean(student, 200)
        keys = (f"Participant {participant}", participant, shown)
        entry = Entry(safe_name(f"{student}-{participant}"), shown, keys, "", f"{where}: {shown}", tuple(taken))
        addresses = tuple(dict.fromkeys(pasted.get((student, participant), ())))
        made = _with_address(entry, addresses, "the submission has neither a file nor the address of a repository")
        if isinstance(made, Entry):
            entries.append(made)
        else:
            unknown.append(made)
    return entries, unknown, rest


# --- a table of repositories ----------------------------------------------------------------------


def _table(path: Path) -> Found | None:
    """What the table *path* holds; None when it is none."""
    if path.suffix.lower() not in (".csv", ".tsv", ".txt"):
        return None
    with path.open("rb") as file:
        raw = file.read(TABLE_BYTES)
    text = raw.decode("utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", errors="replace")
    if not roster.looks_like_one(text):
        return None
    rows, unknown = roster.read(text)
    entries = []
    for row in rows:
        student = clean(row.student or name_of_address(row.address), 200)
        keys = tuple(clean(key, 200) for key in row.keys) or (student,)
        shown = without_secrets(row.address)
        entries.append(
            Entry(safe_name(student), student, keys, row.address, shown, commit=row.commit, before=row.before)
        )
    return entries, [msgspec.structs.replace(item, what=f"{path.name}, {item.what}") for item in unknown]


# --- fetching -------------------------------------------------------------------------------------


def fetch(entry: Entry, scratch: Path) -> str:
    """What is to be taken over for *entry*: its source, or its files fetched into the new folder *scratch*.

    Raises:
        RefusedError: A file is larger than may be handed in, damaged, or has a name that is not taken in.
        FaultError: The machine does not let us write.
        OSError: It does not let us read.
    """
    if entry.source:
        return entry.source
    top = scratch / "handed-in"
    destination, bounds = Destination(top), Bounds()
    for part in entry.parts:
        bounds.member()
        path = member_path(part.path, bounds) or "submission"
        try:
            with _opened(part) as source:
                destination.file(path, _counted(source, part, bounds), executable=False)
        except _MALFORMED as error:
            raise refusal("archive-corrupt", name=part.path, detail=str(error) or type(error).__name__) from error
    only = list(top.iterdir())
    return str(only[0] if len(only) == 1 and only[0].is_file() else top)


def _counted(source: IO[bytes], part: Part, bounds: Bounds) -> Iterator[bytes]:
    """What *source* holds, as far as a file that is handed in may be large."""
    taken, limit = 0, lab.limits().intake.archive_bytes
    for piece in bounds.counted(source):
        taken += len(piece)
        if taken > limit:
            raise refusal("archive-too-large", name=part.path, limit=limit // 1_000_000)
        yield piece


@contextmanager
def _opened(part: Part) -> Iterator[IO[bytes]]:
    if not part.member:
        with Path(part.place).open("rb") as file:
            yield file
        return
    with zipfile.ZipFile(part.place) as archive, archive.open(part.member) as member:
        yield member

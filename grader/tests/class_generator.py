"""Makes a class of submissions, mixed from the zoo with a seed, for tests under load.

Usage: python class_generator.py FOLDER [--count 100] [--seed 1] [--kind directories|minerva|repositories]

What it prints, a folder, a zip or a table below FOLDER, is what `lab2-grader grade-all` takes, and FOLDER/expected.json names the animal of
each student. The same arguments make the same class.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from intake_helpers import commit_all, git
from zoo_builder import Animal, animals, pairs

KINDS = ("directories", "minerva", "repositories")
# As in real cohorts: most are right in some way of their own, some have one fault, few have two.
RIGHT, ONE_FAULT = 0.6, 0.3
COPIED = 0.03  # share of students who hand in another's work
FIRST = ("Ada", "Ben", "Chloë", "Dev", "Eilidh", "Femi", "Grace", "Hana", "Iwan", "Jun", "Kwame", "Léa", "Mia", "Noor")
LAST = ("Abara", "Brown", "Chen", "Davies", "Evans", "Farouk", "Goh", "Hughes", "Iyer", "Jones", "Kaya", "O'Neill")


class Student:
    """A student and what they hand in."""

    def __init__(self, number: int, chance: random.Random, animal: Animal, copied_from: str) -> None:
        self.user = f"sc21{chance.choice('abcdefghijklmnopqrstuvwxyz')}{number:03d}"
        self.name = f"{chance.choice(FIRST)} {chance.choice(LAST)}"
        self.animal = animal
        self.author = copied_from or self.user


def students(count: int, seed: int, slow: bool = False) -> tuple[Student, ...]:
    """*count* students; *slow*: animals that take a minute of real time may be among them."""
    chance = random.Random(seed)
    single = [animal for _, animal in sorted(animals().items()) if slow or not animal.slow]
    right, wrong = ([animal for animal in single if animal.right is is_right] for is_right in (True, False))
    double = [animal for _, animal in sorted(pairs().items()) if slow or not animal.slow] or wrong
    found: list[Student] = []
    for number in range(count):
        if found and chance.random() < COPIED:
            other = chance.choice(found)
            found.append(Student(number, chance, other.animal, other.author))
            continue
        dice = chance.random()
        herd = right if dice < RIGHT else wrong if dice < RIGHT + ONE_FAULT else double
        found.append(Student(number, chance, chance.choice(herd), ""))
    return tuple(found)


def make(
    folder: Path, count: int, seed: int, kind: str = "directories", slow: bool = False
) -> tuple[Path, dict[str, Animal]]:
    """Make a class below *folder*; (what `grade-all` takes, the animal of each student by the name of the result)."""
    folder.mkdir(parents=True, exist_ok=True)
    inbox = {"directories": _directories, "minerva": _minerva, "repositories": _repositories}[kind](
        folder, students(count, seed, slow), random.Random(seed + 1)
    )
    expected = {student.user: student.animal for student in students(count, seed, slow)}
    (folder / "expected.json").write_text(
        json.dumps({name: animal.name for name, animal in expected.items()}, indent=1)
    )
    return inbox, expected


def _build(student: Student, folder: Path) -> Path:
    student.animal.build(folder)
    (folder / student.animal.within / "AUTHORS").write_text(f"{student.author}\n")  # no two honest ones are alike
    return folder


def _zipped(source: Path, target: Path, below: str = "") -> Path:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in _files(source):
            info = zipfile.ZipInfo(f"{below}{path.relative_to(source).as_posix()}", (2026, 10, 20, 12, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, path.read_bytes())
    return target


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_file())


def _directories(folder: Path, group: tuple[Student, ...], chance: random.Random) -> Path:
    """Folders, with zips and tars among them."""
    inbox = folder / "inbox"
    inbox.mkdir()
    for student in group:
        built = _build(student, inbox / student.user)
        form = chance.random()
        if form < 0.2:
            _zipped(built, inbox / f"{student.user}.zip", "lab2/")
        elif form < 0.35:
            with tarfile.open(inbox / f"{student.user}.tar.gz", "w:gz") as archive:
                archive.add(built, "lab2")
        if form < 0.35:
            shutil.rmtree(built)
    return inbox


def _minerva(folder: Path, group: tuple[Student, ...], chance: random.Random) -> Path:
    """A bulk download: earlier attempts, archives in archives, texts, and what macOS adds."""
    parts = folder / "parts"
    parts.mkdir()
    inbox = folder / "gradebook_COMP3631_Lab_2_2026-10-23-18-00-00.zip"
    with zipfile.ZipFile(inbox, "w") as outer:
        for student in group:
            package = _zipped(_build(student, parts / student.user), parts / f"{student.user}.zip", "lab2/")
            if chance.random() < 0.3:
                inner = package.rename(parts / "inner.zip")
                with zipfile.ZipFile(package, "w") as nested:
                    nested.write(inner, "submission/lab2.zip")
                    nested.writestr("__MACOSX/submission/._lab2.zip", b"\0\5\x16\7")
            if chance.random() < 0.3:
                _attempt(outer, student, "2026-10-19-09-00-00", b"not an archive at all", "draft.zip")
            _attempt(outer, student, "2026-10-20-17-30-05", package.read_bytes(), "my lab_2 (final).zip")
            shutil.rmtree(parts / student.user)
            package.unlink()
    return inbox


def _attempt(outer: zipfile.ZipFile, student: Student, time: str, data: bytes, original: str) -> None:
    head = f"Lab 2_Talker_{student.user}_attempt_{time}"
    text = (
        f"Name: {student.name} ({student.user})\r\nAssignment: Lab 2_Talker\r\nDate Submitted: {time}\r\n"
        "Current Grade: Needs Grading\r\n\r\nSubmission Field:\r\n"
        "There is no student submission text data for this assignment.\r\n\r\nComments:\r\nNone\r\n\r\n"
        f"Files:\r\n\tOriginal filename: {original}\r\n\tFilename: {head}_{original}\r\n"
    )
    outer.writestr(f"{head}.txt", text)
    outer.writestr(f"{head}_{original}", data)


def _repositories(folder: Path, group: tuple[Student, ...], chance: random.Random) -> Path:
    """Repositories with some history, and the table that names them."""
    del chance
    table = ["Student,Username,Repository"]
    for student in group:
        built = _build(student, folder / "repositories" / student.user)
        commit_all(built)
        git(built, "remote", "add", "origin", f"https://github.example/{student.user}/lab2.git")
        table.append(f'"{student.name}",{student.user},file://{built}')
    inbox = folder / "inbox.csv"
    inbox.write_text("\n".join(table) + "\n")
    return inbox


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, default=KINDS[0])
    parser.add_argument("--slow", action="store_true", help="with animals that take a minute of real time")
    arguments = parser.parse_args()
    print(make(arguments.folder, arguments.count, arguments.seed, arguments.kind, arguments.slow)[0])

"""Reads the hostile zoo (`hostile/*.toml`) and builds its animals: the solution, changed so that it attacks."""

from __future__ import annotations

import functools
import importlib.util
import shutil
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

import msgspec
from zoo_builder import CHECKS, FILES, GIT_CHECKS, ROOT, Edit

HOSTILE = Path(__file__).resolve().parent / "hostile"
TEXTS = "texts.toml"


# colcon reads what setup.py prints: what is printed besides the description would be no more than a build that fails.
ASIDE = """
import sys
sys.stdout, _stdout = sys.stderr, sys.stdout
{code}
sys.stdout = _stdout
"""


class Animal(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A hostile submission, what it must get, and what must be seen of it.

    Args:
        name: Unique.
        about: What it is after, in one line.
        prepend: File (path or short name) → code that stands before its content; `@NAME@` is one of `snippets.py`.
        edits: What else is changed in a copy of `solution/`.
        fails: Check → key of the fault in the catalogue.
        blocked: Check → the check because of which.
        blocks_all: Every check that needs the build is blocked by this one.
        any_of: Checks that may also pass, or be missed in another way: the race is the animal's own.
        says: Texts that must stand in the evidence: it came to do what it is for.
        notes: Fragments that must stand in the notes of the result.
        seconds: It holds the grader no longer than this.
        build_seconds: The build's limit for this animal; 0 for the lab's own.
        beside: Another animal that is graded at the same time.
        slow: Left to `make test-slow`.
    """

    name: str
    about: str
    prepend: dict[str, str] = {}
    edits: tuple[Edit, ...] = ()
    fails: dict[str, str] = {}
    blocked: dict[str, str] = {}
    blocks_all: str = ""
    any_of: tuple[str, ...] = ()
    says: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: float = 120
    build_seconds: float = 0
    beside: str = ""
    slow: bool = False

    def statuses(self) -> dict[str, str]:
        """The expected status of each check; for a folder, git is not assessed."""
        usual = "blocked" if self.blocks_all else "pass"
        expected = {check: "not-assessed" if check in GIT_CHECKS else usual for check in CHECKS}
        return expected | dict.fromkeys(self.blocked, "blocked") | dict.fromkeys(self.fails, "fail")

    def build(self, folder: Path, values: Mapping[str, str]) -> Path:
        """Make the submission in the empty *folder*, with *values* in the place of `@NAME@`, and return it."""
        shutil.copytree(ROOT / "solution", folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
        for edit in self.edits:
            edit.apply(folder)
        for file, text in self.prepend.items():
            path = folder / FILES.get(file, file)
            code = getattr(snippets(), text.strip("@")) if text.startswith("@") and text.endswith("@") else text
            for name, value in values.items():
                code = code.replace(f"@{name}@", value)
            assert "@" not in code or "@" in text.replace("@", "", 2), f"{self.name}: an unknown @NAME@ in {file}"
            if file == "setup":
                code = ASIDE.format(code=code.lstrip("\n"))
            path.write_text(code.lstrip("\n") + "\n" + path.read_text())
        return folder


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    animal: tuple[Animal, ...] = ()


@functools.cache
def snippets() -> ModuleType:
    """`hostile/snippets.py`."""
    spec = importlib.util.spec_from_file_location("hostile_snippets", HOSTILE / "snippets.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@functools.cache
def animals() -> dict[str, Animal]:
    """Every hostile animal by name."""
    found: dict[str, Animal] = {}
    for path in sorted(HOSTILE.glob("*.toml")):
        if path.name == TEXTS:
            continue
        for animal in msgspec.toml.decode(path.read_bytes(), type=_File).animal:
            if animal.name in found:
                raise ValueError(f"two animals are called {animal.name}")
            found[animal.name] = animal
    return found


class Text(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A text that attacks whoever reads it: `name` for people, `text` itself."""

    name: str
    text: str


class _Texts(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    text: tuple[Text, ...]


@functools.cache
def texts() -> tuple[Text, ...]:
    """The hostile texts of `texts.toml`, for every place where text of a submission is shown."""
    return msgspec.toml.decode((HOSTILE / TEXTS).read_bytes(), type=_Texts).text

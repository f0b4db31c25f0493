"""Reads what the worksheet keeps as data: its tasks, questions and commands."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Literal, TypeVar

import msgspec
from jinja2 import Environment, StrictUndefined, TemplateError
from lab2_grader import lab

from lab2_worksheet.errors import SourceError
from lab2_worksheet.places import SOURCE

T = TypeVar("T")


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the records below: frozen, and an unknown key is refused."""


class Command(Record, frozen=True):
    """A command of the worksheet.

    Args:
        id: Its name in the sources.
        terminal: In which terminal of the page it is typed.
        run: The command; `{{ … }}` takes facts of the lab.
        see: Regular expressions, each of which must be found in what it prints.
        keeps_running: It goes on until it is interrupted with Ctrl-C.
        stop: Ids of running commands that are interrupted before this one is typed.
        elsewhere: Pairs of a running command's id and a regular expression: what that one must then print.
        show: How many lines of its output the page shows; 0 for none.
        needs_exercise: It needs the exercise of 6.7 to be done.
        not_played: Why it is not played by a machine; empty when it is.
    """

    id: str
    terminal: Literal["A", "B", "C"]
    run: str
    see: tuple[str, ...] = ()
    elsewhere: tuple[tuple[str, str], ...] = ()
    keeps_running: bool = False
    stop: tuple[str, ...] = ()
    show: int = 0
    needs_exercise: bool = False
    not_played: str = ""


class Fault(Record, frozen=True):
    """A common fault: what it is, and in how many of the submissions that were read; 0 when it was not counted."""

    text: str
    seen: int = 0


class Change(Record, frozen=True):
    """A file of the solution and the file of the template it began as; empty when it is new."""

    file: str
    began_as: str


class Task(Record, frozen=True):
    """A part of the exercise.

    Args:
        id: Its name in the sources and in the page's memory of what is done.
        section: Its section number.
        row: The specification, label and value, in order; values are Markdown.
        hints: Three of them: a nudge, where to look, almost there.
        try_it: Commands that show whether it works, in order.
        expect: What they show when all is well; Markdown.
        minutes: How long it usually takes: an estimate for planning.
        changes: What the solution changes for it.
        marking: What whoever marks should know; Markdown.
        faults: Common faults.
    """

    id: str
    section: str
    row: tuple[tuple[str, str], ...]
    hints: tuple[str, str, str]
    try_it: tuple[str, ...]
    expect: str
    minutes: int
    changes: tuple[Change, ...]
    marking: str
    faults: tuple[Fault, ...]


class Option(Record, frozen=True):
    """An answer that can be chosen, and why it is right or wrong."""

    text: str
    reason: str
    right: bool = False


class Question(Record, frozen=True):
    """A question to check oneself with; `after` is the section at whose end it stands."""

    id: str
    after: str
    ask: str
    option: tuple[Option, ...]


class _Commands(Record, frozen=True):
    command: tuple[Command, ...]


class _Tasks(Record, frozen=True):
    task: tuple[Task, ...]


class _Questions(Record, frozen=True):
    question: tuple[Question, ...]


def facts() -> dict[str, object]:
    """The names that every source may use: the lab's facts, and nothing else."""
    return {
        "course": lab.course(),
        "spec": lab.specification(),
        "rubric": lab.rubric(),
        "package": lab.specification().package,
        "workspace": lab.course().workspace,
    }


@functools.cache
def _plain() -> Environment:
    return Environment(undefined=StrictUndefined, autoescape=False)  # fills TOML; escaped when it is shown


def fill(text: str, where: str) -> str:
    """*text* with the lab's facts put into its `{{ … }}`.

    Raises:
        SourceError: It names a fact that does not exist.
    """
    if "{{" not in text and "{%" not in text:
        return text
    try:
        return _plain().from_string(text).render(facts())
    except TemplateError as error:
        raise SourceError(f"{where}: {error}.") from error


def _read(path: Path, kind: type[T]) -> T:
    try:
        return msgspec.toml.decode(fill(path.read_text(encoding="utf-8"), path.name), type=kind)
    except msgspec.DecodeError as error:
        raise SourceError(f"{path.name}: {error}.") from error


def _by_id(path: Path, entries: tuple[T, ...]) -> dict[str, T]:
    found: dict[str, T] = {}
    for entry in entries:
        key = str(getattr(entry, "id"))  # noqa: B009 - the three kinds share the field, not a base
        if key in found:
            raise SourceError(f"{path.name}: {key} stands there twice.")
        found[key] = entry
    return found


@functools.cache
def commands() -> dict[str, Command]:
    """The commands by id, in the order in which they are played."""
    path = SOURCE / "commands.toml"
    return _by_id(path, _read(path, _Commands).command)


@functools.cache
def tasks() -> dict[str, Task]:
    """The tasks by id, in the order of the page."""
    path = SOURCE / "tasks.toml"
    return _by_id(path, _read(path, _Tasks).task)


@functools.cache
def questions() -> dict[str, Question]:
    """The questions by id, in the order of the page.

    Raises:
        SourceError: One has not exactly one right answer, or an answer without a reason.
    """
    path = SOURCE / "questions.toml"
    found = _by_id(path, _read(path, _Questions).question)
    for question in found.values():
        if sum(option.right for option in question.option) != 1 or not all(o.reason for o in question.option):
            raise SourceError(f"{path.name}: {question.id} needs one right answer, and a reason for each answer.")
    return found

"""Writes the lab's facts into the packages as handed out: what stands in them must be what stands in the facts."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from lab2_grader import lab

from lab2_worksheet.errors import SourceError
from lab2_worksheet.places import REPOSITORY


@dataclass(frozen=True)
class Fact:
    """A place in a handed-out file that repeats a fact.

    Args:
        path: The file, relative to the repository.
        pattern: Matches exactly one place; its first group is the fact.
        value: What must stand there.
    """

    path: str
    pattern: str
    value: str


def facts() -> tuple[Fact, ...]:
    """Every place that repeats a fact, with the value that the facts give it now."""
    course, specification = lab.course(), lab.specification()
    period = f"{specification.text_topic.period_seconds}"
    largest = f"{specification.number_topic.largest}"
    talkers = ("lab2_template/lab2/talker.py", "solution/lab2/talker.py", "solution/lab2/numeric_talker.py")
    workflows = ("lab2_template/.github/workflows/feedback.yml", "solution/.github/workflows/feedback.yml")
    return (
        *(Fact(path, r"period_in_seconds = (\S+)\n", period) for path in talkers),
        Fact("solution/lab2/numeric_talker.py", r"LARGEST_NUMBER = (\S+)\n", largest),
        *(Fact(path, r"\n  GRADER: (\S+)\n", course.grader_install_url) for path in workflows),
    )


def write(repository: Path = REPOSITORY) -> tuple[Path, ...]:
    """Put every fact in its place below *repository*; the files that changed.

    Raises:
        SourceError: A place is missing, or there are several.
    """
    changed = []
    for fact in facts():
        path = repository / fact.path
        text = path.read_text(encoding="utf-8")
        begin, end = _place(fact, text)
        if text[begin:end] != fact.value:
            path.write_text(text[:begin] + fact.value + text[end:], encoding="utf-8")
            changed.append(path)
    return tuple(changed)


def check(repository: Path = REPOSITORY) -> None:
    """Hold that every place says what the facts say: a page would contradict its own listings.

    Raises:
        SourceError: A place says something else, is missing, or there are several.
    """
    for fact in facts():
        text = (repository / fact.path).read_text(encoding="utf-8")
        begin, end = _place(fact, text)
        if text[begin:end] != fact.value:
            raise SourceError(f"{fact.path} says {text[begin:end]}, the facts say {fact.value}. Run `make worksheet`.")


def _place(fact: Fact, text: str) -> tuple[int, int]:
    found = list(re.finditer(fact.pattern, text))
    if len(found) != 1:
        raise SourceError(f"{fact.path}: {fact.pattern!r} stands there {len(found)} times; it must stand there once.")
    return found[0].span(1)

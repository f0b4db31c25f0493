"""Grades animals of the zoo side by side, and says in which verdicts a result differs from what is expected."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from zoo_builder import Animal, Repository

from lab2_grader import pipeline
from lab2_grader.records import CheckResult, Result, Status, Verdict

AT_ONCE = 3  # two cores: a submission waits for half of its time


class Zoo:
    """Grades *animals* in the background, in their order.

    Args:
        means: With what they are graded.
        folder: Where they are built and their results go; its own.
        animals: Which.
        at_once: How many side by side.
    """

    def __init__(self, means: pipeline.Means, folder: Path, animals: Iterable[Animal], at_once: int = AT_ONCE) -> None:
        self._means = means
        self._folder = folder
        self._pool = ThreadPoolExecutor(max_workers=at_once)
        self._results: dict[str, Future[Result]] = {
            animal.name: self._pool.submit(self._grade, animal) for animal in animals
        }

    def _grade(self, animal: Animal) -> Result:
        built = animal.build(self._folder / animal.name / "in")
        return pipeline.grade(str(built), self.folder(animal.name), self._means, lambda doing: None)[0]

    def folder(self, name: str) -> Path:
        """Where the result of the animal *name* is."""
        return self._folder / name / "out"

    def result(self, name: str) -> Result:
        """The result of the animal *name*; waits for it."""
        return self._results[name].result()

    def __enter__(self) -> Zoo:
        return self

    def __exit__(self, *exception: object) -> None:
        self._pool.shutdown(cancel_futures=True)


def complaints(animal: Animal | Repository, checks: Iterable[CheckResult | Verdict]) -> list[str]:
    """In which ways *checks* are not what *animal* must get; empty when they are."""
    found = []
    expected = animal.statuses()
    for check in checks:
        name = check.id if isinstance(check, CheckResult) else check.check
        seen = f"{name}: {check.status.value} {check.message} {check.because or ''} ({check.observed} | {check.hint})"
        if check.status.value != expected[name]:
            found.append(f"{seen} instead of {expected[name]}")
        elif check.status is Status.FAIL:
            key, fragment = animal.fails[name]
            if check.message != key:
                found.append(f"{seen} instead of {key}")
            if fragment not in check.hint:
                found.append(f"{seen} without '{fragment}'")
            if not (check.expected and check.observed and check.hint):
                found.append(f"{seen} without words")
        elif (
            check.status is Status.BLOCKED
            and isinstance(animal, Animal)
            and not set((animal.blocked.get(name) or animal.blocks_all).split(" or ")).intersection(check.because)
        ):
            found.append(f"{seen} instead of because of {animal.blocked.get(name) or animal.blocks_all}")
    return found

"""Measures how fast a class is graded and marked again; `make bench` calls `figures`.

Usage: python bench_class.py [--count 100] [--seed 1] [--kind directories|minerva|repositories] [--jobs N] [--out FOLDER]

Processor time and memory are those of the whole machine while it works, so it should have nothing else to do.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import tempfile
import threading
import time
from pathlib import Path

from class_generator import KINDS, make

from lab2_grader import lab, pipeline, process
from lab2_grader.classroom import pool, remark, run
from lab2_grader.records import ClassLine, ClassState

SAMPLE_SECONDS = 0.2


class _Silent:
    """Watches a class without a word."""

    def total(self, entries: int, unknown: int) -> None: ...
    def begins(self, name: str, doing: str) -> None: ...
    def ended(self, line: ClassLine, *, before: bool) -> None: ...
    def again(self, names: tuple[str, ...]) -> None: ...


class _Peak:
    """The most memory that the machine had in use since it was entered, beyond what was in use then."""

    def __enter__(self) -> _Peak:
        self._least = self._before = pool.memory_free()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._sample)
        self._thread.start()
        return self

    def _sample(self) -> None:
        while not self._end.wait(SAMPLE_SECONDS):
            self._least = min(self._least, pool.memory_free())

    def __exit__(self, *exception: object) -> None:
        self._end.set()
        self._thread.join()

    @property
    def megabytes(self) -> int:
        return (self._before - self._least) // 1_000_000


def measure(folder: Path, count: int, seed: int = 1, kind: str = "directories", jobs: int = 0) -> dict[str, float]:
    """Grade a class of *count* below *folder*, go over it again, and judge it again; the figures."""
    box, expected = make(folder / "class", count, seed, kind)
    out = folder / "results"
    order = run.Order(str(box), str(out), lab.rubric(), jobs=jobs)
    busy, began = pool.ticks()[0], time.monotonic()
    with _Peak() as peak:
        summed = run.grade_class(order, _Silent())
    seconds = time.monotonic() - began
    cpu = (pool.ticks()[0] - busy) / os.sysconf("SC_CLK_TCK")
    began = time.monotonic()
    run.grade_class(order, _Silent())
    again = time.monotonic() - began
    results = {path.parent.name: json.loads(path.read_bytes()) for path in out.glob("*/result.json")}
    wrong = sum(_differs(results.get(name), animal.statuses()) for name, animal in expected.items())
    return {
        "class_per_minute": round(60 * count / seconds, 1),
        "class_cpu_seconds_each": round(cpu / count, 2),
        "class_seconds_each": round(seconds / count, 2),
        "class_peak_megabytes": peak.megabytes,
        "class_withheld": sum(line.state is not ClassState.GRADED for line in summed.lines),
        "class_otherwise_than_expected": wrong,
        "class_second_call_seconds": round(again, 2),
        "rescore_per_second": rescore_per_second(out, folder / "many"),
    }


def rescore_per_second(out: Path, folder: Path, count: int = 1000) -> float:
    """How many recorded submissions are judged again in a second: those in *out*, copied to *folder* until they are *count*."""
    recorded = sorted(path.parent for path in out.glob(f"*/{pipeline.EVIDENCE}"))
    for number, source in zip(range(count), itertools.cycle(recorded)):
        shutil.copytree(source, folder / f"{number:04}")
    remark.rescore(folder, lab.rubric())  # what was recorded by another version of the grader is another result now
    began = time.monotonic()
    judged = remark.rescore(folder, lab.rubric()).count
    return round(judged / (time.monotonic() - began), 1)


def _differs(result: dict[str, list[dict[str, str]]] | None, expected: dict[str, str]) -> bool:
    if result is None:
        return True
    return any(
        check["status"] != expected[check["id"]] for check in result["checks"] if not check["id"].startswith("git-")
    )


def figures(count: int = 24) -> dict[str, float]:
    """What `make bench` adds: three figures of a mixed class of *count*."""
    with tempfile.TemporaryDirectory() as name:
        found = measure(Path(name), count)
    return {name: found[name] for name in ("class_per_minute", "class_cpu_seconds_each", "rescore_per_second")}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, default=KINDS[0])
    parser.add_argument("--jobs", type=int, default=0)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    process.become_reaper()
    with tempfile.TemporaryDirectory() as name:
        below = arguments.out or Path(name)
        print(json.dumps(measure(below, arguments.count, arguments.seed, arguments.kind, arguments.jobs), indent=2))

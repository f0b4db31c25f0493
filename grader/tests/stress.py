"""Grades some animals again and again on an overloaded machine: no verdict may change.

PYTHONPATH=grader python grader/tests/stress.py [--times 20] [--loops 4] [--seconds 7200]        (or `make stress`)

Each processor gets so many busy loops. What the machine makes impossible may be inconclusive, which withholds the mark;
a verdict that is wrong is an error. Stops by itself after so many seconds.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import zoo_builder
from zoo_runner import complaints

from lab2_grader import lab, pipeline, process, ros, sandbox


def spin(parent: int) -> None:
    """Keep a processor busy for as long as *parent* lives."""
    while os.getppid() == parent:
        sum(range(100_000))


def main() -> int:
    """Grade, compare, say what changed; 1 when anything did."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--loops", type=int, default=4, help="busy loops for each processor")
    parser.add_argument("--seconds", type=float, default=7200, help="stop after so long")
    arguments = parser.parse_args()
    process.become_reaper()
    means = pipeline.Means(ros.find(), sandbox.probe(), lab.rubric())
    animals = [animal for animal in zoo_builder.animals().values() if animal.under_load]
    loops = arguments.loops * (os.cpu_count() or 1)
    workers = [multiprocessing.Process(target=spin, args=(os.getpid(),), daemon=True) for _ in range(loops)]
    for worker in workers:
        worker.start()
    began, graded, wrong, withheld = time.monotonic(), 0, Counter[str](), Counter[str]()
    try:
        for turn in range(arguments.times):
            for animal in animals:
                if time.monotonic() - began > arguments.seconds:
                    break
                with tempfile.TemporaryDirectory() as folder:
                    submission = animal.build(Path(folder) / "in")
                    result, _ = pipeline.grade(str(submission), Path(folder) / "out", means, lambda doing: None)
                graded += 1
                if not result.graded:
                    withheld[animal.name] += 1
                    sys.stdout.write(f"turn {turn + 1}, {animal.name}: withheld. {' '.join(result.notes)}\n")
                elif found := complaints(animal, result.checks):
                    wrong[animal.name] += 1
                    sys.stdout.write(f"turn {turn + 1}, {animal.name}: " + "\n  ".join(found) + "\n")
                sys.stdout.flush()
    finally:
        for worker in workers:
            worker.kill()
    seconds = time.monotonic() - began
    sys.stdout.write(
        f"{graded} grades of {len(animals)} animals beside {loops} busy loops in {seconds:.0f} s: "
        f"{wrong.total()} changed verdicts, {withheld.total()} withheld.\n"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

"""Hostile submissions get a verdict, and nothing else: each goes through the real pipeline, one at a time.

What each may get is in `hostile/*.toml`. Whatever it is after, the same holds for all: a mark is given (or, where the
data says so, it gets what an honest package with its faults would), nothing of it is left a second later, what it
looked for it did not find, and it did not hold the grader for longer than the bound.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import hostile_builder
import msgspec
import pytest
import traces
from readers import shown_harmlessly
from zoo_builder import ROOT

from lab2_grader import lab, pipeline, process, report
from lab2_grader.records import Result, Status

ANIMALS = hostile_builder.animals()
SECRET = "canary" + secrets.token_hex(8)


class Bait:
    """What a submission could be after on this machine: a file, a key in the environment, three sockets.

    Args:
        folder: Where the file and the socket are; readable for all.
    """

    def __init__(self, folder: Path) -> None:
        self.reached: list[str] = []
        self.file = folder / "results-of-another"
        self.file.write_text(SECRET)
        self._sockets = []
        self.abstract = f"lab2-{SECRET}"
        self.path = str(folder / "socket")
        for family, address in (
            (socket.AF_INET, ("127.0.0.1", 0)),
            (socket.AF_UNIX, f"\0{self.abstract}"),
            (socket.AF_UNIX, self.path),
        ):
            listener = socket.socket(family, socket.SOCK_STREAM)
            listener.bind(address)
            listener.listen()
            self._sockets.append(listener)
            threading.Thread(target=self._accept, args=(listener,), daemon=True).start()
        self.port = self._sockets[0].getsockname()[1]

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listener.accept()
                connection.close()
                self.reached.append(str(listener.getsockname()))

    def close(self) -> None:
        for listener in self._sockets:
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)
            listener.close()

    def values(self, means: pipeline.Means) -> dict[str, str]:
        """What stands in the place of `@NAME@` in the animals."""
        visible = [
            sys.prefix,
            sys.base_prefix,
            os.path.realpath(sys.base_prefix),
            *means.ros.reads(),
            *means.ros.prefixes,
        ]
        return {
            "SECRET": SECRET,
            "FILE": str(self.file),
            "SOLUTION": str(ROOT / "solution" / "setup.py"),
            "PORT": str(self.port),
            "ABSTRACT": self.abstract,
            "SOCKET": self.path,
            "VISIBLE": repr(tuple(visible)),
        }


@pytest.fixture(scope="module")
def bait(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bait]:
    folder = tmp_path_factory.mktemp("bait")
    os.environ["LAB2_GRADER_KEY"] = SECRET
    bait = Bait(folder)
    try:
        yield bait
    finally:
        del os.environ["LAB2_GRADER_KEY"]
        bait.close()


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for temporary files that nobody else uses, so that what is left in it can be counted."""
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


# The limits of the whole tree, one animal each, are in the normal run; all others in `make test-slow`.
NORMAL = ("fork-bomb", "thread-bomb", "memory-hog", "memory-hog-of-many", "disk-filler", "shared-memory-filler")


def _parameters() -> list[object]:
    return [
        pytest.param(name, marks=[] if name in NORMAL and not animal.slow else [pytest.mark.slow])
        for name, animal in ANIMALS.items()
        if name not in {other.beside for other in ANIMALS.values()}
    ]


def _short_build(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    limits = lab.limits()
    shorter = msgspec.structs.replace(limits, build=msgspec.structs.replace(limits.build, seconds=seconds))
    monkeypatch.setattr(lab, "limits", lambda: shorter)


@pytest.mark.parametrize("name", _parameters())
def test_gets_a_verdict_and_nothing_else(
    name: str,
    means: pipeline.Means,
    bait: Bait,
    temporary: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    record_property: object,
) -> None:
    if not means.isolation.on:
        pytest.skip(f"hostile code is run only behind walls: {means.isolation.reason}")
    animal = ANIMALS[name]
    if animal.build_seconds:
        _short_build(monkeypatch, animal.build_seconds)
    mounted, shared = traces.mounts(), set(os.listdir("/dev/shm"))
    source = animal.build(tmp_path / "in", bait.values(means))
    began = time.monotonic()
    with ThreadPoolExecutor(max_workers=1) as pool:
        if animal.beside:
            other = ANIMALS[animal.beside].build(tmp_path / "beside", bait.values(means))
            beside = pool.submit(pipeline.grade, str(other), tmp_path / "out-beside", means, lambda doing: None)
        result, out = pipeline.grade(str(source), tmp_path / "out", means, lambda doing: None)
        held = time.monotonic() - began
        if animal.beside:
            assert beside.result()[0].score == beside.result()[0].max_score
    record_property("held", held)  # type: ignore[operator]

    assert not traces.soon_empty(lambda: traces.processes(process.run_name()))
    assert not traces.soon_empty(lambda: traces.files(temporary))
    assert traces.mounts() == mounted
    assert not {entry for entry in set(os.listdir("/dev/shm")) - shared if SECRET in entry or "hoard" in entry}
    assert not list(tmp_path.rglob("*escaped*"))
    assert not bait.reached, "it came out of its network"

    assert not _complaints(animal, result)
    recorded = b"".join(path.read_bytes() for path in sorted((out / "evidence").iterdir())).decode()
    leaks = [line for line in recorded.splitlines() if "LEAK" in line.replace("print('LEAK", "")]
    assert not [line[max(0, line.find("LEAK") - 50) : line.find("LEAK") + 200] for line in leaks if _printed(line)]
    for text in animal.says:
        assert text in recorded.replace(f"print('{text}", "")
    for fragment in animal.notes:
        assert any(fragment in note for note in result.notes), (fragment, result.notes)
    assert held < animal.seconds
    for file, data in report.files(result, *_evidence(out)):
        shown_harmlessly(file, data)


def _printed(line: str) -> bool:
    """Whether this line of the evidence is something that was printed, not a source file that was kept."""
    return line.startswith('["Line"') or '"log"' in line


def _evidence(out: Path) -> tuple[object, ...]:
    from lab2_grader import evidence

    return (evidence.read(out / "evidence"),)


def _complaints(animal: hostile_builder.Animal, result: Result) -> list[str]:
    """In which ways *result* is not what *animal* must get."""
    found = [] if result.graded else [f"no mark: {result.notes}"]
    expected = animal.statuses()
    for check in result.checks:
        seen = f"{check.id}: {check.status.value} {check.message} {check.because or ''} ({check.observed})"
        if check.id in animal.any_of and check.status is not Status.INCONCLUSIVE:
            continue
        if check.status.value != expected[check.id]:
            found.append(f"{seen} instead of {expected[check.id]}")
        elif check.status is Status.FAIL and check.message != animal.fails[check.id]:
            found.append(f"{seen} instead of {animal.fails[check.id]}")
        elif (
            check.status is Status.BLOCKED and (animal.blocked.get(check.id) or animal.blocks_all) not in check.because
        ):
            found.append(f"{seen} because of something else")
    return found


def test_there_are_enough() -> None:
    assert len(ANIMALS) >= 40

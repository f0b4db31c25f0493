"""However a run of the grader ends, a second later nothing of it is left on the machine but its results.

Real runs of the command line, ended in each way, at each stage, with submissions that do not want to go.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import hostile_builder
import pytest
import traces
from zoo_builder import ROOT

from lab2_grader import cgroup, pipeline, process

SOON = 60.0  # until a stage is reached, on a busy machine
STAYS = "import time\ntime.sleep(100)\n"


class Run:
    """A `lab2-grader grade` with a folder for temporary files of its own."""

    def __init__(self, source: Path, folder: Path, *options: str) -> None:
        self.out = folder / "out"
        self.temporary = folder / "tmp"
        self.temporary.mkdir()
        environment = os.environ | {"TMPDIR": str(self.temporary), "PYTHONPATH": str(ROOT / "grader")}
        environment.pop(process.MARK, None)
        self.popen = subprocess.Popen(
            [sys.executable, "-m", "lab2_grader", "grade", str(source), "--out", str(self.out), *options],
            env=environment,
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + SOON
        while not condition():
            assert self.popen.poll() is None, self.popen.stderr and self.popen.stderr.read()
            assert time.monotonic() < deadline
            time.sleep(0.02)

    def reach(self, stage: str) -> None:
        """Wait until the submission's own code runs in that stage."""
        marker = {"build": "contextlib import suppress", "scenes": "/lib/lab2/"}[stage]  # colcon asks setup.py like so
        self.until(lambda: any(marker in line for line in traces.processes(f"{self.popen.pid}.")))

    def end(self) -> int:
        code = self.popen.wait(SOON)
        assert self.popen.stderr is not None
        self.popen.stderr.close()
        return code

    def left(self) -> list[str]:
        """Everything of this run that is there."""
        mine = f"{cgroup.PREFIX}{self.popen.pid}."
        base = process.control_groups()
        groups = [path for folder in (base.paths() if base else ()) for path in Path(folder).glob(f"{mine}*")]
        return [
            *traces.processes(f"{self.popen.pid}."),
            *traces.processes_naming(str(self.temporary)),
            *map(str, self.temporary.iterdir()),
            *map(str, groups),
        ]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    started: list[Run] = []

    def start(source: Path, *options: str) -> Run:
        started.append(Run(source, tmp_path, *options))
        return started[-1]

    yield start
    for one in started:
        with contextlib.suppress(ProcessLookupError):
            one.popen.kill()
        one.end()


@pytest.fixture
def sticky(tmp_path: Path) -> Callable[[str], Path]:
    """A submission that leaves daemons behind and stays for long in a stage."""

    def make(stage: str) -> Path:
        daemon = hostile_builder.snippets().DAEMON
        file = {"build": "setup", "scenes": "talker"}[stage]
        animal = hostile_builder.Animal("sticky", "stays", prepend={file: daemon + STAYS})
        return animal.build(tmp_path / "in", {})

    return make


def _shared_memory() -> set[str]:
    return {name for name in os.listdir("/dev/shm") if "lab2" in name or "fastrtps" in name or "fastdds" in name}


@pytest.mark.parametrize("stage", ["build", "scenes"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_is_ended(
    stage: str, number: signal.Signals, run: Callable[..., Run], sticky: Callable[[str], Path], means: pipeline.Means
) -> None:
    if not means.isolation.on:
        pytest.skip("hostile code is run only behind walls")
    mounted = traces.mounts()
    grading = run(sticky(stage))
    grading.reach(stage)
    assert grading.left()
    grading.popen.send_signal(number)
    code = grading.end()
    assert code == (-signal.SIGKILL if number is signal.SIGKILL else 130)
    assert not traces.soon_empty(grading.left, 5.0 if os.getloadavg()[0] > 8 else traces.GONE_SECONDS)
    assert traces.mounts() == mounted
    partial = json.loads((grading.out / "result.json").read_text())
    assert partial["graded"] is False
    assert partial["score"] is None
    assert any("stopped" in note for note in partial["notes"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_run_without_isolation_that_is_ended(number: signal.Signals, run: Callable[..., Run]) -> None:
    grading = run(ROOT / "solution", "--isolation", "off")
    grading.reach("scenes")
    grading.popen.send_signal(number)
    grading.end()
    assert not traces.soon_empty(grading.left, 5.0 if os.getloadavg()[0] > 8 else traces.GONE_SECONDS)


def test_a_run_that_ends_well(run: Callable[..., Run]) -> None:
    mounted, shared = traces.mounts(), _shared_memory()
    grading = run(ROOT / "solution")
    assert grading.end() == 0
    assert not grading.left()
    assert traces.mounts() == mounted
    assert _shared_memory() <= shared


def test_a_run_that_is_refused(run: Callable[..., Run], tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    grading = run(tmp_path / "in")
    assert grading.end() == 2
    assert not grading.left()
    assert not grading.out.exists()

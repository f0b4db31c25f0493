"""A class on a Dask cluster: a real scheduler and two workers on loopback, one of which is killed in the middle."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from class_generator import make
from conftest import ROOT
from test_classroom import Watched, graded, marks, order, wrong

from lab2_grader.classroom import run
from lab2_grader.classroom.cluster import Cluster
from lab2_grader.errors import UsageError
from lab2_grader.records import ClassState

pytest.importorskip("distributed", reason="the extra `dask` is not installed")


@contextmanager
def started(
    *arguments: str, log: Path, wanted: str, grader: Path = ROOT / "grader"
) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """A process of Dask that has said *wanted* in *log*; (it, what that matched)."""
    environment = {
        **os.environ,
        "PYTHONPATH": f"{grader}:{os.environ.get('PYTHONPATH', '')}",
        "DASK_DISTRIBUTED__WORKER__DAEMON": "False",
    }
    argv = [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]]
    with log.open("w") as file:
        process = subprocess.Popen(argv, env=environment, cwd=log.parent, stdout=subprocess.DEVNULL, stderr=file)
    try:
        deadline = time.monotonic() + 60
        while not (match := re.search(wanted, log.read_text())):
            assert time.monotonic() < deadline and process.poll() is None, log.read_text()
            time.sleep(0.05)
        yield process, match[1]
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """(address of a scheduler, its workers)."""
    with ExitStack() as stack:
        scheduler = ("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        _, address = stack.enter_context(
            started(*scheduler, log=folder / "scheduler.log", wanted=r"Scheduler at:\s+(tcp://\S+)")
        )
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--memory-limit", "0", "--host", "127.0.0.1")
        found = []
        for number in range(workers):
            own = folder / f"worker-{number}"
            own.mkdir()
            worker = ("dask_worker", address, *options, "--local-directory", str(own))
            said = started(*worker, log=folder / f"worker-{number}.log", wanted=r"Registered to:\s+(tcp://\S+)")
            found.append(stack.enter_context(said)[0])
        yield address, found


def test_the_same_marks_although_a_worker_is_killed(tmp_path: Path) -> None:
    box, expected = make(tmp_path / "class", 5, 2)
    with cluster(tmp_path, 2) as (address, workers):

        class Killing(Watched):
            def ended(self, line, *, before):
                super().ended(line, before=before)
                workers[0].send_signal(signal.SIGKILL)  # with the first result: it is at its next one

        watched = Killing()
        summed = run.grade_class(order(box, tmp_path / "results", scheduler=address), watched)
        assert workers[0].wait(5) == -signal.SIGKILL and workers[1].poll() is None
    assert {line.state for line in summed.lines} == {ClassState.GRADED}
    assert len(watched.graded) == len(set(watched.graded)) == 5
    for name, (_, found) in marks(tmp_path / "results").items():
        assert wrong(found, expected[name]) == {}
    _, again = graded(box, tmp_path / "results")  # here, without the cluster: what is there is up to date
    assert sorted(again.known) == sorted(expected)


def test_a_worker_with_another_grader_is_named(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "grader/lab2_grader", tmp_path / "other/lab2_grader")
    with (tmp_path / "other/lab2_grader/score.py").open("a") as file:
        file.write("# another version\n")
    with ExitStack() as stack:
        address, _ = stack.enter_context(cluster(tmp_path, 0))
        one = Cluster(address)
        try:
            with pytest.raises(UsageError, match="no workers"):
                one.check("auto", isolation=True)
            options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path / "w"))
            worker = ("dask_worker", address, *options)
            registered = r"Registered to:\s+(tcp://\S+)"
            other = started(*worker, log=tmp_path / "other.log", wanted=registered, grader=tmp_path / "other")
            stack.enter_context(other)
            with pytest.raises(UsageError, match="another grader"):
                one.check("auto", isolation=True)
        finally:
            one.close()


def test_nobody_at_that_address() -> None:
    with pytest.raises(UsageError, match="No Dask scheduler"):
        Cluster("tcp://127.0.0.1:1")

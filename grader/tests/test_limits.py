"""Every limit at its edge: what stays just below is left alone, what goes just above is stopped and named.

Twice: with control groups where this machine has them, and without, as on machines that have none.
"""

from __future__ import annotations

import io
import tarfile
import time
from pathlib import Path

import msgspec
import pytest

from lab2_grader import build, lab, messages, pipeline, process, sandbox
from lab2_grader.checks.verdicts import failed
from lab2_grader.errors import FaultError
from lab2_grader.observe.output import OutputLines
from lab2_grader.records import EndedBy, Limits, Outcome, Request

PYTHON = "/usr/bin/python3"
MB = 1_000_000
TOUCH = "data = bytearray({size})\nfor i in range(0, len(data), 4096): data[i] = 1\nimport time; time.sleep(0.5)"
CHILDREN = """
import subprocess, time
children = [subprocess.Popen(['sleep', '5']) for _ in range({count})]
time.sleep(0.5)
print('all')
for child in children: child.kill()
"""


@pytest.fixture(params=["control groups", "watching"], autouse=True)
def means_of_limits(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "watching":
        monkeypatch.setattr(process, "control_groups", lambda: None)
    elif process.control_groups() is None:
        pytest.skip("no control groups here")
    return str(request.param)


@pytest.fixture
def isolation(means: pipeline.Means) -> sandbox.Isolation:
    if not means.isolation.on:
        pytest.skip(means.isolation.reason)
    if not Path(PYTHON).exists():
        pytest.skip("no Python of the system")
    return means.isolation


def _run(isolation: sandbox.Isolation, code: str, limits: Limits) -> Outcome:
    request = Request((PYTHON, "-c", code), (("PATH", "/usr/bin:/bin"),), "/tmp", limits)
    return process.run(sandbox.confine(request, (), isolation))


def test_processes(isolation: sandbox.Isolation) -> None:
    limits = Limits(seconds=20, processes=40)
    below = _run(isolation, CHILDREN.format(count=30), limits)
    assert (below.code, below.limit) == (0, "")
    above = _run(isolation, CHILDREN.format(count=60), limits)
    assert (above.ended_by, above.limit) == (EndedBy.LIMIT, "processes")
    assert b"all" not in above.stdout


def test_threads_count_as_processes(isolation: sandbox.Isolation) -> None:
    code = "import threading, time\nfor _ in range({count}): threading.Thread(target=time.sleep, args=(1,)).start()"
    assert _run(isolation, code.format(count=25), Limits(seconds=20, processes=40)).limit == ""
    assert _run(isolation, code.format(count=60), Limits(seconds=20, processes=40)).limit == "processes"


def test_memory(isolation: sandbox.Isolation) -> None:
    limits = Limits(seconds=20, memory_bytes=200 * MB)
    below = _run(isolation, TOUCH.format(size=150 * MB), limits)
    assert (below.code, below.limit) == (0, "")
    above = _run(isolation, TOUCH.format(size=250 * MB), limits)
    assert (above.ended_by, above.limit) == (EndedBy.LIMIT, "memory")


def test_memory_is_that_of_the_whole_tree(isolation: sandbox.Isolation) -> None:
    code = f"import os\nfor _ in range(3): os.fork()\n{TOUCH.format(size=40 * MB)}"
    assert _run(isolation, code, Limits(seconds=20, memory_bytes=200 * MB)).limit == "memory"


def test_time_on_processors(isolation: sandbox.Isolation) -> None:
    spin = "import time\nwhile time.process_time() < {seconds}: pass"
    limits = Limits(seconds=60, cpu_seconds=1.5)
    assert _run(isolation, spin.format(seconds=0.8), limits).limit == ""
    assert _run(isolation, spin.format(seconds=30), limits).limit == "cpu"


def test_wall_time(isolation: sandbox.Isolation) -> None:
    below = _run(isolation, "import time; time.sleep(0.2)", Limits(seconds=20))
    assert (below.code, below.ended_by) == (0, EndedBy.ITSELF)
    began = time.monotonic()
    above = _run(isolation, "import time; time.sleep(60)", Limits(seconds=1))
    assert (above.ended_by, above.limit) == (EndedBy.DEADLINE, "seconds")
    ladder = lab.limits().stop
    assert time.monotonic() - began < 1 + ladder.interrupt_seconds + ladder.terminate_seconds + 5


def test_the_size_of_a_file(isolation: sandbox.Isolation) -> None:
    write = "open('/tmp/file', 'wb').write(bytes({size}))"
    limits = Limits(seconds=20, file_bytes=5 * MB)
    assert _run(isolation, write.format(size=5 * MB), limits).code == 0
    above = _run(
        isolation, f"import os\n{write.format(size=5 * MB + 1)}\nassert os.stat('/tmp/file').st_size > {5 * MB}", limits
    )
    assert above.code != 0


@pytest.mark.parametrize("where", ["/tmp", "/dev/shm", sandbox.HOME])
def test_the_disk(where: str, isolation: sandbox.Isolation) -> None:
    size = lab.limits().resources.scratch_bytes
    code = f"for i in range({{count}}): open(f'{where}/{{{{i}}}}', 'wb').write(bytes({size // 20}))"
    assert _run(isolation, code.format(count=19), Limits(seconds=20)).code == 0
    above = _run(isolation, code.format(count=22), Limits(seconds=20))
    assert above.code != 0
    assert b"No space left on device" in above.stderr


@pytest.mark.parametrize("where", ["/", "/dev", "/usr", "/home", "/proc", "/etc"])
def test_nothing_else_can_be_written_to(where: str, isolation: sandbox.Isolation) -> None:
    outcome = _run(isolation, f"open('{where}/file', 'w')", Limits(seconds=20))
    assert (
        b"Read-only file system" in outcome.stderr
        or b"Permission denied" in outcome.stderr
        or b"No such file" in outcome.stderr
    )


def test_output_that_is_kept(isolation: sandbox.Isolation) -> None:
    code = "import sys\nsys.stdout.write('x' * {size})\nsys.stderr.write('y' * 100)"
    exact = _run(isolation, code.format(size=50_000), Limits(seconds=20, output_bytes=50_000))
    assert (len(exact.stdout), len(exact.stderr), exact.dropped_bytes) == (50_000, 100, 0)
    above = _run(isolation, code.format(size=50_001), Limits(seconds=20, output_bytes=50_000))
    assert (len(above.stdout), len(above.stderr), above.dropped_bytes) == (50_000, 100, 1)


def test_a_line_that_is_kept() -> None:
    lines = OutputLines("stdout", "talker", 100)
    assert [line.text for line in lines.take(b"x" * 100 + b"\n" + b"y" * 101 + b"\nz\n", 0.0)][0] == "x" * 100
    overlong = OutputLines("stdout", "talker", 100)
    first = overlong.take(b"y" * 101, 0.0)
    assert [len(line.text) for line in first] == [100]
    assert [line.text for line in overlong.take(b"y" * 1000 + b"\nz\n", 0.0)] == ["z"]


def test_what_a_build_installs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limits = lab.limits()
    small = msgspec.structs.replace(limits, build=msgspec.structs.replace(limits.build, files=5, install_bytes=1000))
    monkeypatch.setattr(lab, "limits", lambda: small)

    def archive(*sizes: int) -> bytes:
        data = io.BytesIO()
        with tarfile.open(fileobj=data, mode="w") as members:
            for index, size in enumerate(sizes):
                member = tarfile.TarInfo(f"install/{index}")
                member.size = size
                members.addfile(member, io.BytesIO(bytes(size)))
        return data.getvalue()

    assert build._unpack(archive(*[200] * 5), tmp_path) == ""
    assert build._unpack(archive(*[1] * 6), tmp_path) == "files"
    assert build._unpack(archive(500, 501), tmp_path) == "install"
    assert build._unpack(b"no archive at all" * 100, tmp_path) == "install"


def test_every_limit_has_words_that_can_be_acted_on() -> None:
    for limit in ("processes", "memory", "cpu", "file", "disk", "install", "files"):
        verdict = failed("package-builds", f"limit-{limit}")
        assert any(character.isdigit() for character in verdict.observed)
        assert verdict.hint
    for limit in ("processes", "memory", "cpu", "disk", "seconds"):
        assert messages.note(f"limit-{limit}", **messages.limits() | {"scene": "listener", "seconds": 5})


def test_walls_that_cannot_be_put_up_are_our_fault(isolation: sandbox.Isolation) -> None:
    request = Request(("true",), (("PATH", "/usr/bin"),), "/tmp", Limits(seconds=10))
    with pytest.raises(FaultError, match="sandbox did not start"):
        process.run(sandbox.confine(request, (sandbox.Mount("/nowhere/at/all"),), isolation))


def test_a_program_that_fails_at_once_is_not_taken_for_the_walls(isolation: sandbox.Isolation) -> None:
    outcome = _run(isolation, "import sys; sys.exit('bwrap: Creating new namespace failed')", Limits(seconds=10))
    assert outcome.code == 1
    assert outcome.stderr == b"bwrap: Creating new namespace failed\n"


def test_who_cannot_take_output_does_not_hang(isolation: sandbox.Isolation) -> None:
    def full(stream: str, data: bytes) -> None:
        raise OSError(28, "No space left on device")

    request = Request(("yes",), (("PATH", "/usr/bin"),), "/tmp", Limits(seconds=30))
    began = time.monotonic()
    with pytest.raises(FaultError, match="No space left on device"):
        process.run(sandbox.confine(request, (), isolation), full)
    assert time.monotonic() - began < 10

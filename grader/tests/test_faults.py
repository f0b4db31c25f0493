"""What fails of ours or of the machine's costs no mark: the grader says so, ends with 3 (or a clear 2), and keeps what it has.

The faults are real: a tiny disk, a read-only folder, a kernel that refuses namespaces, a killed observer.
"""

from __future__ import annotations

import ast
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec
import pytest
import traces
from zoo_builder import ROOT

import lab2_grader
from lab2_grader import pipeline, process, process_table, report
from lab2_grader.observe.observer import BLIND_SECONDS, Observer
from lab2_grader.observe.recorder import Recorder
from lab2_grader.records import Limits, Request, Result, Status
from lab2_grader.sandbox import Isolation

GRADER = (sys.executable, "-m", "lab2_grader")


def _grade(out: Path, *around: str, code: str = "") -> subprocess.CompletedProcess[str]:
    """Grade the solution from within *around*; *code* is run in the place of the command line when it is given."""
    run = (sys.executable, "-c", code) if code else (*GRADER, "grade", str(ROOT / "solution"), "--out", str(out))
    environment = os.environ | {"PYTHONPATH": str(ROOT / "grader")}
    environment.pop(process.MARK, None)
    return subprocess.run([*around, *run], env=environment, cwd=out.parent, capture_output=True, text=True, timeout=120)


def _is_withheld(result: Result) -> None:
    assert not result.graded
    assert result.score is None
    lost = [check.id for check in result.checks if check.status in (Status.FAIL, Status.PARTIAL)]
    assert not lost, "a fault of ours cost a mark"


def _needs_walls(means: pipeline.Means) -> None:
    if not means.isolation.on:
        pytest.skip(means.isolation.reason)


def test_colcon_is_missing(means: pipeline.Means, tmp_path: Path) -> None:
    if any(Path(folder, "colcon").exists() for folder in ("/usr/local/bin", "/usr/bin", "/bin")):
        pytest.skip("colcon belongs to the system here")
    without = msgspec.structs.replace(means, ros=msgspec.structs.replace(means.ros, path=()))
    result, out = pipeline.grade(str(ROOT / "solution"), tmp_path / "out", without, lambda doing: None)
    _is_withheld(result)
    assert any("colcon is not installed" in note for note in result.notes)
    assert json.loads((out / "result.json").read_text())["graded"] is False


def test_colcon_is_half_installed(means: pipeline.Means, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    (broken / "colcon_core").mkdir(parents=True)
    (broken / "colcon_core" / "__init__.py").write_text("raise ImportError('colcon_core is half installed')\n")
    path = (str(broken), *means.ros.python_path)
    prefixes = (*means.ros.prefixes, str(broken))  # so that it is seen inside
    half = msgspec.structs.replace(means, ros=msgspec.structs.replace(means.ros, python_path=path, prefixes=prefixes))
    result, _ = pipeline.grade(str(ROOT / "solution"), tmp_path / "out", half, lambda doing: None)
    _is_withheld(result)
    assert any("does not build anything" in note and "half installed" in note for note in result.notes)


def test_colcon_is_not_found_inside_the_sandbox(means: pipeline.Means, tmp_path: Path) -> None:
    _needs_walls(means)
    outside = tmp_path / "bin"
    outside.mkdir()
    (outside / "colcon").symlink_to(Path(process.PYTHON).with_name("colcon"))
    lost = msgspec.structs.replace(means, ros=msgspec.structs.replace(means.ros, path=(str(outside),)))
    result, _ = pipeline.grade(str(ROOT / "solution"), tmp_path / "out", lost, lambda doing: None)
    _is_withheld(result)
    assert any("colcon is not found inside" in note for note in result.notes)


def test_the_grader_is_called_by_a_roundabout_name_of_python(tmp_path: Path) -> None:
    python = Path(process.PYTHON)
    roundabout = str(python.parent / ".." / python.parent.name / python.name)
    environment = os.environ | {"PYTHONPATH": str(ROOT / "grader"), "PATH": os.defpath}
    argv = [roundabout, *GRADER[1:], "grade", str(ROOT / "solution"), "--out", str(tmp_path / "out")]
    done = subprocess.run(argv, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["score"] == result["max_score"]


def test_a_wheel_is_half_installed(means: pipeline.Means, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    (broken / "rclpy").mkdir(parents=True)
    (broken / "rclpy" / "__init__.py").write_text("raise ImportError('librcl.so: cannot open shared object file')\n")
    path = (str(broken), *means.ros.python_path)
    half = msgspec.structs.replace(means, ros=msgspec.structs.replace(means.ros, python_path=path))
    result, out = pipeline.grade(str(ROOT / "solution"), tmp_path / "out", half, lambda doing: None)
    _is_withheld(result)
    assert any("librcl.so" in note for note in result.notes)
    assert json.loads((out / "result.json").read_text())["score"] is None


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of what rclpy imports
def test_time_in_which_the_observer_did_not_look_does_not_count_as_quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    class Slow(process.Process):
        """Is started by a machine that takes its time."""

        def __init__(self, *arguments: object, **keywords: object) -> None:
            time.sleep(3 * BLIND_SECONDS)
            super().__init__(*arguments, **keywords)

    monkeypatch.setattr(process, "Process", Slow)
    observer = Observer(Recorder(io.BytesIO()))
    try:
        observer.start(Request(("sleep", "60"), process.environment("PATH"), "/", Limits(seconds=60)), "sleep")
        assert observer.quiet_seconds < BLIND_SECONDS
        observer.until(lambda: False, 2 * BLIND_SECONDS)
        assert 0 < observer.quiet_seconds < 3 * BLIND_SECONDS
        before = observer.quiet_seconds
        time.sleep(3 * BLIND_SECONDS)
        assert observer.quiet_seconds == before
        observer.spin(0.0)
        assert observer.quiet_seconds < before + BLIND_SECONDS
    finally:
        observer.stop()


def test_the_observer_is_killed_in_mid_scene(means: pipeline.Means, tmp_path: Path) -> None:
    _needs_walls(means)
    out = tmp_path / "out"
    with ThreadPoolExecutor(max_workers=1) as pool:
        grading = pool.submit(pipeline.grade, str(ROOT / "solution"), out, means, lambda doing: None)
        deadline = time.monotonic() + 60
        killed: list[int] = []
        while not killed:
            assert time.monotonic() < deadline
            assert not grading.done()
            # The observer that has a launch below it is the one that plays; it is killed as soon as a node runs there.
            for observer in _observers():
                below = process_table.tree(observer)
                if any("/lib/lab2/numeric_talker" in " ".join(info.command) for info in below):
                    os.kill(observer, signal.SIGKILL)
                    killed.append(observer)
                    break
            time.sleep(0.01)
        result, _ = grading.result()
    _is_withheld(result)
    assert any("observer" in note and "did not come to its end" in note for note in result.notes)
    found = {check.id: check.status for check in result.checks}
    assert found["package-builds"] is Status.PASS
    assert found["listener-numeric"] is Status.PASS
    assert found["launch-starts"] is Status.INCONCLUSIVE
    assert not traces.soon_empty(lambda: traces.processes(process.run_name()))


def _observers() -> list[int]:
    """The observers that this process runs: the Python process itself, not what stands around it."""
    own = [info for info in process_table.tree(os.getpid()) if "lab2_grader.observe" in info.command]
    return [info.pid for info in own if "bwrap" not in info.command[0] and info.command[0] != "sh"]


@pytest.mark.parametrize("size", [8_192, 49_152, 131_072, 262_144])
def test_no_space_for_the_results(size: int, means: pipeline.Means, tmp_path: Path) -> None:
    _needs_walls(means)
    small = tmp_path / "small"
    small.mkdir()
    kept = tmp_path / "kept"
    keep = (
        "sh",
        "-c",
        'out=$1; kept=$2; shift 2; "$@"; code=$?; cp -R "$out" "$kept"; exit $code',
        "keep",
        str(small),
        str(kept),
    )
    around = ("bwrap", "--dev-bind", "/", "/", "--size", str(size), "--tmpfs", str(small), "--", *keep)
    run = _grade(small / "out", *around)
    assert run.returncode == 3, run.stderr
    assert "No space left on device" in run.stderr
    assert "grader itself failed" not in run.stderr
    partial = kept / "out" / "result.json"
    if partial.exists():  # there was room for the first
        assert json.loads(partial.read_text())["graded"] is False
    assert size == 8_192 or partial.exists()
    assert not list(kept.rglob("*.draft"))


UNPACK = """
import io, sys, tarfile
from pathlib import Path
from lab2_grader import build
archive = io.BytesIO()
with tarfile.open(fileobj=archive, mode="w") as tar:
    member = tarfile.TarInfo("install/lab2/large")
    member.size = 400_000
    tar.addfile(member, io.BytesIO(bytes(member.size)))
print(build._unpack(archive.getvalue(), Path(sys.argv[1])))
"""


def test_no_space_for_what_was_built_is_not_the_students_fault(means: pipeline.Means, tmp_path: Path) -> None:
    _needs_walls(means)
    small = tmp_path / "small"
    small.mkdir()
    around = ("bwrap", "--dev-bind", "/", "/", "--size", "131072", "--tmpfs", str(small), "--")
    run = subprocess.run(
        [*around, sys.executable, "-c", UNPACK, str(small)],
        env=os.environ | {"PYTHONPATH": str(ROOT / "grader")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "FaultError" in run.stderr and "No space left on device" in run.stderr


def test_what_an_earlier_run_said_does_not_outlive_it(
    solution_graded: tuple[Result, Path], means: pipeline.Means, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(solution_graded[1], out)
    assert all((out / name).exists() for name in report.NAMES)

    def stop(doing: str) -> None:
        if "building" in doing:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pipeline.grade(str(ROOT / "solution"), out, means, stop)
    left = [name for name in report.NAMES if (out / name).exists()]
    assert left == [report.RESULT] and json.loads((out / report.RESULT).read_bytes())["graded"] is False


def test_the_folder_for_the_results_is_read_only(means: pipeline.Means, tmp_path: Path) -> None:
    _needs_walls(means)
    closed = tmp_path / "closed"
    (closed / "out").mkdir(parents=True)
    (closed / "out" / "report.md").write_text("of an earlier run")
    run = _grade(closed / "out", "bwrap", "--dev-bind", "/", "/", "--ro-bind", str(closed), str(closed), "--")
    assert run.returncode == 2, run.stderr
    assert str(closed) in run.stderr
    assert "Traceback" not in run.stderr


NO_NAMESPACES = ("bwrap", "--unshare-user", "--disable-userns", "--dev-bind", "/", "/", "--")


def test_bubblewrap_is_refused_by_the_kernel(means: pipeline.Means, tmp_path: Path) -> None:
    _needs_walls(means)
    run = _grade(tmp_path / "out", *NO_NAMESPACES)
    assert run.returncode == 0, run.stderr
    assert "Isolation is off" in run.stderr
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["runtime"]["isolation"] == "off"
    assert any("Isolation was off" in note for note in result["notes"])


def test_bubblewrap_is_refused_after_it_had_worked(means: pipeline.Means, tmp_path: Path) -> None:
    _needs_walls(means)
    code = (
        "import sys; from pathlib import Path; from lab2_grader import lab, pipeline, ros, sandbox\n"
        "means = pipeline.Means(ros.find(), sandbox.Isolation(True), lab.rubric())\n"
        f"result, _ = pipeline.grade({str(ROOT / 'solution')!r}, Path('out'), means, lambda doing: None)\n"
        "sys.exit(0 if result.graded else 3)\n"
    )
    run = _grade(tmp_path / "out", *NO_NAMESPACES, code=code)
    assert run.returncode == 3, run.stderr
    result = msgspec.json.decode((tmp_path / "out" / "result.json").read_bytes(), type=Result)
    _is_withheld(result)
    assert any("sandbox did not start" in note for note in result.notes)


def test_without_isolation_the_report_says_what_is_off(means: pipeline.Means, tmp_path: Path) -> None:
    off = msgspec.structs.replace(means, isolation=Isolation(on=False, reason="it was switched off"))
    _, out = pipeline.grade(str(ROOT / "solution"), tmp_path / "out", off, lambda doing: None)
    for name in ("report.md", "report.html"):
        assert "Isolation was off" in (out / name).read_text()


def test_jumps_of_the_machines_clock_do_not_matter() -> None:
    """Durations and deadlines come from the monotonic clock alone: nothing reads the time of day."""
    package = Path(lab2_grader.__file__).parent
    found = []
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                name = f"{node.value.id}.{node.attr}"
                if name in ("time.time", "time.time_ns", "datetime.now", "datetime.utcnow", "date.today"):
                    found.append(f"{path.relative_to(package)}:{node.lineno} {name}")
    # The launcher prefixes its log lines with the time of day, as `ros2 launch` does; nothing waits for it.
    stamps = ("ros/launcher/", "pipeline.py")  # for people to read: when a line was logged, when a grade began
    assert not [line for line in found if not line.startswith(stamps)]

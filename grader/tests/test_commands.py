"""The contract of the command line: exit codes, sentences, and what is on disk afterwards."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from conftest import ROOT

KEYS = {"schema", "submission", "graded", "score", "max_score", "checklist", "checks", "notes", "runtime", "seconds"}
CHECK_KEYS = {"id", "item", "title", "status", "points", "max_points", "expected", "observed", "hint", "section"}


def run(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the real command in *cwd*."""
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'grader'}:{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, "-m", "lab2_grader", *arguments]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120, check=False)


def test_a_grade_says_the_mark_and_leaves_a_whole_result(tmp_path: Path) -> None:
    done = run("grade", str(ROOT / "solution"), "--out", str(tmp_path / "out"), cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "Mark: 92 of 92" in done.stdout
    result = json.loads((tmp_path / "out/result.json").read_text())
    assert result.keys() >= KEYS
    assert all(check.keys() >= CHECK_KEYS for check in result["checks"])
    assert result["schema"] == "lab2-grader/result/1"
    assert (result["graded"], result["score"], result["max_score"]) == (True, 92, 92)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"result.json", "report.md", "evidence"}


@pytest.mark.parametrize(("mark", "code"), [(92, 0), (93, 1)])
def test_fail_under_turns_a_low_mark_into_an_exit_code(tmp_path: Path, mark: int, code: int) -> None:
    done = run("grade", str(ROOT / "solution"), "--out", str(tmp_path / "out"), "--fail-under", str(mark), cwd=tmp_path)

    assert done.returncode == code, done.stderr


def test_the_template_gets_its_floor(tmp_path: Path) -> None:
    done = run("grade", str(ROOT / "lab2_template"), "--out", str(tmp_path / "out"), cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "out/result.json").read_text())
    statuses = {check["id"]: check["status"] for check in result["checks"]}
    assert {name for name, status in statuses.items() if status == "pass"} == {"package-builds", "originals-kept"}
    assert result["score"] == 9


def _corrupt(path: Path) -> None:
    path.write_bytes(b"PK\x03\x04" + b"\0" * 200)


def _climbing(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("../package.xml", "<package><name>lab2</name></package>")


@pytest.mark.parametrize(
    ("name", "make", "said"),
    [
        ("nowhere", None, "cannot be graded: No such file or directory"),
        ("empty", lambda path: path.mkdir(), "There is nothing in it"),
        ("other", lambda path: (path.mkdir(), (path / "notes.txt").write_text("hello")), "No package named lab2"),
        ("text.zip", lambda path: path.write_text("hello"), "archive"),
        ("corrupt.zip", _corrupt, ""),
        ("climbing.zip", _climbing, ".."),
    ],
)
def test_what_cannot_be_graded_is_refused_in_a_sentence(tmp_path: Path, name: str, make: object, said: str) -> None:
    if callable(make):
        make(tmp_path / name)
    done = run("grade", str(tmp_path / name), "--out", str(tmp_path / "out"), cwd=tmp_path)

    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip()) > 20
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_an_unknown_option_is_wrong_usage(tmp_path: Path) -> None:
    assert run("grade", ".", "--no-such-option", cwd=tmp_path).returncode == 2


@pytest.mark.parametrize("command", ["grade", "grade-all", "report"])
def test_help_offers_what_can_be_typed(command: str, tmp_path: Path) -> None:
    offered = re.findall(r"\{([^}]*)\}", run(command, "--help", cwd=tmp_path).stdout)

    assert offered
    assert all(re.fullmatch(r"[a-z0-9-]+", choice.strip()) for choices in offered for choice in choices.split(","))


def test_rescoring_gives_the_same_bytes(tmp_path: Path) -> None:
    run("grade", str(ROOT / "solution"), "--out", str(tmp_path / "out"), cwd=tmp_path)
    before = (tmp_path / "out/result.json").read_bytes()

    done = run("rescore", str(tmp_path / "out"), cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out/result.json").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("explain",), 0),
        (("report", "{result}"), 0),
        (("report", "{result}", "--format", "junit"), 0),
        (("verify", "x"), 2),
    ],
)
def test_a_reader_who_goes_away_changes_no_exit_code(
    solution_graded: tuple[object, Path], tmp_path: Path, arguments: tuple[str, ...], code: int
) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    asked = [argument.format(result=solution_graded[1]) for argument in arguments]
    with open(writing, "wb") as gone:
        done = subprocess.run(
            [sys.executable, "-m", "lab2_grader", *asked],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT / "grader")},
            stdout=gone,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr and "BrokenPipe" not in done.stderr


def test_the_wheels_can_be_asked_for_whatever_is_sourced(tmp_path: Path) -> None:
    pytest.importorskip("ros_wheels_bootstrapper", reason="the wheels are not here")
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "grader"), "ROS_DISTRO": "humble", "AMENT_PREFIX_PATH": "/x"}
    (tmp_path / "ros2").write_text("#!/bin/sh\n")
    (tmp_path / "ros2").chmod(0o755)
    environment["PATH"] = f"{tmp_path}:{environment['PATH']}"
    code = "import sys; from lab2_grader import ros; print(ros.find(sys.argv[1]).kind)"
    found = {
        wanted: subprocess.run(
            [sys.executable, "-c", code, wanted], env=environment, capture_output=True, text=True, check=False
        )
        for wanted in ("wheels", "auto")
    }
    assert found["wheels"].stdout == "wheels\n", found["wheels"].stderr
    assert "ROS 2 humble is sourced here" in found["auto"].stderr


def test_explain_tells_every_check(tmp_path: Path) -> None:
    done = run("explain", cwd=tmp_path)
    assert done.returncode == 0
    for line in done.stdout.splitlines():
        told = run("explain", line.split()[0], cwd=tmp_path)
        assert told.returncode == 0, told.stderr
        assert "Ruling:" in told.stdout
    assert run("explain", "no-such-check", cwd=tmp_path).returncode == 2

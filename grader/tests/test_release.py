"""What is handed out: complete, the same bytes each time, usable by itself, and without the solution."""

from __future__ import annotations

import difflib
import json
import os
import runpy
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from datetime import date, timedelta
from pathlib import Path

import pytest
from conftest import ROOT

from lab2_grader import lab
from lab2_grader.errors import UsageError

RELEASE = runpy.run_path(str(ROOT / "grader/release/make_release.py"))


@pytest.fixture(scope="module")
def students(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The release for students and assistants."""
    out = tmp_path_factory.mktemp("students")
    RELEASE["make_students"](out)
    RELEASE["write_checksums"](out, "students")
    return out


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below *folder*, by name."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """The checkout at another place, and in it what git does not track."""
    copy = tmp_path / "checkout"
    RELEASE["copy_tracked"](ROOT, copy)
    for command in (("init", "--quiet"), ("add", "--all", "--force")):
        subprocess.run(["git", *command], cwd=copy, check=True)
    for name in ("lab2_template/marks.csv", "lab2_template/lab2/draft.py", "lab2_template/build/lab2/setup.py"):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text("nobody's business")
    for name in ("lab2_grader/draft.py", "lab2_grader/facts/answers.toml", "lab2_grader/notes.md"):
        (copy / "grader" / name).write_text("nobody's business")
    return copy


def test_two_releases_are_the_same_bytes_whatever_else_lies_there(
    students: Path, elsewhere: Path, tmp_path: Path
) -> None:
    subprocess.run(
        [sys.executable, elsewhere / "grader/release/make_release.py", "students", tmp_path / "out"],
        env={**os.environ, "PYTHONPATH": f"{elsewhere}/grader:{elsewhere}/worksheet"},
        check=True,
    )
    assert contents(tmp_path / "out" / "students") == contents(students)


def test_what_is_tracked_and_gone_stops_the_release(elsewhere: Path, tmp_path: Path) -> None:
    (elsewhere / "lab2_template/setup.py").unlink()
    with pytest.raises(UsageError, match="tracked"):
        RELEASE["make_zip"](tmp_path / "lab2.zip", elsewhere / "lab2_template", "lab2")


def test_the_checksums_hold(students: Path) -> None:
    done = subprocess.run(
        ["sha256sum", "--check", "--strict", "SHA256SUMS-students"], cwd=students, capture_output=True
    )
    assert done.returncode == 0, done.stdout.decode()


def solution_lines() -> set[str]:
    """The lines that only the solution has, those that could stand anywhere left out."""
    lines: set[str] = set()
    template = ROOT / "lab2_template"
    for path in (ROOT / "solution").rglob("*"):
        if path.suffix != ".py" or "__pycache__" in path.parts:
            continue
        other = template / path.relative_to(ROOT / "solution")
        before = other.read_text().splitlines() if other.exists() else []
        for line in difflib.ndiff(before, path.read_text().splitlines()):
            if line.startswith("+ ") and len(line.strip()) > 25:
                lines.add(line[2:].strip())
    handed_out = {line.strip() for path in template.rglob("*.py") for line in path.read_text().splitlines()}
    return lines - handed_out


def texts(path: Path) -> list[tuple[str, str]]:
    """(name, text) of every file in an archive, or of the file itself."""
    if path.suffix in (".zip", ".whl"):
        with zipfile.ZipFile(path) as archive:
            return [(name, archive.read(name).decode(errors="replace")) for name in archive.namelist()]
    if path.name.endswith(".tar.gz"):
        with tarfile.open(path) as tar:
            members = [(member.name, tar.extractfile(member)) for member in tar.getmembers()]
            return [(name, file.read().decode(errors="replace")) for name, file in members if file is not None]
    return [(path.name, path.read_text(errors="replace"))]


def test_nothing_of_the_solution_is_handed_out(students: Path, tmp_path: Path) -> None:
    wanted = solution_lines()
    assert len(wanted) > 20
    repository = next(students.glob("*.git"))
    subprocess.run(["git", "clone", "--quiet", str(repository), str(tmp_path / "clone")], check=True)
    found = [item for path in students.iterdir() if path.is_file() for item in texts(path)]
    found += [(name, data.decode(errors="replace")) for name, data in contents(tmp_path / "clone").items()]
    leaks = {(name, line) for name, text in found for line in wanted if line in text}
    assert not leaks
    assert any("talker.py" in name for name, _ in found)


def test_the_repository_has_one_commit_and_the_template(students: Path, tmp_path: Path) -> None:
    subprocess.run(["git", "clone", "--quiet", str(next(students.glob("*.git"))), str(tmp_path / "clone")], check=True)
    count = subprocess.run(
        ["git", "rev-list", "--count", "--all"], cwd=tmp_path / "clone", capture_output=True, text=True, check=True
    )
    assert count.stdout.strip() == "1"
    handed_out = {name: path.read_bytes() for name, path in RELEASE["tracked"](ROOT / "lab2_template")}
    cloned = {name: data for name, data in contents(tmp_path / "clone").items() if not name.startswith(".git/")}
    assert cloned == handed_out


def test_the_wheel_works_where_nothing_of_the_checkout_is(
    students: Path, tmp_path: Path, solution_graded: tuple[object, Path]
) -> None:
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True)
    wheel = next(students.glob("*.whl"))
    python = tmp_path / "venv/bin/python"
    install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"{wheel}[wheels,colcon]"]
    subprocess.run(install, check=True, cwd=tmp_path)
    clean = {name: value for name, value in os.environ.items() if name in ("HOME", "LANG")} | {"PATH": os.defpath}

    def grader(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [str(tmp_path / "venv/bin/lab2-grader"), *arguments]
        return subprocess.run(command, cwd=tmp_path, env=clean, capture_output=True, text=True, check=False)

    assert lab.rubric().check[0].id in grader("explain").stdout
    evidence = tmp_path / "results"
    evidence.mkdir()
    subprocess.run(["cp", "-r", str(solution_graded[1] / "evidence"), str(evidence)], check=True)
    done = grader("rescore", str(evidence))
    assert done.returncode == 0, done.stderr
    assert (evidence / "report.html").exists()
    done = grader("grade", str(ROOT / "solution"), "--out", str(tmp_path / "graded"))
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "graded" / "result.json").read_text())
    assert result["score"] == result["max_score"], result["notes"]


def test_solutions_come_out_on_their_date_and_not_before(tmp_path: Path) -> None:
    make: Callable[[Path, date], None] = RELEASE["make_solutions"]
    day = lab.course().solutions_release
    with pytest.raises(UsageError, match=str(day.year)):
        make(tmp_path, day - timedelta(days=1))
    assert not list(tmp_path.iterdir())

    make(tmp_path, day)
    assert {path.suffix for path in tmp_path.iterdir()} == {".zip", ".html"}


def test_what_the_solution_did_not_change_is_as_handed_out() -> None:
    own = {"README.md", "setup.py", "lab2/numeric_talker.py", "lab2/numeric_listener.py", "launch/numeric_chatter.py"}
    template = {name: path.read_bytes() for name, path in RELEASE["tracked"](ROOT / "lab2_template")}
    solution = {name: path.read_bytes() for name, path in RELEASE["tracked"](ROOT / "solution")}
    assert {name for name in solution if solution[name] != template.get(name)} == own
    assert template.keys() <= solution.keys()

"""The zip for Gradescope: what is in it, and its two scripts played in a tree laid out like the harness's."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAKE = ROOT / "grader" / "gradescope" / "make_zip.py"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip, made as `make gradescope` makes it."""
    target = tmp_path_factory.mktemp("zip") / "lab2-gradescope.zip"
    subprocess.run([sys.executable, MAKE, target], check=True)
    return target


def test_its_root_is_what_gradescope_looks_for(archive: Path) -> None:
    with zipfile.ZipFile(archive) as opened:
        infos = {info.filename: info for info in opened.infolist()}
        for name in ("setup.sh", "run_autograder"):
            data = opened.read(name)
            assert data.startswith(b"#!") and b"\r" not in data
            assert infos[name].external_attr >> 16 & 0o111
    assert {"grader/pyproject.toml", "grader/README.md", "grader/lab2_grader/cli.py"} <= set(infos)
    assert archive.stat().st_size < 100_000_000


def test_nothing_of_the_solution_is_in_it(archive: Path) -> None:
    handed_out = {path.read_bytes() for path in (ROOT / "lab2_template").rglob("*") if path.is_file()}
    solutions = [path.read_text() for path in (ROOT / "solution").rglob("*.py") if path.read_bytes() not in handed_out]
    lines = {line.strip() for text in solutions for line in text.splitlines() if len(line.strip()) > 40}
    known = b"\n".join(handed_out).decode(errors="replace")
    telling = {line for line in lines if line not in known}
    assert telling
    with zipfile.ZipFile(archive) as opened:
        assert not [name for name in opened.namelist() if "solution" in name or "tests/" in name]
        for name in opened.namelist():
            text = opened.read(name).decode(errors="replace")
            assert not [line for line in telling if line in text], name


def test_the_whole_package_is_in_it(archive: Path) -> None:
    listing = subprocess.run(
        ["git", "ls-files", "-z", "lab2_grader"], cwd=ROOT / "grader", capture_output=True, check=True, text=True
    )
    tracked = {f"grader/{name}" for name in listing.stdout.split("\0") if name}
    with zipfile.ZipFile(archive) as opened:
        assert len(tracked) > 90 and tracked <= set(opened.namelist())


def test_the_same_sources_make_the_same_bytes_whatever_else_lies_there(archive: Path, tmp_path: Path) -> None:
    copy = tmp_path / "grader"  # no checkout: there is no git here
    for name in ("gradescope", "lab2_grader"):
        shutil.copytree(ROOT / "grader" / name, copy / name)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / "grader" / name, copy)
    for name in (".env", "lab2_grader/id_rsa", "lab2_grader/facts/marks.csv", "lab2_grader/.cache/result.json"):
        (copy / name).parent.mkdir(exist_ok=True)
        (copy / name).write_text("nobody's business")
    subprocess.run([sys.executable, copy / "gradescope" / "make_zip.py", tmp_path / "again.zip"], check=True)
    assert (tmp_path / "again.zip").read_bytes() == archive.read_bytes()


@pytest.mark.slow
def test_the_harness_can_take_it(archive: Path, tmp_path: Path) -> None:
    root = tmp_path / "autograder"
    for name in ("source", "submission", "results"):
        (root / name).mkdir(parents=True)
    with zipfile.ZipFile(archive) as opened:  # as unzip does, modes included
        for info in opened.infolist():
            Path(opened.extract(info, root / "source")).chmod(info.external_attr >> 16 & 0o777)
    # The harness copies run_autograder beside the folders and runs both scripts from /autograder.
    shutil.copy(root / "source" / "run_autograder", root)
    environment = {
        "PATH": f"{Path(sys.executable).parent}:/usr/local/bin:/usr/bin:/bin",
        "HOME": str(tmp_path),
        "AUTOGRADER_ROOT": str(root),
        **{name: value for name, value in os.environ.items() if name.startswith(("PIP_", "http", "HTTP"))},
    }
    subprocess.run([root / "source" / "setup.sh"], cwd=root, env=environment, check=True)

    def run(package: Path) -> dict[str, object]:
        shutil.rmtree(root / "submission")
        shutil.copytree(package, root / "submission", ignore=shutil.ignore_patterns("__pycache__"))
        (root / "submission_metadata.json").write_text(json.dumps({"assignment": {"total_points": "50.0"}}))
        ended = subprocess.run([root / "run_autograder"], cwd=root, env=environment, check=False, capture_output=True)
        assert ended.returncode == 0, ended.stderr
        data: dict[str, object] = json.loads((root / "results" / "results.json").read_text())
        return data

    assert run(ROOT / "solution")["score"] == 50
    template = run(ROOT / "lab2_template")
    assert isinstance(template["score"], float) and 0 < template["score"] < 10
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "nothing in it" in str(run(empty)["output"])

"""Next year: the facts change, and the worksheet follows; what cannot follow is refused."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from lab2_worksheet.places import REPOSITORY


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    ignored = shutil.ignore_patterns("node_modules", "__pycache__", "tests", ".*_cache", "build")
    for folder in ("grader", "worksheet", "lab2_template", "solution"):
        shutil.copytree(REPOSITORY / folder, tmp_path / folder, ignore=ignored)
    return tmp_path


def edit(path: Path, *changes: tuple[str, str]) -> None:
    text = path.read_text(encoding="utf-8")
    for pattern, replacement in changes:
        text, count = re.subn(pattern, replacement, text, flags=re.MULTILINE)
        assert count == 1, pattern
    path.write_text(text, encoding="utf-8")


def build(copy: Path) -> subprocess.CompletedProcess[str]:
    return run(copy, "lab2_worksheet", "build")


def run(copy: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a module of the copy, and nothing of the repository itself."""
    path = os.pathsep.join([str(copy / "grader"), str(copy / "worksheet")])
    return subprocess.run(
        [sys.executable, "-m", *command],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_worksheet_follows_the_facts(copy: Path) -> None:
    facts = copy / "grader" / "lab2_grader" / "facts"
    edit(
        facts / "course.toml",
        (r"^year = .*", "year = 2031"),
        (r"^week = .*", "week = 9"),
        (r"^module_code = .*", 'module_code = "ROBO1234"'),
        (r"^contact_name = .*", 'contact_name = "Ada Lovelace"'),
        (r"^contact_email = .*", 'contact_email = "ada@example.org"'),
        (r"^template_clone_url = .*", 'template_clone_url = "git@example.org:robo/lab2"'),
        (r"^solutions_url = .*", 'solutions_url = "https://example.org/solutions"'),
        (r"^grader_install_url = .*", 'grader_install_url = "git+https://example.org/grader"'),
        (r"^solutions_release = .*", "solutions_release = 2031-11-30"),
        (r"^worksheet_url = .*", 'worksheet_url = "https://example.org/lab2.html"'),
    )
    edit(facts / "specification.toml", (r"^largest = .*", "largest = 99"))
    edit(facts / "rubric.toml", (r'(id = "talker-wrap"(?:\n.+)*\npoints = )\d+', r"\g<1>77"))
    done = build(copy)
    assert done.returncode == 0, done.stderr
    student = (copy / "build" / "worksheet" / "student.html").read_text(encoding="utf-8")
    readme = (copy / "lab2_template" / "README.md").read_text(encoding="utf-8")
    for fact in ("2031", "week 9", "ROBO1234", "Ada Lovelace", "ada@example.org", "30 November 2031", "77 points"):
        assert fact in student
    assert "git clone git@example.org:robo/lab2 lab2" in student and "git@example.org:robo/lab2" in readme
    assert "up to 99 (or 98)" in student
    assert "LARGEST_NUMBER = 99\n" in (copy / "solution/lab2/numeric_talker.py").read_text()
    workflow = (copy / "lab2_template/.github/workflows/feedback.yml").read_text()
    assert "GRADER: git+https://example.org/grader\n" in workflow
    assert "<https://example.org/lab2.html>" in readme and "lab2.html#section-6-7-1" in readme
    for old in ("COMP3631", "Xiao Wang", "week 3"):
        assert old not in student and old not in readme


def test_the_packages_follow_the_period(copy: Path) -> None:
    specification = copy / "grader" / "lab2_grader" / "facts" / "specification.toml"
    edit(specification, (r"^period_seconds = .*", "period_seconds = 2.0"))
    done = build(copy)
    assert done.returncode == 0, done.stderr
    for package in ("lab2_template", "solution"):
        assert "period_in_seconds = 2.0\n" in (copy / package / "lab2/talker.py").read_text()


def test_the_grader_follows_the_facts(copy: Path) -> None:
    facts = copy / "grader" / "lab2_grader" / "facts"
    edit(
        facts / "course.toml",
        (r"^title = .*", 'title = "Lab 2: Talk and Listen"'),
        (r"^module_code = .*", 'module_code = "ROBO1234"'),
        (r"^contact_name = .*", 'contact_name = "Ada Lovelace"'),
        (r"^worksheet_url = .*", 'worksheet_url = "https://example.org/lab2.html"'),
    )
    edit(
        facts / "specification.toml",
        (r"^largest = .*", "largest = 99"),
        (r"^period_seconds = .*", "period_seconds = 1"),
    )
    edit(facts / "rubric.toml", (r'(id = "talker-wrap"(?:\n.+)*\npoints = )\d+', r"\g<1>77"))
    assert build(copy).returncode == 0

    now = grade(copy, copy / "solution")
    assert now["score"] == now["max_score"] > 77, now["checks"]
    assert all("127" not in check["expected"] for check in now["checks"])

    then = grade(copy, REPOSITORY / "solution")
    lost = {check["id"]: check for check in then["checks"] if check["status"] == "fail"}
    assert list(lost) == ["talker-wrap"]
    assert then["score"] == then["max_score"] - 77
    assert "99" in lost["talker-wrap"]["expected"]
    for report in ("report.html", "report.md"):
        text = (copy / "results" / "solution" / report).read_text(encoding="utf-8")
        assert "Talk and Listen" in text and "https://example.org/lab2.html#section-6-7" in text
    assert "ROBO1234" in (copy / "results" / "solution" / "report.html").read_text(encoding="utf-8")


def grade(copy: Path, submission: Path) -> dict[str, Any]:
    done = run(copy, "lab2_grader", "grade", str(submission), "--out", str(copy / "results" / "solution"))
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads((copy / "results" / "solution" / "result.json").read_text(encoding="utf-8"))
    return result


@pytest.mark.parametrize(
    ("file", "pattern", "replacement", "said"),
    [
        ("specification", r"^largest = .*", "largest = 300", "largest"),
        ("specification", r"^period_seconds = .*", "period_seconds = 0.0", "period"),
        ("specification", r'^type = "std_msgs/msg/Int8"', 'type = "std_msgs/msg/Int32"', "Int8"),
        ("course", r"^week = .*", "week = 77", "week"),
        ("course", r"^solutions_release = .*", "solutions_release = 2019-01-01", "solutions_release"),
        ("course", r"^contact_email = .*", 'contact_email = "nobody"', "contact_email"),
        ("messages", r"^blocked = .*", "blocked = 3", "status"),
    ],
)
def test_what_cannot_follow_is_refused(copy: Path, file: str, pattern: str, replacement: str, said: str) -> None:
    edit(copy / "grader" / "lab2_grader" / "facts" / f"{file}.toml", (pattern, replacement))
    done = build(copy)
    assert done.returncode == 2
    assert said in done.stderr and f"{file}.toml" in done.stderr

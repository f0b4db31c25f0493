"""What tests share: the repository's folders, one grade of the solution that many tests look at, and a browser."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lab2_grader import lab, pipeline, ros, sandbox
from lab2_grader.records import Result

ROOT = Path(__file__).resolve().parents[2]

# Tests that interrupt a grader do so also where they run in the background of a script, which ignores SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM_FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
)

# What the samples change in the solution: (file, what stands there, what takes its place).
SAMPLES = {
    "middling": (
        ("lab2/numeric_talker.py", "        self.string_publisher.publish(message)\n", ""),
        ("lab2/numeric_talker.py", "number.data = self.counter", "number.data = (self.counter + 128) % 256 - 128"),
        ("lab2/numeric_talker.py", "LARGEST_NUMBER = 127", "LARGEST_NUMBER = 100_000"),
        ("setup.py", "            'numeric_listener = lab2.numeric_listener:main',\n", ""),
    ),
    "broken": (("setup.py", "'listener = lab2.listener:main',", "'listener = lab2.listener:main'("),),
}


@pytest.fixture(scope="session")
def means() -> pipeline.Means:
    """With what the tests grade: the ROS and the isolation that are here."""
    return pipeline.Means(ros.find(), sandbox.probe(), lab.rubric())


@pytest.fixture(scope="session")
def solution_graded(means: pipeline.Means, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """The solution, graded for real: its result and the folder that holds it."""
    return pipeline.grade(str(ROOT / "solution"), tmp_path_factory.mktemp("solution"), means, lambda doing: None)


@pytest.fixture(scope="session")
def samples(
    means: pipeline.Means, solution_graded: tuple[Result, Path], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """Folders of three results: a perfect, a middling and a broken submission, all graded for real."""
    folders = {"perfect": solution_graded[1]}
    for name, edits in SAMPLES.items():
        package = tmp_path_factory.mktemp(name) / "lab2"
        shutil.copytree(ROOT / "solution", package)
        for file, find, replace in edits:
            text = (package / file).read_text()
            assert text.count(find) == 1, (file, find)
            (package / file).write_text(text.replace(find, replace))
        folders[name] = pipeline.grade(str(package), tmp_path_factory.mktemp(f"{name}-out"), means, lambda doing: None)[
            1
        ]
    return folders


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """The installed Chromium."""
    program = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if program is None:
        pytest.skip("no Chromium is installed (apt-get install chromium)")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=program, args=list(CHROMIUM_FLAGS))
        yield opened
        opened.close()

"""What all tests share: the repository's folders, and one grade of the solution that many tests look at."""

from __future__ import annotations

from pathlib import Path

import pytest

from lab2_grader import lab, pipeline, ros, sandbox
from lab2_grader.records import Result

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def means() -> pipeline.Means:
    """With what the tests grade: the ROS and the isolation that are here."""
    return pipeline.Means(ros.find(), sandbox.probe(), lab.rubric())


@pytest.fixture(scope="session")
def solution_graded(means: pipeline.Means, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """The solution, graded for real: its result and the folder that holds it."""
    return pipeline.grade(str(ROOT / "solution"), tmp_path_factory.mktemp("solution"), means, lambda doing: None)

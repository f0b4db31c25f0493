"""What a GitHub job and Gradescope are told when there is no result, stage by stage, and what never reaches them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lab2_grader import cli, pipeline
from lab2_grader.errors import FaultError, RefusedError
from lab2_grader.outlets import GithubJob, Gradescope, why_not
from lab2_grader.report.github import defused


@pytest.fixture
def job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    """The files that GitHub gives a step, and the checkout."""
    files = {name: tmp_path / name for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT")}
    for name, path in files.items():
        path.touch()
        monkeypatch.setenv(name, str(path))
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path / "checkout"))
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    (tmp_path / "checkout").mkdir()
    monkeypatch.chdir(tmp_path / "checkout")
    return files


def test_a_refused_submission_is_told_of(
    job: dict[str, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    Path("README.md").write_text("no package here")
    folder = tmp_path / "autograder"
    assert cli.main(["grade", ".", "--ci", "--gradescope", str(folder)]) == 2
    commands = [line for line in capsys.readouterr().out.splitlines() if line.startswith("::")]
    assert len(commands) == 1 and commands[0].startswith("::error title=") and "package.xml" in commands[0]
    assert "package.xml" in job["GITHUB_STEP_SUMMARY"].read_text()
    assert "graded=false\nscore=\n" in job["GITHUB_OUTPUT"].read_text()
    told = json.loads((folder / "results" / "results.json").read_text())
    assert "package.xml" in told["output"] and told["score"] == 0


def test_a_name_that_is_a_command_is_none(job: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    folder = Path("::error::forged ##[error]forged")
    folder.mkdir()
    (folder / "::warning::x").write_text("")
    assert cli.main(["grade", str(folder), "--ci"]) == 2
    streams = capsys.readouterr()
    for text in (streams.out, streams.err, job["GITHUB_STEP_SUMMARY"].read_text()):
        lines = [line for line in text.splitlines() if line.lstrip().startswith("::") or "##[" in line]
        assert all(line.startswith("::error title=Lab 2") for line in lines)


def test_a_fault_of_ours_is_told_as_ours(
    job: dict[str, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("ROS_DISTRO", "")
    monkeypatch.chdir(tmp_path)
    assert cli.main(["grade", ".", "--ci", "--rubric", "missing.toml", "--gradescope", "gs"]) == 2
    assert "missing.toml" in job["GITHUB_STEP_SUMMARY"].read_text()
    assert "not your fault" in why_not(FaultError("The disk is full."))
    assert "The disk is full." in why_not(FaultError("The disk is full."))
    assert "secret" not in why_not(KeyError("secret"))
    assert "not your fault" not in why_not(RefusedError("x", "No package."))
    capsys.readouterr()


def test_gradescope_has_a_file_after_every_stage(
    samples: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "submission_metadata.json").write_text('{"id": 1, "assignment": {"id": 2, "total_points": "50.0"}}')
    outlet = Gradescope(tmp_path)
    path = tmp_path / "results" / "results.json"
    result, observed = pipeline.read(samples["broken"])
    seen = []
    assert outlet.began() == ()
    seen.append(json.loads(path.read_text()))
    for stage in ("submission", "build", ""):
        outlet.stage(result, observed, stage)
        seen.append(json.loads(path.read_text()))
    assert [entry["score"] for entry in seen[:3]] == [0, 0, 0]
    assert result.score is not None
    assert seen[3]["score"] == round(result.score * 50 / result.max_score, 2)
    assert "'build'" in seen[2]["output"] and "'" not in seen[3]["output"].split("Note")[0]


def test_annotations_name_paths_from_the_top_of_the_checkout(samples: dict[str, Path], tmp_path: Path) -> None:
    result, observed = pipeline.read(samples["middling"])
    (tmp_path / "work" / "lab2").mkdir(parents=True)
    inside = GithubJob(str(tmp_path / "work" / "lab2"), {"GITHUB_WORKSPACE": str(tmp_path)})
    lines = inside.stage(result, observed, "")
    assert any(line.startswith("::warning file=work/lab2/lab2/numeric_talker.py") for line in lines)
    top = GithubJob(str(tmp_path), {"GITHUB_WORKSPACE": str(tmp_path)})
    assert any(line.startswith("::warning file=lab2/numeric_talker.py") for line in top.stage(result, observed, ""))
    assert top.stage(result, observed, "build") == ()


def test_what_is_defused_still_reads(samples: dict[str, Path]) -> None:
    assert defused("a :: b\nrclcpp::Node") == "a :: b\nrclcpp::Node"
    assert defused("  ::error::x") == ": :error::x"

"""A result that was changed, or whose evidence was, is found out; with a key, also one that somebody else made."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from lab2_grader import cli, lab, pipeline, provenance
from lab2_grader.records import Result

KEY = "correct horse battery staple"


@pytest.fixture
def folder(solution_graded: tuple[Result, Path], tmp_path: Path) -> Path:
    """A copy of the solution's result, to be tampered with."""
    return Path(shutil.copytree(solution_graded[1], tmp_path / "result"))


@pytest.fixture
def verify(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """Run `lab2-grader verify`; its exit code and what it printed."""
    monkeypatch.delenv(provenance.KEY, raising=False)

    def run(*arguments: str, key: str = "") -> tuple[int, str]:
        if key:
            monkeypatch.setenv(provenance.KEY, key)
        code = cli.main(["verify", *arguments])
        printed = capsys.readouterr()
        return code, " ".join((printed.out + printed.err).split())

    return run


def _sign(folder: Path, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(provenance.KEY, key)
    pipeline.write_reports(folder, pipeline.rescore(folder, lab.rubric()))
    monkeypatch.delenv(provenance.KEY)


def _change(path: Path, change: Callable[[dict], None]) -> None:
    value = json.loads(path.read_text())
    change(value)
    path.write_text(json.dumps(value))


def test_an_untouched_result_matches(folder: Path, verify: Callable[..., tuple[int, str]]) -> None:
    code, said = verify(str(folder))
    assert code == 0
    assert "does not match" not in said
    assert verify(str(folder / "result.json"))[0] == 0


def test_digests_are_of_what_was_graded(folder: Path) -> None:
    result = pipeline.read(folder)[0]
    assert result.digests.submission == result.submission.sha256
    assert len(result.digests.evidence) == len(result.digests.rubric) == 64


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda value: value.update(score=value["score"] + 1), id="mark"),
        pytest.param(lambda value: value["checks"][3].update(status="fail"), id="verdict"),
        pytest.param(lambda value: value["checks"][3].update(points=99), id="points"),
        pytest.param(lambda value: value["checks"][3].update(hint="Well done."), id="hint"),
        pytest.param(lambda value: value["notes"].append("All is well."), id="notes"),
        pytest.param(lambda value: value["runtime"].update(grader="0.0.1"), id="version"),
        pytest.param(lambda value: value["submission"].update(name="somebody"), id="name"),
        pytest.param(lambda value: value["digests"].update(evidence="\u00e9" * 64), id="digest-not-ascii"),
        pytest.param(lambda value: value["digests"].update(evidence="0" * 64), id="evidence"),
        pytest.param(lambda value: value["digests"].update(submission="0" * 64), id="submission"),
        pytest.param(lambda value: value["digests"].update(rubric="0" * 64), id="rubric"),
    ],
)
def test_a_changed_result_does_not(
    change: Callable[[dict], None], folder: Path, verify: Callable[..., tuple[int, str]]
) -> None:
    _change(folder / "result.json", change)
    code, said = verify(str(folder))
    assert code == 1
    assert "does not match" in said


def test_changed_evidence_does_not(folder: Path, verify: Callable[..., tuple[int, str]]) -> None:
    scene = folder / "evidence" / "conversation.jsonl"
    scene.write_bytes(scene.read_bytes().replace(b"numeric_talker", b"numeric_walker", 1))
    code, said = verify(str(folder))
    assert code == 1
    assert "the evidence was changed after grading" in said


def test_another_rubric_does_not(folder: Path, tmp_path: Path, verify: Callable[..., tuple[int, str]]) -> None:
    other = tmp_path / "rubric.toml"
    text = (lab.FACTS / "rubric.toml").read_text()
    assert "points = 12" in text
    other.write_text(text.replace("points = 12", "points = 13", 1))
    code, said = verify(str(folder), "--rubric", str(other))
    assert code == 1
    assert "another rubric" in said


def test_a_signature_is_checked(
    folder: Path, verify: Callable[..., tuple[int, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    _sign(folder, KEY, monkeypatch)
    assert len(pipeline.read(folder)[0].signature) == 64
    assert verify(str(folder), key=KEY)[0] == 0
    code, said = verify(str(folder), key="another")
    assert code == 1
    assert "not made with this key" in said


def test_a_signed_result_that_was_changed_is_found_out(
    folder: Path, verify: Callable[..., tuple[int, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever changes evidence, digests and mark so that they fit each other still lacks the key."""
    _sign(folder, KEY, monkeypatch)
    result = pipeline.read(folder)[0]
    _change(folder / "evidence" / "submission.json", lambda value: value.update(name="somebody-else"))
    forged = msgspec.structs.replace(pipeline.rescore(folder, lab.rubric()), signature=result.signature)
    (folder / "result.json").write_bytes(msgspec.json.encode(forged))
    assert verify(str(folder))[0] == 0
    assert verify(str(folder), key=KEY)[0] == 1


def test_with_a_key_an_unsigned_result_is_not_trusted(folder: Path, verify: Callable[..., tuple[int, str]]) -> None:
    _change(folder / "result.json", lambda value: value.update(signature=""))
    code, said = verify(str(folder), key=KEY)
    assert code == 1
    assert "not signed" in said


def test_the_submission_itself_can_be_compared(folder: Path, verify: Callable[..., tuple[int, str]]) -> None:
    root = Path(__file__).resolve().parents[2]
    assert verify(str(folder), "--submission", str(root / "solution"))[0] == 0
    code, said = verify(str(folder), "--submission", str(root / "lab2_template"))
    assert code == 1
    assert "not the submission that was graded" in said


def test_what_is_no_result(tmp_path: Path, verify: Callable[..., tuple[int, str]]) -> None:
    assert verify(str(tmp_path))[0] == 2
    (tmp_path / "result.json").write_text("{}")
    assert verify(str(tmp_path))[0] == 2


def test_another_version_of_the_grader_may_judge_otherwise(
    folder: Path, verify: Callable[..., tuple[int, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(provenance, "__version__", "99.0")
    assert verify(str(folder))[0] == 0  # it judges as that one did
    _change(folder / "result.json", lambda value: value["checks"][3].update(hint="Said otherwise then."))
    code, said = verify(str(folder))
    assert code == 0 and "not checked" in said and "may have judged otherwise" in said


def test_a_signature_that_is_no_signature(folder: Path, verify: Callable[..., tuple[int, str]]) -> None:
    _change(folder / "result.json", lambda value: value.update(signature="\u00e9"))
    code, said = verify(str(folder), key=KEY)
    assert code == 1 and "not made with this key" in said

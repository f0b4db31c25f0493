"""A class is graded for real: the same marks as one by one, resumed, killed, locked, marked again, shown."""

from __future__ import annotations

import csv
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import pytest
import traces
from class_generator import make
from conftest import ROOT
from test_formats import files_named
from zoo_builder import Animal, animals

from lab2_grader import lab, pipeline, report
from lab2_grader.classroom import pool, remark, results, run, summary
from lab2_grader.classroom.records import Stamp
from lab2_grader.errors import FaultError, UsageError
from lab2_grader.records import ClassLine, ClassState, ClassSummary, Clock, Lost, SubmissionFacts, Unknown
from lab2_grader.report import class_page


class Watched:
    """Remembers what a class said of itself."""

    def __init__(self) -> None:
        self.graded: list[str] = []
        self.known: list[str] = []
        self.tried_again: list[tuple[str, ...]] = []

    def total(self, entries: int, unknown: int) -> None:
        pass

    def begins(self, name: str, doing: str) -> None:
        pass

    def ended(self, line: ClassLine, *, before: bool) -> None:
        (self.known if before else self.graded).append(line.name)

    def again(self, names: tuple[str, ...]) -> None:
        self.tried_again.append(names)


def order(box: Path, out: Path, **options: object) -> run.Order:
    return run.Order(str(box), str(out), lab.rubric(), **options)  # type: ignore[arg-type]


def graded(box: Path, out: Path, **options: object) -> tuple[ClassSummary, Watched]:
    watched = Watched()
    return run.grade_class(order(box, out, **options), watched), watched


def marks(out: Path) -> dict[str, tuple[int | None, dict[str, str]]]:
    """Of each result in *out* the score and every check's status."""
    found = {}
    for path in sorted(out.glob("*/result.json")):
        result = json.loads(path.read_bytes())
        found[path.parent.name] = (result["score"], {check["id"]: check["status"] for check in result["checks"]})
    return found


def wrong(result: dict[str, str], animal: Animal) -> dict[str, str]:
    """Statuses in *result* that are not those of *animal*, git aside."""
    expected = animal.statuses()
    return {
        check: status for check, status in result.items() if not check.startswith("git") and status != expected[check]
    }


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An inbox of a few, one of them no submission, two of them the same."""
    box = tmp_path_factory.mktemp("class") / "inbox"
    shutil.copytree(ROOT / "solution", box / "ada")
    shutil.copytree(ROOT / "solution", box / "ben")
    shutil.copytree(ROOT / "lab2_template", box / "cem")
    (box / "dev").mkdir()
    (box / "dev/hello.txt").write_text("<script>alert(1)</script>")
    (box / "notes.md").write_text("nobody's")
    return box


@pytest.fixture(scope="module")
def small_results(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of that class."""
    out = tmp_path_factory.mktemp("graded") / "results"
    summed, watched = graded(small, out)
    assert sorted(watched.graded) == ["ada", "ben", "cem", "dev"]
    assert {line.name: line.state for line in summed.lines} == {
        "ada": ClassState.GRADED,
        "ben": ClassState.GRADED,
        "cem": ClassState.GRADED,
        "dev": ClassState.REFUSED,
    }
    return out


@pytest.fixture
def copied(small: Path, small_results: Path, tmp_path: Path) -> tuple[Path, Path]:
    """That class and its results, to be changed."""
    shutil.copytree(small, tmp_path / "inbox")
    shutil.copytree(small_results, tmp_path / "results")
    return tmp_path / "inbox", tmp_path / "results"


def test_what_the_page_of_formats_names(small_results: Path) -> None:
    named = {name for name in files_named("A class") if not name.startswith("<name>")} - {run.FAULTS}
    assert {path.name for path in small_results.iterdir() if path.is_file()} - {results.LOCK} == named
    stamped = {path.name for path in (small_results / "ada").iterdir()}
    assert {f"<name>/{name}" for name in stamped} & files_named("A class") == {f"<name>/{results.STAMP}"}


def test_what_a_class_leaves(small_results: Path) -> None:
    summed = summary.read(small_results)
    lines = {line.name: line for line in summed.lines}
    assert lines["ada"].score == lines["ben"].score == lines["ada"].max_score
    assert lines["cem"].score is not None and lines["cem"].score < 20
    assert "no package.xml" in lines["dev"].reason
    assert summed.identical == (("ada", "ben"),)
    assert [item.what for item in summed.unknown] == ["notes.md"]
    rates = {check.id: check for check in summed.checks}
    assert (rates["talker-wrap"].passed, rates["talker-wrap"].judged) == (2, 3)
    with (small_results / summary.CSV).open(encoding="utf-8-sig", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert (rows["ada"]["talker-wrap"], rows["cem"]["talker-wrap"]) == ("pass", "blocked")
    assert (rows["ada"]["git-pushed"], rows["dev"]["git-pushed"]) == ("not-assessed", "")
    assert sum(fault.count for fault in rates["talker-wrap"].faults) == 1
    assert not (small_results / "dev").exists()
    assert list((small_results / results.INCOMING).glob("*")) == []
    for name in ("ada", "ben", "cem"):
        stored = results.result(small_results / name)
        assert stored is not None and pipeline.rescore(small_results / name, lab.rubric()) == stored


def test_the_second_call_grades_only_what_is_new_or_has_changed(copied: tuple[Path, Path]) -> None:
    box, out = copied
    before = marks(out)
    _, watched = graded(box, out)
    assert sorted(watched.known) == ["ada", "ben", "cem"] and watched.graded == ["dev"]  # a refusal costs nothing
    assert marks(out) == before
    with (box / "ben/lab2/numeric_talker.py").open("a") as file:
        file.write("# changed\n")
    shutil.copytree(ROOT / "lab2_template", box / "fay")
    (out / "cem/evidence/manifest.json").unlink()
    shutil.rmtree(box / "ada")
    summed, watched = graded(box, out)
    assert sorted(watched.graded) == ["ben", "cem", "dev", "fay"] and watched.known == []
    assert [line.name for line in summed.lines] == ["ben", "cem", "dev", "fay"]
    assert marks(out)["ben"] == before["ben"] and marks(out)["cem"] == before["cem"]


@pytest.mark.parametrize("damage", [b"", b"{", b'{"key": "\xff"}', b'{"schema": 1}'])
def test_what_is_damaged_counts_as_not_there(tmp_path: Path, damage: bytes) -> None:
    for name in (results.STAMP, report.RESULT):
        (tmp_path / name).write_bytes(damage)
    assert results.stamp(tmp_path) is None and results.result(tmp_path) is None


def test_a_result_is_up_to_date_only_for_the_way_in_which_it_was_run() -> None:
    facts = SubmissionFacts("ada", "here", "0" * 64, None, "", None, ())
    keys = {
        results.key_of(facts, clock, ros, isolation=isolation)
        for clock in Clock
        for ros in ("auto", "wheels")
        for isolation in (True, False)
    }
    assert len(keys) == 8


def test_another_rubric_costs_no_run(copied: tuple[Path, Path], tmp_path: Path) -> None:
    box, out = copied
    text = (lab.FACTS / "rubric.toml").read_text()
    changed = tmp_path / "rubric.toml"
    changed.write_text(re.sub(r'(id = "talker-wrap".*?points = )12', r"\g<1>2", text, flags=re.DOTALL))
    assert changed.read_text() != text
    watched = Watched()
    summed = run.grade_class(msgspec.structs.replace(order(box, out), rubric=lab.rubric(changed)), watched)
    assert sorted(watched.known) == ["ada", "ben", "cem"]
    assert {line.max_score for line in summed.lines if line.max_score} == {summed.lines[0].max_score}
    assert summed.lines[0].score == summary.read(out).max_score - 8 - 0  # git is not assessed: 8 points
    done = remark.rescore(out, lab.rubric())
    assert done.count == 3 and not done.failed
    assert [(change.name, change.why) for change in done.changes] == [
        ("ada", ("talker-wrap (pass) counted 2 of 2, counts 12 of 12",)),
        ("ben", ("talker-wrap (pass) counted 2 of 2, counts 12 of 12",)),
        ("cem", done.changes[2].why),
    ]
    assert summary.read(out).lines[0].score == summed.lines[0].score + 10  # type: ignore[operator]
    assert remark.rescore(out, lab.rubric()).changes == ()


def test_evidence_that_cannot_be_judged_is_named_and_the_rest_is_judged(copied: tuple[Path, Path]) -> None:
    _, out = copied
    (out / "ada/evidence/build.json").write_text("{")
    done = remark.rescore(out, lab.rubric())
    assert done.count == 2 and [name for name, _ in done.failed] == ["ada"]


def test_two_calls_at_once(copied: tuple[Path, Path]) -> None:
    box, out = copied
    with results.locked(out):
        with pytest.raises(UsageError, match=f"process {os.getpid()}"):
            graded(box, out)
        with pytest.raises(UsageError, match="being written"):
            remark.rescore(out, lab.rubric())
    graded(box, out)


def test_nothing_of_somebody_else_is_overwritten(small: Path, tmp_path: Path) -> None:
    box = tmp_path / "inbox"
    shutil.copytree(small / "cem", box / "cem")
    (tmp_path / "out/cem").mkdir(parents=True)
    (tmp_path / "out/cem/thesis.tex").write_text("years of work")
    summed, watched = graded(box, tmp_path / "out")
    assert summed.lines[0].state is ClassState.WITHHELD and "in the way" in summed.lines[0].reason
    assert (tmp_path / "out/cem/thesis.tex").read_text() == "years of work"
    assert watched.tried_again == [("cem",), ("cem",)]


def test_without_bubblewrap_nothing_is_graded(small: Path, tmp_path: Path) -> None:
    (tmp_path / "bin").mkdir()
    for program in ("sh", "git", "rm", "cat", "chmod", "env"):
        (tmp_path / "bin" / program).symlink_to(shutil.which(program) or "")
    done = subprocess.run(
        [sys.executable, "-m", "lab2_grader", "grade-all", str(small), "--out", str(tmp_path / "out")],
        env={**environment(), "PATH": str(tmp_path / "bin")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 3
    assert "apt-get install bubblewrap" in done.stderr.replace("\n", " ") and "ISOLATION=off" in done.stderr.replace(
        "\n", " "
    )
    assert not list((tmp_path / "out").glob("*/"))


# --- killed ---------------------------------------------------------------------------------------


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": f"{ROOT / 'grader'}:{os.environ.get('PYTHONPATH', '')}"}


def start(box: Path, out: Path, *options: str) -> subprocess.Popen[str]:
    argv = [sys.executable, "-m", "lab2_grader", "grade-all", str(box), "--out", str(out), *options]
    return subprocess.Popen(argv, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def left_running(pid: int) -> list[str]:
    """Processes that carry the mark of those which the process *pid* starts."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if f"LAB2_GRADER_RUN={pid}.".encode() in path.read_bytes():
                found.append((path.parent / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"))
        except OSError:
            continue
    return found


def wait_until(condition: object, seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline, "it did not come in time"
        time.sleep(0.02)


def kill_and_go_on(box: Path, out: Path, times: int, seed: int, longest: float) -> None:
    """Kill grading *box* at random moments, then let it end; nothing that was finished is graded again."""
    chance = random.Random(seed)
    for _ in range(times):
        finished = {path.parent.name: path.stat().st_mtime_ns for path in out.glob("*/class.json")}
        process = start(box, out)
        try:
            process.wait(chance.uniform(0.3, longest))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
        process.communicate()
        for name, when in finished.items():
            assert (out / name / "class.json").stat().st_mtime_ns == when, f"{name} was graded again"
        for folder in out.glob("*/"):
            if folder.name != results.INCOMING:
                assert msgspec.json.decode((folder / "class.json").read_bytes(), type=Stamp)
                assert pipeline.rescore(folder, lab.rubric()) == results.result(folder), (
                    f"half a result of {folder.name}"
                )
    finished = {path.parent.name for path in out.glob("*/class.json")}
    process = start(box, out)
    said, errors = process.communicate(timeout=1200)
    assert process.returncode == 0, said + errors
    known = {line.split("] ")[1].split(":")[0] for line in errors.splitlines() if "graded before" in line}
    assert known == finished


def test_killed_and_called_again(small: Path, small_results: Path, tmp_path: Path) -> None:
    out = tmp_path / "results"
    process = start(small, out)
    wait_until(lambda: list(out.glob("*/class.json")), 120)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    kill_and_go_on(small, out, 1, seed=3, longest=5.0)
    assert marks(out) == marks(small_results)
    assert not list((out / results.INCOMING).glob("*"))


def test_interrupted_says_how_far_it_came_and_leaves_nothing_running(small: Path, tmp_path: Path) -> None:
    out = tmp_path / "results"
    process = start(small, out)

    def builds() -> bool:
        assert process.poll() is None, process.communicate()
        return any("colcon build" in command for command in left_running(process.pid))

    wait_until(builds, 60)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130 and "Interrupted" in errors
    assert not traces.soon_empty(lambda: left_running(process.pid), 5)
    page = (out / "index.html").read_text()
    assert "Grading is not finished" in page
    assert not (out / results.INCOMING).exists() or not list((out / results.INCOMING).glob("*"))


@pytest.mark.slow
def test_killed_ten_times_in_a_class_of_forty(tmp_path: Path) -> None:
    box, expected = make(tmp_path / "class", 40, 11)
    graded(box, tmp_path / "undisturbed")
    kill_and_go_on(box, tmp_path / "results", 10, seed=5, longest=20.0)
    assert marks(tmp_path / "results") == marks(tmp_path / "undisturbed")
    assert {name: wrong(found, expected[name]) for name, (_, found) in marks(tmp_path / "results").items()} == {
        name: {} for name in expected
    }


# --- the same marks -------------------------------------------------------------------------------


def test_a_download_is_graded_as_its_parts_would_be(tmp_path: Path) -> None:
    box, expected = make(tmp_path / "class", 4, 7, "minerva")
    summed, _ = graded(box, tmp_path / "results")
    assert sorted(line.name for line in summed.lines) == sorted(expected)
    for name, (_, found) in marks(tmp_path / "results").items():
        assert wrong(found, expected[name]) == {}, f"{name} is {expected[name].name}"


def test_repositories_are_assessed_with_their_history(tmp_path: Path) -> None:
    box, expected = make(tmp_path / "class", 2, 1, "repositories")
    summed, _ = graded(box, tmp_path / "results")
    assert {line.state for line in summed.lines} == {ClassState.GRADED}
    for name, (_, found) in marks(tmp_path / "results").items():
        assert (found["git-pushed"], found["git-clean"]) == ("pass", "pass") and wrong(found, expected[name]) == {}
    _, watched = graded(box, tmp_path / "results")
    assert sorted(watched.known) == sorted(expected)


@pytest.mark.slow
def test_the_whole_zoo_side_by_side(tmp_path: Path) -> None:
    for name, animal in animals().items():
        animal.build(tmp_path / "inbox" / name)
    summed, _ = graded(tmp_path / "inbox", tmp_path / "results")
    found = marks(tmp_path / "results")
    wrongly = {
        name: bad for name, animal in animals().items() if name in found and (bad := wrong(found[name][1], animal))
    }
    assert wrongly == {}
    assert {line.name for line in summed.lines if line.state is not ClassState.GRADED} == set(animals()) - set(found)


# --- the page and the tables ----------------------------------------------------------------------


class Page(HTMLParser):
    """The tags and texts of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data


def big_summary(count: int, nasty: str = "") -> ClassSummary:
    checks = [check.id for check in lab.rubric().check]
    chance = random.Random(1)
    lines = []
    for number in range(count):
        lost = tuple(
            Lost(check, "fail", 5, "overflow", f"{nasty}saw {number}") for check in checks if chance.random() < 0.1
        )
        lines.append(
            ClassLine(
                f"sc21a{number:03d}", f"{nasty}Student {number}", (), ClassState.GRADED, 100 - 5 * len(lost), 100, lost=lost,
                flags=(nasty,) if nasty else (), sha256=f"{number // 2}", seconds=3.2, report=f"sc21a{number:03d}/report.html",
            )
        )  # fmt: skip
    lines.append(ClassLine("x", f"{nasty}x", (), ClassState.REFUSED, reason=f"{nasty}no package"))
    return summary.summarise(lines, (), lab.rubric(), (Unknown(f"{nasty}notes", f"{nasty}what"),))


def test_the_overview_shows_a_class_of_five_hundred() -> None:
    began = time.monotonic()
    text = class_page.render(big_summary(500))
    assert time.monotonic() - began < 5
    assert len(text) < 600_000
    page = Page(text)
    assert sum(tag == "tr" and "data-is" in attributes for tag, attributes in page.tags) == 501
    for tag, attributes in page.tags:  # self-contained
        for name in ("src", "href", "action"):
            assert not re.match(r"(https?:)?//", attributes.get(name) or ""), (tag, attributes)
    ids = {attributes["id"] for _, attributes in page.tags if "id" in attributes}
    for _, attributes in page.tags:
        for name in ("aria-labelledby", "for"):
            assert not attributes.get(name) or attributes[name] in ids
    assert [tag for tag, _ in page.tags if tag == "h1"] == ["h1"]
    assert all("scope" in attributes for tag, attributes in page.tags if tag == "th")


def test_nothing_of_a_submission_is_markup_or_a_formula() -> None:
    nasty = "=cmd|<img src=x onerror=alert(1)></script>\"'&{{7*7}}"
    summed = big_summary(3, nasty)
    page = Page(class_page.render(summed))
    assert not [tag for tag, attributes in page.tags if tag == "img" or "onerror" in attributes]
    assert sum(tag == "script" for tag, _ in page.tags) == 1 and nasty in page.text
    rows = list(csv.reader(summary.table(summed).splitlines()))
    assert len({len(row) for row in rows}) == 1
    assert all(not cell.startswith(("=", "+", "-", "@")) for row in rows for cell in row)


# --- the pool -------------------------------------------------------------------------------------


def test_jobs_fit_the_machine() -> None:
    assert 1 <= pool.default_jobs() <= pool.cores() + 1
    assert pool.memory_free() > 0


def test_an_unexpected_failure_is_raised_and_the_lanes_end() -> None:
    def step(item: int) -> int:
        if item == 3:
            raise FaultError("three")
        return item * item

    lanes: pool.Lanes[int, int] = pool.Lanes(2, step)
    assert sorted(lanes.run([1, 2], lambda: None)) == [1, 4]
    with pytest.raises(FaultError, match="three"):
        list(lanes.run([1, 2, 3, 4], lambda: None))

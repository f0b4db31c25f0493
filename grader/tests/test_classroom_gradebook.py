"""Marks go into the file that a gradebook gave out, and nothing else in it changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from lab2_grader import lab
from lab2_grader.classroom import gradebook, summary
from lab2_grader.errors import UsageError
from lab2_grader.records import ClassLine, ClassState, Lost

HEADER = '"Last Name","First Name","Username","Student ID","Last Access","Lab 2 [Total Pts: 20 Score] |987654"'


def line(name: str, score: int | None, *keys: str, of: int = 100) -> ClassLine:
    lost = (
        (Lost("talker-wrap", "fail", 12, "overflow", "=cmd()|'after 127 came -128"),) if score not in (None, of) else ()
    )
    state = ClassState.GRADED if score is not None else ClassState.WITHHELD
    return ClassLine(name, name, (*keys, name), state, score, of, lost=lost)


@pytest.fixture
def results(tmp_path: Path) -> Path:
    lines = (
        line("ada", 92),
        line("ben", 92, of=92),
        line("cem", None),
        line("zoe", 50, "Participant 7", "zoe@x.example"),
    )
    summary.write(tmp_path / "results", summary.summarise(lines, (), lab.rubric(), ()))
    return tmp_path / "results"


def filled(tmp_path: Path, results: Path, raw: bytes, **options: object) -> tuple[bytes, gradebook.Filled]:
    (tmp_path / "in.csv").write_bytes(raw)
    done = gradebook.fill(results, tmp_path / "in.csv", tmp_path / "out.csv", **options)  # type: ignore[arg-type]
    assert (tmp_path / "in.csv").read_bytes() == raw
    return (tmp_path / "out.csv").read_bytes(), done


ROWS = (
    '"Brown","Ada, ""the first""","ada","201","2026-10-20",""\r\n'
    '"Chen","Ben","BEN","202","","3"\r\n'
    '"Kaya","Cem","cem","203","","=1+1"\r\n'
    '"Nobody","Nora","nora","204","",""'
)


@pytest.mark.parametrize(
    ("encoding", "bom"),
    [
        ("utf-8", b""),
        ("utf-8", b"\xef\xbb\xbf"),
        ("utf-16-le", b"\xff\xfe"),
        ("utf-16-be", b"\xfe\xff"),
        ("cp1252", b""),
    ],
)
@pytest.mark.parametrize("tabs", [False, True])
def test_minerva_keeps_every_byte_but_the_marks(
    tmp_path: Path, results: Path, encoding: str, bom: bytes, tabs: bool
) -> None:
    text = f"{HEADER}\r\n{ROWS}".replace("Nora", "Noëlle")
    if tabs:
        text = text.replace('","', '"\t"')
    before = bom + text.encode(encoding)
    after, done = filled(tmp_path, results, before)
    expected = text.replace(
        '"2026-10-20"\t""' if tabs else '"2026-10-20",""', '"2026-10-20"\t"18.4"' if tabs else '"2026-10-20","18.4"'
    )
    expected = expected.replace('"3"', '"20"')
    assert after == bom + expected.encode(encoding)
    assert (done.cells, done.total) == (2, "20")
    assert done.without_mark == ("cem",)
    assert done.only_in_book == ("nora",)
    assert done.only_in_results == ("zoe",)


def test_unquoted_cells_stay_unquoted(tmp_path: Path, results: Path) -> None:
    after, _ = filled(tmp_path, results, b"Username,Lab [Total Pts: 100 Score] |1,Other\nada,,x\nben,7,\n")
    assert after == b"Username,Lab [Total Pts: 100 Score] |1,Other\nada,92,x\nben,100,\n"


def test_which_column(tmp_path: Path, results: Path) -> None:
    raw = b"Username,A [Total Pts: 10 Score] |11,B [Total Pts: 20 Score] |22,All [Total Pts: up to 30 Score] |33\nada,,,\n"
    with pytest.raises(UsageError, match="--column"):
        filled(tmp_path, results, raw)
    assert not (tmp_path / "out.csv").exists()
    assert filled(tmp_path, results, raw, column="22")[0].endswith(b"ada,,18.4,\n")
    assert filled(tmp_path, results, raw, column="A")[0].endswith(b"ada,9.2,,\n")
    with pytest.raises(UsageError, match="called"):
        filled(tmp_path, results, raw, column="C")


def test_feedback_is_no_formula_and_never_without_a_mark(tmp_path: Path, results: Path) -> None:
    raw = (
        b'"Username","Lab [Total Pts: 100 Score] |1","Grading Notes","Notes Format","Feedback to Learner","Feedback Format"\n'
        b'"zoe","","","","",""\n"cem","","","","",""\n'
    )
    after, _ = filled(tmp_path, results, raw, feedback=True)
    rows = after.decode().splitlines()
    assert rows[1].startswith('"zoe","50","","","50 of 100. Lost: talker-wrap (-12): =cmd()')
    assert rows[2] == '"cem","","","","",""'
    assert (
        gradebook.guarded("=1") == "'=1"
        and gradebook.guarded(" @x") == "' @x"
        and gradebook.guarded("-1").startswith("'")
    )
    with pytest.raises(UsageError, match="feedback"):
        filled(tmp_path, results, b"Username,Lab [Total Pts: 100 Score] |1\nada,\n", feedback=True)


def test_moodle(tmp_path: Path, results: Path) -> None:
    raw = (
        'Identifier,"Full name","Email address",Status,Grade,"Maximum Grade","Grade can be changed","Feedback comments"\n'
        '"Participant 7","Zoë",zoe@x.example,"Submitted",,"10.00",Yes,\n'
        '"Participant 8","Ada",ada,"Submitted",5.00,"50,00",Yes,"old, kept"\n'
    ).encode()
    after, done = filled(tmp_path, results, raw)
    assert after == raw.replace(b'"Submitted",,', b'"Submitted",5,').replace(b"5.00,", b"46,")
    assert done.cells == 2
    with_words, _ = filled(tmp_path, results, raw, feedback=True)
    assert b"50 of 100. Lost: talker-wrap" in with_words and b"old, kept" not in with_words


def test_a_namesake_gets_nobody_elses_mark(tmp_path: Path) -> None:
    lines = (line("john-40", 90, "Participant 40", "John Smith"),)
    summary.write(tmp_path / "results", summary.summarise(lines, (), lab.rubric(), ()))
    head = b'Identifier,"Full name",Grade,"Maximum Grade"\n'
    twelve, forty = b'"Participant 12","John Smith",,100\n', b'"Participant 40","John Smith",,100\n'
    after, done = filled(tmp_path, tmp_path / "results", head + twelve + forty)
    assert after == head + twelve + forty.replace(b",,", b",90,")
    assert done.only_in_book == ("Participant 12",)
    # By their names alone nobody can tell them apart.
    _, done = filled(
        tmp_path, tmp_path / "results", b'"Full name",Grade,"Maximum Grade"\nJohn Smith,,9\nJohn Smith,,9\n'
    )
    assert (done.cells, done.ambiguous) == (0, ("John Smith", "John Smith"))


def test_two_results_for_one_student_are_left_to_a_person(tmp_path: Path) -> None:
    lines = (line("alice", 20, "alice"), line("alice-2", 90, "alice"), line("bob", 50))
    summary.write(tmp_path / "results", summary.summarise(lines, (), lab.rubric(), ()))
    raw = b"Username,Lab [Total Pts: 100 Score] |1\nalice,\nbob,\n"
    after, done = filled(tmp_path, tmp_path / "results", raw)
    assert after == raw.replace(b"bob,", b"bob,50")
    assert done.ambiguous == ("alice",) and not done.only_in_results


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b"", "empty"),
        (b"Name,Lab [Total Pts: 100 Score] |1\nada,\n", "names the student"),
        (b"Username,Lab\nada,\n", "no column for marks"),
        (b"Username,Lab [Total Pts: 0 Score] |1\nada,\n", "worth 0"),
        (b'Username,Lab [Total Pts: 100 Score] |1\n"ada,\n', "quotes"),
    ],
)
def test_what_is_no_gradebook(tmp_path: Path, results: Path, raw: bytes, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        filled(tmp_path, results, raw)
    assert not (tmp_path / "out.csv").exists()


def test_the_download_is_never_overwritten(tmp_path: Path, results: Path) -> None:
    (tmp_path / "in.csv").write_bytes(HEADER.encode())
    with pytest.raises(UsageError, match="another"):
        gradebook.fill(results, tmp_path / "in.csv", tmp_path / "in.csv")

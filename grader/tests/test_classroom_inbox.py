"""What an inbox holds is recognised: folders, archives, downloads from Minerva and Moodle, tables; the rest is listed."""

from __future__ import annotations

import zipfile
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest
from class_generator import make
from intake_helpers import write, write_package

from lab2_grader import cli, submission
from lab2_grader.classroom import inbox, minerva, roster, run, summary
from lab2_grader.classroom.records import Inbox
from lab2_grader.errors import RefusedError, UsageError


def looked(path: Path) -> Inbox:
    return inbox.look(path, path.parent / "results")


def names(found: Inbox) -> list[str]:
    return [entry.name for entry in found.entries]


def zip_of(path: Path, members: dict[str, bytes | str]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


def package_zip(folder: Path) -> bytes:
    write_package(folder / "package")
    files = {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    return zip_of(folder / "made.zip", files).read_bytes()  # type: ignore[arg-type]


def text(user: str, field: str = "", files: str = "", name: str = "Ada Brown") -> str:
    return (
        f"Name: {name} ({user})\nAssignment: Lab_2 Talker\nDate Submitted: 20 October 2026\nCurrent Grade: Needs Grading\n"
        f"\nSubmission Field:\n{field}\n\nComments:\nnone\n\nFiles:\n{files or 'No files were attached to this submission.'}\n"
    )


# --- folders --------------------------------------------------------------------------------------


def test_a_folder_of_folders_and_archives(tmp_path: Path) -> None:
    box = tmp_path / "inbox"
    write_package(box / "Ada Brown")
    write_package(box / "ben/src/lab2")
    (box / "chloe.zip").write_bytes(package_zip(tmp_path / "z"))
    write(box, {"notes.txt": "mine", ".DS_Store": "", "__MACOSX/x": ""})
    (box / "nobody").mkdir()
    found = looked(box)
    assert names(found) == ["Ada-Brown", "ben", "chloe"]
    assert {item.what for item in found.unknown} == {"notes.txt", "nobody"}
    assert all(item.reason for item in found.unknown)


def test_names_are_told_apart_whatever_their_case(tmp_path: Path) -> None:
    box = tmp_path / "inbox"
    write_package(box / "ada")
    (box / "ada.zip").write_bytes(package_zip(tmp_path / "z"))
    (box / "ADA.tar.gz").write_bytes(b"whatever")
    write_package(box / "index.html")
    found = looked(box)
    assert len({name.lower() for name in names(found)}) == 4 and "index.html" not in names(found)
    assert sum("more than one" in entry.note for entry in found.entries) == 3


def test_a_students_archive_speaks_for_nobody_else(tmp_path: Path) -> None:
    box = tmp_path / "inbox"
    write_package(box / "ben")
    forged = {"L_alice_attempt_2026-10-20-17-30-05_lab2.zip": package_zip(tmp_path / "p")}
    zip_of(box / "mallory.zip", forged)
    assert {entry.keys for entry in looked(box).entries} == {("ben",), ("mallory",)}
    # Downloads and nothing else are what an assistant has put there.
    both = tmp_path / "downloads"
    zip_of(both / "group-1.zip", forged)
    zip_of(both / "group-2.zip", {"L_bob_attempt_2026-10-20-17-30-05_lab2.zip": package_zip(tmp_path / "p2")})
    assert names(looked(both)) == ["alice", "bob"]
    (both / "carol.tar.gz").write_bytes(b"whatever")
    assert names(looked(both)) == ["carol", "group-1", "group-2"]


def test_no_submission_takes_the_name_of_a_file_of_the_results(tmp_path: Path) -> None:
    assert {summary.PAGE, summary.CSV, summary.JSON, run.FAULTS} == inbox.RESERVED
    for name in inbox.RESERVED:
        write_package(tmp_path / "in" / name)
    assert not inbox.RESERVED.intersection(names(looked(tmp_path / "in")))


def test_what_is_no_table_is_listed(tmp_path: Path) -> None:
    write_package(tmp_path / "in/ada")
    write(tmp_path / "in", {"long.txt": "x" * 200_000, "long.csv": "repository,x\n" + "y" * 200_000})
    assert {item.what for item in looked(tmp_path / "in").unknown} == {"long.txt", "long.csv"}


def test_the_results_in_the_inbox_are_no_submission(tmp_path: Path) -> None:
    write_package(tmp_path / "ada")
    (tmp_path / "results/x").mkdir(parents=True)
    assert names(inbox.look(tmp_path, tmp_path / "results")) == ["ada"]


def test_one_submission_or_nothing_is_no_class(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="lab2-grader grade"):
        looked(write_package(tmp_path / "lab2"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="nothing"):
        looked(tmp_path / "empty")
    with pytest.raises(UsageError, match="no inbox"):
        looked(tmp_path / "missing")


# --- Minerva --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "user", "original"),
    [
        ("Lab 2_sc21abc_attempt_2026-10-20-17-30-05_lab2.zip", "sc21abc", "lab2.zip"),
        ("Lab_2_the talker_sc21abc_attempt_2026-10-20-17-30-05_my_lab_2 (1).zip", "sc21abc", "my_lab_2 (1).zip"),
        ("An_attempt_at it_name.surname_attempt_2026-10-20-17-30-05.txt", "name.surname", ""),
        ("L_201234567_attempt_2026-10-20-17-30-05_L_x_attempt_2025-01-01-00-00-00_a.zip", "201234567",
         "L_x_attempt_2025-01-01-00-00-00_a.zip"),
    ],
)  # fmt: skip
def test_names_of_minerva(name: str, user: str, original: str) -> None:
    found = minerva.member_name(name)
    assert found is not None and found.original == original
    assert minerva.user_of(found.head, None) == user


def test_a_user_name_with_an_underscore_is_taken_from_the_text() -> None:
    found = minerva.member_name("Lab_2_ada_b_attempt_2026-10-20-17-30-05.txt")
    assert found is not None
    assert minerva.user_of(found.head, minerva.read_text(text("ada_b").encode())) == "ada_b"
    assert minerva.user_of(found.head, minerva.read_text(text("someone").encode())) == "b"


def test_what_is_no_name_of_minerva() -> None:
    assert minerva.member_name("lab2.zip") is None
    assert minerva.member_name("Lab_x_attempt_yesterday_a.zip") is None


@pytest.mark.parametrize(
    ("field", "expected"),
    [
        ("https://github.com/ada/lab2", ["https://github.com/ada/lab2"]),
        ("<p>My repo: <a href='https://github.com/ada/lab2'>https://github.com/ada/lab2</a>.</p>",
         ["https://github.com/ada/lab2"]),
        ("git@github.com:ada/lab2.git and again https://github.com/Ada/lab2/", ["git@github.com:ada/lab2.git"]),
        ("github.com/ada/lab2", ["github.com/ada/lab2"]),
        ("file:///etc/passwd ext::sh -c id ssh://h/x", []),
        ("https://github.com/ada/lab2 https://github.com/ben/lab2",
         ["https://github.com/ada/lab2", "https://github.com/ben/lab2"]),
    ],
)  # fmt: skip
def test_addresses_that_students_paste(field: str, expected: list[str]) -> None:
    assert sorted(minerva.addresses(field)) == sorted(expected)


@pytest.mark.parametrize("unpacked", [False, True])
def test_a_download_from_minerva(tmp_path: Path, unpacked: bool) -> None:
    good = package_zip(tmp_path / "p")
    nested = zip_of(tmp_path / "n.zip", {"sub/lab2.zip": good, "__MACOSX/sub/._lab2.zip": b"x"}).read_bytes()
    late, early = "2026-10-20-17-30-05", "2026-10-19-09-00-00"
    members: dict[str, bytes | str] = {
        f"L_ada_attempt_{early}_draft.zip": b"no archive",
        f"L_ada_attempt_{early}.txt": text("ada"),
        f"L_ada_attempt_{late}_final_lab 2.zip": nested,
        f"L_ada_attempt_{late}.txt": text("ada"),
        f"L_ben_attempt_{late}.txt": text("ben", "<p>https://github.com/ben/lab2</p>", name="Ben Chen"),
        f"L_dev_attempt_{late}.txt": text("dev", "sorry"),
        f"L_eve_attempt_{late}.txt": text("eve", "file:///etc"),
        f"L_fay_attempt_{late}.txt": text("fay", "https://github.com/a/b https://github.com/c/d"),
        "readme.txt": "what is this",
    }
    box = zip_of(tmp_path / "gradebook_COMP3631_L_2026.zip", members)
    if unpacked:
        with zipfile.ZipFile(box) as archive:
            archive.extractall(tmp_path / "inbox")
        box = tmp_path / "inbox"
    found = looked(box)
    assert names(found) == ["ada", "ben"]
    ada, ben = found.entries
    assert ada.student == "Ada Brown" and ada.keys == ("ada", "Ada Brown") and late in ada.shown
    assert ben.source == "https://github.com/ben/lab2"
    reasons = {item.what: item.reason for item in found.unknown}
    assert len(reasons) == 4 and any("readme.txt" in what for what in reasons)
    assert any("several addresses" in reason for reason in reasons.values())
    (tmp_path / "s").mkdir()
    taken = submission.take(inbox.fetch(ada, tmp_path / "s"), tmp_path / "out")
    assert (Path(taken.package_dir) / "lab2/talker.py").exists()


def test_a_damaged_member_is_refused_alone(tmp_path: Path) -> None:
    box = zip_of(tmp_path / "d.zip", {"L_ada_attempt_2026-10-20-17-30-05_a.zip": package_zip(tmp_path / "p")})
    raw = bytearray(box.read_bytes())
    raw[len(raw) // 3] ^= 0xFF
    box.write_bytes(raw)
    (entry,) = looked(box).entries
    (tmp_path / "s").mkdir()
    with pytest.raises(RefusedError) as caught:
        submission.take(inbox.fetch(entry, tmp_path / "s"), tmp_path / "out")
    assert caught.value.rule == "archive-corrupt"


# --- Moodle ---------------------------------------------------------------------------------------


def test_a_download_from_moodle(tmp_path: Path) -> None:
    good = package_zip(tmp_path / "p")
    box = zip_of(
        tmp_path / "COMP3631-Lab 2-1234.zip",
        {
            "Ada O'Neill_77_assignsubmission_file_/lab2.zip": good,
            "Chloë Brown_78_assignsubmission_file_lab2.zip": good,
            "Ada O'Neill_79_assignsubmission_onlinetext_/onlinetext.html": "<a href='https://github.com/a/b'>x</a>",
            "Evil_80_assignsubmission_file_/../../../etc/x.zip": good,
        },
    )
    found = looked(box)
    assert names(found) == ["Ada-O-Neill-77", "Ada-O-Neill-79", "Chlo-Brown-78"]
    assert found.entries[0].keys[0] == "Participant 77"
    assert found.entries[1].source == "https://github.com/a/b"
    assert len(found.unknown) == 1 and "Evil" in found.unknown[0].what
    (tmp_path / "s").mkdir()
    assert submission.take(inbox.fetch(found.entries[2], tmp_path / "s"), tmp_path / "out")


@pytest.mark.parametrize("piece", [".\u200b.", "..\u00ad", ".\x1b[m.", "\u202e..", ".. "])
def test_no_name_leads_out_of_the_scratch_folder(tmp_path: Path, piece: str) -> None:
    inside = f"X_12_assignsubmission_file_/{piece}/{piece}/escaped/evil.txt"
    box = zip_of(tmp_path / "box/moodle.zip", {inside: "gone"})
    (entry,) = looked(box).entries
    scratch = tmp_path / "scratch" / "deep"
    scratch.mkdir(parents=True)
    try:
        inbox.fetch(entry, scratch)
    except RefusedError as error:
        assert error.rule == "name-control"
    assert not [path for path in tmp_path.rglob("evil.txt") if scratch / "handed-in" not in path.parents]


def test_a_name_too_long_for_the_disk_is_refused(tmp_path: Path) -> None:
    box = zip_of(tmp_path / "moodle.zip", {f"X_12_assignsubmission_file_/{'語' * 200}.py": "x"})
    (entry,) = looked(box).entries
    with pytest.raises(RefusedError) as caught:
        inbox.fetch(entry, tmp_path)
    assert caught.value.rule == "name-too-long"


# --- tables ---------------------------------------------------------------------------------------


def test_a_table_of_repositories(tmp_path: Path) -> None:
    path = tmp_path / "class.csv"
    path.write_bytes(
        b"\xef\xbb\xbfName;Username;Repository;Commit;Deadline\r\n"
        b"Ada;sc1;https://github.com/ada/lab2;;2026-10-23T17:00:00+01:00\r\n"
        b"Ben;sc2;git@github.com:ben/lab2.git;abc1234;\r\n"
        b"Eve;sc3;;;\r\nDev;sc4;/etc;;\r\nFay;sc5;https://github.com/f/l;;tomorrow\r\n"
    )
    found = looked(path)
    assert [(entry.student, entry.commit) for entry in found.entries] == [("sc1", ""), ("sc2", "abc1234")]
    assert found.entries[0].before == datetime(2026, 10, 23, 17, tzinfo=timezone(timedelta(hours=1)))
    assert found.entries[0].keys == ("sc1", "Ada")
    assert [item.what.split(", ")[1].split(":")[0] for item in found.unknown] == ["line 4", "line 5", "line 6"]


def test_a_table_without_a_header() -> None:
    rows, unknown = roster.read("ada,https://github.com/ada/lab2\nben,https://github.com/ben/lab2\n")
    assert [(row.student, row.address) for row in rows] == [
        ("ada", "https://github.com/ada/lab2"),
        ("ben", "https://github.com/ben/lab2"),
    ]
    assert not unknown


def test_a_deadline_for_all_spares_folders_and_those_with_their_own(tmp_path: Path) -> None:
    write_package(tmp_path / "in/ada")
    own = "2026-10-01T00:00:00+00:00"
    (tmp_path / "in/class.csv").write_text(
        f"student,repo,due\nben,https://h.example/b,\ncem,https://h.example/c,{own}\n"
    )
    before = datetime(2026, 10, 23, tzinfo=timezone.utc)
    found = {e.name: e.before for e in inbox.look(tmp_path / "in", tmp_path / "out", before).entries}
    assert found == {"ada": None, "ben": before, "cem": datetime.fromisoformat(own)}


@pytest.mark.parametrize("kind", ["directories", "minerva", "repositories"])
def test_generated_classes_are_understood(tmp_path: Path, kind: str) -> None:
    box, expected = make(tmp_path / "class", 12, 3, kind)
    found = looked(box)
    assert sorted(names(found)) == sorted(expected) and not found.unknown


def test_no_inbox_is_not_the_folder_one_stands_in(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["grade-all", ""]) == 2
    assert "No inbox was named" in capsys.readouterr().err

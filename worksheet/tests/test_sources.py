"""The sources: spelling, links, commands and facts, and that each of these checks can find something."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest
from lab2_grader import lab, messages

from lab2_worksheet import cli_check, lint, manifest
from lab2_worksheet.errors import SourceError
from lab2_worksheet.pages import Editions
from lab2_worksheet.places import RECORDED
from lab2_worksheet.recording import normalise, recording


def test_nothing_is_found_in_the_sources() -> None:
    assert lint.everything() == []


def test_spelling_finds_american_and_unknown_words(made: Editions) -> None:
    bad = dataclasses.replace(made, readme=made.readme + "\nThe color of the publissher.\n")
    found = lint.spelling(bad)
    assert any("color: in British English colour" in line for line in found)
    assert any("publissher" in line for line in found)


def test_links_that_lead_nowhere_are_found(made: Editions) -> None:
    bad = dataclasses.replace(made, student=made.student.replace('id="section-6-7-1"', 'id="section-6-7-9"'))
    found = lint.links(bad)
    assert any("section-6-7-1 leads nowhere" in line for line in found)
    assert any("section-6-7-1, to which feedback links" in line for line in found)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("ros2 run lab2 numeric_talker", ""),
        ("ros2 topic info -v /numeric_chatter", ""),
        ("env | grep ^ROS_", ""),
        ("ros2 run lab3 talker", "the package is lab2"),
        ("ros2 run lab2 nummeric_talker", "no executable"),
        ("ros2 launch lab2 chater.py", "has no launch/chater.py"),
        ("ros2 topic info --loud /chatter", "has no option --loud"),
        ("ros2 topic echo /chater", "no topic"),
        ("ros2 topics list", "no known verb"),
        ("ros2 topic pub --once /chatter std_msgs/msg/Int8 '{data: 1}'", "does not carry"),
        ("ros2 node info /nobody", "no node"),
        ("colcon build --symlinks", "has no option --symlinks"),
        ("git psuh", "not among"),
        ("rosnode list", "no program"),
        ("ROS_DOMIAN_ID=3 ros2 node list", "no variable"),
    ],
)
def test_tier_one_knows_what_exists(command: str, words: str) -> None:
    found = cli_check.problems(command)
    assert (words in " ".join(found)) if words else (found == [])


@pytest.mark.parametrize(
    "text", ["in 2031", "in week 4", "x.y@leeds.ac.uk", "https://example.org/x", "git@github.com:somebody/lab2"]
)
def test_a_stray_fact_is_found(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = tmp_path / "page.md.j2"
    source.write_text(f"Hello {text}.\n", encoding="utf-8")
    monkeypatch.setattr(lint, "sources", lambda: iter([source]))
    assert lint.stray_facts()


def test_every_message_names_a_row_that_exists() -> None:
    rows = {row.id for row in lab.symptoms()}
    assert len(rows) == len(lab.symptoms()) >= 29
    named = {fault.symptom for check in messages.catalogue().check.values() for fault in check.fault.values()}
    assert named - {""} <= rows


def test_an_error_pasted_whole_contains_its_pieces() -> None:
    for row in lab.symptoms():
        for piece in row.pasted:
            assert piece.strip() and "{" not in piece


def test_an_unknown_fact_stops_the_build() -> None:
    with pytest.raises(SourceError, match="nothing_of_this_name"):
        manifest.fill("{{ course.nothing_of_this_name }}", "a test")


def test_the_recording_fits_the_manifest_and_names_no_machine() -> None:
    shown = {key: command.show for key, command in manifest.commands().items() if command.show}
    assert {key: len(lines) for key, lines in recording().outputs.items()} == shown
    text = RECORDED.read_text(encoding="utf-8")
    assert not re.search(r"/(root|home|tmp|opt|usr)\b", text)
    for key, lines in recording().outputs.items():
        patterns = [pattern.split("\\n")[0] for pattern in manifest.commands()[key].see]
        assert not patterns or any(re.search(pattern, "\n".join(lines), re.MULTILINE) for pattern in patterns), key


def test_normalise_takes_out_what_differs() -> None:
    text = (
        "[INFO] [launch]: All log files can be found below /x/.ros/log/2030-host-7\n"
        "[INFO] [1795.5] [123456789.25] at /x/ws on host\n\n"
    )
    assert normalise(text, "/x", "host") == (
        "[INFO] [launch]: All log files can be found below ~/.ros/log/<date and time>",
        "[INFO] [1795.5] [<time>] at ~/ws on <computer>",
    )

"""Tier 2: the page's commands, played in order in a real workspace, wherever ROS 2 is on the path."""

from __future__ import annotations

import pytest

from lab2_worksheet import play
from lab2_worksheet.recording import recording
from lab2_worksheet.terminal import Terminal


@pytest.mark.slow
@pytest.mark.skipif(not play.available(), reason="ros2, colcon and git are not all on the path")
def test_every_command_does_what_the_page_says() -> None:
    played = play.play()
    assert played.wrong == []
    assert played.recording.outputs.keys() == recording().outputs.keys()
    assert played.recording.cli.items() >= recording().cli.items()


def test_a_terminal_runs_commands_and_can_be_interrupted(tmp_path: object) -> None:
    env = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "TERM": "dumb", "LC_ALL": "C.UTF-8"}
    with Terminal(env, str(tmp_path)) as terminal:
        terminal.type("echo one; (exit 3)")
        assert terminal.wait_ready(10) and terminal.output.strip() == "one" and terminal.code == 3
        terminal.clear()
        terminal.type(r"printf 'a\rb\n'; sleep 100")
        assert terminal.wait_for("^b$", 10) and terminal.code is None
        assert terminal.interrupt(20) and terminal.code == 130

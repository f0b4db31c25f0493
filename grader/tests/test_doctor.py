"""The doctor: what it finds in real folders and processes, and that every way to be unwell has its cure."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from lab2_grader import cli, lab, messages, sandbox
from lab2_grader.doctor import (
    ENOUGH_DISK,
    ENOUGH_MEMORY,
    ENOUGH_PROCESSES,
    Finding,
    Surroundings,
    Terminal,
    examine,
    look_around,
)

WELL = Surroundings(
    container="Singularity",
    distro="jazzy",
    ros2="/opt/ros/jazzy/bin/ros2",
    wheels=False,
    workspace="~/ros2_ws",
    workspace_there=True,
    workspace_built=True,
    workspace_sourced=True,
    here=Terminal(1, "this terminal", "", "LOCALHOST"),
    others=(),
    daemon=None,
    nodes=(),
    colcon="/usr/bin/colcon",
    products=(),
    repositories=("/home/a/ros2_ws/src/lab2",),
    keys=("id_ed25519.pub",),
    python="/usr/bin/python3",
    python_has_rclpy=True,
    isolation=sandbox.Isolation(True),
    keeper="The kernel keeps the limits.",
    processes=0,
    memory=8_000_000_000,
    disk=8_000_000_000,
)
OTHER = Terminal(7, "numeric_talker", "5", "")

# What is different, what is then found unwell, and a piece of what mends it.
UNWELL = (
    ({"distro": "", "ros2": ""}, "ROS", "Singularity"),
    ({"distro": "humble"}, "ROS", "/opt/ros/jazzy/setup.bash"),
    ({"ros2": ""}, "ROS", "/opt/ros/jazzy/setup.bash"),
    ({"python": "/home/a/miniconda3/bin/python3", "python_has_rclpy": False}, "Python", "conda deactivate"),
    ({"workspace_built": False, "workspace_sourced": False}, "Workspace", "colcon build"),
    ({"workspace_sourced": False}, "Workspace", "source ~/ros2_ws/install/setup.bash"),
    ({"here": Terminal(1, "", "232", "LOCALHOST")}, "Domain", "unset ROS_DOMAIN_ID"),
    ({"here": Terminal(1, "", "two", "LOCALHOST")}, "Domain", "unset ROS_DOMAIN_ID"),
    ({"here": Terminal(1, "", "", "")}, "Discovery range", "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"),
    ({"others": (OTHER,)}, "Other terminals", "grep ^ROS_"),
    ({"daemon": OTHER}, "ros2 daemon", "ros2 daemon stop"),
    ({"nodes": (OTHER,)}, "Nodes", "kill 7"),
    ({"colcon": ""}, "colcon", "apt-get install"),
    ({"products": ("/home/a/ros2_ws/src/build",)}, "Build folders", "rm -r /home/a/ros2_ws/src/build"),
    ({"repositories": ("/home/a", "/home/a/lab2")}, "Git", "/home/a/lab2/.git"),
    ({"keys": ()}, "SSH key", "ssh-keygen"),
    ({"isolation": sandbox.Isolation(False, "it is not here", "get it")}, "Isolation", "get it"),
    ({"processes": 100}, "Limits", "ulimit"),
    ({"memory": 1_000}, "Limits", "Close"),
    ({"disk": 1_000}, "Limits", "TMPDIR"),
)


def test_a_well_kept_machine_is_well() -> None:
    findings = examine(WELL)
    assert [finding.what for finding in findings if not finding.well] == []
    assert len(findings) == len(messages.catalogue().doctor)
    assert all(finding.found and not finding.mend for finding in findings)


@pytest.mark.parametrize(("changed", "what", "mend"), UNWELL)
def test_each_illness_has_its_cure(changed: dict[str, object], what: str, mend: str) -> None:
    ill = [finding for finding in examine(msgspec.structs.replace(WELL, **changed)) if not finding.well]
    found = {finding.what: finding for finding in ill}
    assert what in found
    assert mend in found[what].mend and found[what].found and found[what].wanted


def test_what_is_enough_is_said_in_numbers() -> None:
    least = {"processes": ENOUGH_PROCESSES, "memory": ENOUGH_MEMORY, "disk": ENOUGH_DISK}
    assert all(finding.well for finding in examine(msgspec.structs.replace(WELL, **least)))
    for name, enough in least.items():
        ill = next(f for f in examine(msgspec.structs.replace(WELL, **{name: enough - 1})) if not f.well)
        assert ill.what == "Limits"
        assert f"{ENOUGH_PROCESSES} processes, {ENOUGH_MEMORY // 10**9} GB" in ill.wanted


def test_every_sentence_of_the_catalogue_is_reached_and_names_a_row_that_there_is() -> None:
    said = set()
    for changed, _, _ in UNWELL:
        said |= {finding.symptom for finding in examine(msgspec.structs.replace(WELL, **changed)) if not finding.well}
    ways = sum(len(texts.ill) for texts in messages.catalogue().doctor.values())
    assert ways == len({(what, mend) for _, what, mend in UNWELL}) + 1  # the two that source ROS share their cure
    rows = {row.id for row in lab.symptoms()}
    assert said - {""} <= rows
    # the rows of the troubleshooting table that the doctor is there to prevent
    assert {
        *("command-not-found", "package-not-found", "build-install-log-in-package", "someone-else"),
        *("one-terminal-only", "stale-daemon", "same-name", "no-rclpy", "permission-denied", "empty-folder-on-github"),
    } <= said


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A student's home: a workspace, colcon run in the wrong folder, a repository in a repository."""
    package = tmp_path / "ros2_ws" / "src" / "lab2"
    (package / ".git").mkdir(parents=True)
    (tmp_path / "ros2_ws" / ".git").mkdir()
    for folder in (package / "build", tmp_path / "ros2_ws" / "build", tmp_path / "ros2_ws" / "install" / "lab2"):
        folder.mkdir(parents=True)
    for folder in (package / "build", tmp_path / "ros2_ws" / "build", tmp_path / "ros2_ws" / "install"):
        (folder / "COLCON_IGNORE").touch()
    (package / "log").mkdir()  # of a package's own: an ordinary word
    (package / "install").mkdir()
    (package / "install" / "local_setup.bash").touch()  # all that some clean-up left of colcon's
    (tmp_path / ".ssh").mkdir()
    (tmp_path / ".ssh" / "id_ed25519.pub").touch()
    return tmp_path


def found_in(home: Path, **variables: str) -> dict[str, Finding]:
    environment = {"PATH": os.environ["PATH"], **variables}
    package = home / "ros2_ws" / "src" / "lab2"
    return {finding.what: finding for finding in examine(look_around(environment, package, home))}


def test_it_sees_what_is_there(home: Path) -> None:
    found = found_in(home, ROS_DISTRO="jazzy", ROS_DOMAIN_ID="3")
    package = home / "ros2_ws" / "src" / "lab2"
    assert not found["Build folders"].well and str(package / "build") in found["Build folders"].found
    assert str(package / "install") in found["Build folders"].found
    assert str(package / "log") not in found["Build folders"].found
    assert str(home / "ros2_ws" / "build") not in found["Build folders"].found
    assert not found["Git"].well and str(home / "ros2_ws") in found["Git"].found
    assert found["SSH key"].well and "id_ed25519.pub" in found["SSH key"].found
    assert not found["Workspace"].well and "source" in found["Workspace"].mend
    sourced = found_in(home, ROS_DISTRO="jazzy", AMENT_PREFIX_PATH=f"{home}/ros2_ws/install/lab2")
    assert sourced["Workspace"].well


@pytest.fixture
def forgotten(tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A node of the lab that still runs, in another domain than the terminal."""
    program = tmp_path / "install" / "lab2" / "lib" / "lab2" / "numeric_talker"
    program.parent.mkdir(parents=True)
    program.write_text("import sys; print('up', flush=True); sys.stdin.read()")
    with subprocess.Popen(
        [sys.executable, str(program)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "ROS_DISTRO": "jazzy", "ROS_DOMAIN_ID": "42"},
    ) as started:
        assert started.stdout is not None and started.stdout.readline() == b"up\n"
        yield started
        started.kill()


def test_it_sees_what_runs(home: Path, forgotten: subprocess.Popen[bytes]) -> None:
    found = found_in(home, ROS_DISTRO="jazzy", ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
    assert not found["Nodes"].well and str(forgotten.pid) in found["Nodes"].mend
    assert not found["Other terminals"].well  # this machine may have more of them
    others = {other.pid: other for other in look_around({}, home, home).others}
    assert others[forgotten.pid] == Terminal(forgotten.pid, "numeric_talker", "42", "")


def test_the_command_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.main(["doctor"])
    out = capsys.readouterr().out
    assert code == ("to mend it" in out)
    assert "Isolation" in out and "Limits" in out

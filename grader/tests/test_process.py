"""What every process is started with, whatever the grader itself was started with."""

from __future__ import annotations

import signal
import subprocess
import sys

from zoo_builder import ROOT

# A shell gives SIGINT and SIGQUIT to what runs in the background of a script as ignored, nohup does so with SIGHUP;
# a program that is started inherits it.
IGNORING = "trap '' INT QUIT HUP; exec \"$@\""
STARTS = """
from lab2_grader import process
from lab2_grader.records import Limits, Request
status = ("cat", "/proc/self/status")
outcome = process.run(Request(status, (("PATH", "/usr/bin:/bin"),), "/", Limits(seconds=20)))
print(outcome.stdout.decode())
"""


def test_a_grader_in_the_background_of_a_script_starts_programs_that_can_be_interrupted() -> None:
    ignoring = ("sh", "-c", IGNORING, "sh", sys.executable, "-c", STARTS)
    done = subprocess.run(ignoring, cwd=ROOT / "grader", capture_output=True, text=True, check=True)
    status = dict(line.split(":", 1) for line in done.stdout.splitlines() if ":" in line)
    ignored = int(status["SigIgn"], 16)
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
        assert not ignored >> (number - 1) & 1, number.name

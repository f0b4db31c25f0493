"""Entry of the observer's process: says that it is ready, reads one plan, plays it, writes what it observed.

Standard input is one line with a `ScenePlan` in JSON; standard output is one JSON array a line, `Event`s in order; an
exit code of 0 means that the plan was played to its end.
"""

from __future__ import annotations

import os
import sys

from lab2_grader import decoding, process
from lab2_grader.observe import scenes
from lab2_grader.observe.observer import Observer
from lab2_grader.observe.recorder import Recorder
from lab2_grader.records import ScenePlan


def main() -> None:
    """Play one scene."""
    process.become_reaper()
    recorder = Recorder(sys.stdout.buffer)
    observer = Observer(recorder)
    line = sys.stdin.buffer.readline()
    if not line:
        return  # nobody wants this observer any more
    scenes.play(observer, decoding.from_json(line, ScenePlan))
    recorder.flush()


if __name__ == "__main__":
    main()
    # The middleware's own farewell takes longer than a scene's; nothing of it is needed.
    sys.stderr.flush()
    os._exit(0)

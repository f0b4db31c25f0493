"""Launches a Python launch file where there is no `ros2 launch`: see README.md beside this file.

python -P run.py [--use-sim-time] <package> <launch file name> [name:=value …]
"""

from __future__ import annotations

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))

if __name__ == "__main__":
    sys.path.insert(0, HERE)
    from lab2_launcher.main import main  # type: ignore[import-not-found, unused-ignore]

    sys.path[:] = [
        path for path in sys.path if path != HERE
    ]  # what a launch file imports must not be found in here by chance
    sys.exit(main(sys.argv[1:]))

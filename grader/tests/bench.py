"""Measures how fast a grade is, beside what it cannot be faster than, in one run; writes the figures as JSON.

Usage: python bench.py OUT.json
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from pathlib import Path

import bench_class

from lab2_grader import lab, pipeline, process, ros, sandbox
from lab2_grader.records import Clock, Limits, Measured, Request, SceneName

ROOT = Path(__file__).resolve().parents[2]
TIMES = 20
NODE = "import rclpy; rclpy.init(); node = rclpy.create_node('floor'); node.destroy_node(); rclpy.shutdown()"


def timed(work: object) -> float:
    """Seconds that *work*, a function without arguments, takes."""
    began = time.monotonic()
    assert callable(work)
    work()
    return time.monotonic() - began


def grade(means: pipeline.Means, folder: Path) -> None:
    """Grade the solution into *folder*; it must get everything."""
    result, _ = pipeline.grade(str(ROOT / "solution"), folder, means, lambda doing: None)
    assert result.score == result.max_score, result.notes


def floor(means: pipeline.Means) -> None:
    """`colcon build` of the solution and the start and stop of one node, without any grader around them."""
    with process.temporary_directory() as home:
        environment = means.ros.environment(str(home))
        script = f"mkdir -p {home}/ws/src && cp -R {ROOT}/solution {home}/ws/src/lab2 && cd {home}/ws && colcon build"
        for argv in (("sh", "-c", script), (sys.executable, "-c", NODE)):
            outcome = process.run(Request(argv, environment, str(home), Limits(seconds=120)))
            assert outcome.code == 0, outcome.stderr.decode()


def graph_seconds(folder: Path) -> float:
    """From starting the nodes to a complete graph, as the observer measured it."""
    from lab2_grader import evidence

    scene = evidence.read(folder / pipeline.EVIDENCE).scene(SceneName.CONVERSATION)
    assert scene is not None
    found = [e.value for e in scene.events if isinstance(e, Measured) and e.name == "graph_seconds"]
    return found[0]


def main() -> None:
    """Measure, print, write."""
    process.become_reaper()
    means = pipeline.Means(ros.find(), sandbox.probe(), lab.rubric())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        grade(means, folder / "warm-up")
        grades, floors, graphs = [], [], []
        for _ in range(TIMES):  # side by side, so that a noisy machine is noisy for both
            floors.append(timed(lambda: floor(means)))
            grades.append(timed(lambda: grade(means, folder / "grade")))
            graphs.append(graph_seconds(folder / "grade"))
        slow = pipeline.Means(means.ros, means.isolation, means.rubric, Clock.REAL_TIME)
        realtime = timed(lambda: grade(slow, folder / "real-time"))
    grade_seconds, floor_seconds = statistics.median(grades), statistics.median(floors)
    figures = {
        "grade_seconds": round(grade_seconds, 2),
        "floor_seconds": round(floor_seconds, 2),
        "grade_over_floor": round(grade_seconds / floor_seconds, 2),
        "realtime_seconds": round(realtime, 2),
        "realtime_over_timelapse": round(realtime / grade_seconds, 1),
        "graph_seconds_worst": round(max(graphs), 2),
        **bench_class.figures(),
    }
    out = Path(sys.argv[1])
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(figures, indent=2) + "\n")
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()

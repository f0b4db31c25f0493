"""Decoding by several threads, none of which was the first."""

from __future__ import annotations

import subprocess
import sys

TOGETHER = """
import sys, threading
from lab2_grader import lab, messages

def read():
    together.wait()
    messages.catalogue(), lab.rubric(), lab.limits(), lab.symptoms()

sys.setswitchinterval(1e-6)
together = threading.Barrier(6)
threads = [threading.Thread(target=read) for _ in range(6)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""
TIMES = 12  # decoded without a lock, about every third ends with a segmentation fault


def test_threads_may_read_the_facts_at_once() -> None:
    codes = [subprocess.run([sys.executable, "-c", TOGETHER], check=False).returncode for _ in range(TIMES)]
    assert codes == [0] * TIMES

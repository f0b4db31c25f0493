"""Makes the zip that Gradescope takes: setup.sh and run_autograder at its root, and the grader's sources below grader/.

    python3 grader/gradescope/make_zip.py dist/lab2-gradescope.zip

Needs nothing but Python. The same sources give the same bytes.
"""

from __future__ import annotations

import argparse
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path

GRADER = Path(__file__).resolve().parents[1]
SUFFIXES = (".py", ".toml", ".j2", ".css", ".js")  # of the package's files; the others that it needs, by name:
OTHERS = (
    "build_proof/package.xml",
    "ros/quick_discovery.xml",
    "ros/launcher/README.md",
    "ros/launcher/bin/ros2",
    "ros/launcher/lab2_launcher/jazzy_names.txt",
)
EXECUTABLE, PLAIN = 0o100755, 0o100644
MOMENT = (1980, 1, 1, 0, 0, 0)


def members() -> Iterator[tuple[str, bytes, int]]:
    """(name in the zip, content, mode) of all that goes in: an allow-list, so that what happens to lie there does not.

    Line ends become Unix ones in the two scripts, as Gradescope asks.
    """
    for name in ("setup.sh", "run_autograder"):
        yield name, (GRADER / "gradescope" / name).read_bytes().replace(b"\r\n", b"\n"), EXECUTABLE
    package = GRADER / "lab2_grader"
    files = [path for path in sorted(package.rglob("*")) if path.is_file() and path.suffix in SUFFIXES]
    for path in (GRADER / "pyproject.toml", GRADER / "README.md", *files, *(package / name for name in OTHERS)):
        yield f"grader/{path.relative_to(GRADER).as_posix()}", path.read_bytes(), PLAIN


def write(target: Path, entries: Iterable[tuple[str, bytes, int]]) -> None:
    """Write a zip of *entries*, (name, content, mode) each, whose bytes depend on nothing else."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data, mode in entries:
            entry = zipfile.ZipInfo(name, MOMENT)
            entry.external_attr = mode << 16
            entry.create_system = 3  # Unix, so that the modes count
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)


def make(target: Path) -> None:
    """Write the zip that Gradescope takes to *target*."""
    target.parent.mkdir(parents=True, exist_ok=True)
    write(target, members())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the zip that Gradescope takes.")
    parser.add_argument("target", type=Path)
    make(parser.parse_args().target)

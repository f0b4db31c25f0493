"""Makes the zip that Gradescope takes: setup.sh and run_autograder at its root, and the grader's sources below grader/.

    python3 grader/gradescope/make_zip.py dist/lab2-gradescope.zip

Needs nothing but Python. The same sources give the same bytes.
"""

from __future__ import annotations

import argparse
import zipfile
from collections.abc import Iterator
from pathlib import Path

GRADER = Path(__file__).resolve().parents[1]
LEFT_OUT = ("__pycache__", ".mypy_cache", ".ruff_cache", ".pytest_cache")
EXECUTABLE, PLAIN = 0o100755, 0o100644
MOMENT = (1980, 1, 1, 0, 0, 0)


def members() -> Iterator[tuple[str, Path, int]]:
    """(name in the zip, file, mode) of all that goes in: an allow-list, so that nothing else can."""
    for name in ("setup.sh", "run_autograder"):
        yield name, GRADER / "gradescope" / name, EXECUTABLE
    for name in ("pyproject.toml", "README.md"):
        yield f"grader/{name}", GRADER / name, PLAIN
    package = GRADER / "lab2_grader"
    for path in sorted(package.rglob("*")):
        if path.is_file() and not path.name.endswith(".pyc") and not set(path.parts) & set(LEFT_OUT):
            yield f"grader/{path.relative_to(GRADER).as_posix()}", path, PLAIN


def make(target: Path) -> None:
    """Write the zip to *target*; line ends become Unix ones in the two scripts, as Gradescope asks."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, path, mode in members():
            data = path.read_bytes()
            entry = zipfile.ZipInfo(name, MOMENT)
            entry.external_attr = mode << 16
            entry.create_system = 3  # Unix, so that the modes count
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data.replace(b"\r\n", b"\n") if mode == EXECUTABLE else data)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the zip that Gradescope takes.")
    parser.add_argument("target", type=Path)
    make(parser.parse_args().target)

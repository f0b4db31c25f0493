"""Records the evidence on which the pure tests judge: grades a few animals and packs what was observed.

PYTHONPATH=grader python grader/tests/record_evidence.py        (or `make record`)
"""

from __future__ import annotations

import io
import sys
import tarfile
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
DATA = HERE / "data" / "evidence"
RECORDED = (
    *("solution", "never-wraps", "publisher-overwritten", "listener-counts-for-itself", "no-entry-points"),
    *("launch-old-pair", "sleep-loop-fast", "setup-syntax-error"),
    *(
        "number-right-after-a-dot",
        "talker-callback-without-self",
        "talker-dies-in-its-callback",
        "talker-data-is-a-float",
    ),
    *("talker-without-super", "listener-without-super", "talker-dies-after-the-first"),
    *("random-from-the-first", "rate-in-the-callback", "second-node-never-spins"),
    *("listener-throttles", "listener-logs-once", "listener-prints-the-first", "listener-never-ends-its-lines"),
    *("listener-reads-arguments", "launch-files-by-another-pattern", "launch-on-a-condition", "setup-of-another-name"),
    *("launch-moves-the-talker", "listener-does-not-spin"),
)


def pack(folder: Path, archive: Path) -> None:
    """Put the evidence in *folder* into *archive*, the same bytes for the same evidence."""
    archive.parent.mkdir(parents=True, exist_ok=True)
    with tarfile.open(archive, "w:xz", preset=9) as out:
        for path in sorted(folder.iterdir()):
            member = tarfile.TarInfo(path.name)
            member.size = path.stat().st_size
            out.addfile(member, io.BytesIO(path.read_bytes()))


def main() -> None:
    """Grade the animals and pack their evidence."""
    import zoo_builder
    from zoo_runner import Zoo, complaints

    from lab2_grader import lab, pipeline, ros, sandbox

    means = pipeline.Means(ros.find(), sandbox.probe(), lab.rubric())
    animals = [zoo_builder.animals()[name] for name in RECORDED]
    with tempfile.TemporaryDirectory() as folder, Zoo(means, Path(folder), animals, at_once=2) as zoo:
        for animal in animals:
            assert not complaints(animal, zoo.result(animal.name).checks), animal.name
            pack(zoo.folder(animal.name) / pipeline.EVIDENCE, DATA / f"{animal.name}.tar.xz")
            sys.stdout.write(f"{animal.name}: {(DATA / f'{animal.name}.tar.xz').stat().st_size} bytes\n")


if __name__ == "__main__":
    main()

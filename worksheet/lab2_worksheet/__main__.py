"""The command line: builds the worksheet, checks its sources, plays its commands."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from lab2_grader.errors import UsageError

from lab2_worksheet import handout, play, recording
from lab2_worksheet.build import build
from lab2_worksheet.errors import SourceError
from lab2_worksheet.places import OUTPUT


def main(argv: list[str] | None = None) -> int:
    """Run one command; 0 when all is well, 1 when something was found, 2 for wrong usage or a source that is wrong."""
    parser = argparse.ArgumentParser(prog="python -m lab2_worksheet", description=__doc__)
    commands = parser.add_subparsers(dest="command")
    builder = commands.add_parser("build", help="build every edition (the default)")
    builder.add_argument("--out", type=Path, default=OUTPUT, help="folder for the editions (default: build/worksheet)")
    commands.add_parser("lint", help="check spelling, links, commands and stray facts")
    player = commands.add_parser("play", help="play the page's commands in a real workspace; needs ros2")
    player.add_argument("--record", action="store_true", help="keep what they print as what the page shows")
    options = parser.parse_args(argv)
    try:
        if options.command == "lint":
            return _lint()
        if options.command == "play":
            return _play(record=options.record)
        return _build(getattr(options, "out", OUTPUT))
    except (SourceError, UsageError) as error:
        print(f"worksheet: {error}", file=sys.stderr)
        return 2


def _build(out: Path) -> int:
    begun = time.perf_counter()
    for path in handout.write():
        print(f"   facts into  {path}")
    written = build(out)
    for file in written:
        print(f"{file.size:>8,} bytes  {file.path}")
    print(f"built in {time.perf_counter() - begun:.2f} s")
    return 0


def _lint() -> int:
    from lab2_worksheet import lint  # noqa: PLC0415 - its dictionary is needed for nothing else

    found = lint.everything()
    for line in found:
        print(line)
    print(f"worksheet: {len(found)} found" if found else "worksheet: spelling, links, commands and facts are in order")
    return 1 if found else 0


def _play(*, record: bool) -> int:
    if not play.available():
        print("worksheet: ros2, colcon, git and bash must be on the path to play the commands.", file=sys.stderr)
        return 2
    played = play.play(say=lambda text: print(text, flush=True))
    for line in played.wrong:
        print(line)
    if record and not played.wrong:
        recording.write(played.recording)
        print("recorded")
    return 1 if played.wrong else 0


if __name__ == "__main__":
    sys.exit(main())

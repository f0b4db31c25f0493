"""Makes what is handed out, into a folder; the same commit gives the same bytes.

    python grader/release/make_release.py students dist      what students and assistants get
    python grader/release/make_release.py solutions dist     the solution and the staff edition, from their date on

Nothing of `solution/` is in the first. The second refuses before the date in the lab's facts. What git does not track goes
nowhere.
"""

from __future__ import annotations

import argparse
import hashlib
import runpy
import shutil
import sys
import tempfile
from collections.abc import Iterator
from datetime import date
from pathlib import Path

from lab2_worksheet.build import build as build_worksheet
from lab2_worksheet.release import in_words, solutions_released

from lab2_grader import __version__, lab, process
from lab2_grader.errors import FaultError, Lab2Error, UsageError
from lab2_grader.records import Limits, Request

ROOT = Path(__file__).resolve().parents[2]
EPOCH = 315532800  # 1 January 1980 in seconds: the first moment that a zip can name
GRADESCOPE = "gradescope/make_zip.py"
ZIP = runpy.run_path(str(ROOT / "grader" / GRADESCOPE))
SECONDS = 300.0


def run(*argv: str, cwd: Path, **variables: str) -> str:
    """Run a program to its end and return what it printed.

    Raises:
        FaultError: It failed.
    """
    environment = process.environment("PATH", "HOME", "PYTHONPATH") + tuple(variables.items())
    outcome = process.run(Request(argv, environment, str(cwd), Limits(seconds=SECONDS)))
    if outcome.code != 0:
        said = outcome.stderr.decode(errors="replace").strip()
        raise FaultError(f"{' '.join(argv[:3])} failed: {said}")
    return outcome.stdout.decode().strip()


def tracked(folder: Path) -> Iterator[tuple[str, Path]]:
    """(name, file) of what git tracks in *folder*, as it is now.

    Raises:
        FaultError: git cannot say.
        UsageError: A file is tracked and not there.
    """
    for name in sorted(filter(None, run("git", "ls-files", "-z", cwd=folder).split("\0"))):
        if not (folder / name).is_file():
            raise UsageError(
                f"{folder.name}/{name} is tracked by git and is not there. Restore it, or commit that it is gone."
            )
        yield name, folder / name


def copy_tracked(folder: Path, into: Path) -> None:
    """Copy what git tracks in *folder* to the folder *into*."""
    for name, path in tracked(folder):
        (into / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, into / name)


def make_zip(target: Path, folder: Path, top: str) -> None:
    """Pack the package in *folder* below the folder *top* of a zip, with fixed times and modes."""
    modes = (ZIP["PLAIN"], ZIP["EXECUTABLE"])
    ZIP["write"](
        target,
        (
            (f"{top}/{name}", path.read_bytes(), modes[bool(path.stat().st_mode & 0o100)])
            for name, path in tracked(folder)
        ),
    )


def make_repository(target: Path, folder: Path) -> None:
    """A bare git repository at *target* with one commit that holds the package in *folder*; no history, no author of ours."""
    shutil.rmtree(target, ignore_errors=True)
    who = lab.course()
    identity = {
        "GIT_AUTHOR_NAME": who.module_code,
        "GIT_AUTHOR_EMAIL": who.contact_email,
        "GIT_AUTHOR_DATE": f"{EPOCH} +0000",
        "GIT_COMMITTER_NAME": who.module_code,
        "GIT_COMMITTER_EMAIL": who.contact_email,
        "GIT_COMMITTER_DATE": f"{EPOCH} +0000",
        "GIT_CONFIG_GLOBAL": "/dev/null",
        "GIT_CONFIG_NOSYSTEM": "1",
        "GIT_DIR": str(target),
    }
    run("git", "init", "--quiet", "--bare", "--template=", "--initial-branch=main", str(target), cwd=ROOT)
    with tempfile.TemporaryDirectory() as name:
        tree = Path(name)
        copy_tracked(folder, tree)
        index = {"GIT_WORK_TREE": str(tree), "GIT_INDEX_FILE": str(tree.with_suffix(".index"))}
        run("git", "add", "--all", "--force", cwd=tree, **identity, **index)
        root = run("git", "write-tree", cwd=tree, **identity, **index)
        tree.with_suffix(".index").unlink()
    message = f"{who.title}: the package as handed out"
    commit = run("git", "commit-tree", root, "-m", message, cwd=ROOT, **identity)
    run("git", "update-ref", "refs/heads/main", commit, cwd=ROOT, **identity)


def make_students(out: Path) -> None:
    """Everything that students and assistants get."""
    make_zip(out / f"lab2-template-{__version__}.zip", ROOT / "lab2_template", lab.specification().package)
    make_repository(out / f"lab2-template-{__version__}.git", ROOT / "lab2_template")
    with tempfile.TemporaryDirectory() as name:
        build_worksheet(Path(name), Path(name) / "README.md")
        shutil.copyfile(Path(name) / "student.html", out / f"lab2-worksheet-{__version__}.html")
    with tempfile.TemporaryDirectory() as name:
        grader = Path(name)
        copy_tracked(ROOT / "grader", grader)
        command = (sys.executable, "-m", "hatchling", "build", "--directory", str(out))
        run(*command, cwd=grader, SOURCE_DATE_EPOCH=str(EPOCH))
        runpy.run_path(str(grader / GRADESCOPE))["make"](out / f"lab2-gradescope-{__version__}.zip")


def make_solutions(out: Path, today: date) -> None:
    """The solution and the staff edition.

    Raises:
        UsageError: It is too early.
    """
    if not solutions_released(today):
        raise UsageError(f"The solutions come out on {in_words(lab.course().solutions_release)}, not before.")
    make_zip(out / f"lab2-solution-{__version__}.zip", ROOT / "solution", lab.specification().package)
    with tempfile.TemporaryDirectory() as name:
        build_worksheet(Path(name), Path(name) / "README.md")
        shutil.copyfile(Path(name) / "staff.html", out / f"lab2-worksheet-staff-{__version__}.html")


def write_checksums(out: Path, kind: str) -> None:
    """SHA-256 of every file in *out*, in the form that `sha256sum --check` takes."""
    files = sorted(path for path in out.rglob("*") if path.is_file() and not path.name.startswith("SHA256SUMS"))
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(out).as_posix()}" for path in files]
    (out / f"SHA256SUMS-{kind}").write_text("\n".join(lines) + "\n")


def main() -> int:
    """Make a release; 0, or 2 with a sentence when it cannot be made."""
    parser = argparse.ArgumentParser(description="Make what is handed out.")
    parser.add_argument("kind", choices=("students", "solutions"))
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    out: Path = arguments.out.resolve() / arguments.kind
    try:
        if arguments.kind == "students":
            shutil.rmtree(out, ignore_errors=True)
            out.mkdir(parents=True)
            make_students(out)
        else:
            if solutions_released(date.today()):
                shutil.rmtree(out, ignore_errors=True)
                out.mkdir(parents=True)
            make_solutions(out, date.today())
        write_checksums(out, arguments.kind)
    except Lab2Error as error:
        print(error, file=sys.stderr)
        return error.exit_code
    for path in sorted(out.iterdir()):
        size = sum(p.stat().st_size for p in ([path] if path.is_file() else path.rglob("*")))
        print(f"{size:>10,}  {path.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

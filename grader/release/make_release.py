"""Makes what is handed out, into a folder; the same commit gives the same bytes.

    python grader/release/make_release.py students dist      what students and assistants get
    python grader/release/make_release.py solutions dist     the solution and the staff edition, from their date on

Nothing of `solution/` is in the first. The second refuses before the date in the lab's facts.
"""

from __future__ import annotations

import argparse
import hashlib
import runpy
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from datetime import date
from pathlib import Path

from lab2_worksheet.build import build as build_worksheet
from lab2_worksheet.release import in_words, solutions_released

from lab2_grader import __version__, lab, process
from lab2_grader.errors import FaultError, Lab2Error, UsageError
from lab2_grader.records import Limits, Request

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = ("__pycache__", "build", "install", "log", "results")
EPOCH = 315532800  # 1 January 1980 in seconds: the first moment that a zip can name
MOMENT = (1980, 1, 1, 0, 0, 0)
EXECUTABLE, PLAIN = 0o100755, 0o100644
SECONDS = 300.0


def package_files(folder: Path) -> Iterator[tuple[str, Path]]:
    """(name, file) of a ROS package as it is handed out: everything but what a build or a run leaves behind."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_file() and not set(name.parts) & set(LEFT_OUT) and path.suffix != ".pyc":
            yield name.as_posix(), path


def make_zip(target: Path, folder: Path, top: str) -> None:
    """Pack the package in *folder* below the folder *top* of a zip, with fixed times and modes."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, path in package_files(folder):
            entry = zipfile.ZipInfo(f"{top}/{name}", MOMENT)
            entry.external_attr = (EXECUTABLE if path.stat().st_mode & 0o100 else PLAIN) << 16
            entry.create_system = 3
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, path.read_bytes())


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
        for inside, path in package_files(folder):
            (tree / inside).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, tree / inside)
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
    command = (sys.executable, "-m", "hatchling", "build", "--directory", str(out))
    run(*command, cwd=ROOT / "grader", SOURCE_DATE_EPOCH=str(EPOCH))
    gradescope = runpy.run_path(str(ROOT / "grader/gradescope/make_zip.py"))
    gradescope["make"](out / f"lab2-gradescope-{__version__}.zip")


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

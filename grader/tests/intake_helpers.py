"""Makes packages, archives and git repositories for the tests of the intake."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from lab2_grader import lab, submission
from lab2_grader.errors import RefusedError

MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>1.0.0</version>
</package>
"""


def write_package(folder: Path, name: str = "lab2", numeric: bool = True) -> Path:
    """A package called *name* in *folder*, small and whole as far as the intake is concerned."""
    files = {
        "package.xml": MANIFEST.format(name=name),
        "setup.py": "from setuptools import setup\nsetup()\n",
        "setup.cfg": "[develop]\n",
        f"resource/{name}": "",
        f"{name}/__init__.py": "",
        f"{name}/talker.py": "print('talk')\n",
        "launch/chatter.py": "pass\n",
    }
    if numeric:
        files |= {
            f"{name}/numeric_talker.py": "print(1)\n",
            f"{name}/numeric_listener.py": "print(2)\n",
            "launch/numeric_chatter.py": "pass\n",
        }
    return write(folder, files)


def write(folder: Path, files: dict[str, str]) -> Path:
    """*files* in *folder*."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def listing(folder: Path | str) -> set[str]:
    """The files below *folder*, relative to it."""
    return {str(path.relative_to(folder)) for path in Path(folder).rglob("*") if not path.is_dir()}


PACKAGE_FILES = {
    "package.xml",
    "setup.py",
    "setup.cfg",
    "resource/lab2",
    "lab2/__init__.py",
    "lab2/talker.py",
    "launch/chatter.py",
    "lab2/numeric_talker.py",
    "lab2/numeric_listener.py",
    "launch/numeric_chatter.py",
}


def refused(source: Path | str, into: Path, **options: object) -> RefusedError:
    """The refusal that taking *source* ends in; nothing may be left of the copy."""
    with pytest.raises(RefusedError) as caught:
        submission.take(str(source), into, **options)  # type: ignore[arg-type]
    assert not into.exists()
    sentence = str(caught.value)
    assert sentence.isprintable() and "{" not in sentence and len(sentence) < 900
    return caught.value


@contextlib.contextmanager
def limited(monkeypatch: pytest.MonkeyPatch, **values: float) -> Iterator[None]:
    """Other limits of intake than the lab's."""
    all_limits = lab.limits()
    changed = msgspec.structs.replace(all_limits, intake=msgspec.structs.replace(all_limits.intake, **values))
    with monkeypatch.context() as patch:
        patch.setattr(lab, "limits", lambda: changed)
        yield


def git(folder: Path, *arguments: str, when: str = "2026-10-05T12:00:00+0000", text: str = "") -> str:
    """Run git in *folder* as a student would; *text* is its standard input."""
    environment = {
        "PATH": os.environ["PATH"],
        "HOME": str(folder),
        "GIT_CONFIG_NOSYSTEM": "1",
        "GIT_AUTHOR_NAME": "A Student",
        "GIT_AUTHOR_EMAIL": "student@example.com",
        "GIT_COMMITTER_NAME": "A Student",
        "GIT_COMMITTER_EMAIL": "student@example.com",
        "GIT_AUTHOR_DATE": when,
        "GIT_COMMITTER_DATE": when,
    }
    command = ["git", *arguments]
    done = subprocess.run(
        command, cwd=folder, env=environment, input=text, check=False, capture_output=True, encoding="utf-8"
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def commit_all(folder: Path, message: str = "Work", when: str = "2026-10-05T12:00:00+0000") -> str:
    """Make *folder* a repository if it is none, commit all in it, and return the commit."""
    if not (folder / ".git").exists():
        git(folder, "init", "--quiet", "--initial-branch=main")
    git(folder, "add", "--all", "--force")
    git(folder, "commit", "--quiet", "--allow-empty", f"--message={message}", when=when)
    return git(folder, "rev-parse", "HEAD")

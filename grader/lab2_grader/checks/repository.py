"""What the submission's git repository says of itself (worksheet 6.7.6)."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from pathlib import PurePosixPath

from lab2_grader import lab, messages
from lab2_grader.checks.verdicts import failed, not_assessed, passed
from lab2_grader.checks.view import View, names
from lab2_grader.records import Verdict
from lab2_grader.submission.products import COLCON

Earlier = Mapping[str, Verdict]


def git_pushed(view: View, earlier: Earlier) -> Verdict:
    """The work is committed, and pushed to a repository of their own."""
    check, git = "git-pushed", view.evidence.submission.git
    if git is None:
        return not_assessed(check, "not-assessed-git")
    if git.commit is None:
        return failed(check, "no-commit")
    if git.submodule:
        return failed(check, "submodule", path=git.submodule)
    if not git.committed_work:
        return failed(check, "no-work", missing=names(view.specification.work))
    if not git.remotes:
        return failed(check, "no-remote")
    own = [remote for remote in git.remotes if not _is_course_remote(remote)]
    if not own:
        return failed(check, "course-remote", remote=git.remotes[0])
    if git.uncommitted:
        return failed(check, "uncommitted", files=names(git.uncommitted))
    if not git.pushed:
        return failed(check, "unpushed")
    return passed(check)


def _is_course_remote(address: str) -> bool:
    """Whether *address* is the repository that was handed out."""
    return _path(address) == _path(lab.course().template_clone_url)


def _path(address: str) -> str:
    """`owner/name` of a git address, in lower case."""
    return "/".join(re.split(r"[/:]", address.lower().removesuffix("/").removesuffix(".git"))[-2:])


def git_clean(view: View, earlier: Earlier) -> Verdict:
    """No `build/`, `install/`, `log/` or caches are committed."""
    check, git = "git-clean", view.evidence.submission.git
    if git is None or git.commit is None:
        return not_assessed(check, "not-assessed-git")
    if not git.products:
        return passed(check)
    more = messages.phrase("more", count=git.products_count - 3) if git.products_count > 3 else ""
    by_colcon = any(PurePosixPath(path).name in COLCON for path in git.products)
    key = "products" if by_colcon else "caches"
    return failed(check, key, examples=", ".join(git.products[:3]), more=more, paths=_arguments(git.products))


def _arguments(paths: tuple[str, ...]) -> str:
    """*paths* for a command line, as many as fit: each whole, for beside it may lie the student's own work."""
    words = [shlex.quote(path.rstrip("/")) for path in paths]
    while len(" ".join(words)) > messages.VALUE_LENGTH:
        words.pop()
    return " ".join(words)

"""What the submission's git repository says of itself (worksheet 6.7.6)."""

from __future__ import annotations

import re
from collections.abc import Mapping

from lab2_grader import lab, messages
from lab2_grader.checks.verdicts import failed, not_assessed, passed
from lab2_grader.checks.view import View, names
from lab2_grader.records import Verdict

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
    folders = " ".join(sorted({path.split("/")[0] for path in git.products}))
    return failed(check, "products", examples=", ".join(git.products[:3]), more=more, folders=folders)

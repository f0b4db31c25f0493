"""Repositories are read and cloned, and nothing of theirs is ever run."""

from __future__ import annotations

import os
import shutil
import socket
import stat
import threading
import time
from datetime import datetime, timezone
from pathlib import Path

import pytest
from intake_helpers import PACKAGE_FILES, commit_all, git, limited, listing, refused, write, write_package

from lab2_grader.errors import FaultError, UsageError
from lab2_grader.records import GitFacts
from lab2_grader.submission import take

WORK = ("lab2/numeric_talker.py", "lab2/numeric_listener.py", "launch/numeric_chatter.py")


def facts(source: Path | str, out: Path) -> GitFacts:
    """What the repository says; it must have been read."""
    found = take(str(source), out).facts
    assert found.git is not None
    assert found.commit == found.git.commit
    return found.git


def pushed_repository(folder: Path, package: str = ".") -> Path:
    """A repository with a package, pushed to a bare one beside it."""
    write_package(folder / package)
    commit_all(folder)
    git(folder, "init", "--quiet", "--bare", "--initial-branch=main", f"../{folder.name}-origin.git")
    git(folder, "remote", "add", "origin", f"../{folder.name}-origin.git")
    git(folder, "push", "--quiet", "--set-upstream", "origin", "main")
    return folder


# --- a folder that is a repository -------------------------------------------------------------------


@pytest.mark.parametrize("package", [".", "lab2", "src/lab2"])
def test_all_is_well(tmp_path: Path, package: str) -> None:
    repository = pushed_repository(tmp_path / "in", package)
    assert facts(repository, tmp_path / "out") == GitFacts(
        commit=git(repository, "rev-parse", "HEAD"),
        remotes=("../in-origin.git",),
        committed_work=WORK,
        uncommitted=(),
        pushed=True,
        products=(),
        products_count=0,
        committed="2026-10-05T12:00:00+00:00",
    )


def test_the_working_tree_is_what_is_taken(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    write(repository, {"lab2/talker.py": "print('new')\n"})
    assert facts(repository, tmp_path / "out").uncommitted == ("lab2/talker.py",)
    assert (tmp_path / "out/lab2/talker.py").read_text() == "print('new')\n"


def test_changed_new_and_deleted_files_are_uncommitted_ignored_ones_are_not(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in", "src/lab2")
    package = repository / "src/lab2"
    write(repository, {".gitignore": "*.log\nscratch/\n", "elsewhere.txt": "not in the package"})
    write(
        package,
        {"lab2/new.py": "", "run.log": "", "scratch/x.py": "", "lab2/talker.py": "changed", ".gitignore": "*.tmp"},
    )
    write(package, {"x.tmp": "", "lab2/__pycache__/talker.pyc": "", "lab2/näh.py": ""})
    (package / "launch/chatter.py").unlink()
    git(repository, "add", "src/lab2/lab2/new.py")  # staged is not committed
    assert facts(repository, tmp_path / "out").uncommitted == (
        ".gitignore",
        "lab2/new.py",
        "lab2/näh.py",
        "lab2/talker.py",
        "launch/chatter.py",
    )


def test_line_ends_of_windows_are_no_change(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    (repository / "setup.py").write_bytes((repository / "setup.py").read_bytes().replace(b"\n", b"\r\n"))
    assert facts(repository, tmp_path / "out").uncommitted == ()


def test_what_is_uncommitted_is_bounded(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    write(repository, {f"lab2/m{number:03}.py": "" for number in range(100)})
    assert len(facts(repository, tmp_path / "out").uncommitted) == 20


def test_only_the_work_that_is_committed_counts(tmp_path: Path) -> None:
    repository = write_package(tmp_path / "in", numeric=False)
    commit_all(repository)
    write_package(repository)
    found = facts(repository, tmp_path / "out")
    assert found.committed_work == ()
    assert set(found.uncommitted) == set(WORK)
    git(repository, "add", WORK[0])
    git(repository, "commit", "--quiet", "--message=some")
    assert facts(repository, tmp_path / "out2").committed_work == (WORK[0],)


def test_nothing_was_ever_committed(tmp_path: Path) -> None:
    repository = write_package(tmp_path / "in")
    git(repository, "init", "--quiet")
    found = facts(repository, tmp_path / "out")
    assert found.commit is None and not found.pushed and found.committed_work == ()
    assert set(found.uncommitted) == PACKAGE_FILES


def test_committed_and_not_pushed(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    assert facts(repository, tmp_path / "out").pushed
    write(repository, {"lab2/more.py": ""})
    commit_all(repository)
    assert not facts(repository, tmp_path / "out2").pushed
    git(repository, "push", "--quiet")
    git(repository, "gc", "--quiet")  # packed objects and branches are read as well
    assert facts(repository, tmp_path / "out3").pushed


@pytest.mark.parametrize(
    "way",
    [
        ["checkout", "--quiet", "--detach"],  # as on a build server
        ["checkout", "--quiet", "-b", "solution/my-work"],
        ["pack-refs", "--all"],
    ],
)
def test_pushed_however_the_branches_stand(tmp_path: Path, way: list[str]) -> None:
    repository = pushed_repository(tmp_path / "in")
    git(repository, *way)
    assert facts(repository, tmp_path / "out").pushed


def test_a_shallow_clone_is_read(tmp_path: Path) -> None:
    pushed_repository(tmp_path / "in")
    write(tmp_path / "in", {"more": ""})
    commit_all(tmp_path / "in")
    git(tmp_path, "clone", "--quiet", "--depth=1", f"file://{tmp_path}/in", "copy")
    assert facts(tmp_path / "copy", tmp_path / "out").pushed


def test_a_repository_with_long_ids_is_read(tmp_path: Path) -> None:
    repository = write_package(tmp_path / "in")
    git(repository, "init", "--quiet", "--object-format=sha256")
    commit_all(repository)
    found = facts(repository, tmp_path / "out")
    assert found.commit and len(found.commit) == 64
    assert found.uncommitted == () and found.committed_work == WORK


@pytest.mark.parametrize(
    ("address", "shown"),
    [
        ("https://me:ghp_secret@github.com/me/lab2.git", "https://github.com/me/lab2.git"),
        ("https://ghp_secret@github.com/me/lab2?token=secret#secret", "https://github.com/me/lab2"),
        ("git@github.com:COMP3631-2026/lab2", "git@github.com:COMP3631-2026/lab2"),
        ("ssh://git:secret@github.com:22/me/lab2", "ssh://git@github.com:22/me/lab2"),
        ("me@server.example:lab2", "server.example:lab2"),
        ("https://x/\x1b[31m\u202elab2", "https://x/lab2"),
    ],
)
def test_remotes_are_shown_without_secrets(tmp_path: Path, address: str, shown: str) -> None:
    repository = write_package(tmp_path / "in")
    commit_all(repository)
    git(repository, "remote", "add", "origin", address)
    assert facts(repository, tmp_path / "out").remotes == (shown,)


def test_products_are_found_where_colcon_makes_them(tmp_path: Path) -> None:
    repository = write_package(tmp_path / "in/src/lab2").parent.parent
    write(
        repository,
        {
            "build/COLCON_IGNORE": "",
            "build/lab2/x.py": "",
            "src/install/setup.bash": "",
            "src/lab2/log/latest_build/events.log": "",
            "src/lab2/lab2/__pycache__/talker.cpython-312.pyc": "",
            "src/lab2/lab2/old.pyc": "",
            "src/lab2/lab2.egg-info/PKG-INFO": "",
            "src/lab2/.pytest_cache/x": "",
            "docs/install/COLCON_IGNORE": "",
            "env/pyvenv.cfg": "",
            "env/bin/x": "",
            "docs/build/index.md": "no product",
            "src/lab2/lab2/log/__init__.py": "no product",
            "log.txt": "no product",
        },
    )
    commit_all(repository)
    found = facts(repository, tmp_path / "out")
    assert found.products == (
        "build/",
        "docs/install/",
        "env/",
        "src/install/",
        "src/lab2/.pytest_cache/",
        "src/lab2/lab2.egg-info/",
        "src/lab2/lab2/__pycache__/",
        "src/lab2/lab2/old.pyc",
        "src/lab2/log/",
    )
    assert found.products_count == 9


def test_products_that_are_not_committed_do_not_count(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    write(repository, {"build/x": "", "lab2/__pycache__/x.pyc": ""})
    assert facts(repository, tmp_path / "out").products == ()


def test_products_are_bounded_and_counted(tmp_path: Path) -> None:
    repository = write_package(tmp_path / "in")
    write(repository, {f"lab2/m{number}.pyc": "" for number in range(50)})
    commit_all(repository)
    found = facts(repository, tmp_path / "out")
    assert len(found.products) == 20 and found.products_count == 50


# --- what is not a repository of the submission's own --------------------------------------------------


def test_a_folder_inside_another_repository_is_not_assessed(tmp_path: Path) -> None:
    write_package(tmp_path / "course/submissions/alice")
    commit_all(tmp_path / "course")
    assert take(str(tmp_path / "course/submissions/alice"), tmp_path / "out").facts.git is None


def test_a_workspace_around_a_repository_is_not_assessed(tmp_path: Path) -> None:
    pushed_repository(tmp_path / "ws/src/lab2")
    assert take(str(tmp_path / "ws"), tmp_path / "out").facts.git is None


def test_a_work_tree_of_another_repository_is_not_assessed(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    git(repository, "worktree", "add", "--quiet", "../tree")
    assert take(str(tmp_path / "tree"), tmp_path / "out").facts.git is None


@pytest.mark.parametrize(
    "change", ["link", "no-head", "no-objects", "head-pipe", "config-pipe", "alternates", "nothing", "torn"]
)
def test_what_only_looks_like_a_repository_is_not_assessed(tmp_path: Path, change: str) -> None:
    repository = pushed_repository(tmp_path / "in")
    inner = repository / ".git"
    if change == "link":
        shutil.move(inner, tmp_path / "real")
        inner.symlink_to(tmp_path / "real")
    elif change == "no-head":
        (inner / "HEAD").unlink()
    elif change == "no-objects":
        shutil.rmtree(inner / "objects")
    elif change.endswith("-pipe"):
        (inner / {"head-pipe": "HEAD", "config-pipe": "config"}[change]).unlink()
        os.mkfifo(inner / {"head-pipe": "HEAD", "config-pipe": "config"}[change])
    elif change == "alternates":
        (inner / "objects/info").mkdir(exist_ok=True)
        (inner / "objects/info/alternates").write_text("/somewhere/else\n")
    elif change == "torn":
        for folder in (inner / "objects").glob("??"):
            shutil.rmtree(folder)
    else:
        shutil.rmtree(inner)
        inner.mkdir()
    assert take(str(repository), tmp_path / "out").facts.git is None


def test_replacements_do_not_change_what_was_committed(tmp_path: Path) -> None:
    repository = write_package(tmp_path / "in", numeric=False)
    empty = commit_all(repository)
    write_package(repository)
    full = commit_all(repository)
    git(repository, "reset", "--quiet", "--hard", empty)
    git(repository, "replace", empty, full)
    assert facts(repository, tmp_path / "out").committed_work == ()


# --- nothing of theirs is run ---------------------------------------------------------------------------


def arm(repository: Path, marker: Path) -> None:
    """Make *repository* run a command that leaves *marker* in every way that git knows."""
    command = f"touch {marker}; cat"
    script = repository / ".git/evil.sh"
    script.write_text(f"#!/bin/sh\ntouch {marker}\ncat\n")
    script.chmod(0o755)
    (repository / ".git/included").write_text(
        f"[core]\n\tfsmonitor = {script}\n\thooksPath = {repository}/.git/hooks\n"
    )
    settings = {
        "core.fsmonitor": script,
        "core.hooksPath": repository / ".git/hooks",
        "core.sshCommand": command,
        "core.pager": command,
        "core.editor": command,
        "core.askPass": script,
        "core.gitProxy": script,
        "core.alternateRefsCommand": command,
        "core.attributesFile": repository / ".gitattributes",
        "core.worktree": repository,
        "credential.helper": f"!{command}",
        "alias.config": f"!{command}",
        "alias.status": f"!{command}",
        "alias.ls-tree": f"!{command}",
        "diff.external": script,
        "diff.evil.textconv": command,
        "diff.evil.command": command,
        "filter.evil.clean": command,
        "filter.evil.smudge": command,
        "filter.evil.process": command,
        "filter.evil.required": "true",
        "merge.evil.driver": command,
        "tar.tar.command": command,
        "tar.tgz.command": command,
        "gpg.program": script,
        "log.showSignature": "true",
        "pager.log": command,
        "pager.config": command,
        "pager.ls-tree": command,
        "uploadpack.packObjectsHook": script,
        "remote.origin.uploadpack": command,
        "remote.origin.vcs": "ext",
        "protocol.ext.allow": "always",
        "include.path": repository / ".git/included",
        "includeIf.gitdir:/.path": repository / ".git/included",
        "submodule.recurse": "true",
        "extensions.partialClone": "origin",
        "remote.origin.promisor": "true",
        "remote.origin.url": f"ext::sh -c '{command}'",
        "url.ext::sh -c x.insteadOf": "https://",
        "trailer.x.command": command,
        "sequence.editor": command,
        "interactive.diffFilter": command,
    }
    (repository / ".gitattributes").write_text(
        "* filter=evil diff=evil merge=evil export-subst\nsetup.py export-ignore\n"
    )
    (repository / ".git/hooks").mkdir(exist_ok=True)
    for hook in (
        "post-checkout",
        "pre-auto-gc",
        "post-index-change",
        "reference-transaction",
        "fsmonitor-watchman",
        "pre-commit",
    ):
        shutil.copy(script, repository / ".git/hooks" / hook)
    (repository / ".git/info").mkdir(exist_ok=True)
    (repository / ".git/info/attributes").write_text("* filter=evil diff=evil\n")
    with (repository / ".git/config").open("a") as config:
        for key, value in settings.items():
            section, _, rest = key.partition(".")
            subsection, _, name = rest.rpartition(".")
            heading = f'[{section} "{subsection}"]' if subsection else f"[{section}]"
            quoted = str(value).replace("\\", "\\\\").replace('"', '\\"')
            config.write(f'{heading}\n\t{name} = "{quoted}"\n')


def test_the_arms_are_live(tmp_path: Path) -> None:
    """An ordinary git in such a repository does run them: without this, the next tests would prove nothing."""
    repository = pushed_repository(tmp_path / "in")
    arm(repository, tmp_path / "ran")
    try:
        git(repository, "status")
    except AssertionError:
        pass
    assert (tmp_path / "ran").exists()


@pytest.mark.parametrize("submodule", [False, True])
def test_nothing_is_run_in_a_folder(tmp_path: Path, submodule: bool) -> None:
    repository = pushed_repository(tmp_path / "in")
    if submodule:
        inner = pushed_repository(repository / "inner")
        write(repository, {".gitmodules": '[submodule "inner"]\n\tpath = inner\n\turl = ./x\n\tupdate = !touch x\n'})
    write(repository, {".gitattributes": "* filter=evil diff=evil\n"})
    commit_all(repository)
    if submodule:
        arm(inner, tmp_path / "ran")
        write(inner, {"new": ""})
    arm(repository, tmp_path / "ran")
    write(repository, {"lab2/talker.py": "changed", "lab2/new.py": ""})
    before = listing(repository / ".git")
    found = facts(repository, tmp_path / "out")
    assert not (tmp_path / "ran").exists()
    assert {"lab2/talker.py", "lab2/new.py"} <= set(found.uncommitted)
    assert found.committed_work == WORK
    assert listing(repository / ".git") == before  # nor is anything written there


def test_nothing_is_run_from_an_address(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    write(
        repository, {".gitattributes": "* filter=evil ident export-subst\nsetup.py export-ignore\n*.py text eol=crlf\n"}
    )
    write(repository, {"lab2/subst.py": "# $Format:%H$ $Id$\n"})
    commit_all(repository)
    arm(repository, tmp_path / "ran")
    taken = take(f"file://{repository}", tmp_path / "out")
    assert not (tmp_path / "ran").exists()
    assert listing(tmp_path / "out") == PACKAGE_FILES | {
        ".gitattributes",
        "lab2/subst.py",
    }  # export-ignore is not obeyed
    assert (tmp_path / "out/lab2/subst.py").read_text() == "# $Format:%H$ $Id$\n"  # nor is anything filled in
    assert b"\r" not in (tmp_path / "out/setup.py").read_bytes()
    assert taken.facts.git and taken.facts.git.remotes == (f"file://{repository}",)


# --- an address -----------------------------------------------------------------------------------------


def test_an_address_gives_the_default_branch(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in", "src/lab2")
    bare = tmp_path / "in-origin.git"
    taken = take(f"file://{bare}", tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES
    assert taken.facts.package_path == "src/lab2"
    assert taken.facts.source == f"file://{bare}"
    assert taken.facts.name == "in-origin"
    assert taken.facts.commit == git(repository, "rev-parse", "HEAD")
    made = "2026-10-05T12:00:00+00:00"
    assert taken.facts.git == GitFacts(taken.facts.commit, (f"file://{bare}",), WORK, (), True, (), 0, made)


def test_an_address_gives_what_is_committed_not_the_working_tree(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    write(repository, {"lab2/talker.py": "changed"})
    take(f"file://{repository}", tmp_path / "out")
    assert (tmp_path / "out/lab2/talker.py").read_text() == "print('talk')\n"


def test_the_digest_is_that_of_the_folder(tmp_path: Path) -> None:
    repository = pushed_repository(tmp_path / "in")
    by_address = take(f"file://{repository}", tmp_path / "out").facts.sha256
    assert take(str(repository), tmp_path / "out2").facts.sha256 == by_address


def test_modes_links_and_odd_names_of_a_commit(tmp_path: Path) -> None:
    repository = write_package(tmp_path / "in")
    (repository / "setup.py").chmod(0o755)
    (repository / "lab2/again.py").symlink_to("talker.py")
    (repository / "lab2/out.py").symlink_to("/etc/passwd")
    write(repository, {"lab2/" + "x" * 150 + "/" + "y" * 60 + ".py": "long", "lab2/näme.py": ""})
    commit_all(repository)
    take(f"file://{repository}", tmp_path / "out")
    files = listing(tmp_path / "out")
    assert "lab2/again.py" in files and "lab2/out.py" not in files and "lab2/näme.py" in files and len(files) == 13
    assert stat.S_IMODE((tmp_path / "out/setup.py").stat().st_mode) == 0o755


@pytest.fixture
def history(tmp_path: Path) -> tuple[Path, list[str]]:
    """A repository with three commits, a day apart."""
    repository, commits = write_package(tmp_path / "in"), []
    for day in (1, 2, 3):
        write(repository, {"lab2/day.py": f"{day}"})
        commits.append(commit_all(repository, when=f"2026-10-0{day}T12:00:00+0000"))
    return repository, commits


def test_a_commit_can_be_asked_for(tmp_path: Path, history: tuple[Path, list[str]]) -> None:
    repository, commits = history
    for number, commit in enumerate((commits[0], commits[1][:8].upper())):
        taken = take(f"file://{repository}", tmp_path / f"out{number}", commit=commit)
        assert taken.facts.commit == commits[number]
        assert (tmp_path / f"out{number}/lab2/day.py").read_text() == str(number + 1)
    assert refused(f"file://{repository}", tmp_path / "out", commit="f" * 40).rule == "no-such-commit"
    git(repository, "branch", "abcdef12")
    assert refused(f"file://{repository}", tmp_path / "out", commit="abcdef12").rule == "no-such-commit"
    for nonsense in ("main", "--help", "HEAD~1", ""):
        with pytest.raises(UsageError):
            take(f"file://{repository}", tmp_path / "out", commit=nonsense)


def test_a_deadline_can_be_asked_for(tmp_path: Path, history: tuple[Path, list[str]]) -> None:
    repository, commits = history
    deadline = datetime(2026, 10, 2, 12, 0, 0, tzinfo=timezone.utc)
    taken = take(f"file://{repository}", tmp_path / "out", before=deadline)
    assert taken.facts.commit == commits[1]
    early = datetime(2026, 9, 30, tzinfo=timezone.utc)
    refusal = refused(f"file://{repository}", tmp_path / "out2", before=early)
    assert refusal.rule == "no-commit-before" and "30 September 2026" in str(refusal)
    with pytest.raises(UsageError):
        take(f"file://{repository}", tmp_path / "out3", before=datetime(2026, 9, 30))


@pytest.mark.parametrize(
    ("address", "rule"),
    [
        ("ext::sh -c 'touch ran'", "address-kind"),
        ("ext::sh", "address-kind"),
        ("fd::17", "address-kind"),
        ("git://example.com/x", "address-kind"),
        ("ftp://example.com/x", "address-kind"),
        ("javascript://x", "address-kind"),
        ("file://server/share/x", "address-kind"),
        ("ssh://-oProxyCommand=touch ran/x", "address-option"),
        ("ssh://-oProxyCommand=touch@host/x", "address-option"),
        ("-oProxyCommand@host:x", "address-option"),
        ("git@-oProxyCommand=x:y", "usage"),
        ("git@host:-x", "address-option"),
        ("https://example.com/a b", "address-option"),
        ("https://example.com/a\nb", "address-option"),
        ("https://github.com/me/lab2/tree/main", "address-page"),
        ("github.com/me/lab2/blob/main/setup.py", "address-page"),
        ("https://gitlab.com/me/lab2/-/tree/main", "address-page"),
    ],
)
def test_addresses_that_are_not_cloned(
    tmp_path: Path, address: str, rule: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if rule == "usage":
        with pytest.raises(UsageError):
            take(address, tmp_path / "out")
    else:
        assert refused(address, tmp_path / "out").rule == rule
    assert not any(tmp_path.iterdir())


def test_a_file_address_without_a_repository(tmp_path: Path) -> None:
    write_package(tmp_path / "in")
    assert refused(f"file://{tmp_path}/in", tmp_path / "out").rule == "no-repository"
    assert refused(f"file://{tmp_path}/nothing", tmp_path / "out").rule == "no-repository"
    os.mkfifo(tmp_path / "pipe")
    assert refused(f"file://{tmp_path}/pipe", tmp_path / "out").rule == "no-repository"


def test_a_file_address_may_have_escapes(tmp_path: Path) -> None:
    pushed_repository(tmp_path / "my work")
    take(f"file://{tmp_path}/my%20work", tmp_path / "out")


def test_an_empty_repository(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet", "--bare", "empty.git")
    assert refused(f"file://{tmp_path}/empty.git", tmp_path / "out").rule == "repository-empty"
    (tmp_path / "in").mkdir()
    commit_all(tmp_path / "in")
    assert refused(f"file://{tmp_path}/in", tmp_path / "out").rule == "empty"


def test_a_package_that_is_only_a_link_to_another_repository(tmp_path: Path) -> None:
    """What happens when the template's own .git folder was not removed before `git add`."""
    pushed_repository(tmp_path / "in/lab2")
    write(tmp_path / "in", {"README.md": ""})
    commit_all(tmp_path / "in")
    refusal = refused(f"file://{tmp_path}/in", tmp_path / "out")
    assert refusal.rule == "package-is-submodule" and "git rm --cached lab2" in str(refusal)
    found = facts(tmp_path / "in", tmp_path / "out2")
    assert found.committed_work == () and set(WORK) <= set(found.uncommitted)


def test_a_commit_that_is_too_large_or_has_too_many_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    repository = pushed_repository(tmp_path / "in")
    with limited(monkeypatch, members=5):
        assert refused(f"file://{repository}", tmp_path / "out").rule == "too-many-files"
    with limited(monkeypatch, unpacked_bytes=100):
        assert refused(f"file://{repository}", tmp_path / "out").rule == "too-large"


def test_a_tree_that_holds_itself_a_thousandfold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A bomb for git: ten folders that are the same, ten levels deep, in a few kilobytes."""
    git(tmp_path, "init", "--quiet", "in")
    repository = tmp_path / "in"
    write(repository, {"x": "x"})
    blob = git(repository, "hash-object", "-w", "x")
    entry = f"100644 blob {blob}"
    for _ in range(9):
        tree = git(repository, "mktree", text="".join(f"{entry}\tf{number}\n" for number in range(10)))
        entry = f"040000 tree {tree}"
    git(repository, "update-ref", "refs/heads/main", git(repository, "commit-tree", tree, "-m", "bomb"))
    git(repository, "symbolic-ref", "HEAD", "refs/heads/main")
    with limited(monkeypatch, clone_seconds=1):
        began = time.monotonic()
        assert refused(f"file://{repository}", tmp_path / "out").rule in ("too-many-files", "repository-timeout")
        assert time.monotonic() - began < 8


def test_hostile_paths_in_a_commit(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet", "in")
    repository = tmp_path / "in"
    write(repository, {"x": "x", "package.xml": "<package><name>lab2</name></package>"})
    blob, manifest = (git(repository, "hash-object", "-w", name) for name in ("x", "package.xml"))
    for name in ("..", ".git"):
        inner = git(repository, "mktree", text=f"100644 blob {blob}\tx\n")
        tree = git(repository, "mktree", text=f"100644 blob {manifest}\tpackage.xml\n040000 tree {inner}\t{name}\n")
        assert tree
        git(repository, "update-ref", "refs/heads/main", git(repository, "commit-tree", tree, "-m", "x"))
        git(repository, "symbolic-ref", "HEAD", "refs/heads/main")
        assert refused(f"file://{repository}", tmp_path / "out").rule == "repository-unreadable"


# --- clones over the network (of this machine) ------------------------------------------------------------


@pytest.fixture
def deaf_port() -> int:
    """A port where connections are taken and never answered."""
    server = socket.socket()
    server.bind(("127.0.0.1", 0))
    server.listen(8)
    yield server.getsockname()[1]
    server.close()


@pytest.mark.parametrize("scheme", ["http", "https", "ssh"])
def test_an_endless_clone_ends_by_the_deadline_and_leaves_nothing(
    tmp_path: Path, scheme: str, deaf_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    if scheme == "ssh" and not shutil.which("ssh"):
        pytest.skip("no ssh on this machine")
    user = "me" if scheme == "ssh" else "me:secret"
    with limited(monkeypatch, clone_seconds=1):
        began = time.monotonic()
        refusal = refused(f"{scheme}://{user}@127.0.0.1:{deaf_port}/lab2.git", tmp_path / "out")
        assert time.monotonic() - began < 8
    assert refusal.rule == "repository-timeout"
    assert "secret" not in str(refusal)
    assert not processes_with(str(deaf_port))


def processes_with(text: str) -> list[str]:
    """The command lines of living processes that contain *text*."""
    lines = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            lines.append(path.read_bytes().replace(b"\0", b" ").decode(errors="replace"))
        except OSError:
            continue
    return [line for line in lines if text in line]


@pytest.fixture
def web(tmp_path: Path) -> str:
    """A plain web server of this machine on *tmp_path*; git can clone from it once `update-server-info` was run."""
    from functools import partial
    from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *arguments: object) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture
def smart_web(tmp_path: Path) -> str:
    """git's own web service (`git http-backend`) on *tmp_path*."""
    import subprocess
    from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

    class Backend(BaseHTTPRequestHandler):
        def log_message(self, *arguments: object) -> None: ...

        def answer(self) -> None:
            path, _, query = self.path.partition("?")
            body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
            environment = {
                "PATH": os.environ["PATH"],
                "GIT_PROJECT_ROOT": str(tmp_path),
                "GIT_HTTP_EXPORT_ALL": "1",
                "PATH_INFO": path,
                "QUERY_STRING": query,
                "REQUEST_METHOD": self.command,
                "CONTENT_TYPE": self.headers.get("Content-Type", ""),
                "HTTP_CONTENT_ENCODING": self.headers.get("Content-Encoding", ""),
                "GIT_PROTOCOL": self.headers.get("Git-Protocol", ""),
                "GIT_CONFIG_COUNT": "1",
                "GIT_CONFIG_KEY_0": "safe.directory",
                "GIT_CONFIG_VALUE_0": "*",
            }
            done = subprocess.run(
                ["git", "http-backend"], input=body, env=environment, capture_output=True, check=False
            )
            head, _, content = done.stdout.partition(b"\r\n\r\n")
            headers = dict(line.split(": ", 1) for line in head.decode().split("\r\n") if line)
            self.send_response(int(headers.pop("Status", "200").split()[0]))
            for key, value in headers.items():
                self.send_header(key, value)
            self.end_headers()
            self.wfile.write(content)

        do_GET = do_POST = answer

    with ThreadingHTTPServer(("127.0.0.1", 0), Backend) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_a_clone(tmp_path: Path, smart_web: str, history: tuple[Path, list[str]]) -> None:
    repository, commits = history
    arm(repository, tmp_path / "ran")
    git(tmp_path, "-c", "core.fsmonitor=false", "clone", "--quiet", "--bare", "in", "sc21abc/lab2.git")
    (tmp_path / "ran").unlink(missing_ok=True)
    address = f"{smart_web.replace('//', '//me:secret@')}/sc21abc/lab2.git"
    taken = take(address, tmp_path / "out")
    assert taken.facts.commit == commits[-1]
    assert taken.facts.source == f"{smart_web}/sc21abc/lab2.git"
    assert taken.facts.name == "sc21abc-lab2"
    assert taken.facts.git and taken.facts.git.pushed and taken.facts.git.remotes == (taken.facts.source,)
    assert take(address, tmp_path / "out1", commit=commits[0][:10]).facts.commit == commits[0]
    deadline = datetime(2026, 10, 2, 13, tzinfo=timezone.utc)
    assert take(address, tmp_path / "out2", before=deadline).facts.commit == commits[1]
    assert not (tmp_path / "ran").exists()


def test_a_clone_that_is_too_large(tmp_path: Path, smart_web: str, monkeypatch: pytest.MonkeyPatch) -> None:
    repository = write_package(tmp_path / "in")
    (repository / "data.bin").write_bytes(os.urandom(3_000_000))
    commit_all(repository)
    with limited(monkeypatch, unpacked_bytes=1_000_000, members=100):
        assert refused(f"{smart_web}/in/.git", tmp_path / "out").rule == "repository-too-large"


def test_a_clone_that_fails(tmp_path: Path, smart_web: str, web: str) -> None:
    refusal = refused(f"{smart_web}/nothing.git", tmp_path / "out")
    assert refusal.rule == "repository-not-found" and f"{smart_web}/nothing.git" in str(refusal)
    git(tmp_path, "init", "--quiet", "--bare", "empty.git")
    assert refused(f"{smart_web}/empty.git", tmp_path / "out").rule == "repository-empty"
    write(tmp_path, {"page/info/refs": f"{40 * 'a'}\trefs/heads/main\n", "page/HEAD": "ref: refs/heads/main\n"})
    assert refused(f"{web}/page", tmp_path / "out").rule == "clone-failed"


def test_an_address_that_cannot_be_reached_is_not_the_students_fault(tmp_path: Path) -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        address = f"http://me:secret@127.0.0.1:{unused.getsockname()[1]}/lab2.git"
        with pytest.raises(FaultError) as caught:
            take(address, tmp_path / "out")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("asked", ["rev-parse", "for-each-ref", "ls-tree", "ls-files"])
def test_git_that_is_killed_is_not_the_students_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: str
) -> None:
    repository = pushed_repository(tmp_path / "in")
    write(repository, {"lab2/new.py": ""})
    real = shutil.which("git")
    wrapper = tmp_path / "bin" / "git"
    write(wrapper.parent, {"git": f'#!/bin/sh\ncase "$*" in *{asked}*) kill -9 $$;; esac\nexec {real} "$@"\n'})
    wrapper.chmod(0o755)
    monkeypatch.setenv("PATH", f"{wrapper.parent}:{os.environ['PATH']}")
    with pytest.raises(FaultError, match="git was ended by signal 9"):
        take(str(repository), tmp_path / "out")


def test_git_that_is_missing_is_our_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    repository = pushed_repository(tmp_path / "in")
    (tmp_path / "bin").mkdir()
    for program in ("sh", "cat", "chmod", "rm"):
        (tmp_path / "bin" / program).symlink_to(shutil.which(program) or "")
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    with pytest.raises(FaultError):
        take(str(repository), tmp_path / "out")

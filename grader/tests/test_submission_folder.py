"""A folder is taken over: the package is found as colcon finds it, copied clean, and described; or refused by rule."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from intake_helpers import MANIFEST, PACKAGE_FILES, limited, listing, refused, write, write_package

from lab2_grader.errors import FaultError, RefusedError, UsageError
from lab2_grader.submission import take

# --- finding the package ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "where", [".", "lab2", "src/lab2", "ros2_ws/src/lab2", "home/me/ros2_ws/src/my-copy", "anything"]
)
def test_found_by_its_name_wherever_it_is(tmp_path: Path, where: str) -> None:
    write_package(tmp_path / "in" / where)
    taken = take(str(tmp_path / "in"), tmp_path / "out")
    assert taken.facts.package_path == where
    assert taken.package_dir == str(tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES
    assert taken.facts.git is None and taken.facts.commit is None


def test_of_a_workspace_only_the_package_is_taken(tmp_path: Path) -> None:
    write_package(tmp_path / "in/src/lab2")
    write_package(tmp_path / "in/src/lab1", name="lab1")
    write(tmp_path / "in", {"notes.txt": "mine"})
    take(str(tmp_path / "in"), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES


def test_a_package_inside_another_package_is_found(tmp_path: Path) -> None:
    write_package(tmp_path / "in", name="course")
    write_package(tmp_path / "in/lab2_work")
    assert take(str(tmp_path / "in"), tmp_path / "out").facts.package_path == "lab2_work"


def test_a_copy_inside_the_package_is_part_of_it_as_for_colcon(tmp_path: Path) -> None:
    write_package(tmp_path / "in")
    write_package(tmp_path / "in/old/lab2")
    assert take(str(tmp_path / "in"), tmp_path / "out").facts.package_path == "."
    assert (tmp_path / "out/old/lab2/package.xml").exists()


def test_two_packages_are_refused_naming_both(tmp_path: Path) -> None:
    write_package(tmp_path / "in/src/lab2")
    write_package(tmp_path / "in/backup")
    refusal = refused(tmp_path / "in", tmp_path / "out")
    assert refusal.rule == "two-packages"
    assert "backup, src/lab2" in str(refusal)


@pytest.mark.parametrize(
    "folder",
    ["build/lab2", "install/lab2/share/lab2", "log", "__pycache__", ".git/x", "node_modules/x", ".venv/x", "__MACOSX"],
)
def test_build_products_are_never_searched(tmp_path: Path, folder: str) -> None:
    write_package(tmp_path / "in/src/lab2")
    write_package(tmp_path / "in" / folder)
    assert take(str(tmp_path / "in"), tmp_path / "out").facts.package_path == "src/lab2"
    shutil.rmtree(tmp_path / "in/src")
    refused(tmp_path / "in", tmp_path / "out2")


def test_a_virtual_environment_of_any_name_is_never_searched(tmp_path: Path) -> None:
    write_package(tmp_path / "in/lab2")
    write_package(tmp_path / "in/tools/lib/lab2")
    write(tmp_path / "in/tools", {"pyvenv.cfg": ""})
    assert take(str(tmp_path / "in"), tmp_path / "out").facts.package_path == "lab2"


def test_colcon_ignore_is_respected(tmp_path: Path) -> None:
    write_package(tmp_path / "in/new")
    write_package(tmp_path / "in/old")
    write(tmp_path / "in/old", {"COLCON_IGNORE": ""})
    assert take(str(tmp_path / "in"), tmp_path / "out").facts.package_path == "new"
    write(tmp_path / "in/new", {"COLCON_IGNORE": ""})
    refusal = refused(tmp_path / "in", tmp_path / "out2")
    assert refusal.rule == "package-ignored" and "COLCON_IGNORE" in str(refusal)


@pytest.mark.parametrize("name", ["lab_2", "Lab2", "lab-2", "lab2_package", "lba2"])
def test_a_near_miss_is_named(tmp_path: Path, name: str) -> None:
    write_package(tmp_path / "in/src", name=name)
    refusal = refused(tmp_path / "in", tmp_path / "out")
    assert refusal.rule == "package-misnamed"
    assert name in str(refusal) and "src/package.xml" in str(refusal)


def test_other_packages_are_named(tmp_path: Path) -> None:
    write_package(tmp_path / "in/a", name="turtle")
    write_package(tmp_path / "in/b", name="navigation")
    refusal = refused(tmp_path / "in", tmp_path / "out")
    assert refusal.rule == "other-packages"
    assert "turtle (a/package.xml), navigation (b/package.xml)" in str(refusal)


def test_a_broken_manifest_is_named_with_its_line(tmp_path: Path) -> None:
    write_package(tmp_path / "in")
    write(tmp_path / "in", {"package.xml": "<package>\n<name>lab2</nam>\n</package>"})
    refusal = refused(tmp_path / "in", tmp_path / "out")
    assert refusal.rule == "package-xml"
    assert "package.xml" in str(refusal) and "line 2" in str(refusal)


def test_no_manifest_no_package(tmp_path: Path) -> None:
    write(tmp_path / "in", {"setup.py": "", "lab2/talker.py": ""})
    assert refused(tmp_path / "in", tmp_path / "out").rule == "no-package-xml"
    write(tmp_path / "in2", {"talker.py": "", "notes.txt": ""})
    assert refused(tmp_path / "in2", tmp_path / "out").rule == "no-package"
    (tmp_path / "in3/deep").mkdir(parents=True)
    assert refused(tmp_path / "in3", tmp_path / "out").rule == "empty"


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (b"\xef\xbb\xbf" + MANIFEST.format(name="lab2").encode(), "lab2"),
        (MANIFEST.format(name="lab2").replace("\n", "\r\n").encode(), "lab2"),
        (MANIFEST.format(name="\n    lab2\t").encode(), "lab2"),
        (b"<package><!-- <name>x</name> --><name><![CDATA[lab2]]></name><a><name>y</name></a></package>", "lab2"),
        (MANIFEST.format(name="lab2").replace("1.0", "1.0", 1).encode("utf-16"), "lab2"),
    ],
)
def test_manifests_of_every_shape_are_read(tmp_path: Path, content: bytes, name: str) -> None:
    write_package(tmp_path / "in")
    (tmp_path / "in/package.xml").write_bytes(content)
    take(str(tmp_path / "in"), tmp_path / "out")


@pytest.mark.parametrize(
    "content",
    [
        '<!DOCTYPE p [<!ENTITY a "lab2">]><package><name>&a;</name></package>',
        '<!DOCTYPE p [<!ENTITY a SYSTEM "file:///etc/hostname">]><package><name>lab2&a;</name></package>',
        "<package><name>lab2</name><name>lab2</name></package>",
        "<package><version>1</version></package>",
        "<package><name>lab2</name><!--" + "x" * 300_000 + "--></package>",
        "",
        "\0\0\0",
    ],
)
def test_manifests_that_are_tricks_or_nothing_are_refused(tmp_path: Path, content: str) -> None:
    write_package(tmp_path / "in")
    write(tmp_path / "in", {"package.xml": content})
    assert refused(tmp_path / "in", tmp_path / "out").rule == "package-xml"


def test_entities_are_not_expanded(tmp_path: Path) -> None:
    """A billion laughs ends at the first declaration."""
    laughs = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 12))
    write_package(tmp_path / "in")
    write(tmp_path / "in", {"package.xml": f"<!DOCTYPE p [{laughs}]><package><name>&l11;</name></package>"})
    assert "entities" in str(refused(tmp_path / "in", tmp_path / "out"))


# --- the clean copy --------------------------------------------------------------------------------


def test_the_copy_holds_regular_files_of_ordinary_modes_only(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    os.mkfifo(source / "pipe.py")
    with contextlib.closing(socket.socket(socket.AF_UNIX)) as listener:
        listener.bind(str(source / "socket"))
        (source / "setup.py").chmod(0o6777)
        (source / "lab2/talker.py").chmod(0o600)
        if os.geteuid() == 0:
            os.mknod(source / "null", 0o666 | 0o020000, os.makedev(1, 3))
        take(str(source), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES
    assert (tmp_path / "out/setup.py").stat().st_mode & 0o7777 == 0o755
    assert (tmp_path / "out/lab2/talker.py").stat().st_mode & 0o7777 == 0o644


def test_a_pipe_in_place_of_the_manifest_does_not_hang(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    os.mkfifo(tmp_path / "in/package.xml")
    refused(tmp_path / "in", tmp_path / "out")


def test_links_inside_become_copies_and_links_out_are_passed_over(tmp_path: Path) -> None:
    secret = write(tmp_path / "outside", {"secret.py": "secret", "sub/package.xml": ""})
    source = write_package(tmp_path / "in/lab2")
    write(tmp_path / "in", {"shared/common.py": "common"})
    (source / "lab2/common.py").symlink_to("../../shared/common.py")
    (source / "lab2/secret.py").symlink_to(secret / "secret.py")
    (source / "lab2/passwd").symlink_to("/etc/passwd")
    (source / "outside").symlink_to(secret)
    (source / "loop").symlink_to(".")
    (source / "a").symlink_to("b")
    (source / "b").symlink_to("a")
    (source / "nothing").symlink_to("nowhere")
    (tmp_path / "in/elsewhere").symlink_to(tmp_path)
    take(str(tmp_path / "in"), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES | {"lab2/common.py"}
    assert (tmp_path / "out/lab2/common.py").read_text() == "common"


def test_a_link_to_the_submission_itself_is_followed(tmp_path: Path) -> None:
    write_package(tmp_path / "in")
    (tmp_path / "link").symlink_to("in")
    assert take(str(tmp_path / "link"), tmp_path / "out").facts.package_path == "."


def test_products_are_left_behind_and_do_not_change_the_digest(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    clean = take(str(source), tmp_path / "out").facts.sha256
    write(
        source,
        {
            "build/lab2/x.py": "",
            "install/setup.bash": "",
            "log/latest": "",
            "lab2/__pycache__/talker.cpython-312.pyc": "",
            "lab2/build/COLCON_IGNORE": "",
            "lab2/build/x.py": "",
            "lab2.egg-info/PKG-INFO": "",
            ".pytest_cache/x": "",
            ".git/config": "",
            "env/pyvenv.cfg": "",
            "env/lib/big.py": "",
            "results/in/result.json": "{}",
            "results/in/evidence/scene": "",
            "._setup.py": "",
            ".DS_Store": "",
        },
    )
    again = take(str(source), tmp_path / "out2")
    assert listing(tmp_path / "out2") == PACKAGE_FILES
    assert again.facts.sha256 == clean


def test_a_module_called_log_is_no_product(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    write(source, {"lab2/log/__init__.py": "", "lab2/build/maker.py": ""})
    take(str(source), tmp_path / "out")
    assert {"lab2/log/__init__.py", "lab2/build/maker.py"} <= listing(tmp_path / "out")


def test_names_that_differ_in_case_are_two_files(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    write(source, {"lab2/Talker.py": "other"})
    take(str(source), tmp_path / "out")
    assert (tmp_path / "out/lab2/Talker.py").read_text() == "other"
    assert (tmp_path / "out/lab2/talker.py").read_text() == "print('talk')\n"


def test_the_result_may_lie_inside_the_submission(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    take(str(source), source / "results/x/package")
    assert listing(source / "results/x/package") == PACKAGE_FILES


# --- limits ----------------------------------------------------------------------------------------


def test_a_hundred_thousand_files_are_refused_by_count(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    many = source / "data"
    many.mkdir()
    (many / "0").write_text("")
    for number in range(1, 20_100):
        os.link(many / "0", many / str(number))
    assert refused(source, tmp_path / "out").rule == "too-many-files"
    shutil.move(many, source / ".venv")  # and where nobody looks, they do not matter
    take(str(source), tmp_path / "out")


def test_the_count_is_exact_at_its_edge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = write_package(tmp_path / "in")
    members = sum(1 for _ in source.rglob("*"))
    with limited(monkeypatch, members=members):
        take(str(source), tmp_path / "out")
    with limited(monkeypatch, members=members - 1):
        assert refused(source, tmp_path / "out2").rule == "too-many-files"


def test_size_is_bounded_and_exact_at_its_edge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = write_package(tmp_path / "in")
    size = sum(path.stat().st_size for path in source.rglob("*") if path.is_file())
    with limited(monkeypatch, unpacked_bytes=size):
        take(str(source), tmp_path / "out")
    with limited(monkeypatch, unpacked_bytes=size - 1):
        assert refused(source, tmp_path / "out2").rule == "too-large"


def test_a_huge_file_with_holes_is_refused_at_once(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    with (source / "huge.bin").open("wb") as huge:
        huge.truncate(1_000_000_000_000)
    assert refused(source, tmp_path / "out").rule == "too-large"


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        (b"line\nend.py", "name-control"),
        (b"esc\x1b[31m.py", "name-control"),
        (b"latin\xe9.py", "name-not-utf8"),
        (b"x" * 241, "name-too-long"),
    ],
)
def test_names_that_cannot_be(tmp_path: Path, name: bytes, rule: str) -> None:
    source = write_package(tmp_path / "in/lab2")
    (tmp_path / "in" / os.fsdecode(name)).write_text("")  # outside the package it does not matter
    take(str(tmp_path / "in"), tmp_path / "out")
    (source / os.fsdecode(name)).write_text("")
    assert refused(tmp_path / "in", tmp_path / "out2").rule == rule


def test_a_path_may_be_as_long_as_the_limit(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    write(source, {"a" * 119 + "/" + "b" * 120: ""})
    take(str(source), tmp_path / "out")
    write(source, {"a" * 119 + "/" + "b" * 121: ""})
    assert refused(source, tmp_path / "out2").rule == "name-too-long"


def test_thousands_of_folders_deep_is_refused(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    here = os.open(source, os.O_RDONLY)
    for _ in range(600):
        os.mkdir("deeper", dir_fd=here)
        below = os.open("deeper", os.O_RDONLY, dir_fd=here)
        os.close(here)
        here = below
    os.close(here)
    assert refused(source, tmp_path / "out").rule == "name-too-long"


# --- what is recorded ------------------------------------------------------------------------------


def test_the_digest_is_that_of_names_and_contents(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    first = take(str(source), tmp_path / "1").facts.sha256
    moved = shutil.copytree(source, tmp_path / "other/src/lab2")
    assert take(str(tmp_path / "other"), tmp_path / "2").facts.sha256 == first
    (moved / "setup.py").chmod(0o755)
    assert take(str(moved), tmp_path / "3").facts.sha256 == first
    write(moved, {"lab2/talker.py": "print('talk!')\n"})
    assert take(str(moved), tmp_path / "4").facts.sha256 != first
    write(moved, {"lab2/talker.py": "print('talk')\n"})
    (moved / "lab2/talker.py").rename(moved / "lab2/Talker.py")
    assert take(str(moved), tmp_path / "5").facts.sha256 != first


def test_the_digest_is_as_documented(tmp_path: Path) -> None:
    import hashlib

    write(tmp_path / "in", {"package.xml": "<package><name>lab2</name></package>", "ä/b.py": "é"})
    documented = b"11:package.xml36:<package><name>lab2</name></package>" + "7:ä/b.py2:é".encode()
    assert take(str(tmp_path / "in"), tmp_path / "out").facts.sha256 == hashlib.sha256(documented).hexdigest()


def test_sources_are_kept_for_hints_and_bounded(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    write(source, {"lab2/long.py": "#" * 200_001, "lab2/edge.py": "#" * 200_000, "lab2/notes.txt": "no"})
    (source / "lab2/bom.py").write_bytes(b"\xef\xbb\xbfprint(1)\r\n# \xff")
    write(source, {f"lab2/deep/m{number:03}.py": "" for number in range(100)})
    kept = {file.path: file.text for file in take(str(source), tmp_path / "out").facts.sources}
    assert list(kept)[:3] == ["setup.py", "setup.cfg", "package.xml"]
    assert kept["lab2/bom.py"] == "print(1)\r\n# \ufffd"
    assert kept["lab2/edge.py"] and "lab2/long.py" not in kept and "lab2/notes.txt" not in kept
    assert {"lab2/numeric_talker.py", "launch/numeric_chatter.py"} <= set(kept)
    assert len(kept) <= 60


def test_facts_can_be_written_as_json_whatever_the_names_are(tmp_path: Path) -> None:
    source = write_package(tmp_path / os.fsdecode(b"in\xff\x1b[31m") / os.fsdecode(b"we\nird"))
    facts = take(str(source), tmp_path / "out").facts
    msgspec.json.encode(facts)
    assert facts.source.isprintable()
    assert facts.name == "we-ird"


# --- ours, theirs, the caller's ----------------------------------------------------------------------


@pytest.mark.parametrize("source", ["nowhere", "", "--help", "-c", "in/package.xml/x", "\0", "x" * 5000, "/dev/null"])
def test_what_is_not_there_is_the_callers_mistake(tmp_path: Path, source: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_package(tmp_path / "in")
    with pytest.raises(UsageError) as caught:
        take(source, tmp_path / "out")
    assert str(caught.value).isprintable()
    assert not (tmp_path / "out").exists()


def test_a_place_that_is_not_empty_is_the_callers_mistake(tmp_path: Path) -> None:
    write(tmp_path / "out", {"precious": "data"})
    with pytest.raises(UsageError):
        take(str(write_package(tmp_path / "in")), tmp_path / "out")
    assert (tmp_path / "out/precious").exists()


def test_a_deadline_is_for_addresses_only(tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        take(str(write_package(tmp_path / "in")), tmp_path / "out", commit="abcdef1")


def test_a_place_that_cannot_be_made_is_our_fault(tmp_path: Path) -> None:
    source = write_package(tmp_path / "in")
    write(tmp_path, {"file": ""})
    with pytest.raises(FaultError):
        take(str(source), tmp_path / "file/out")


def test_a_full_disk_is_our_fault(tmp_path: Path) -> None:
    """The kernel's limit on the size of a file stands in for a full disk: the same call fails in the same way."""
    source = write_package(tmp_path / "in")
    write(source, {"lab2/large.py": "#" * 100_000})
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, before[1]))
    try:
        with pytest.raises(FaultError):
            take(str(source), tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert not (tmp_path / "out").exists()


@contextlib.contextmanager
def as_nobody() -> Iterator[Path]:
    """A folder that an ordinary user may write, and that user in place of root."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o777)
        root = os.geteuid() == 0
        if root:
            os.seteuid(65534)
        try:
            yield Path(folder)
        finally:
            if root:
                os.seteuid(0)


def test_files_that_cannot_be_read_are_named() -> None:
    with as_nobody() as folder:
        source = write_package(folder / "in")
        (source / "lab2/talker.py").chmod(0)
        with pytest.raises(RefusedError) as caught:
            take(str(source), folder / "out")
        assert caught.value.rule == "unreadable" and "lab2/talker.py" in str(caught.value)
        (source / "lab2/talker.py").chmod(0o600)
        (source / "launch").chmod(0)
        with pytest.raises(RefusedError) as caught:
            take(str(source), folder / "out")
        assert caught.value.rule == "unreadable" and "launch" in str(caught.value)
        (source / "launch").chmod(0o700)
        source.chmod(0)
        with pytest.raises(RefusedError):
            take(str(source), folder / "out")
        source.chmod(0o700)


def test_a_place_that_cannot_be_written_is_our_fault() -> None:
    with as_nobody() as folder:
        source = write_package(folder / "in")
        (folder / "locked").mkdir(mode=0o500)
        with pytest.raises(FaultError):
            take(str(source), folder / "locked/out")


def test_nothing_is_left_in_the_temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    take(str(write_package(tmp_path / "in")), tmp_path / "out")
    refused(write(tmp_path / "in2", {"x.zip": "x"}), tmp_path / "out2")
    assert listing(tmp_path / "tmp") == set() and not any((tmp_path / "tmp").iterdir())

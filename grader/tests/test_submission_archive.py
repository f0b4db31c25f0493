"""An archive is unpacked without believing it, or refused by the rule that it breaks."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import os
import random
import stat
import struct
import subprocess
import sys
import tarfile
import time
import zipfile
import zlib
from pathlib import Path

import pytest
from intake_helpers import PACKAGE_FILES, limited, listing, refused, write_package

from lab2_grader.errors import RefusedError, UsageError
from lab2_grader.submission import take

Entry = tuple[str, bytes]


def package_entries(prefix: str = "") -> list[Entry]:
    """The members of an archive that holds a package."""
    content = dict.fromkeys(PACKAGE_FILES, b"pass\n") | {"package.xml": b"<package><name>lab2</name></package>"}
    return [(prefix + name, data) for name, data in sorted(content.items())]


def make_zip(
    path: Path, entries: list[Entry | tuple[zipfile.ZipInfo, bytes]], method: int = zipfile.ZIP_DEFLATED
) -> Path:
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return path


def make_tar(path: Path, entries: list[Entry | tarfile.TarInfo], mode: str = "w:gz", **options: object) -> Path:
    with tarfile.open(path, mode, **options) as archive:  # type: ignore[call-overload]
        for entry in entries:
            if isinstance(entry, tarfile.TarInfo):
                archive.addfile(entry)
            else:
                info = tarfile.TarInfo(entry[0])
                info.size = len(entry[1])
                archive.addfile(info, io.BytesIO(entry[1]))
    return path


def tar_member(name: str, kind: bytes, target: str = "") -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.linkname = kind, target
    return info


def zip_member(name: str, mode: int = 0o100644) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = mode << 16
    return info


# --- honest archives -------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["tar", "tar.gz", "tgz", "tar.xz", "tar.bz2"])
@pytest.mark.parametrize("layout", [tarfile.USTAR_FORMAT, tarfile.GNU_FORMAT, tarfile.PAX_FORMAT])
def test_tar(tmp_path: Path, suffix: str, layout: int) -> None:
    mode = {"tar": "w", "tar.gz": "w:gz", "tgz": "w:gz", "tar.xz": "w:xz", "tar.bz2": "w:bz2"}[suffix]
    path = make_tar(tmp_path / f"sc21abc.{suffix}", package_entries("./ros2_ws/src/lab2/"), mode, format=layout)
    taken = take(str(path), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES
    assert taken.facts.package_path == "ros2_ws/src/lab2"
    assert taken.facts.name == "sc21abc"
    assert taken.facts.git is None


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_zip(tmp_path: Path, method: int) -> None:
    path = make_zip(tmp_path / "sc21abc.zip", package_entries("lab2/"), method)
    assert take(str(path), tmp_path / "out").facts.package_path == "lab2"
    assert listing(tmp_path / "out") == PACKAGE_FILES


def test_the_same_package_has_the_same_digest_however_it_comes(tmp_path: Path) -> None:
    folder = write_package(tmp_path / "in")
    entries: list[Entry] = [(name, (folder / name).read_bytes()) for name in sorted(listing(folder))]
    sources = [folder, make_zip(tmp_path / "a.zip", list(entries)), make_tar(tmp_path / "a.tgz", list(entries))]
    assert len({take(str(source), tmp_path / str(number)).facts.sha256 for number, source in enumerate(sources)}) == 1


def test_the_kind_is_told_by_the_content(tmp_path: Path) -> None:
    path = make_zip(tmp_path / "a.tar.gz", package_entries())
    take(str(path), tmp_path / "out")
    path = make_tar(tmp_path / "upload", package_entries())
    assert take(str(path), tmp_path / "out2").facts.name == "upload"


def test_a_zip_from_windows_has_backslashes(tmp_path: Path) -> None:
    entries = [(name.replace("/", "\\"), data) for name, data in package_entries("ws/src/lab2/")]
    path = make_zip(tmp_path / "a.zip", [("ws\\", b""), ("ws\\src\\", b""), *entries])
    assert take(str(path), tmp_path / "out").facts.package_path == "ws/src/lab2"


def test_a_zip_from_macos_has_companions_and_utf8_without_its_flag(tmp_path: Path) -> None:
    name = "lab2/übung.py".encode()
    path = make_zip(
        tmp_path / "a.zip", [*package_entries("lab2/"), ("__MACOSX/lab2/._setup.py", b"x"), ("lab2/.DS_Store", b"x")]
    )
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("lab2/" + "x" * (len(name) - 5), b"")
    path.write_bytes(path.read_bytes().replace(b"lab2/" + b"x" * (len(name) - 5), name))
    take(str(path), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES | {"übung.py"}


def test_modes_are_ordinary_afterwards(tmp_path: Path) -> None:
    info = tarfile.TarInfo("lab2/run.py")
    info.mode = 0o6755
    path = make_tar(tmp_path / "a.tar", [*package_entries(), info], "w")
    take(str(path), tmp_path / "out")
    assert (tmp_path / "out/lab2/run.py").stat().st_mode & 0o7777 == 0o755
    path = make_zip(tmp_path / "a.zip", [*package_entries(), (zip_member("lab2/run.py", 0o104700), b"")])
    take(str(path), tmp_path / "out2")
    assert (tmp_path / "out2/lab2/run.py").stat().st_mode & 0o7777 == 0o755
    assert (tmp_path / "out2/setup.py").stat().st_mode & 0o7777 == 0o644


def test_an_archive_in_an_archive_is_opened_one_level_down(tmp_path: Path) -> None:
    inner = make_tar(tmp_path / "inner.tar.gz", package_entries("lab2/")).read_bytes()
    outer = make_zip(tmp_path / "outer.zip", [("sub/inner.tar.gz", inner), ("readme.txt", b"marks please")])
    assert take(str(outer), tmp_path / "out").facts.package_path == "lab2"
    outermost = make_zip(tmp_path / "outermost.zip", [("outer.zip", outer.read_bytes())])
    assert refused(outermost, tmp_path / "out2").rule == "archive-nested"


def test_an_archive_in_a_folder_is_opened(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    make_zip(tmp_path / "in/lab2.zip", package_entries())
    assert take(str(tmp_path / "in"), tmp_path / "out").facts.name == "in"
    make_zip(tmp_path / "in/lab2 (2).zip", package_entries())
    refusal = refused(tmp_path / "in", tmp_path / "out2")
    assert refusal.rule == "archives-inside" and "lab2 (2).zip, lab2.zip" in str(refusal)


def test_names_that_differ_in_case_are_two_files(tmp_path: Path) -> None:
    path = make_zip(tmp_path / "a.zip", [*package_entries(), ("lab2/TALKER.py", b"other")])
    take(str(path), tmp_path / "out")
    assert (tmp_path / "out/lab2/TALKER.py").read_bytes() == b"other"
    assert (tmp_path / "out/lab2/talker.py").read_bytes() == b"pass\n"


def test_products_are_not_unpacked(tmp_path: Path) -> None:
    waste: list[Entry] = [
        (f"lab2/{folder}/x", b"") for folder in (".git", "__pycache__", "node_modules", ".venv", "build")
    ]
    take(str(make_zip(tmp_path / "a.zip", [*package_entries("lab2/"), *waste])), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES


# --- links -----------------------------------------------------------------------------------------


def test_links_inside_become_copies(tmp_path: Path) -> None:
    entries = [
        *package_entries("ws/lab2/"),
        ("ws/common.py", b"common"),
        tar_member("ws/lab2/a.py", tarfile.SYMTYPE, "../common.py"),
        tar_member("ws/lab2/b.py", tarfile.LNKTYPE, "ws/common.py"),
        tar_member("ws/lab2/c.py", tarfile.SYMTYPE, "a.py"),
        tar_member("ws/lab2/loop", tarfile.SYMTYPE, "loop"),
        tar_member("ws/lab2/folder", tarfile.SYMTYPE, "lab2"),
        tar_member("ws/lab2/nothing", tarfile.SYMTYPE, "nowhere"),
    ]
    take(str(make_tar(tmp_path / "a.tar.gz", entries)), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES | {"a.py", "b.py", "c.py"}
    assert {(tmp_path / "out" / name).read_bytes() for name in ("a.py", "b.py", "c.py")} == {b"common"}
    link = (zip_member("lab2/d.py", stat.S_IFLNK | 0o777), b"talker.py")
    take(str(make_zip(tmp_path / "a.zip", [*package_entries(), link])), tmp_path / "out2")
    assert (tmp_path / "out2/lab2/d.py").read_bytes() == b"pass\n"


@pytest.mark.parametrize("target", ["/etc/passwd", "../../outside", "..", "lab2/../../x", "C:/windows", "..\\..\\x"])
@pytest.mark.parametrize("kind", ["symbolic", "hard", "zip"])
def test_links_out_are_refused(tmp_path: Path, target: str, kind: str) -> None:
    if kind == "zip":
        link = (zip_member("link.py", stat.S_IFLNK | 0o777), target.encode())
        path = make_zip(tmp_path / "a.zip", [*package_entries(), link])
    else:
        tar_kind = tarfile.SYMTYPE if kind == "symbolic" else tarfile.LNKTYPE
        path = make_tar(tmp_path / "a.tar", [*package_entries(), tar_member("link.py", tar_kind, target)], "w")
    refusal = refused(path, tmp_path / "out")
    assert refusal.rule == "archive-link-out" and "link.py" in str(refusal)


def test_links_out_of_products_are_passed_over(tmp_path: Path) -> None:
    """As colcon makes them with --symlink-install, and Python in a virtual environment."""
    entries = [
        *package_entries("src/lab2/"),
        tar_member("build/lab2/setup.py", tarfile.SYMTYPE, "/home/me/ros2_ws/src/lab2/setup.py"),
        tar_member(".venv/bin/python", tarfile.SYMTYPE, "/usr/bin/python3"),
    ]
    take(str(make_tar(tmp_path / "a.tar.gz", entries)), tmp_path / "out")
    assert listing(tmp_path / "out") == PACKAGE_FILES


def test_nothing_is_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "outside").mkdir()
    entries = [
        *package_entries(),
        tar_member("door", tarfile.SYMTYPE, "lab2"),
        ("door/evil.py", b"evil"),
        tar_member("twice", tarfile.SYMTYPE, "setup.py"),
        ("twice", b"evil"),
    ]
    take(str(make_tar(tmp_path / "a.tar", entries, "w")), tmp_path / "out")
    assert (tmp_path / "out/setup.py").read_bytes() == b"pass\n"
    assert not (tmp_path / "out/lab2/evil.py").exists()


# --- one rule each -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"x",
        b"just a text\n" * 100,
        b"\x7fELF" + b"\0" * 2000,
        b"%PDF-1.7\n" * 200,
        bytes(range(256)) * 8,
        gzip.compress(b"one file"),
    ],
)
def test_no_archive(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "work.zip").write_bytes(content)
    refusal = refused(tmp_path / "work.zip", tmp_path / "out")
    assert refusal.rule == "no-archive" and "work.zip" in str(refusal)


@pytest.mark.parametrize(
    ("magic", "kind"),
    [(b"Rar!\x1a\x07\x01\0", "RAR"), (b"7z\xbc\xaf\x27\x1c\0\4", "7z"), (b"\x28\xb5\x2f\xfd", "Zstandard")],
)
def test_archives_that_are_not_read_are_named(tmp_path: Path, magic: bytes, kind: str) -> None:
    (tmp_path / "lab2.rar").write_bytes(magic + b"\0" * 600)
    refusal = refused(tmp_path / "lab2.rar", tmp_path / "out")
    assert refusal.rule == "archive-kind" and kind in str(refusal)


@pytest.mark.parametrize("kind", ["zip", "tar", "tar.gz", "tar.xz", "tar.bz2"])
def test_cut_off_or_damaged(tmp_path: Path, kind: str) -> None:
    entries = [*package_entries(), ("noise.bin", random.Random(1).randbytes(40_000))]
    path = tmp_path / f"a.{kind}"
    if kind == "zip":
        make_zip(path, list(entries))
    else:
        make_tar(path, list(entries), "w" if kind == "tar" else f"w:{kind[4:]}")
    whole = path.read_bytes()
    for part in (0.1, 0.5, 0.9):
        path.write_bytes(whole[: int(len(whole) * part)])
        if part == 0.1 or kind != "tar":
            assert refused(path, tmp_path / "out").rule in ("archive-corrupt", "no-archive")
    path.write_bytes(whole[: len(whole) // 2])
    assert refused(path, tmp_path / "out").rule == "archive-corrupt"
    if kind != "tar":  # a plain tar has no checksum of its contents
        damaged = bytearray(whole)
        damaged[len(whole) // 2 : len(whole) // 2 + 50] = bytes(50)
        path.write_bytes(damaged)
        assert refused(path, tmp_path / "out").rule == "archive-corrupt"


def test_encrypted(tmp_path: Path) -> None:
    path = make_zip(tmp_path / "a.zip", package_entries())
    content = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        position = content.find(signature)
        while position >= 0:
            content[position + offset] |= 1
            position = content.find(signature, position + 4)
    path.write_bytes(content)
    assert refused(path, tmp_path / "out").rule == "archive-encrypted"


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_methods_that_cannot_be_bounded(tmp_path: Path, method: int) -> None:
    assert refused(make_zip(tmp_path / "a.zip", package_entries(), method), tmp_path / "out").rule == "archive-method"


BAD_NAMES = [
    ("../evil.py", "archive-parent"),
    ("lab2/../../evil.py", "archive-parent"),
    ("..", "archive-parent"),
    ("lab2\\..\\..\\evil.py", "archive-parent"),
    ("/etc/evil.py", "archive-absolute"),
    ("//server/evil.py", "archive-absolute"),
    ("C:\\evil.py", "archive-absolute"),
    ("c:evil.py", "archive-absolute"),
    ("\\\\server\\share\\evil.py", "archive-absolute"),
    ("new\nline.py", "name-control"),
    ("escape\x1b[31m.py", "name-control"),
    ("c1\x9b31m.py", "name-control"),
    ("separator\u2028.py", "name-control"),
    ("x" * 241, "name-too-long"),
    ("x" * 300, "name-too-long"),
    ("ü" * 121, "name-too-long"),
    ("/".join("x" * 121), "name-too-long"),
]


@pytest.mark.parametrize(("name", "rule"), BAD_NAMES)
@pytest.mark.parametrize("kind", ["zip", "tar"])
def test_names(tmp_path: Path, name: str, rule: str, kind: str) -> None:
    entries = [*package_entries(), (name, b"evil")]
    path = (
        make_zip(tmp_path / "a.zip", list(entries))
        if kind == "zip"
        else make_tar(tmp_path / "a.tar", list(entries), "w")
    )
    assert refused(path, tmp_path / "out").rule == rule
    assert listing(tmp_path) == {path.name}


def test_a_nul_in_a_name_of_a_zip(tmp_path: Path) -> None:
    path = make_zip(tmp_path / "a.zip", [*package_entries(), ("setupXpy", b"evil")])
    path.write_bytes(path.read_bytes().replace(b"setupXpy", b"setup\0py"))
    assert refused(path, tmp_path / "out").rule == "name-control"


def test_a_name_that_is_not_utf8(tmp_path: Path) -> None:
    path = make_tar(
        tmp_path / "a.tar", [*package_entries(), (os.fsdecode(b"caf\xe9.py"), b"")], "w", format=tarfile.GNU_FORMAT
    )
    assert refused(path, tmp_path / "out").rule == "name-not-utf8"


@pytest.mark.parametrize("kind", [tarfile.FIFOTYPE, tarfile.CHRTYPE, tarfile.BLKTYPE, b"Z"])
def test_devices_and_pipes_in_a_tar(tmp_path: Path, kind: bytes) -> None:
    path = make_tar(tmp_path / "a.tar", [*package_entries(), tar_member("thing", kind)], "w")
    assert refused(path, tmp_path / "out").rule == "archive-special"


@pytest.mark.parametrize("mode", [stat.S_IFIFO, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFSOCK])
def test_devices_and_pipes_in_a_zip(tmp_path: Path, mode: int) -> None:
    path = make_zip(tmp_path / "a.zip", [*package_entries(), (zip_member("thing", mode | 0o644), b"")])
    assert refused(path, tmp_path / "out").rule == "archive-special"


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("name", ["setup.py", "./setup.py", "lab2//talker.py", "lab2", "setup.py/x"])
@pytest.mark.parametrize("kind", ["zip", "tar"])
def test_a_name_twice(tmp_path: Path, name: str, kind: str) -> None:
    entries = [*package_entries(), (name, b"other")]
    path = (
        make_zip(tmp_path / "a.zip", list(entries))
        if kind == "zip"
        else make_tar(tmp_path / "a.tar", list(entries), "w")
    )
    assert refused(path, tmp_path / "out").rule == "name-twice"


# --- bombs -----------------------------------------------------------------------------------------


def peak_memory(source: Path, out: Path) -> tuple[str, int, float]:
    """What taking *source* raised, in a process of its own; by how many bytes its memory grew at most; seconds."""
    script = """
import re, sys
from pathlib import Path
from lab2_grader.submission import take
from lab2_grader.errors import RefusedError

def peak():
    return int(re.search("VmHWM:\\s*([0-9]+)", Path("/proc/self/status").read_text())[1])

before, rule = peak(), "taken"
try:
    take(sys.argv[1], Path(sys.argv[2]))
except RefusedError as error:
    rule = error.rule
print(rule, peak() - before)
"""
    began = time.monotonic()
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", script, source, out], check=False, capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    rule, kilobytes = done.stdout.split()
    assert not out.exists()
    return rule, int(kilobytes) * 1024, time.monotonic() - began


def zip_bomb(path: Path, megabytes: int) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in package_entries():
            archive.writestr(name, data)
        with archive.open("zeros.bin", "w", force_zip64=True) as member:
            for _ in range(megabytes):
                member.write(bytes(1_000_000))
    return path


def tar_bomb(path: Path, mode: str, megabytes: int) -> Path:
    """A tar with one member of zeros, in the kind of compression that *mode* names."""
    opener = {"gz": gzip.open, "bz2": bz2.open, "xz": lzma.open}[mode]
    info = tarfile.TarInfo("zeros.bin")
    info.size = megabytes * 1_000_000
    with opener(path, "wb") as stream:
        stream.write(info.tobuf())
        for _ in range(megabytes):
            stream.write(bytes(1_000_000))
        stream.write(bytes(10240))
    return path


@pytest.mark.parametrize("kind", ["zip", "gz", "bz2", "xz"])
def test_a_bomb_stops_early_and_stays_small(tmp_path: Path, kind: str) -> None:
    path = zip_bomb(tmp_path / "a.zip", 120) if kind == "zip" else tar_bomb(tmp_path / f"a.tar.{kind}", kind, 120)
    rule, grown, seconds = peak_memory(path, tmp_path / "out")
    assert rule == "archive-bomb"
    assert grown < 50_000_000
    assert seconds < 10


def test_a_bomb_is_told_by_its_ratio(tmp_path: Path) -> None:
    assert refused(zip_bomb(tmp_path / "a.zip", 100), tmp_path / "out").rule == "archive-bomb"
    assert refused(tar_bomb(tmp_path / "a.tgz", "gz", 100), tmp_path / "out").rule == "archive-bomb"
    take(
        str(make_zip(tmp_path / "b.zip", [*package_entries(), ("zeros", bytes(990_000))])), tmp_path / "out"
    )  # below 1 MB


def test_a_bomb_in_an_archive(tmp_path: Path) -> None:
    inner = zip_bomb(tmp_path / "inner.zip", 100)
    outer = make_zip(tmp_path / "outer.zip", [("inner.zip", inner.read_bytes())])
    assert refused(outer, tmp_path / "out").rule == "archive-bomb"


def test_a_zip_that_lies_about_its_sizes(tmp_path: Path) -> None:
    """A member that announces 10 bytes and holds 50 MB: what it holds is never read, and the lie is found."""
    path = make_zip(tmp_path / "a.zip", [("package.xml", bytes(50_000_000))])
    path.write_bytes(path.read_bytes().replace(struct.pack("<L", 50_000_000), struct.pack("<L", 10)))
    rule, grown, _ = peak_memory(path, tmp_path / "out")
    assert rule == "archive-corrupt" and grown < 50_000_000
    path.write_bytes(
        make_zip(path, [("a", b"x" * 10)]).read_bytes().replace(struct.pack("<L", 10), struct.pack("<L", 10**9))
    )
    assert refused(path, tmp_path / "out").rule in ("too-large", "archive-corrupt")


def test_overlapping_members(tmp_path: Path) -> None:
    """David Fifield's trick: many entries of the directory share one member's bytes."""
    data = zlib.compress(bytes(10_000_000), 9)[2:-4]
    name = b"aaaaaaaa"
    checksum = zlib.crc32(bytes(10_000_000))
    fields = struct.pack("<HHHHHLLLHH", 20, 0, 8, 0, 0, checksum, len(data), 10_000_000, len(name), 0)
    local = b"PK\x03\x04" + fields + name + data
    directory = b"".join(
        b"PK\x01\x02" + struct.pack("<H", 20) + fields + struct.pack("<HHHLL", 0, 0, 0, 0, 0) + name
        for _ in range(1000)
    )
    end = b"PK\x05\x06" + struct.pack("<HHHHLLH", 0, 0, 1000, 1000, len(directory), len(local), 0)
    (tmp_path / "a.zip").write_bytes(local + directory + end)
    assert refused(tmp_path / "a.zip", tmp_path / "out").rule in ("archive-overlap", "archive-corrupt")


@pytest.mark.parametrize("kind", ["zip", "tar"])
def test_too_many_members(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = package_entries()
    path = make_zip(tmp_path / "a.zip", list(entries)) if kind == "zip" else make_tar(tmp_path / "a.tgz", list(entries))
    with limited(monkeypatch, members=len(entries) + 3):  # and the three folders
        take(str(path), tmp_path / "out")
    with limited(monkeypatch, members=len(entries) - 1):
        assert refused(path, tmp_path / "out2").rule == "too-many-files"


def test_a_million_entries_in_the_directory_of_a_zip(tmp_path: Path) -> None:
    entry = b"PK\x01\x02" + bytes(42)
    directory = entry * 1_000_000
    end = b"PK\x05\x06" + struct.pack("<HHHHLLH", 0, 0, 5, 5, len(directory), 0, 0)
    (tmp_path / "a.zip").write_bytes(b"PK\x03\x04" + directory + end)
    rule, grown, seconds = peak_memory(tmp_path / "a.zip", tmp_path / "out")
    assert rule == "too-many-files" and grown < 50_000_000 and seconds < 5


@pytest.mark.parametrize("kind", [b"x", b"g", b"L", b"K"])
def test_a_header_of_a_tar_that_is_a_bomb(tmp_path: Path, kind: bytes) -> None:
    info = tarfile.TarInfo("header")
    info.type, info.size = kind, 150_000_000
    with (tmp_path / "a.tar").open("wb") as stream:
        stream.write(info.tobuf())
        stream.write(b"30 path=aaaaaaaaaaaaaaaaaaaaa\n" * 100_000)
    rule, grown, seconds = peak_memory(tmp_path / "a.tar", tmp_path / "out")
    assert rule == "archive-corrupt" or rule == "archive-too-large"
    assert grown < 50_000_000 and seconds < 5


def test_a_sparse_tar_counts_its_holes(tmp_path: Path) -> None:
    with (tmp_path / "huge").open("wb") as huge:
        huge.truncate(10_000_000_000)
    subprocess.run(["tar", "-S", "-cf", "a.tar", "huge"], cwd=tmp_path, check=True)
    (tmp_path / "huge").unlink()
    assert refused(tmp_path / "a.tar", tmp_path / "out").rule == "too-large"


def test_an_xz_that_asks_for_gigabytes(tmp_path: Path) -> None:
    filters = [
        {"id": lzma.FILTER_LZMA2, "dict_size": 1_500_000_000, "mode": lzma.MODE_FAST, "nice_len": 10, "mf": lzma.MF_HC3}
    ]
    try:
        content = lzma.compress(b"x" * 1000, filters=filters)
    except MemoryError:
        pytest.skip("this machine has not the memory to make such a file")
    (tmp_path / "a.tar.xz").write_bytes(content)
    rule, grown, _ = peak_memory(tmp_path / "a.tar.xz", tmp_path / "out")
    assert rule == "archive-corrupt" and grown < 50_000_000


def test_an_archive_that_is_too_large(tmp_path: Path) -> None:
    path = make_zip(tmp_path / "a.zip", package_entries())
    with path.open("ab") as archive:
        archive.truncate(100_000_001)
    assert refused(path, tmp_path / "out").rule == "archive-too-large"


# --- whatever comes --------------------------------------------------------------------------------


def test_random_bytes_are_always_refused(tmp_path: Path) -> None:
    draw = random.Random(3631)
    starts = [b"", b"PK\x03\x04", b"PK\x05\x06", b"\x1f\x8b\x08", b"BZh9", b"\xfd7zXZ\0", b"\0" * 257 + b"ustar"]
    for number in range(300):
        path = tmp_path / "a.zip"
        path.write_bytes(draw.choice(starts) + draw.randbytes(draw.randrange(3000)))
        refused(path, tmp_path / f"out{number}")


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("kind", ["zip", "tar", "tar.gz"])
def test_damaged_archives_are_taken_or_refused_and_nothing_else(tmp_path: Path, kind: str) -> None:
    draw = random.Random(2026)
    path = tmp_path / f"a.{kind}"
    if kind == "zip":
        make_zip(path, package_entries())
    else:
        make_tar(path, package_entries(), "w" if kind == "tar" else "w:gz")
    whole = path.read_bytes()
    outcomes = set()
    for number in range(200):
        damaged = bytearray(whole)
        for _ in range(draw.randrange(1, 6)):
            damaged[draw.randrange(len(damaged))] = draw.randrange(256)
        path.write_bytes(damaged)
        try:
            take(str(path), tmp_path / f"out{number}")
        except RefusedError as error:
            outcomes.add(error.rule)
    assert "archive-corrupt" in outcomes
    assert {file for file in listing(tmp_path) if not file.startswith("out")} == {path.name}


def test_an_archive_that_cannot_be_read_is_the_callers_mistake(tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        take(str(tmp_path / "nothing.zip"), tmp_path / "out")

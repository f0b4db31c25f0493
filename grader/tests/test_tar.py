"""What is taken out of an archive that is not trusted stays in its folder."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

import pytest

from lab2_grader.tar import take_out


def member(name: str, kind: bytes = tarfile.REGTYPE, target: str = "", mode: int = 0o644) -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.linkname, info.mode = kind, target, mode
    info.size = 4 if kind == tarfile.REGTYPE else 0
    return info


def taken(folder: Path, *members: tarfile.TarInfo) -> list[str]:
    """The paths that are below *folder* when all *members* were taken out of one archive."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        for info in members:
            archive.addfile(info, io.BytesIO(b"text") if info.size else None)
    buffer.seek(0)
    inside = folder / "inside"
    inside.mkdir()
    with tarfile.open(fileobj=buffer) as archive:
        for info in archive:
            take_out(archive, info, inside)
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_files_and_folders_are_taken(tmp_path: Path) -> None:
    run, empty = member("a/b/run", mode=0o4755), member("empty", tarfile.DIRTYPE, mode=0)
    assert taken(tmp_path, run, empty) == ["inside", "inside/a", "inside/a/b", "inside/a/b/run", "inside/empty"]
    path = tmp_path / "inside" / "a" / "b" / "run"
    assert path.read_bytes() == b"text"
    assert path.stat().st_mode & 0o7777 == 0o755


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE])
def test_nothing_follows_a_link(kind: bytes, tmp_path: Path) -> None:
    (tmp_path / "outside").mkdir()
    links = (member("way", kind, "../outside"), member("way/escaped"))
    assert taken(tmp_path, *links) == ["inside", "inside/way", "inside/way/escaped", "outside"]


@pytest.mark.parametrize(
    "odd",
    [
        member("../escaped"),
        member("a/../../escaped"),
        member("/tmp/lab2-escaped"),
        member("device", tarfile.CHRTYPE),
        member("pipe", tarfile.FIFOTYPE),
    ],
    ids=lambda info: info.name,
)
def test_what_leads_out_or_is_no_file_is_refused(odd: tarfile.TarInfo, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=odd.name):
        taken(tmp_path, odd)
    assert [path.name for path in tmp_path.rglob("*")] == ["inside"]

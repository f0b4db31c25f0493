"""Unpacks an archive that a stranger made, member by member, or refuses it by rule.

Nothing that an archive says of itself is believed: kinds are told by content, sizes are counted while reading, and only
regular files and folders are ever written. Links inside the archive become copies of what they point at.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import os
import posixpath
import re
import stat
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import BinaryIO

from lab2_grader.errors import UsageError
from lab2_grader.messages import refusal
from lab2_grader.submission import products
from lab2_grader.submission.bounds import CHUNK, Bounds, Destination

SUFFIXES = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.xz", ".txz", ".tar.bz2", ".tbz2", ".tbz")

_XZ_MEMORY = 100_000_000  # bytes; `xz -9` needs 65 MB
_HEADER_BYTES = 64 * 1024  # of one tar member's headers, extensions included; a path and some attributes need 2 kB
_DIRECTORY_BYTES = 16_000_000  # of a zip's list of members
_HOPS = 16  # from link to link

_DRIVE = re.compile("[A-Za-z]:")
_MALFORMED = (
    zipfile.BadZipFile,
    tarfile.TarError,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    OSError,
    ValueError,
    OverflowError,
    IndexError,
    RuntimeError,
    NotImplementedError,
)
_ZIP = (b"PK\x03\x04", b"PK\x05\x06")
_STRANGERS = {
    b"Rar!": "RAR",
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"\x28\xb5\x2f\xfd": "Zstandard",
    b"\x04\x22\x4d\x18": "LZ4",
    b"LZIP": "lzip",
    b"\x1f\x9d": "compress (.Z)",
}
_READABLE_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 0x1
_UTF8 = 0x800
_MS_DOS_FOLDER = 0x10


class LinksOut(Enum):
    """What becomes of a link that points out of the archive."""

    REFUSED = "refused"
    DROPPED = "dropped"  # for a commit: a repository may hold any link, and `checkout` makes it too


def unpack(path: Path, into: Path, links_out: LinksOut = LinksOut.REFUSED, largest: int | None = None) -> None:
    """Unpack the archive *path* into the new folder *into*; a compressed tar is put beside it for the time being.

    Args:
        path: A zip, or a tar, plain or compressed with gzip, xz or bzip2.
        into: Where to; only regular files and folders are made.
        links_out: What becomes of a link that points out of the archive.

        largest: Bytes that the archive itself may have; by default what may be handed in.

    Raises:
        RefusedError: It is no archive, or breaks a rule.
        UsageError: It cannot be read.
        FaultError: It cannot be written.
    """
    destination = Destination(into)
    try:
        source = path.open("rb")
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.") from error
    with source, _malformed_is_refused(path.name):
        size = os.fstat(source.fileno()).st_size
        packed = Bounds(size)
        largest = largest or packed.limits.archive_bytes
        if size > largest:
            raise refusal("archive-too-large", name=path.name, limit=largest // 1_000_000)
        start = source.read(tarfile.BLOCKSIZE)
        source.seek(0)
        for magic, kind in _STRANGERS.items():
            if start.startswith(magic):
                raise refusal("archive-kind", name=path.name, kind=kind)
        if start.startswith(_ZIP):
            _unpack_zip(path.name, source, destination, packed)
        elif pieces := _decompressed(start, source, packed):
            plain = into.with_name(into.name + ".tar")
            Destination(plain.parent).file(plain.name, pieces, executable=False)
            with plain.open("rb") as tar:
                _unpack_tar(path.name, tar, destination, links_out)
            plain.unlink()
        else:
            _unpack_tar(path.name, source, destination, links_out)


@contextmanager
def _malformed_is_refused(name: str) -> Iterator[None]:
    """Whatever the readers of the standard library raise over a broken archive is the archive's fault."""
    try:
        yield
    except _MALFORMED as error:
        raise refusal("archive-corrupt", name=name, detail=str(error) or type(error).__name__) from error


class _Wary(io.RawIOBase):
    """A file that refuses to be read in large pieces or too far at once: the readers of headers trust sizes that they find.

    Args:
        source: A seekable file.
        piece: The most bytes that one read may ask for.
    """

    def __init__(self, source: BinaryIO, piece: int) -> None:
        self._source = source
        self._piece = piece
        self.allowance = 0
        self.limited = False

    def read(self, size: int | None = -1, /) -> bytes:
        allowed = min(self._piece, self.allowance) if self.limited else self._piece
        wanted = allowed + 1 if size is None or size < 0 else size
        data = self._source.read(min(wanted, allowed + 1))
        if wanted > allowed and len(data) > allowed:
            raise tarfile.ReadError("a header is larger than any honest one")
        if self.limited:
            self.allowance -= len(data)
        return data

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        return self._source.seek(offset, whence)

    def tell(self) -> int:
        return self._source.tell()

    def seekable(self) -> bool:
        return True

    def readable(self) -> bool:
        return True


def member_path(raw: str, bounds: Bounds) -> str:
    """The path of a member, relative to the top, judged; backslashes, which Windows writes, separate like slashes.

    Empty for the top itself.

    Raises:
        RefusedError: It leads out of the archive, or is a name that is not taken in.
    """
    path = raw.replace("\\", "/")
    if path.startswith("/") or _DRIVE.match(path):
        raise refusal("archive-absolute", name=path)
    parts = [part for part in path.split("/") if part not in ("", ".")]
    if ".." in parts:
        raise refusal("archive-parent", name=path)
    path = "/".join(parts)
    bounds.check_name(path)
    return path


def _is_wanted(path: str) -> bool:
    """Whether the member is unpacked at all: caches and version control are left where they are."""
    return not any(products.is_left_out(part) for part in path.split("/"))


# --- links ---------------------------------------------------------------------------------------


class _Links:
    """The links of an archive, made into copies once all else is there."""

    def __init__(self, destination: Destination, bounds: Bounds, links_out: LinksOut) -> None:
        self._destination = destination
        self._bounds = bounds
        self._links_out = links_out
        self._targets: dict[str, str] = {}

    def add(self, path: str, target: str, base: str) -> None:
        """The member *path* is a link to *target*, relative to the folder *base*.

        Raises:
            RefusedError: It points out of the archive, and does not lie where colcon and Python make such links.
        """
        target = target.replace("\\", "/")
        inside = posixpath.normpath(posixpath.join(base, target))
        if inside.startswith(("/", "../")) or inside == ".." or _DRIVE.match(target):
            harmless = any(part in products.COLCON or part in ("venv", "env") for part in path.split("/"))
            if harmless or self._links_out is LinksOut.DROPPED:
                return
            raise refusal("archive-link-out", name=path)
        self._targets[path] = inside

    def copy(self) -> None:
        """Copy the file at the end of each link; a link to a folder, to nothing or round in circles is dropped."""
        for path in self._targets:
            target = path
            for _ in range(_HOPS):
                if target not in self._targets:
                    break
                target = self._targets[target]
            if target not in self._destination.files or path in self._destination.files:
                continue
            found = self._destination.root / target
            with found.open("rb") as source:
                executable = bool(os.fstat(source.fileno()).st_mode & stat.S_IXUSR)
                self._destination.file(path, self._bounds.counted(source), executable)


# --- zip -----------------------------------------------------------------------------------------


def _unpack_zip(name: str, source: BinaryIO, destination: Destination, bounds: Bounds) -> None:
    """Unpack a zip; its packed size was judged already."""
    _count_zip_members(source, bounds)
    wary = _Wary(source, _DIRECTORY_BYTES)
    links = _Links(destination, bounds, LinksOut.REFUSED)
    with zipfile.ZipFile(wary) as archive:
        infos = archive.infolist()
        _refuse_overlaps(name, infos)
        for info in infos:
            bounds.member()
            if info.flag_bits & _ENCRYPTED:
                raise refusal("archive-encrypted", name=name)
            mode = info.external_attr >> 16
            path = member_path(_zip_name(info), bounds)
            if not path or not _is_wanted(path):
                continue
            if info.compress_type not in _READABLE_METHODS:
                raise refusal("archive-method", name=name)
            if info.filename.endswith(("/", "\\")) or stat.S_ISDIR(mode) or info.external_attr & _MS_DOS_FOLDER:
                destination.folder(path)
            elif stat.S_ISLNK(mode):
                bounds.expect(info.file_size)
                with archive.open(info) as member:
                    target = member.read(bounds.limits.path_length * 4).decode("utf-8", "replace")
                links.add(path, target, posixpath.dirname(path))
            elif stat.S_IFMT(mode) not in (0, stat.S_IFREG):
                raise refusal("archive-special", name=path)
            else:
                bounds.expect(info.file_size)
                with archive.open(info) as member:
                    destination.file(path, bounds.counted(member), bool(mode & stat.S_IXUSR))
    links.copy()


def zip_names(path: Path) -> tuple[str, ...] | None:
    """The names of the files in the zip *path*; None when it is none, or its list of members is longer than any honest one.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as source:
        if not zipfile.is_zipfile(source):
            return None
        try:
            with zipfile.ZipFile(_Wary(source, _DIRECTORY_BYTES)) as archive:
                return tuple(info.filename for info in archive.infolist() if not info.is_dir())
        except (zipfile.BadZipFile, tarfile.TarError, ValueError, NotImplementedError):
            return None


def _count_zip_members(source: BinaryIO, bounds: Bounds) -> None:
    """Refuse a zip with far more entries than allowed before the library keeps an object for each."""
    signature, found, tail = b"PK\x01\x02", 0, b""
    while piece := source.read(CHUNK):
        piece = tail + piece
        found += piece.count(signature)
        tail = piece[-3:]
    source.seek(0)
    if found > 4 * bounds.limits.members:  # four times: archives within the archive have such entries too
        raise refusal("too-many-files", limit=bounds.limits.members)


def _zip_name(info: zipfile.ZipInfo) -> str:
    """The member's name as it stands in the archive, before the library cuts it at a NUL.

    Without the UTF-8 flag the library takes names for code page 437; macOS writes UTF-8 all the same.
    """
    name = info.orig_filename
    if not info.flag_bits & _UTF8:
        try:
            return name.encode("cp437").decode("utf-8")
        except UnicodeError:
            pass
    return name


def _refuse_overlaps(name: str, infos: list[zipfile.ZipInfo]) -> None:
    """Refuse members that share bytes: the trick by which a small zip holds petabytes."""
    end = 0
    for info in sorted(infos, key=lambda info: info.header_offset):
        if info.header_offset < end:
            raise refusal("archive-overlap", name=name)
        end = info.header_offset + 30 + len(info.orig_filename) + info.compress_size


# --- tar -----------------------------------------------------------------------------------------


def _looks_like_tar(start: bytes) -> bool:
    """*start* is the first block of a tar: its checksum is right, or it is the empty block of an empty tar."""
    if len(start) < tarfile.BLOCKSIZE:
        return False
    try:
        tarfile.TarInfo.frombuf(start, "utf-8", "surrogateescape")
    except tarfile.EOFHeaderError:  # type: ignore[attr-defined]
        return True
    except (tarfile.TarError, ValueError):
        return False
    return True


def _decompressed(start: bytes, source: BinaryIO, bounds: Bounds) -> Iterator[bytes] | None:
    """What *source* holds, decompressed and counted; None when it is not compressed."""
    if start.startswith(b"\x1f\x8b"):
        return bounds.counted(gzip.GzipFile(fileobj=source))
    if start.startswith(b"BZh"):
        return bounds.counted(bz2.BZ2File(source))
    if start.startswith(b"\xfd7zXZ\x00"):
        return _unxz(source, bounds)
    return None


def _unxz(source: BinaryIO, bounds: Bounds) -> Iterator[bytes]:
    """What *source* holds, without the dictionary of gigabytes that an xz header may ask for."""
    packed = source.read(CHUNK)
    while packed:
        stream = lzma.LZMADecompressor(memlimit=_XZ_MEMORY)
        while not stream.eof:
            if stream.needs_input and not packed:
                packed = source.read(CHUNK)
                if not packed:
                    raise EOFError("it ends too early")
            piece = stream.decompress(packed, CHUNK)
            packed = b""
            bounds.took(len(piece))
            yield piece
        packed = (stream.unused_data or source.read(CHUNK)).lstrip(b"\0")


def _unpack_tar(name: str, source: BinaryIO, destination: Destination, links_out: LinksOut) -> None:
    """Unpack a tar that is not compressed (any more)."""
    if not _looks_like_tar(source.read(tarfile.BLOCKSIZE)):
        raise refusal("no-archive", name=name)
    source.seek(0)
    bounds = Bounds()
    wary = _Wary(source, _HEADER_BYTES)
    links = _Links(destination, bounds, links_out)
    try:
        wary.limited, wary.allowance = True, _HEADER_BYTES
        with tarfile.open(fileobj=wary, mode="r:", encoding="utf-8", errors="surrogateescape") as archive:
            while True:
                wary.limited, wary.allowance = True, _HEADER_BYTES
                member = archive.next()
                if member is None:
                    break
                archive.members = []  # type: ignore[attr-defined]  # it would keep them all
                bounds.member()
                wary.limited = False
                _unpack_tar_member(archive, member, destination, bounds, links)
            _refuse_a_torn_end(archive, source)
    except UnicodeDecodeError as error:
        raise refusal("name-not-utf8", name=name) from error
    links.copy()


def _unpack_tar_member(
    archive: tarfile.TarFile, member: tarfile.TarInfo, destination: Destination, bounds: Bounds, links: _Links
) -> None:
    path = member_path(member.name, bounds)
    if member.isdir():
        if path and _is_wanted(path):
            destination.folder(path)
    elif not path:
        raise refusal("archive-special", name=member.name)
    elif member.issym():
        if _is_wanted(path):
            links.add(path, member.linkname, posixpath.dirname(path))
    elif member.islnk():
        if _is_wanted(path):
            links.add(path, member.linkname, "")
    elif not member.isreg():
        raise refusal("archive-special", name=path)
    elif _is_wanted(path):
        bounds.expect(member.size)
        content = archive.extractfile(member)
        assert content is not None  # it is a regular file
        with content:
            destination.file(path, bounds.counted(content), bool(member.mode & stat.S_IXUSR))


def _refuse_a_torn_end(archive: tarfile.TarFile, source: BinaryIO) -> None:
    """Refuse a tar that ends without its closing block: something is missing, or broken in the middle."""
    source.seek(archive.offset)
    if source.read(tarfile.BLOCKSIZE) != tarfile.NUL * tarfile.BLOCKSIZE:
        raise tarfile.ReadError("it ends too early")

"""Takes members out of a tar archive that is not trusted.

By hand, because the filters of `tarfile` came with later releases of Python 3.10 and 3.11 than some systems have.
"""

from __future__ import annotations

import shutil
import tarfile
from pathlib import Path, PurePosixPath


def take_out(archive: tarfile.TarFile, member: tarfile.TarInfo, folder: Path) -> None:
    """Write *member*, a folder or a regular file, below *folder*; links are left out.

    Raises:
        ValueError: It would land outside of *folder*, or is a device or a pipe.
        OSError: It cannot be written.
    """
    name = PurePosixPath(member.name)
    if name.is_absolute() or ".." in name.parts:
        raise ValueError(f"{member.name} leads out of the archive")
    if member.issym() or member.islnk():
        return
    path = folder / name
    if member.isdir():
        path.mkdir(parents=True, exist_ok=True)
        return
    source = archive.extractfile(member)
    if source is None:
        raise ValueError(f"{member.name} is no regular file")
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        shutil.copyfileobj(source, file)
    path.chmod(0o755 if member.mode & 0o100 else 0o644)

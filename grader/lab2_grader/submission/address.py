"""Tells git addresses from paths, takes secrets out of them, and makes short names for submissions."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote, urlsplit, urlunsplit

from lab2_grader.messages import refusal
from lab2_grader.text import clean

SCHEMES = ("https", "http", "ssh", "file")  # `git://` is neither encrypted nor served by anyone any more

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")
_HELPER = re.compile(r"[A-Za-z0-9+.-]+::")  # git's `ext::command` and its kind
_SCP = re.compile(r"(?:(?P<user>[A-Za-z0-9_.-]+)@)(?P<host>[A-Za-z0-9_.-]+):(?P<path>[^:].*)", re.DOTALL)
_FORGE = re.compile(r"(?:www\.)?(?:github\.com|gitlab\.com|bitbucket\.org|codeberg\.org)/.", re.IGNORECASE)
_PAGE = re.compile(
    r"(https?://[^/]+/[^/]+/[^/]+)/(?:-/)?(?:tree|blob|commits?|pulls?|issues|actions|releases|settings)(?:/|$)"
)
_CONTROL = re.compile("[\x00-\x20\x7f-\x9f]")

_NAME_LENGTH = 80
_UNSAFE = re.compile("[^A-Za-z0-9._-]+")
# Names that say what kind of thing it is, not whose: the folder above says more.
_PLAIN_NAMES = re.compile(
    r"(?:lab[ ._-]?0?2|src|ros2?|(?:ros2?|dev|colcon|catkin)[._-]?ws|ws|workspace|package|submission|submitted|repo(?:sitory)?|code)",
    re.IGNORECASE,
)
_NOBODY = frozenset(
    {"home", "users", "root", "tmp", "var", "work", "github", "media", "mnt", "desktop", "documents", "downloads"}
)


def is_address(source: str) -> bool:
    """*source* is meant as a git address, allowed or not; everything else is a path."""
    return bool(_SCHEME.match(source) or _HELPER.match(source) or _SCP.fullmatch(source) or _FORGE.match(source))


def checked(source: str) -> str:
    """The address *source* as git is given it.

    Raises:
        RefusedError: It is of a kind that is not cloned, hides an option, or is that of a page about the repository.
    """
    address = f"https://{source}" if _FORGE.match(source) else source
    if scheme := _SCHEME.match(address):
        if scheme[1].lower() not in SCHEMES:
            raise refusal("address-kind", address=without_secrets(address))
        address = scheme[1].lower() + address[len(scheme[1]) :]
        authority = address[scheme.end() :].partition("/")[0]
        host, user = authority.rpartition("@")[2], authority.rpartition("@")[0]
    elif scp := _SCP.fullmatch(address):
        host, user = scp["host"], scp["user"]
        if scp["path"].startswith("-"):
            raise refusal("address-option", address=without_secrets(address))
    else:
        raise refusal("address-kind", address=without_secrets(address))
    if host.startswith("-") or user.startswith("-") or _CONTROL.search(address):
        raise refusal("address-option", address=without_secrets(address))
    if page := _PAGE.match(address):
        raise refusal("address-page", address=without_secrets(address), repository=without_secrets(page[1]))
    return address


def without_secrets(address: str) -> str:
    """*address* without user name, password, query and fragment, cleaned; the `git@` of an SSH address is no secret."""
    if _SCHEME.match(address):
        try:
            parts = urlsplit(address)
            user = "git@" if parts.scheme.lower() == "ssh" and parts.username == "git" else ""
            address = urlunsplit((parts.scheme, user + parts.netloc.rpartition("@")[2], parts.path, "", ""))
        except ValueError:
            address = address.partition("://")[0] + "://" + address.partition("://")[2].rpartition("@")[2]
    elif (scp := _SCP.fullmatch(address)) and scp["user"] != "git":
        address = f"{scp['host']}:{scp['path']}"
    return clean(address, 300)


def local_path(address: str) -> Path | None:
    """The path of a `file://` address, None for every other.

    Raises:
        RefusedError: It names another machine.
    """
    if not address.startswith("file://"):
        return None
    host, _, path = address.removeprefix("file://").partition("/")
    if host not in ("", "localhost"):
        raise refusal("address-kind", address=without_secrets(address))
    return Path("/" + unquote(path))


def name_of_address(address: str) -> str:
    """A short name for the repository at *address*: its owner and its own name."""
    path = without_secrets(address)
    path = _SCHEME.sub("", path, count=1)
    parts = [part for part in re.split("[/:]", path) if part][1:] or [path]
    own = parts[-1].removesuffix(".git")
    if address.startswith("file://"):
        return name_of_path(Path("/", *parts[:-1], own))
    return safe_name("-".join([*parts[-2:-1], own]))


def name_of_path(path: Path, suffix: str = "") -> str:
    """A short name for the submission at *path*, without *suffix*: that of the first folder upwards that says whose it is."""
    own = path.name[: len(path.name) - len(suffix)] if suffix else path.name
    for candidate in (own, *(folder.name for folder in path.parents)):
        if candidate.lower() in _NOBODY:
            break
        if candidate and not _PLAIN_NAMES.fullmatch(candidate):
            return safe_name(candidate)
    return safe_name(own)


def safe_name(name: str) -> str:
    """*name* as a name for a folder anywhere: ASCII letters, digits, `.`, `_`, `-`; at most 80; no dot or dash in front."""
    return _UNSAFE.sub("-", name).lstrip(".-")[:_NAME_LENGTH].rstrip(".-") or "submission"

"""Bytes to records, for every thread: the one place that decodes.

msgspec takes a type apart when it is first asked for, and leaves what it found half filled meanwhile: two threads that
ask for the same type at once end the interpreter. So each type is taken apart under a lock, once.
"""

from __future__ import annotations

import threading
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")

_LEARNING = threading.Lock()
_decoders: dict[Any, msgspec.json.Decoder[Any]] = {}


def _learn(kind: type[T]) -> msgspec.json.Decoder[T]:
    with _LEARNING:
        if kind not in _decoders:
            _decoders[kind] = msgspec.json.Decoder(kind)
        return _decoders[kind]


def from_json(raw: bytes | bytearray | str, kind: type[T]) -> T:
    """The *kind* that *raw* is in JSON.

    Raises:
        msgspec.DecodeError: It is none.
        UnicodeDecodeError: It is no UTF-8.
    """
    return _learn(kind).decode(raw)


def from_msgpack(raw: bytes, kind: type[T]) -> T:
    """The *kind* that *raw* is in MessagePack.

    Raises:
        msgspec.DecodeError: It is none.
    """
    _learn(kind)
    return msgspec.msgpack.decode(raw, type=kind)


def from_toml(raw: bytes, kind: type[T]) -> T:
    """The *kind* that *raw* is in TOML.

    Raises:
        msgspec.DecodeError: It is none.
        UnicodeDecodeError: It is no UTF-8.
    """
    _learn(kind)
    return msgspec.toml.decode(raw, type=kind)

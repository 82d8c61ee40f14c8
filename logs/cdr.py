"""Common Data Representation, little-endian: the byte layout of ROS 2 messages (OMG DDS-XTYPES, plain CDR version 1).

A message is four bytes of header, then its fields, each aligned to its own size counted from after that header.
Strings and sequences carry their length first; a string ends with a zero byte that counts.
"""

from __future__ import annotations

import struct
from functools import cache, lru_cache
from typing import Any

HEADER = b"\x00\x01\x00\x00"
SIZES = {code: struct.calcsize("<" + code) for code in "?bBhHiIqQfd"}
"""Bytes of a number, by its `struct` letter."""


@cache
def _fields(codes: str) -> struct.Struct:
    return struct.Struct(f"<{codes}")


@lru_cache(maxsize=1024)
def _layout(code: str, count: int) -> struct.Struct:
    return struct.Struct(f"<{count}{code}")


class Packer:
    """Builds one message, field by field."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def put(self, code: str, *values: float) -> Packer:
        """Numbers of one type, by their `struct` letter. None at all take no room, not even for alignment."""
        if not values:
            return self
        self._bytes += b"\0" * (-len(self._bytes) % SIZES[code])
        self._bytes += _layout(code, len(values)).pack(*values)
        return self

    def text(self, value: str) -> Packer:
        """A string."""
        encoded = value.encode() + b"\0"
        self.put("I", len(encoded))
        self._bytes += encoded
        return self

    def message(self) -> bytes:
        """The whole message."""
        return HEADER + bytes(self._bytes)


class Unpacker:
    """Takes one message apart, in the order of its fields; raises `struct.error` or `ValueError` when it is cut off."""

    def __init__(self, message: bytes) -> None:
        if message[:2] != HEADER[:2]:  # the two bytes after it are options, and state at most how much padding follows
            raise ValueError(f"not little-endian CDR: starts with {message[:4].hex()}")
        self._body = memoryview(message)[4:]
        self._at = 0

    def take(self, code: str, count: int) -> tuple[float, ...]:
        """``count`` numbers of one type."""
        if count == 0:
            return ()
        layout = _layout(code, count)
        at = self._at + -self._at % SIZES[code]
        self._at = at + layout.size
        return layout.unpack_from(self._body, at)

    def fields(self, codes: str) -> tuple[Any, ...]:
        """Numbers of several types by their letters, none larger than the one before, so that none needs padding."""
        layout = _fields(codes)
        at = self._at + -self._at % SIZES[codes[0]]
        self._at = at + layout.size
        return layout.unpack_from(self._body, at)

    @property
    def left(self) -> int:
        """Bytes not yet taken."""
        return len(self._body) - self._at

    def whole(self, code: str = "I") -> int:
        """One integer."""
        return int(self.take(code, 1)[0])

    def text(self) -> str:
        """A string."""
        length = self.whole()
        encoded = bytes(self._body[self._at : self._at + length])
        if len(encoded) != length:
            raise ValueError("a string is cut off")
        self._at += length
        return _decoded(encoded[:-1])


@lru_cache(maxsize=1024)
def _decoded(encoded: bytes) -> str:
    """The text; the same few names stand in every message."""
    return encoded.decode()

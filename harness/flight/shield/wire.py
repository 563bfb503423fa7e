"""Messages between two processes: a head in JSON and a body of plain numbers, each with its length before it.

Nothing that comes is executed or unpickled, nothing longer than the reader allows is taken. Layout: 4 bytes MARK, lengths of
head and body as uint32 and uint64, little-endian; the head, a JSON object in UTF-8; the body, float64 in little-endian.
"""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

MARK = b"EMA1"
PREFIX = struct.Struct("<4sIQ")
LONGEST_HEAD = 2**20
"""Bytes."""

Array = NDArray[np.float64]


class Forged(Exception):
    """What came is no message; the text says why."""


def encode(head: Mapping[str, Any], body: Array | None = None) -> bytes:
    """One message; `body` of any shape, which the head has to tell."""
    text = json.dumps(head).encode()
    numbers = b"" if body is None else np.ascontiguousarray(body, dtype="<f8").tobytes()
    return PREFIX.pack(MARK, len(text), len(numbers)) + text + numbers


class Reader:
    """Takes bytes as they come and gives messages; a body may have `most` bytes."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._came = bytearray()

    def feed(self, data: bytes) -> None:
        """Take the next bytes."""
        self._came += data

    def next(self) -> tuple[dict[str, Any], Array] | None:
        """Head and body (shape (n,)) of the next message, None if not all of it is there; Forged if it is none."""
        if len(self._came) < PREFIX.size:
            return None
        mark, n_head, n_body = PREFIX.unpack_from(self._came)
        if mark != MARK or n_head > LONGEST_HEAD or n_body > self.most or n_body % 8:
            raise Forged(f"no message: mark {mark!r}, lengths {n_head} and {n_body}, at most {LONGEST_HEAD} and {self.most}")
        end = PREFIX.size + n_head + n_body
        if len(self._came) < end:
            return None
        text, numbers = self._came[PREFIX.size : PREFIX.size + n_head], self._came[PREFIX.size + n_head : end]
        del self._came[:end]
        try:
            head = json.loads(text)
        except (ValueError, RecursionError):
            raise Forged("no message: its head is not JSON") from None
        if not isinstance(head, dict):
            raise Forged("no message: its head is no JSON object")
        return head, np.frombuffer(bytes(numbers), dtype="<f8").astype(np.float64)

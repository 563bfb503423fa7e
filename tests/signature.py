"""The embedded signature of a Mach-O binary, checked as the loader does (xnu: osfmk/kern/cs_blobs.h)."""

import hashlib
import struct

EMBEDDED, DIRECTORY = 0xFADE0CC0, 0xFADE0C02
ADHOC = 0x2
SHA256 = 2
DIRECTORY_SLOT = 0


def check_ad_hoc(binary: bytes, start: int, size: int) -> None:
    """Asserts that the signature at `start`, of `size` bytes, covers all of the binary before it, and names no signer."""
    blobs = _blobs(binary[start : start + size])
    directory = blobs.pop(DIRECTORY_SLOT)
    fields = struct.unpack_from(">9I4BI", directory)
    magic, length, _, flags, hashes, _, n_special, n_pages, limit, hash_size, hash_type, _, page_shift, _ = fields
    assert (magic, length) == (DIRECTORY, len(directory))
    assert flags & ADHOC
    assert (hash_type, hash_size, limit) == (SHA256, 32, start)

    def slot(place: int) -> bytes:
        return directory[hashes + 32 * place : hashes + 32 * (place + 1)]

    pages = [binary[at : min(at + (1 << page_shift), limit)] for at in range(0, limit, 1 << page_shift)]
    assert [slot(place) for place in range(n_pages)] == [hashlib.sha256(page).digest() for page in pages]
    for place in range(1, n_special + 1):  # what else is signed: requirements, entitlements
        assert slot(-place) == (hashlib.sha256(blobs[place]).digest() if place in blobs else bytes(32))


def _blobs(signature: bytes) -> dict[int, bytes]:
    magic, _, count = struct.unpack_from(">3I", signature)
    assert magic == EMBEDDED
    found = {}
    for place in range(count):
        kind, at = struct.unpack_from(">2I", signature, 12 + 8 * place)
        (length,) = struct.unpack_from(">I", signature, at + 4)
        found[kind] = signature[at : at + length]
    return found

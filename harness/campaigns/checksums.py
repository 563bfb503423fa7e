"""SHA-256 of what lies in a campaign's folder: that a file is whole is proven, not taken from its being there.

An entry is a text file in `checksums/`, as `sha256sum` writes it: `cd campaign && sha256sum --check checksums/*`. It is
written after the files that it names, so that what was interrupted has none.
"""

import hashlib
import os
from collections.abc import Collection, Mapping
from pathlib import Path

from harness.provenance import sha256

CHECKSUMS = "checksums"
SUFFIX = ".sha256"
PART = ".part"
"""Of a file that is being written."""


def write(path: Path, content: bytes) -> str:
    """Write `content` to `path`: to a file beside it, onto the disk, then in its place; returns its SHA-256.

    OSError if that fails; then `path` is as it was.
    """
    beside = path.with_name(f"{path.name}{PART}")
    try:
        with beside.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    return hashlib.sha256(content).hexdigest()


class Checksums:
    """The entries of the campaign in `folder`; paths in them are relative to it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._entries = folder / CHECKSUMS

    def add(self, name: str, hashes: Mapping[str, str]) -> None:
        """Write the entry `name`: path -> SHA-256. OSError if that fails."""
        self._entries.mkdir(exist_ok=True)
        write(self._entries / f"{name}{SUFFIX}", "".join(f"{hashes[path]}  {path}\n" for path in sorted(hashes)).encode())

    def has(self, name: str) -> bool:
        """Whether there is an entry `name`, whole or not."""
        return (self._entries / f"{name}{SUFFIX}").exists()

    def problems(self, name: str, paths: Collection[str]) -> list[str]:
        """What is wrong with the files `paths`, which the entry `name` is to prove, a line each; empty if nothing is."""
        entry = self._entries / f"{name}{SUFFIX}"
        stated: dict[str, str] = {}
        try:
            for line in entry.read_text().splitlines():
                digest, _, path = line.partition("  ")
                stated[path] = digest
        except FileNotFoundError:
            return [f"{entry}: is missing"]
        except (OSError, UnicodeDecodeError):
            stated = {}
        if stated.keys() != set(paths):
            return [f"{entry}: is damaged"]
        return [found for path, digest in sorted(stated.items()) if (found := self._problem(path, digest))]

    def _problem(self, path: str, digest: str) -> str:
        file = self.folder / path
        try:
            return "" if sha256(file) == digest else f"{file}: is damaged, its SHA-256 is not {digest[:12]}..."
        except FileNotFoundError:
            return f"{file}: is missing"
        except OSError as error:
            return f"{file}: cannot be read: {error.strerror}"

"""Zip archives of others, opened within bounds: nothing lands outside its folder, nothing grows without limit."""

import io
import shutil
import stat
import struct
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, Any

from harness.errors import HarnessError

LARGEST = 512 * 2**20
"""Most bytes that an archive may unpack to, and may have itself."""
MOST_MEMBERS = 20_000
LONGEST_NAME = 1000
"""Characters."""
LARGEST_READ = 4 * 2**20
"""Bytes at a time: the list of members is read in one piece, 46 bytes and a name each."""
END, NOT_STATED = 22, 2**16 - 1
"""Bytes of the record at the end, and its number of members where a larger record has it."""
PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""What FMI 2.0 lets an FMU be packed by; others may take gigabytes to unpack a byte."""


class Archive:
    """An open archive: `members`, in order, by name as FMI writes it (`binaries/linux64/NAME.so`)."""

    def __init__(self, path: Path, opened: zipfile.ZipFile) -> None:
        self.path = path
        self._opened = opened
        self.members: dict[str, zipfile.ZipInfo] = {}
        listed = opened.infolist()
        if len(listed) > MOST_MEMBERS:
            raise HarnessError(f"{path}: has {len(listed)} members, {MOST_MEMBERS} are the most")
        for member in listed:
            name = _checked(path, member)
            if not member.is_dir() and name in self.members:
                raise HarnessError(f"{path}: member '{told(name)}' is there twice")
            if not member.is_dir() and name:
                self.members[name] = member
        if sum(member.file_size for member in self.members.values()) > LARGEST:
            raise HarnessError(f"{path}: unpacks to more than {LARGEST // 2**20} MiB")

    def read(self, name: str, most: int) -> bytes:
        """The content of the member `name`; KeyError if there is none, HarnessError if it has more than `most` bytes."""
        member = self.members[name]
        if member.file_size > most:
            raise HarnessError(f"{self.path}: {name} has {member.file_size} bytes, {most} are the most")
        content = io.BytesIO()
        with self._opened.open(member) as source:
            shutil.copyfileobj(source, content)
        return content.getvalue()

    def unpack(self, into: Path) -> None:
        """Write all members below the folder `into`; HarnessError for one that cannot be written there."""
        for name, member in self.members.items():
            target = into / name
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
                with self._opened.open(member) as source, target.open("xb") as file:
                    shutil.copyfileobj(source, file)
            except OSError as error:
                reason = f"member '{told(name)[:60]}': {error.strerror or error}"
                raise HarnessError(f"{self.path}: cannot be unpacked into {into}: {reason}") from None


@contextmanager
def opened(path: Path) -> Iterator[Archive]:
    """The archive at `path`; HarnessError, from inside the block too, for what is no archive within the bounds."""
    try:
        if path.stat().st_size > LARGEST:
            raise HarnessError(f"{path}: has more than {LARGEST // 2**20} MiB")
        with path.open("rb") as file:
            if not zipfile.is_zipfile(file):
                raise HarnessError(f"{path}: not an FMU, because it is not a zip archive")
            stated = _stated(file)
            with zipfile.ZipFile(_Bounded(file)) as archive:  # type: ignore[arg-type]
                if stated not in (len(archive.infolist()), NOT_STATED):
                    raise zipfile.BadZipFile(f"{len(archive.infolist())} members are listed, {stated} are stated")
                yield Archive(path, archive)
    except (HarnessError, KeyError):
        raise
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001 - what zipfile raises for damage: its own, zlib's, struct's, EOFError, ...
        raise HarnessError(f"{path}: cannot be unpacked: {told(str(error) or type(error).__name__)}") from None


def _stated(file: IO[bytes]) -> int:
    """The number of members in the record at the end of an archive, which zipfile does not hold against its list: a wrong
    length in one entry would hide the next."""
    size = file.seek(0, io.SEEK_END)
    file.seek(max(0, size - END - 2**16))
    tail = file.read()
    at = tail.rfind(b"PK\x05\x06")
    return int(struct.unpack_from("<H", tail, at + 10)[0]) if 0 <= at <= len(tail) - END else NOT_STATED


class _Bounded(io.RawIOBase):
    """A file of which no more than LARGEST_READ bytes are read at a time."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, size: int | None = -1) -> bytes:
        data = self._file.read(LARGEST_READ + 1 if size is None or size < 0 else min(size, LARGEST_READ + 1))
        if len(data) > LARGEST_READ:
            raise zipfile.BadZipFile(f"its list of members has more than {LARGEST_READ // 2**20} MiB")
        return data

    def seek(self, *where: Any) -> int:
        return self._file.seek(*where)

    def tell(self) -> int:
        return self._file.tell()

    def seekable(self) -> bool:
        return True

    def readable(self) -> bool:
        return True


def _checked(path: Path, member: zipfile.ZipInfo) -> str:
    """The member's name with slashes, without empty parts and dots; HarnessError for one that is not to be unpacked."""
    name = PurePosixPath(member.filename.replace("\\", "/"))
    shown = told(member.filename)
    if len(member.filename) > LONGEST_NAME:
        raise HarnessError(f"{path}: member '{shown[:60]}...' has a name of more than {LONGEST_NAME} characters")
    if name.is_absolute() or ".." in name.parts or ":" in member.filename:
        raise HarnessError(f"{path}: member '{shown}' would land outside its folder")
    if stat.S_ISLNK(member.external_attr >> 16):
        raise HarnessError(f"{path}: member '{shown}' is a link")
    if member.compress_type not in PACKED:
        raise HarnessError(f"{path}: member '{shown}' is packed by method {member.compress_type}; FMI packs by deflate")
    return "/".join(name.parts)


def told(text: str) -> str:
    """Text of others, fit for a line of ours: no control characters, not too long."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return line if len(line) <= LONGEST_LINE else line[: LONGEST_LINE - 3] + "..."


LONGEST_LINE = 2000
"""Characters of what others say that are told."""

"""One campaign in a folder at a time: a lock that the system lets go of when its process ends, however it ends."""

import contextlib
import errno
import fcntl
import json
import os
import platform
import time
from collections.abc import Iterator
from pathlib import Path

from harness.errors import HarnessError

LOCK = "campaign.lock"
CLOCK = "%Y-%m-%d %H:%M:%S"


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Within it, no other process is within it for the same folder; HarnessError, saying who, if one is."""
    path = folder / LOCK
    handle = _taken(path)
    try:
        holder = {"pid": os.getpid(), "host": platform.node(), "since": time.strftime(CLOCK)}
        with contextlib.suppress(OSError):  # a full disk: the lock holds, only its holder stays unnamed
            os.ftruncate(handle, 0)
            os.pwrite(handle, json.dumps(holder).encode(), 0)
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()
        os.close(handle)


def refuse_locked(folder: Path) -> None:
    """HarnessError, saying who, if a process is within `locked` for the folder; nothing is written."""
    path = folder / LOCK
    try:
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return
    try:
        _lock(handle, path, fcntl.LOCK_SH)
    finally:
        os.close(handle)


def _taken(path: Path) -> int:
    """Handle of the lock's file, which is locked; the one that has the name now, if another has just been taken away."""
    while True:
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise HarnessError(f"{path}: cannot be written: {error.strerror}") from None
        try:
            _lock(handle, path, fcntl.LOCK_EX)
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), os.stat(path)):
                    return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _lock(handle: int, path: Path, kind: int) -> None:
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EAGAIN, errno.EACCES):
            raise HarnessError(
                f"{path.parent}: another campaign is at work in it: {_holder(handle)}; wait for it, or choose another --out"
            ) from None
        raise HarnessError(f"{path}: cannot be locked: {error.strerror}; choose an --out that can be") from None


def _holder(handle: int) -> str:
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        found = json.loads(os.pread(handle, 4096, 0))
        return f"process {found['pid']} on {found['host']}, since {found['since']}"
    return "a process that has not said which"

"""Temporary folders that do not stay: removed at the end, or after a kill at the next start.

A folder carries the process id of its owner, who holds a lock on it; the system frees a dead owner's lock.
"""

import atexit
import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from harness.errors import HarnessError

try:
    import fcntl
except ImportError:  # a platform without it
    fcntl = None  # type: ignore[assignment]

NAME = re.compile(r"ema_[a-z]+_(\d+)_\w+")
_held: dict[Path, int] = {}
"""Folders of this process, with the descriptor that holds the lock (-1: no locks here)."""
_swept: set[str] = set()
"""Where this process has looked for what others left."""


def make(purpose: str) -> Path:
    """A new folder of this process, `purpose` (a word) in its name; it is removed by `remove`, at the latest at exit.

    The first one in a place also removes what dead processes have left there. HarnessError if it cannot be made.
    """
    try:
        place = tempfile.gettempdir()
        if place not in _swept:
            _swept.add(place)
            sweep(Path(place))
        folder = Path(tempfile.mkdtemp(prefix=f"ema_{purpose}_{os.getpid()}_", dir=place))
    except OSError as error:
        raise HarnessError(f"no temporary folder can be made: {error}; TMPDIR says where") from None
    _held[folder] = _lock(folder) if fcntl else -1
    return folder


def remove(folder: Path) -> None:
    """Remove a folder that `make` made; a second call does nothing."""
    descriptor = _held.pop(folder, None)
    if descriptor is None:
        return
    shutil.rmtree(folder, ignore_errors=True)
    if descriptor >= 0:
        os.close(descriptor)


@contextmanager
def folder(purpose: str) -> Iterator[Path]:
    """A folder as by `make`, removed at the end of the block."""
    made = make(purpose)
    try:
        yield made
    finally:
        remove(made)


def sweep(place: Path) -> list[Path]:
    """Remove the folders in `place` whose owner is gone, of this user only; those that were removed."""
    removed = []
    with contextlib.suppress(OSError):
        entries = [entry for entry in os.scandir(place) if NAME.fullmatch(entry.name)]
        for entry in entries:
            if _is_orphan(entry):
                shutil.rmtree(entry.path, ignore_errors=True)
                removed.append(Path(entry.path))
    return removed


def _is_orphan(entry: os.DirEntry[str]) -> bool:
    """Whether the owner of a folder is gone: its process id is not in use, and its lock is free.

    Either alone would do, but for ids that are counted anew in a container, and for a folder that is not yet locked.
    """
    found = NAME.fullmatch(entry.name)
    try:
        if not found or not entry.is_dir(follow_symlinks=False) or _is_alive(int(found[1])):
            return False
        if hasattr(os, "getuid") and entry.stat(follow_symlinks=False).st_uid != os.getuid():
            return False
        if fcntl:
            os.close(_lock(Path(entry.path)))
    except OSError:  # locked, or gone meanwhile
        return False
    return True


def _is_alive(number: int) -> bool:
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it is another user's
        return True
    return True


def _lock(folder: Path) -> int:
    """A descriptor that holds the lock on `folder`; BlockingIOError if another process holds it."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


@atexit.register
def remove_all() -> None:
    """Remove all folders of this process, which is about to end."""
    for each in list(_held):
        if f"_{os.getpid()}_" in each.name:  # a forked process has its parent's list
            remove(each)

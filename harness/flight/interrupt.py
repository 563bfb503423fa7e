"""Ctrl-C while an FMU is at work: an FMU written in Python would take it for a failure of its own."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from harness import scratch

INTERRUPTED = 130
"""Exit code of a process that an interrupt from the keyboard has ended, which is also what Typer gives one."""
LAST_WORD = b"\nan FMU is still at work; Ctrl-C once more ends the process at once\n"


@contextmanager
def deferred() -> Iterator[Callable[[], bool]]:
    """Defer interrupts inside the block; yields a function that answers whether one has come, inside the block and after it.

    What to do about it is the caller's. A second interrupt is not deferred: it raises KeyboardInterrupt. Outside the main
    thread, which alone gets interrupts, nothing is done.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return

    def note(number: int, frame: Any) -> None:
        came.append(number)
        if len(came) > 1:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def insisted() -> Iterator[None]:
    """Inside, the third interrupt ends the process at once, even if an FMU does not return; only in the main thread.

    Python tells of an interrupt only between its own steps; what is told here is told by the system.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    watcher = threading.Thread(target=_watch, args=(reader,), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writer)
        watcher.join()
        os.close(reader)


def _watch(reader: int) -> None:
    came = 0
    while data := os.read(reader, 64):
        before, came = came, came + data.count(signal.SIGINT)
        if before < 2 <= came:
            os.write(2, LAST_WORD)
        if came > 2:
            scratch.remove_all()
            os._exit(INTERRUPTED)

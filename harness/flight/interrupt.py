"""Ctrl-C while an FMU is at work: an FMU written in Python would take it for a failure of its own."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


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

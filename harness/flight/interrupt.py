"""Ctrl-C while an FMU is at work: an FMU written in Python would take it for a failure of its own."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def held() -> Iterator[Callable[[], None]]:
    """Hold interrupts back inside the block; yields a function to call where stopping is safe.

    That function raises KeyboardInterrupt if an interrupt has come, and so does the block's end. A second interrupt is
    not held back. Outside the main thread, which gets no interrupts, nothing is done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    came: list[int] = []

    def note(number: int, frame: Any) -> None:
        came.append(number)
        if len(came) > 1:
            raise KeyboardInterrupt

    def check() -> None:
        if came:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, note)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
    check()

"""What FMUs log, with the arguments of printf put in.

A callback in Python cannot read C's variable arguments. FMPy brings a proxy in C that can, but it passes on to one logger in
a process: this one, which finds the FMU by the environment that it was given.
"""

import itertools
from ctypes import byref
from typing import Any

import fmpy
from fmpy import fmi2

try:
    from fmpy.logging import addLoggerProxy
except OSError:  # FMPy has no proxy for this platform: messages stay as the FMU has formatted them
    addLoggerProxy = None

MOST, LONGEST = 20, 1000
"""Different messages that are kept between two looks, and characters of each."""
_numbers = itertools.count(1)
_open: dict[int, "Messages"] = {}


class Messages:
    """Warnings and errors of one FMU whose instances have the name `name`."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._kept: dict[str, None] = {}
        self._number = next(_numbers)
        _open[self._number] = self
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.allocateMemory = _allocate
        self._callbacks.freeMemory = _free
        self._callbacks.componentEnvironment = self._number

    def callbacks(self) -> Any:
        """For a new instance; they must live as long as it. The proxy is ours again, whoever has had it since."""
        self._callbacks.logger = _logger
        if addLoggerProxy:
            addLoggerProxy(byref(self._callbacks))
        return self._callbacks

    def keep(self, message: str) -> None:
        """Keep a message, as one line; nothing if it is known, or if too many are."""
        if len(self._kept) < MOST and (line := " ".join(message.split())[:LONGEST]):
            self._kept[line] = None

    def take(self) -> str:
        """What has been logged since the last call, as one line; the next call does not have it again."""
        text = "; ".join(self._kept)
        self._kept.clear()
        return text

    def close(self) -> None:
        """Forget the FMU; its instances must be freed."""
        _open.pop(self._number, None)


def _log(environment: Any, instance: bytes | None, status: int, category: bytes, message: bytes | None, *_: Any) -> None:
    if status <= fmi2.fmi2OK or not message:
        return
    name, text = (instance or b"").decode(errors="replace"), message.decode(errors="replace")
    known = _open.get(environment or 0)
    for each in (
        [known] if known else [each for each in _open.values() if each.name == name]
    ):  # one that forgot its environment
        each.keep(text)


_logger = fmi2.fmi2CallbackLoggerTYPE(_log)
_allocate = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
_free = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)

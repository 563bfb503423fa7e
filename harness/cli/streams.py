"""Standard input, output and error as a command finds them: closed, full, cut off, or without letters for what is told."""

import errno
import io
import os
import sys
from contextlib import suppress
from typing import Any, TextIO

from harness.errors import HarnessError

CUT_OFF = 128 + 13
"""Exit code where the reader of standard output has gone, as of `ema ports | head`: that of a process that SIGPIPE ends."""
NARROWEST = 20
"""Characters a line; what the environment variable COLUMNS says below that is no terminal."""


class _Output(io.FileIO):
    """Standard output: what cannot be written ends the command with a clear line, whoever writes it."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise SystemExit(CUT_OFF) from None
            raise HarnessError(f"standard output: cannot be written: {error.strerror}") from None


class _Errors(io.FileIO):
    """Standard error: what cannot be written is lost, and no reason to stop."""

    def write(self, data: Any, /) -> int:
        with suppress(OSError):
            return super().write(data)
        return len(data)


def prepare() -> None:
    """Make the standard streams safe to use, and the width that the environment states one that a table can have.

    A closed one is opened to nothing, so that no file of ours takes its number and with it what an FMU prints. Streams that
    have been replaced, as by a test, stay.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    if sys.stdout is sys.__stdout__:
        sys.stdout = _guarded(sys.stdout, _Output(1, "w", closefd=False))
    if sys.stderr is sys.__stderr__:
        sys.stderr = _guarded(sys.stderr, _Errors(2, "w", closefd=False))
    stated = os.environ.get("COLUMNS", "")
    if not stated.isdecimal() or int(stated) < NARROWEST:
        os.environ.pop("COLUMNS", None)


def _guarded(stream: TextIO | None, raw: io.FileIO) -> TextIO:
    """A text stream over `raw`, like `stream` (None: that was closed); file names that are no text pass through as bytes."""
    if stream is not None:
        with suppress(OSError):
            stream.flush()
    encoding = getattr(stream, "encoding", None) or "utf-8"
    unicode = encoding.lower().replace("_", "-") in ("utf-8", "utf8")
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=encoding,
        errors="surrogateescape" if unicode else "backslashreplace",
        line_buffering=bool(getattr(stream, "line_buffering", False)),
        write_through=bool(getattr(stream, "write_through", False)),
    )


def finish() -> None:
    """Write what is buffered; HarnessError or SystemExit as `prepare` has it, after which there is no standard output."""
    try:
        sys.stdout.flush()
    except BaseException:
        drop()
        raise


def drop() -> None:
    """Give up standard output: what is buffered for it cannot be written, and is not tried again."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - until the process ends

"""How every command ends: one clear line and an exit code, whatever has happened."""

import logging
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from harness.cli import streams
from harness.errors import HarnessError
from harness.flight.interrupt import INTERRUPTED

FAILED = 2
"""Exit code for what could not be done."""


@contextmanager
def clear() -> Iterator[None]:
    """Within it, what goes wrong is one line on stderr and exit code 2; an interrupt is one line and 130.

    What is no HarnessError is a fault of ours, and the line says where it is; the traceback is logged (`ema -v`).
    """
    try:
        streams.prepare()
        try:
            yield
        finally:
            streams.finish()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            _tell("interrupted; every file that was written is whole")
        raise
    except HarnessError as error:
        _fail(str(error))
    except OSError as error:
        logging.getLogger("harness").info("where it failed", exc_info=True)
        _fail(_of_system(error))
    except MemoryError:
        _fail("not enough memory; fewer or shorter runs at once need less")
    except UnicodeEncodeError as error:
        logging.getLogger("harness").info("where it failed", exc_info=True)
        _fail(f"{error.object[:200]!r}: {error.encoding} cannot hold this text; a file name that is UTF-8 is needed")
    except Exception as error:
        logging.getLogger("harness").info("where it failed", exc_info=True)
        _fail(_of_ours(error))


def _fail(line: str) -> None:
    _tell(line)
    sys.exit(FAILED)


def _tell(line: str) -> None:
    typer.echo(f"ema: {line}", err=True)


def _of_system(error: OSError) -> str:
    """What the system refused, and for which file."""
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {reason}" if error.filename is not None else reason


def _of_ours(error: Exception) -> str:
    """A fault of the program: what, and the place of ours where it came up."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "/harness/" in frame.filename or "/ema_fmu_src/" in frame.filename] or frames
    place = "/".join(ours[-1].filename.split("/")[-3:])
    words = " ".join(str(error).split())[:300]
    return (
        f"this is a fault of the program, please report it: {type(error).__name__}: {words} ({place}, line "
        f"{ours[-1].lineno}); ema -v COMMAND tells more"
    )

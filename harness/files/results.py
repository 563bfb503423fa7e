"""Writes results, each file whole or not at all."""

import io
import json
import logging
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.errors import HarnessError

_KEPT: ContextVar[tuple[Path, ...]] = ContextVar("kept", default=())


@contextmanager
def kept(paths: Iterable[Path]) -> Iterator[None]:
    """Within it, nothing takes the place of one of these files, and no folder among them is one for results."""
    token = _KEPT.set((*_KEPT.get(), *(path for path in paths if path.exists())))
    try:
        yield
    finally:
        _KEPT.reset(token)


_MADE: ContextVar[list[Path] | None] = ContextVar("made", default=None)


@contextmanager
def tidy() -> Iterator[None]:
    """When it ends, folders that `prepare` and `prepare_file` made within it, and that have stayed empty, are taken away."""
    made: list[Path] = []
    token = _MADE.set(made)
    try:
        yield
    finally:
        _MADE.reset(token)
        for folder in reversed(made):
            with suppress(OSError):  # something is in it
                folder.rmdir()


def refuse_kept(path: Path) -> None:
    """HarnessError if `path` is one of those that are `kept`."""
    if path.exists() and any(path.samefile(other) for other in _KEPT.get() if other.exists()):
        raise HarnessError(
            f"{path}: is read by this command, which would write over it; give another name for what is written"
        )


def prepare(folder: Path) -> None:
    """Make `folder`; HarnessError if it cannot be made or written, or is `kept`. Called before the runs begin."""
    refuse_kept(folder)
    _make(folder)


def _make(folder: Path) -> None:
    made = _MADE.get()
    if made is not None:
        made += [each for each in (*reversed(folder.parents), folder) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None


def prepare_file(path: Path) -> None:
    """As `prepare`, for a file, whose folder is made; HarnessError also if `path` is itself a folder."""
    refuse_kept(path)
    if path.is_dir():
        raise HarnessError(f"{path}: is a folder, the name of a file is needed")
    _make(path.absolute().parent)


def write(path: Path, content: str | bytes) -> None:
    """Write `content` to `path`, through a file beside it that takes its place; HarnessError as from `prepare_file`."""
    refuse_kept(path)
    file = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(_bytes(content) if isinstance(content, str) else content)
        os.chmod(file.name, 0o644)
        os.replace(file.name, path)
        logging.getLogger("harness").info("wrote %s", path)
    except OSError as error:
        raise HarnessError(f"{path}: cannot be written: {error.strerror}") from None
    finally:
        if file is not None:
            Path(file.name).unlink(missing_ok=True)


def _bytes(text: str) -> bytes:
    """UTF-8; what is no text, as in the name of a file, as the sign for that: a page or a table has to be text."""
    try:
        return text.encode()
    except UnicodeEncodeError:
        return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace").encode()


def write_json(path: Path, content: object) -> None:
    """Write `content` to `path` as JSON; ValueError for a number that is not finite, which JSON does not have."""
    write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def csv_text(columns: Mapping[str, NDArray[Any]], *, quoted: bool = False) -> str:
    """Columns of numbers as CSV with a header, 9 significant digits; the header's names in quotes if `quoted`."""
    names = [f'"{name}"' for name in columns] if quoted else list(columns)
    table = np.column_stack([column.astype(float) for column in columns.values()])
    buffer = io.StringIO()
    np.savetxt(buffer, table, fmt="%.9g", delimiter=",", header=",".join(names), comments="")
    return buffer.getvalue()


def trajectory_csv(run: xr.Dataset) -> str:
    """A run as CSV: time, inputs and every output, in SI units; a unit that is not the port's stands in the header."""
    return csv_text({"time": run.time.values, **{_header(run, str(name)): run[name].values for name in run.data_vars}})


def _header(run: xr.Dataset, name: str) -> str:
    unit = run[name].attrs["units"]
    return name if name not in ports.INDEX or unit == ports.VARIABLES[ports.INDEX[name]].unit else f"{name} [{unit}]"

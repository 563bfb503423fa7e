"""A table from the named arrays that a container holds: which are columns, and which of them are whose times."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError
from harness.files.cells import column_of
from harness.files.header import parse_words
from harness.files.table import Column, Table

TIMES = frozenset({"time", "t", "timestamp", "timestamps", "time_s", "tout", "times", "zeit"})
"""Words of an array of times, in lower case."""
WIDEST = 64
"""Columns into which an array of two dimensions is taken apart."""


@dataclass(frozen=True)
class Array:
    """An array by its dotted path, with its unit as written, and the path of its own times if the container says.

    `seconds`: times that are in s by the format.
    """

    path: str
    values: NDArray[Any]
    unit: str = ""
    time: str = ""
    seconds: bool = False

    @property
    def leaf(self) -> str:
        return self.path.rpartition(".")[2]

    @property
    def parent(self) -> str:
        return self.path.rpartition(".")[0]


def table_of(path: Path, arrays: Iterable[Array], remarks: Sequence[str] = ()) -> Table:
    """The table of arrays: those of two dimensions are taken apart, `name.1` and so on; single numbers are left out.

    Where they are of unequal length, or groups have times of their own, each knows its own times: those the container says,
    else an array named like a time of the same length, in the same group or above it; an array whose times are open has
    some that are not there. HarnessError if there is nothing of two values or more.
    """
    flat = [column for array in arrays for column in _apart(array)]
    whole = [array for array in flat if array.values.size > 1]
    if not whole:
        raise HarnessError(f"{path}: holds no column of two or more numbers")
    lengths = Counter(array.values.size for array in whole)
    named = [array for array in whole if _is_time(array)]
    several = len(lengths) > 1 or len({array.time for array in whole if array.time}) > 1 or _differ(named)
    sizes = {_called(array.path): array.values.size for array in whole}
    columns: list[Column] = []
    told = list(remarks)
    words = parse_words([array.leaf for array in whole])
    for place, (array, (leaf, unit)) in enumerate(zip(whole, words, strict=True)):
        name = f"{array.parent}.{leaf}" if array.parent else leaf
        axis = (_called(array.time) or _times_of(array, named)) if several else ""
        if array.time and several and sizes.get(axis, array.values.size) != array.values.size:
            axis = _none_of(array)
        column, remark = column_of(name, array.unit or unit, array.values, place + 1, time=axis)
        columns.append(replace(column, seconds=array.seconds))
        told += [remark] if remark else []
    return Table(path, tuple(columns), remarks=tuple(told))


def _apart(array: Array) -> list[Array]:
    values = np.squeeze(np.asarray(array.values))
    if values.ndim == 1 and values.dtype.names:
        return [
            Array(f"{array.path}.{name}".lstrip("."), values[name], array.unit, array.time) for name in values.dtype.names
        ]
    if values.ndim == 1:
        return [replace(array, values=values)]
    if values.ndim == 2 and values.shape[1] <= WIDEST:
        return [Array(f"{array.path}.{k + 1}", values[:, k], array.unit, array.time) for k in range(values.shape[1])]
    return []


def _times_of(array: Array, times: Sequence[Array]) -> str:
    """Name of the times of an array: of the same length, in its group, else in the nearest above, else the only ones."""
    fitting = [each for each in times if each.values.size == array.values.size]
    own = [each for each in fitting if each.parent == array.parent]
    above = [each for each in fitting if not each.parent or f"{array.parent}.".startswith(f"{each.parent}.")]
    nearest = own[:1] or sorted(above, key=lambda each: -len(each.parent))[:1] or fitting
    if not nearest or _differ(nearest):
        return _none_of(array)
    return _called(nearest[0].path)


def _none_of(array: Array) -> str:
    """In place of the name of its times, where there are none."""
    return f"(none of {array.values.size} rows)"


def _is_time(array: Array) -> bool:
    return parse_words([array.leaf])[0][0].lower() in TIMES and array.values.dtype.kind != "U"


def _called(path: str) -> str:
    """The name that the column of an array has."""
    parent, _, leaf = path.rpartition(".")
    leaf = parse_words([leaf])[0][0]
    return f"{parent}.{leaf}" if parent else leaf


def _differ(times: Sequence[Array]) -> bool:
    """Whether times of several groups are not the same ones; those of one group are one time in several forms."""
    first = {array.parent: array for array in reversed(times)}
    return any(not np.array_equal(array.values, times[0].values) for array in first.values())

"""A table from the named arrays that a container holds: which are columns, and which of them are whose times."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
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
    """An array by its dotted path, with its unit as written, and the path of its own times if the container says."""

    path: str
    values: NDArray[Any]
    unit: str = ""
    time: str = ""

    @property
    def leaf(self) -> str:
        return self.path.rpartition(".")[2]

    @property
    def parent(self) -> str:
        return self.path.rpartition(".")[0]


def table_of(path: Path, arrays: Iterable[Array], remarks: Sequence[str] = ()) -> Table:
    """The table of arrays: those of two dimensions are taken apart, `name.1` and so on; single numbers are left out.

    Where they are of unequal length, each knows its own times: those the container says, else an array named like a time
    of the same length, in the same group if there is one. HarnessError if there is nothing of two values or more.
    """
    flat = [column for array in arrays for column in _apart(array)]
    whole = [array for array in flat if array.values.size > 1]
    if not whole:
        raise HarnessError(f"{path}: holds no column of two or more numbers")
    lengths = Counter(array.values.size for array in whole)
    several = len(lengths) > 1 or len({array.time for array in whole if array.time}) > 1
    columns: list[Column] = []
    told = list(remarks)
    words = parse_words([array.leaf for array in whole])
    for place, (array, (leaf, unit)) in enumerate(zip(whole, words, strict=True)):
        name = f"{array.parent}.{leaf}" if array.parent else leaf
        axis = (array.time or _times_of(array, whole)) if several else ""
        column, remark = column_of(name, array.unit or unit, array.values, place + 1, time=axis)
        columns.append(column)
        told += [remark] if remark else []
    return Table(path, tuple(columns), remarks=tuple(told))


def _apart(array: Array) -> list[Array]:
    values = np.squeeze(np.asarray(array.values))
    if values.ndim == 1 and values.dtype.names:
        return [
            Array(f"{array.path}.{name}".lstrip("."), values[name], array.unit, array.time) for name in values.dtype.names
        ]
    if values.ndim == 1:
        return [Array(array.path, values, array.unit, array.time)]
    if values.ndim == 2 and values.shape[1] <= WIDEST:
        return [Array(f"{array.path}.{k + 1}", values[:, k], array.unit, array.time) for k in range(values.shape[1])]
    return []


def _times_of(array: Array, others: Sequence[Array]) -> str:
    """Path of the times of an array: the nearest array of the same length that is named like a time; "" if there is none."""
    fitting = [
        each for each in others if each.values.size == array.values.size and parse_words([each.leaf])[0][0].lower() in TIMES
    ]
    fitting.sort(key=lambda each: (each.parent != array.parent, not array.parent.startswith(each.parent)))
    if not fitting:
        return f"(none of {array.values.size} rows)"
    leaf = parse_words([fitting[0].leaf])[0][0]
    return f"{fitting[0].parent}.{leaf}" if fitting[0].parent else leaf

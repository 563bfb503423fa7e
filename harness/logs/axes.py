"""Times of rows: in seconds, rising, and of several rates joined into one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError
from harness.logs.find import Found
from harness.logs.log import Between
from harness.units import conversion

Array = NDArray[np.float64]

EPOCHS = ((1e9, 4e9, 1.0, "s"), (1e12, 4e12, 1e-3, "ms"), (1e15, 4e15, 1e-6, "us"), (1e17, 4e18, 1e-9, "ns"))
"""Least and greatest count since 1970 of a time in this unit [s], from 2001 to 2096."""
NEAREST = 1e-6
"""Usual distance of rows [s] below which times are in another unit, such as days."""
TOGETHER, TOGETHER_DATED = 1e-9, 3e-7
"""Times [s] that are no further apart are the same row's; of dates, whose seconds since 1970 are told to 0.2 us."""


@dataclass(frozen=True)
class Axis:
    """Times [s] of a table's rows, shape (n_rows,), not yet known to rise; `epoch`: what 0 is, in seconds since 1970."""

    found: Found
    time: Array
    epoch: float | None
    remark: str = ""


def axis_of(found: Found) -> Axis:
    """The times of a column of times; HarnessError for a cell without one, or a unit that is none of time."""
    column = found.column
    values = found.numbers()
    if np.isnan(values).any():
        row = int(np.flatnonzero(np.isnan(values))[0])
        raise HarnessError(f"{found.cell(row)}: is empty; every row needs its time")
    if column.seconds and found.spec.unit and conversion(found.spec.unit, "s", found.where) != (1.0, 0.0):
        raise HarnessError(
            f"{found.where}: [{found.spec.unit}] is stated, but the times of this format are in s; leave it out"
        )
    if column.epoch is not None:
        return Axis(found, values, column.epoch)
    first = float(values[0]) if len(values) else 0.0
    unit = found.unit
    for low, high, scale, name in EPOCHS:
        if not unit and low <= first <= high:
            return Axis(
                found, (values - first) * scale, first * scale, f"times count {name} since 1970; taken from the first row"
            )
    scale, _ = conversion(unit, "s", found.where) if unit else (1.0, 0.0)
    if first * scale >= EPOCHS[0][0]:
        return Axis(found, (values - first) * scale, first * scale, "times count from long ago; taken from the first row")
    return Axis(found, values * scale, None)


def check_distance(where: str, time: Array) -> None:
    """HarnessError, beginning with `where`, if times [s] are nearer to each other than a log's or a trial's can be."""
    distance = float(np.median(np.diff(time)))
    if distance < NEAREST:
        raise HarnessError(
            f"{where}: its times are {distance:.2g} s apart, {NEAREST:g} s are the least; are they in another unit? "
            "State it, such as --column 'time=COLUMN [day]'"
        )


def check_rises(axis: Axis, rows: NDArray[np.intp], hint: str = "") -> None:
    """HarnessError, with the line, if the times of `rows` repeat or fall."""
    time = axis.time[rows]
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if wrong.size:
        row, before = rows[wrong[0] + 1], rows[wrong[0]]
        raise HarnessError(
            f"{axis.found.table.where(row)}: time {axis.time[row]:.9g} s does not come after {axis.time[before]:.9g} s "
            f"of the row before{hint}"
        )


def joined(axes: Sequence[Axis]) -> tuple[Array, list[NDArray[np.intp]], str]:
    """The times of several axes as one that rises, shape (n_rows,), the place of each axis's rows in it, and a remark.

    HarnessError if one has dates and another has none, or if they have no time in common.
    """
    epochs = [axis.epoch for axis in axes]
    dated = [epoch for epoch in epochs if epoch is not None]
    if dated and len(dated) < len(epochs):
        without = axes[epochs.index(None)].found
        raise HarnessError(f"{without.where}: has no dates, but other times of this log have; they cannot be joined")
    shifts = [epoch - dated[0] if epoch is not None else 0.0 for epoch in epochs]
    times = [axis.time + shift for axis, shift in zip(axes, shifts, strict=True)]
    if max(time[0] for time in times) >= min(time[-1] for time in times):
        raise HarnessError(f"{axes[-1].found.where}: has no time in common with {axes[0].found.where}")
    together = TOGETHER_DATED if dated else TOGETHER
    every = np.sort(np.concatenate(times))
    union = every[np.r_[True, np.diff(every) > together]]
    places = [np.searchsorted(union, time - together) for time in times]
    return union, places, f"{len(axes)} columns of times are joined: {len(union)} rows"


def filled(time: Array, values: Array, between: Between | None) -> Array:
    """An input at every row: between its own values held, or on a straight line; before the first, the first."""
    known = np.flatnonzero(np.isfinite(values))
    if between is Between.HELD:
        before = np.searchsorted(known, np.arange(len(time)), side="right") - 1
        held: Array = values[known[np.maximum(before, 0)]]
        return held
    return np.interp(time, time[known], values[known])

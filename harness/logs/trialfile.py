"""Trials from files: what is commanded, and the loads, from any file that a log may be in."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.errors import HarnessError, unknown
from harness.files.reader import read_table, stem
from harness.logs.axes import Axis, axis_of, check_distance, check_rises
from harness.logs.convert import inside
from harness.logs.find import find, find_times, missing, require_rows
from harness.logs.log import Between
from harness.logs.mapping import INPUTS, parse_specs
from harness.logs.ownrun import with_units
from harness.trials import STEP, Trial, grid

MOST_POINTS = 10_000_000
"""Of a trial from a file, 1000 s; a file that lasts longer most likely has its times in another unit."""
ROUNDING = 1e-9
"""A communication point that is less than this before a row [s] is at the row."""
KNOWN = frozenset({"time", *(port.name for port in (*ports.INPUTS, *ports.OUTPUTS))})
"""Columns of a run's file: what is no input of them is left out when it is flown as a trial."""

Array = NDArray[np.float64]


def read_trial(
    path: Path,
    output: Output | None = None,
    columns: Mapping[str, str] | None = None,
    log: Mapping[str, str] | None = None,
    *,
    longest: float = STEP * MOST_POINTS,
) -> Trial:
    """A trial from a file: time [s], command [rad], optionally load_torque [N.m], supply_voltage [V]; any format and unit.

    `columns`: port -> `COLUMN [unit] words`, as for logs; else columns are taken by the ports' names. `output`: what moves
    at the user's side. `log`: an actuator's `[log]`; it holds for a file whose columns do not bear the names time and
    command, and `columns` win over it. Between the rows inputs are interpolated linearly onto the communication grid, or
    held if their words say so; two rows of the same time are a jump, to the second's values from that time on. Columns that
    are a run's outputs are left out; others are refused, unless `columns` are stated. `longest`: what it may last [s].
    HarnessError, with line and column, for anything that is not a row of finite numbers, or for times that fall or are there
    three times.
    """
    table = with_units(read_table(path))
    if log and not {"time", "command"} <= {column.name for column in table.columns}:
        columns = {key: text for key, text in log.items() if key in ("time", *INPUTS)} | dict(columns or {})
    specs = parse_specs(columns or {})
    found = find([table], specs, INPUTS)
    times = find_times([table], table, table.columns[0], specs)
    linear = output is not None and output.lead is not None
    if times is None or "command" not in found:
        raise missing(table, ["time" if times is None else "command"], linear=linear)
    if not columns:
        for column in table.columns:
            taken = column is times.column or any(column is each.column for each in found.values())
            if column.name not in KNOWN and not taken:
                raise unknown(f"column in {table.at_header}:", column.called, ("time", *INPUTS))
    require_rows(path, len(found["command"].column.values))
    inputs, points = {}, np.empty(0)
    for name in INPUTS:
        if name not in found:
            continue
        own = find_times([table], table, found[name].column, specs)
        axis = axis_of(own or times)
        values = inside(found[name], output or Output(), ratio=1.0)
        if np.isnan(values).any():
            row = int(np.flatnonzero(np.isnan(values))[0])
            raise HarnessError(f"{found[name].cell(row)}: holds no number; every row of a trial needs one")
        if len(axis.time) != len(values):
            raise HarnessError(f"{found[name].where}: has {len(values)} rows, its times {axis.found.where} {len(axis.time)}")
        _check_times(path, axis)
        points = _points(path, axis.time, longest) if name == "command" else points
        inputs[name] = _between(points, axis.time, values, held=found[name].spec.between is Between.HELD)
    return Trial(stem(path), float(points[0]), STEP, inputs, str(path.name))


def _check_times(path: Path, axis: Axis) -> None:
    """HarnessError if the times fall, are too near to each other, or repeat other than in pairs."""
    rows = np.arange(len(axis.time))
    first = np.maximum.accumulate(np.where(np.diff(axis.time, prepend=np.nan) != 0.0, rows, 0))
    again = rows - first
    hint = "; two rows of one time are a jump, a third one is too many" if (again > 1).any() else ""
    check_rises(axis, rows[again != 1], hint)
    if len(apart := axis.time[again == 0]) > 1:
        check_distance(str(path), apart)


def _between(points: Array, times: Array, values: Array, *, held: bool) -> Array:
    """An input at `points` [s], of its rows; at a jump, to ROUNDING, already what comes after it."""
    rows = np.maximum(np.searchsorted(times, points + ROUNDING, side="right") - 1, 0)
    if held:
        held_values: Array = values[rows]
        return held_values
    jumped = np.diff(times, prepend=np.nan)[rows] == 0.0
    return np.interp(np.where(jumped, np.maximum(points, times[rows]), points), times, values)


def _points(path: Path, times: Array, longest: float) -> Array:
    """Communication points from the first to the last time."""
    lasts = float(times[-1] - times[0])
    if not STEP * (1.0 - 1e-6) <= lasts <= longest * (1.0 + 1e-9):
        raise HarnessError(f"{path}: lasts {lasts:g} s; {STEP:g} s to {longest:g} s can be flown")
    return grid(float(times[0]), int(lasts / STEP + 1e-6) + 1, STEP)

"""The trials: the command, and the loads, over time."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.errors import HarnessError, unknown
from harness.actuators.actuator import Output
from harness.files.reader import read_table, stem
from harness.logs.axes import axis_of, check_rises
from harness.logs.convert import inside
from harness.logs.find import find, find_times, missing
from harness.logs.log import Between
from harness.logs.mapping import parse_specs

STEP = 1e-4
"""Communication step [s]."""
DURATION = 2.5
"""Of the built-in trials [s]."""
MOST_POINTS = 10_000_000
"""Of a trial from a file, 1000 s; a file that lasts longer most likely has its times in another unit."""
COLUMNS = ("command", "load_torque", "supply_voltage")
KNOWN = frozenset({"time", *(port.name for port in (*ports.INPUTS, *ports.OUTPUTS))})
"""Columns of a run's file: what is no input of them is left out when it is flown as a trial."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """Inputs on the communication grid.

    `start` [s] and `step` [s] give the times start + n*step; `inputs` holds an array of n_steps + 1 values for each
    input that the trial sets (rad, N.m, V); `source` says where the trial comes from. Inputs named in `continuous` have no
    jumps: an FMU that interpolates inputs lets them ramp from point to point; the others are held.
    """

    name: str
    start: float
    step: float
    inputs: dict[str, Array] = field(repr=False)
    source: str
    continuous: frozenset[str] = frozenset()

    @property
    def time(self) -> Array:
        """Communication points [s], shape (n_steps + 1,)."""
        return grid(self.start, len(self.inputs["command"]), self.step)


def grid(start: float, points: int, step: float) -> Array:
    """Communication points start + n*step [s], shape (points,)."""
    return start + np.arange(points, dtype=np.float64) * step


def _sine(amplitude: float, omega: float) -> Callable[[Array], Array]:
    return lambda t: amplitude * np.sin(omega * t)


def _step_ramp(t: Array) -> Array:
    return np.where(t < 0.01, 0.0, np.where(t < 1.25, 0.1, 0.1 - 0.1 * (t - 1.25)))


def _chirp(t: Array) -> Array:
    """0.05*sin(phase), the frequency rising linearly from 0.2 to 3 Hz over the trial."""
    return 0.05 * np.sin(2.0 * math.pi * (0.2 * t + 0.5 * (3.0 - 0.2) / DURATION * t * t))


def _trapezoid(t: Array) -> Array:
    """Up, hold, down through zero, hold, back, at 0.05 rad/s between +-0.02 rad: slow, reversing twice."""
    return np.interp(t, [0.1, 0.5, 0.8, 1.6, 1.9, 2.3], [0.0, 0.02, 0.02, -0.02, -0.02, 0.0])


def _load_step(t: Array) -> Array:
    return np.full_like(t, 0.05)


BUILT_IN: dict[str, tuple[Callable[[Array], Array], str]] = {
    "SIN": (_sine(0.1, 2.0 * math.pi), "paper, Table 1"),
    "SIN4": (_sine(0.5, 10.0 * math.pi), "paper, Table 1"),
    "STEP-RAMP": (_step_ramp, "paper, Table 1"),
    "CHIRP": (_chirp, "ours; the paper mentions a chirp"),
    "TRAPEZOID": (_trapezoid, "ours, for friction and backlash"),
    "LOAD-STEP": (_load_step, "ours: hold 0.05 rad, load torque 0 to 6 N.m at 1 s"),
}
PAPER = ("SIN", "SIN4", "STEP-RAMP")
"""The paper's trials (Table 1)."""


def trial(name: str) -> Trial:
    """The built-in trial `name`, in upper or lower case; HarnessError with the nearest name if there is none."""
    if name.upper() not in BUILT_IN:
        raise unknown("trial", name, BUILT_IN)
    command, source = BUILT_IN[name.upper()]
    t = grid(0.0, round(DURATION / STEP) + 1, STEP)
    inputs = {"command": command(t)}
    if name.upper() == "LOAD-STEP":
        inputs["load_torque"] = np.where(t < 1.0 - 0.5 * STEP, 0.0, 6.0)
    continuous = frozenset() if name.upper() == "STEP-RAMP" else frozenset({"command"})
    return Trial(name.upper(), 0.0, STEP, inputs, source, continuous)


def read_trial(path: Path, columns: Mapping[str, str] | None = None, output: Output | None = None) -> Trial:
    """A trial from a file: time [s], command [rad], optionally load_torque [N.m], supply_voltage [V]; any format and unit.

    `columns`: port -> `COLUMN [unit] words`, as for logs; else columns are taken by the ports' names. `output`: what moves
    at the user's side. Between the rows the command is interpolated linearly onto the communication grid, or held if its
    words say so. Columns that are a run's outputs are left out; others are refused, unless `columns` are stated.
    HarnessError, with line and column, for anything that is not a row of finite numbers with increasing times.
    """
    table, specs = read_table(path), parse_specs(columns or {})
    found = find([table], specs, COLUMNS)
    times = find_times(table, table.columns[0], specs, first=True)
    linear = output is not None and output.lead is not None
    if times is None or "command" not in found:
        raise missing(table, ["time" if times is None else "command"], linear=linear)
    if not columns:
        for column in table.columns:
            if column.name not in KNOWN and column is not times.column and all(column is not f.column for f in found.values()):
                raise unknown(f"column in {table.at_header}:", column.called, ("time", *COLUMNS))
    inputs, points = {}, np.empty(0)
    for name in COLUMNS:
        if name not in found:
            continue
        own = find_times(table, found[name].column, specs, first=True)
        axis = axis_of(own or times)
        values = inside(found[name], output or Output(), ratio=1.0)
        if np.isnan(values).any():
            row = int(np.flatnonzero(np.isnan(values))[0])
            raise HarnessError(f"{found[name].cell(row)}: is empty; every row of a trial needs a finite number")
        if len(values) < 2:
            raise HarnessError(f"{path}: {len(values)} row(s) of numbers; at least two are needed")
        check_rises(axis, np.arange(len(values)))
        points = _points(path, axis.time) if name == "command" else points
        held = found[name].spec.between is Between.HELD
        rows = np.maximum(np.searchsorted(axis.time, points + 1e-9, side="right") - 1, 0)
        inputs[name] = values[rows] if held else np.interp(points, axis.time, values)
    return Trial(stem(path), float(points[0]), STEP, inputs, str(path.name))


def _points(path: Path, times: Array) -> Array:
    """Communication points from the first to the last time."""
    lasts = float(times[-1] - times[0])
    if not STEP * (1.0 - 1e-6) <= lasts <= STEP * MOST_POINTS:
        raise HarnessError(f"{path}: lasts {lasts:g} s; {STEP:g} s to {STEP * MOST_POINTS:g} s can be flown")
    return grid(float(times[0]), int(lasts / STEP + 1e-6) + 1, STEP)

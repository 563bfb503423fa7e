"""The trials: the command, and the loads, over time."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import DEFAULT, Output
from harness.errors import HarnessError, unknown
from harness.files.columns import read_columns

STEP = 1e-4
"""Communication step [s]."""
DURATION = 2.5
"""Of the built-in trials [s]."""
MOST_POINTS = 10_000_000
"""Of a trial from a file, 1000 s; a file that lasts longer most likely has its times in another unit."""
ROTARY = DEFAULT.output
COLUMNS = ("command", "load_torque", "supply_voltage")

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


def read_trial(path: Path, output: Output = ROTARY) -> Trial:
    """A trial from a CSV file: columns time [s], command [rad], optionally load_torque [N.m], supply_voltage [V].

    For a linear actuator, of which `output` is that, command is in m and load_torque in N.
    Values between the rows are interpolated linearly onto the communication grid, from the first to the last time.
    HarnessError, with line and column, for anything that is not a row of finite numbers with increasing times.
    """
    table = inside(read_columns(path, ("time", "command"), COLUMNS, units=outside_units(output)), output)
    times = table["time"]
    lasts = float(times[-1] - times[0])
    if not STEP * (1.0 - 1e-6) <= lasts <= STEP * MOST_POINTS:
        raise HarnessError(f"{path}: lasts {lasts:g} s; {STEP:g} s to {STEP * MOST_POINTS:g} s can be flown")
    check_ranges(path, table)
    points = grid(float(times[0]), int(lasts / STEP + 1e-6) + 1, STEP)
    inputs = {name: np.interp(points, times, table[name]) for name in COLUMNS if name in table}
    return Trial(path.stem, float(times[0]), STEP, inputs, str(path.name))


def outside_units(output: Output) -> dict[str, str]:
    """Port -> unit outside, for those that `output` has in another unit than the port's own."""
    return {port.name: output.unit(port.name) for port in ports.VARIABLES if output.unit(port.name) != port.unit}


def inside(table: dict[str, Array], output: Output) -> dict[str, Array]:
    """Columns named like ports, given in their units outside, in the ports' own; others as they are."""
    return {name: output.inside(name, series) if name in ports.INDEX else series for name, series in table.items()}


def check_ranges(path: Path, table: dict[str, Array]) -> None:
    """HarnessError if a column that is an input of the FMUs has a value that they refuse."""
    for port in ports.INPUTS:
        low = -math.inf if port.minimum is None else port.minimum
        high = math.inf if port.maximum is None else port.maximum
        for value in table.get(port.name, np.empty(0)):
            if not low <= value <= high:
                raise HarnessError(f"{path}, column {port.name}: {value:g} is out of range, {low:g} to {high:g} {port.unit}")

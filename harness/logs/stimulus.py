"""From a log to the trial that it flew: its inputs on the communication grid, between the rows too."""

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from harness.logs.log import Between, Log
from harness.trials import STEP, Trial, grid

Array = NDArray[np.float64]

DENSE = 2e-3 * (1.0 + 1e-6)
"""Distance of rows [s] up to which they show themselves what the command does between them: a line, or a jump."""
JUMP = 8.0
"""A change of the command between rows is a jump, not a slope, if it is more than so many times that of its neighbours."""


def is_dense(log: Log, *names: str) -> bool:
    """Whether the rows of `names` (the command's, if none is given) are close enough to show the command's shape, and when
    things happen."""
    return all(1.0 / log.rate_of(name) <= DENSE for name in names or ("command",))


def trials_of(log: Log, *, beyond: float = 0.0) -> dict[Between, Trial]:
    """The trials that the log may have flown, by what its command does between rows.

    That is one if the log says it, or if its rows are dense: then the command is a line from row to row, or, where it jumps,
    held until the next row. Else it is each of Between, without those that make the same trial; where nothing is stated, a
    jump is a jump. `beyond` [s]: how far it goes on after the last row, with what is there.
    """
    if log.between is None and is_dense(log):
        return {Between.RAMPED: _trial(log, Between.RAMPED, beyond, jumps_of(log.inputs["command"]))}
    if log.between is not None:
        return {log.between: _trial(log, log.between, beyond, np.zeros(len(log.time), dtype=bool))}
    trials: dict[Between, Trial] = {}
    for between in Between:
        trial = _trial(log, between, beyond, jumps_of(log.inputs["command"]))
        if not any(np.array_equal(trial.inputs["command"], other.inputs["command"]) for other in trials.values()):
            trials[between] = trial
    return trials


def jumps_of(command: Array) -> NDArray[np.bool_]:
    """Whether the command jumps after each row, shape (n_rows,)."""
    change = np.abs(np.diff(command))
    beside = np.maximum(np.r_[0.0, change[:-1]], np.r_[change[1:], 0.0])
    return np.r_[(change > JUMP * beside) & (change > 1e-3 * np.ptp(command)), False]


def _trial(log: Log, between: Between, beyond: float, jumps: NDArray[np.bool_]) -> Trial:
    time, start = log.time, float(log.time[0])
    points = grid(start, int((time[-1] - start + beyond) / STEP + 1e-6) + 1, STEP)
    inputs = {key: np.interp(points, time, series) for key, series in log.inputs.items()}
    inputs["command"] = _command(points, time, log.inputs["command"], between, jumps)
    held = between is Between.HELD or bool(jumps.any())
    return Trial(log.name, start, STEP, inputs, "measured", frozenset() if held else frozenset({"command"}))


def _command(points: Array, time: Array, command: Array, between: Between, jumps: NDArray[np.bool_]) -> Array:
    """The command at `points`; after a row that jumps it is held until the next. Smooth is a cubic spline: the loop
    multiplies the command's error by some 1e4 A/rad, so a curve of lower order shows in the current."""
    rows = np.minimum(np.searchsorted(time, points + 1e-9, side="right") - 1, len(time) - 1)
    if between is Between.HELD:
        return command[rows]
    if between is Between.RAMPED:
        return np.where(jumps[rows], command[rows], np.interp(points, time, command))
    smooth = command[rows].copy()
    edges = np.r_[0, np.flatnonzero(jumps) + 1, len(time)]
    for first, last in itertools.pairwise(edges):
        inside = (rows >= first) & (points <= time[last - 1])
        if last - first >= 3:
            smooth[inside] = CubicSpline(time[first:last], command[first:last])(points[inside])
        elif last - first == 2:
            smooth[inside] = np.interp(points[inside], time[first:last], command[first:last])
    return smooth

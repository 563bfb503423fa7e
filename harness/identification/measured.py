"""A measured run: what was commanded and what was measured, as the monitor needs it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.files.columns import read_columns
from harness.trials import STEP, Trial, check_ranges, grid

Array = NDArray[np.float64]

SLOWEST = 500.0
"""Rows a second that a measurement needs."""
LONGEST = 100.0
"""Of a measurement [s]: beyond it, it is cut by its owner, or its times are in another unit."""
SHORTEST = 0.2
"""Of a measurement [s]: the speed loop's integral needs about as long to settle."""
CURRENT = "equivalent_current_filtered"
PHASES = ("phase_current_a", "phase_current_b", "phase_current_c")
LOADS = ("load_torque", "supply_voltage")
JUMP = 8.0
"""A change of the command between two rows that is as many times its neighbours' is a jump, not a slope."""
START = 0.01
"""Of a run [s], whose rows give the state at its start."""
REST = 0.01
"""A run starts at rest if its speed is as near to zero as this fraction of its range (ours: twice what a straight line
misses of a start from rest), or as four times the noise; and at its command likewise."""
SETTLE = 0.2
"""Of a run that starts in motion [s]: left out, as the speed loop's integral at its start is not measured."""
STUCK = 0.02
"""While the shaft has been at rest for as long [s], the run carries no weight: the integral leaves the current anywhere in
the stiction band, where two right models differ."""


@dataclass(frozen=True)
class Measured:
    """A measured run.

    `time` [s], shape (n,); `trial` the inputs on the communication grid; `channels` port name -> values of shape (n,) in
    the port's unit; `initial` the initial.* parameters; `carries`, shape (n,), where a difference from a model says
    something.
    """

    name: str
    time: Array = field(repr=False)
    trial: Trial
    channels: dict[str, Array] = field(repr=False)
    initial: dict[str, float]
    carries: NDArray[np.bool_] = field(repr=False)

    @property
    def values(self) -> Array:
        """Shape (n, n_channels)."""
        return np.column_stack(list(self.channels.values()))


def read_measured(path: Path, parameters: Mapping[str, float] | None = None) -> Measured:
    """A run from a CSV file; columns that are not needed are left out.

    Columns: time [s], command [rad], position [rad], motor_speed [rad/s], and equivalent_current_filtered [A] or the three
    phase currents [A]; optionally load_torque [N.m], supply_voltage [V]. `parameters` are those set for this actuator.
    HarnessError, with line and column, for anything that cannot be used.
    """
    table = read_columns(path, ("time", "command", "position", "motor_speed"), (CURRENT, *PHASES, *LOADS), others=True)
    if CURRENT in table:
        currents = [CURRENT]
    elif all(name in table for name in PHASES):
        currents = list(PHASES)
    else:
        missing = ", ".join(name for name in PHASES if name not in table)
        raise HarnessError(f"{path}, line 1: no column '{CURRENT}', and of the phase currents {missing} missing")
    check_ranges(path, table)
    inputs = {name: table[name] for name in ("command", *LOADS) if name in table}
    channels = {name: table[name] for name in ("position", "motor_speed", *currents)}
    for name, values in channels.items():
        if np.ptp(values) == 0.0:
            raise HarnessError(f"{path}, column {name}: the same value in all rows; nothing was measured")
    return measured(path.stem, table["time"], inputs, channels, parameters or {}, where=str(path))


def measured(
    name: str,
    time: Array,
    inputs: Mapping[str, Array],
    channels: Mapping[str, Array],
    parameters: Mapping[str, float],
    *,
    where: str,
) -> Measured:
    """A run from arrays of shape (n,); `where` is what a complaint begins with."""
    lasts = float(time[-1] - time[0])
    rate = (len(time) - 1) / lasts
    if rate < SLOWEST * (1.0 - 1e-6):
        raise HarnessError(
            f"{where}: {rate:.4g} rows a second of the time column; at least {SLOWEST:g} are needed (time in s)"
        )
    widest = float(np.max(np.diff(time)))
    if widest > 5.0 / SLOWEST:
        raise HarnessError(f"{where}: {widest:.4g} s without a row; at most {5.0 / SLOWEST:g} s can be bridged")
    if not SHORTEST <= lasts <= LONGEST:
        raise HarnessError(f"{where}: lasts {lasts:g} s; {SHORTEST:g} s to {LONGEST:g} s can be identified (time in s)")
    initial, moving = _start(time, inputs["command"], channels, parameters)
    carries = ~_stuck(time, channels["motor_speed"])
    if moving:
        carries &= time >= time[0] + SETTLE
    if carries.sum() * lasts / len(time) < 0.05:
        raise HarnessError(f"{where}: the shaft hardly moves; a run in motion is needed")
    return Measured(name, time, _trial(name, time, inputs), dict(channels), initial, carries)


def _trial(name: str, time: Array, inputs: Mapping[str, Array]) -> Trial:
    """The inputs on the communication grid: interpolated, but where the command jumps, held until the row after."""
    start = float(time[0])
    points = grid(start, int((time[-1] - time[0]) / STEP + 1e-6) + 1, STEP)
    rows = np.minimum(np.searchsorted(time, points + 1e-9, side="right") - 1, len(time) - 1)
    on_grid = {key: np.interp(points, time, series) for key, series in inputs.items()}
    jumps = jumps_of(inputs["command"])
    on_grid["command"] = np.where(jumps[rows], inputs["command"][rows], on_grid["command"])
    return Trial(name, start, STEP, on_grid, "measured", frozenset() if jumps.any() else frozenset({"command"}))


def jumps_of(command: Array) -> NDArray[np.bool_]:
    """Whether the command jumps after each row, shape (n,)."""
    change = np.abs(np.diff(command))
    beside = np.maximum(np.r_[0.0, change[:-1]], np.r_[change[1:], 0.0])
    return np.r_[(change > JUMP * beside) & (change > 1e-3 * np.ptp(command)), False]


def _start(
    time: Array, command: Array, channels: Mapping[str, Array], parameters: Mapping[str, float]
) -> tuple[dict[str, float], bool]:
    """The initial.* parameters, from straight lines through the first rows, and whether the shaft moves there."""
    first = time <= time[0] + START
    t = time[first] - time[0]
    position, speed = (np.polynomial.polynomial.polyfit(t, channels[name][first], 1) for name in ("position", "motor_speed"))
    near = {}
    for name in ("position", "motor_speed"):
        series = channels[name]
        near[name] = max(REST * np.ptp(series), 4.0 * np.std(np.diff(series)) / np.sqrt(first.sum()))
    moves = 0.0 if abs(speed[0]) <= near["motor_speed"] else float(speed[0])
    stands = moves == 0.0 and abs(position[0] - command[0]) <= near["position"]
    at = float(command[0] if stands else position[0])  # a servo at rest stands at its command, unless that has just jumped
    ratio = parameters.get("gear.ratio", ports.VARIABLES[ports.INDEX["gear.ratio"]].start)
    state = {"initial.motor_position": ratio * at, "initial.position": at, "initial.motor_speed": moves}
    return ({} if at == 0.0 and moves == 0.0 else state), moves != 0.0


def _stuck(time: Array, speed: Array) -> NDArray[np.bool_]:
    """Where the shaft is at rest for STUCK or longer: the mean speed over a quarter of that is within its noise."""
    width = max(1, round(STUCK / 4.0 / float(np.median(np.diff(time)))))
    noise = noise_of(speed) / np.sqrt(width)
    still = np.abs(uniform_filter1d(speed, width)) < max(4.0 * noise, 1e-3 * float(np.ptp(speed)))
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    stuck = np.zeros(len(time), dtype=bool)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if time[end - 1] - time[begin] >= STUCK:
            stuck[begin:end] = True
    return stuck


def noise_of(series: Array) -> float:
    """Standard deviation of the white noise in a smooth series: from its third differences, robust against jumps."""
    difference = np.diff(series, 3)
    return float(1.4826 * np.median(np.abs(difference)) / np.sqrt(20.0))

"""A measured run: what was commanded and what was measured, checked and ready to be fitted."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.logs.read import read_one
from harness.logs.run import SAME
from harness.trials import STEP, Trial, grid

Array = NDArray[np.float64]

LEAST_RATE = 500.0
"""Rows a second that a measurement needs."""
MOST_SECONDS = 100.0
"""Longest measurement [s]: a longer one should be cut, or its times are in another unit."""
LEAST_SECONDS = 0.2
"""Shortest measurement [s]: the integral of the speed loop needs about as long to settle."""
CURRENT = "equivalent_current_filtered"
PHASES = ("phase_current_a", "phase_current_b", "phase_current_c")
JUMP = 8.0
"""A change of the command between rows is a jump, not a slope, if it is more than so many times that of its neighbours."""
START_WINDOW = 0.01
"""Time [s] from the first row on, whose rows give the state at the start."""
AT_REST = 0.01
"""A run starts at rest if its speed there is within this fraction of its range of zero (ours: twice what a straight line
misses of a start from rest), or within four times the noise; and at its command likewise."""
SETTLING = 0.2
"""Time [s] that is left out of a run that starts in motion: the integral of the speed loop at its start is not measured."""
STUCK = 0.02
"""Time at rest [s] from which rows carry no weight: the integral leaves the current anywhere in the stiction band, where two
right models differ."""


@dataclass(frozen=True)
class Measured:
    """A measured run.

    `time` [s], shape (n_rows,); `trial`: the inputs on the communication grid; `channels`: port name -> values of shape
    (n_rows,) in the port's unit; `initial`: the parameters initial.*; `informative`, shape (n_rows,): the rows in which a
    difference from a model means something.
    """

    name: str
    time: Array = field(repr=False)
    trial: Trial
    channels: dict[str, Array] = field(repr=False)
    initial: dict[str, float]
    informative: NDArray[np.bool_] = field(repr=False)

    @property
    def values(self) -> Array:
        """The channels side by side, shape (n_rows, n_channels)."""
        return np.column_stack(list(self.channels.values()))


def read_measured(
    path: Path,
    parameters: Mapping[str, float] | None = None,
    output: Output | None = None,
    columns: Mapping[str, str] | None = None,
    *,
    with_files: Sequence[Path] = (),
) -> Measured:
    """The run of a log, from a file of any format; columns that are not needed are ignored.

    Needed are time, command, position, motor_speed, and equivalent_current_filtered or the three phase currents;
    load_torque and supply_voltage where they are there. The arguments are those of `read_log`. HarnessError, with line and
    column, for anything that cannot be used.
    """
    log = read_one(path, columns, output, parameters, with_files=with_files)
    lost = {name: line for line in log.remarks if SAME in line for name in log_names(line)}
    currents = [CURRENT] if CURRENT in log.channels else list(PHASES)
    for name in ("position", "motor_speed", *currents):
        if name in log.channels:
            continue
        if name in lost:
            raise HarnessError(f"{path}, {lost[name]}")
        if name in PHASES:
            missing = ", ".join(phase for phase in PHASES if phase not in log.channels)
            raise HarnessError(f"{path}: no column '{CURRENT}', and of the phase currents {missing} missing")
        raise HarnessError(f"{path}: no column '{name}', found: {', '.join(log.channels)}")
    channels = {name: log.channels[name] for name in ("position", "motor_speed", *currents)}
    known = np.all([np.isfinite(series) for series in channels.values()], axis=0)
    whole = {name: np.interp(log.time, log.time[known], series[known]) for name, series in channels.items()}
    run = measured(log.name, log.time, log.inputs, whole, parameters or {}, where=str(path))
    return replace(run, informative=run.informative & known)


def log_names(remark: str) -> list[str]:
    """The ports that a log's remark names in brackets."""
    return re.findall(r"\((\w+)\)", remark)


def measured(
    name: str,
    time: Array,
    inputs: Mapping[str, Array],
    channels: Mapping[str, Array],
    parameters: Mapping[str, float],
    *,
    where: str,
) -> Measured:
    """A run from arrays of shape (n_rows,), by port name; an error message begins with `where`."""
    seconds = float(time[-1] - time[0])
    rate = (len(time) - 1) / seconds
    if rate < LEAST_RATE * (1.0 - 1e-6):
        raise HarnessError(
            f"{where}: {rate:.4g} rows a second of the time column; at least {LEAST_RATE:g} are needed (time in s)"
        )
    widest = float(np.max(np.diff(time)))
    if widest > 5.0 / LEAST_RATE:
        raise HarnessError(f"{where}: {widest:.4g} s without a row; at most {5.0 / LEAST_RATE:g} s can be bridged")
    if not LEAST_SECONDS <= seconds <= MOST_SECONDS:
        raise HarnessError(
            f"{where}: lasts {seconds:g} s; {LEAST_SECONDS:g} s to {MOST_SECONDS:g} s can be identified (time in s)"
        )
    initial, moving = _start(time, inputs["command"], channels, parameters)
    informative = ~_stuck(time, channels["motor_speed"])
    if moving:
        informative &= time >= time[0] + SETTLING
    if informative.sum() * seconds / len(time) < 0.05:
        raise HarnessError(f"{where}: the shaft hardly moves; a run in motion is needed")
    return Measured(name, time, _trial(name, time, inputs), dict(channels), initial, informative)


def _trial(name: str, time: Array, inputs: Mapping[str, Array]) -> Trial:
    """The inputs on the communication grid: interpolated, except where the command jumps; there it is held until the next
    row."""
    start = float(time[0])
    points = grid(start, int((time[-1] - time[0]) / STEP + 1e-6) + 1, STEP)
    rows = np.minimum(np.searchsorted(time, points + 1e-9, side="right") - 1, len(time) - 1)
    on_grid = {key: np.interp(points, time, series) for key, series in inputs.items()}
    jumps = jumps_of(inputs["command"])
    on_grid["command"] = np.where(jumps[rows], inputs["command"][rows], on_grid["command"])
    return Trial(name, start, STEP, on_grid, "measured", frozenset() if jumps.any() else frozenset({"command"}))


def jumps_of(command: Array) -> NDArray[np.bool_]:
    """Whether the command jumps after each row, shape (n_rows,)."""
    change = np.abs(np.diff(command))
    beside = np.maximum(np.r_[0.0, change[:-1]], np.r_[change[1:], 0.0])
    return np.r_[(change > JUMP * beside) & (change > 1e-3 * np.ptp(command)), False]


def _start(
    time: Array, command: Array, channels: Mapping[str, Array], parameters: Mapping[str, float]
) -> tuple[dict[str, float], bool]:
    """The parameters initial.*, from straight lines through the first rows, and whether the shaft moves there."""
    first = time <= time[0] + START_WINDOW
    t = time[first] - time[0]
    position, speed = (np.polynomial.polynomial.polyfit(t, channels[name][first], 1) for name in ("position", "motor_speed"))
    near = {}
    for name in ("position", "motor_speed"):
        series = channels[name]
        near[name] = max(AT_REST * np.ptp(series), 4.0 * np.std(np.diff(series)) / np.sqrt(first.sum()))
    w = 0.0 if abs(speed[0]) <= near["motor_speed"] else float(speed[0])
    settled = w == 0.0 and abs(position[0] - command[0]) <= near["position"]
    x = float(command[0] if settled else position[0])  # a servo at rest stands at its command, unless that has just jumped
    ratio = parameters.get("gear.ratio", ports.VARIABLES[ports.INDEX["gear.ratio"]].start)
    state = {"initial.motor_position": ratio * x, "initial.position": x, "initial.motor_speed": w}
    return ({} if x == 0.0 and w == 0.0 else state), w != 0.0


def _stuck(time: Array, speed: Array) -> NDArray[np.bool_]:
    """Whether each row is part of a rest of STUCK or longer, shape (n_rows,): the mean speed over a quarter of that time is
    within its noise."""
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
    """Standard deviation of the white noise on a smooth series, from its third differences; robust against jumps."""
    difference = np.diff(series, 3)
    return float(1.4826 * np.median(np.abs(difference)) / np.sqrt(20.0))

"""A measured run: what was commanded and what was measured, checked and ready to be fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.logs.log import Between, Log
from harness.logs.noise import filled, quantum_of
from harness.logs.observer import Observer, observer_of, shift_bounds
from harness.logs.read import read_one
from harness.logs.run import SAME
from harness.logs.shown import ON_THE_MOTOR, Shown, shown
from harness.logs.start import resting, start_of
from harness.logs.stimulus import trials_of
from harness.trials import Trial

Array = NDArray[np.float64]

LEAST_RATE = 25.0
"""Rows a second that a measurement needs."""
MOST_ROWS_MISSING = 5.0
"""Longest gap that can be bridged while the command moves, in distances of rows; or 10 ms, if that is more."""
MOST_SECONDS = 100.0
"""Longest measurement [s]: a longer one should be cut, or its times are in another unit."""
LEAST_SECONDS = 0.2
"""Shortest measurement [s]: the integral of the speed loop needs about as long to settle."""
CURRENT = "equivalent_current_filtered"
PHASES = ("phase_current_a", "phase_current_b", "phase_current_c")
CURRENTS = ((CURRENT,), PHASES, ("equivalent_current",), ("supply_current",))
"""Sets of channels that show the motor's current; the first that a log holds is fitted."""
SETTLING = 0.2
"""Time [s] that is left out of a run that starts in motion: the integral of the speed loop at its start is not measured."""
LEAST_WEIGHED = 0.05
"""Time in motion [s] that a run must show."""


@dataclass(frozen=True)
class Measured:
    """A measured run.

    `time` [s], shape (n_rows,). `trials`: the inputs on the communication grid, by what the command may have done
    between rows. `channels`: port name -> values of shape (n_rows,) in the port's unit, not a number in rows that
    are masked. `initial`: the parameters initial.*. `informative`, shape (n_rows,): the rows in which a difference from a
    model means something. `observer`: how the rows were taken. `shift_bounds` [s], shape (n_channels,): how far each
    channel may be shifted in time, either way; 0 if not at all. `remarks`: a line for each thing a user should know.
    """

    name: str
    time: Array = field(repr=False)
    trials: dict[Between, Trial]
    channels: dict[str, Array] = field(repr=False)
    initial: dict[str, float]
    informative: NDArray[np.bool_] = field(repr=False)
    observer: Observer = field(repr=False)
    shift_bounds: Array = field(repr=False)
    remarks: tuple[str, ...] = ()
    output: Output = field(default_factory=Output)
    shown: Mapping[str, Shown] = field(default_factory=dict)

    @property
    def trial(self) -> Trial:
        """The first of the trials: the only one, where nothing is open or all has been decided."""
        return next(iter(self.trials.values()))

    @property
    def is_slow(self) -> bool:
        """Whether the rows are too far apart to show when things happen, so that the channels' shifts are estimated."""
        return bool(self.shift_bounds.any())

    @cached_property
    def values(self) -> Array:
        """The channels side by side, shape (n_rows, n_channels); masked rows interpolated, for `weighed` leaves them out."""
        return np.column_stack([filled(self.time, series) for series in self.channels.values()])

    @cached_property
    def weighed(self) -> NDArray[np.bool_]:
        """Where a difference from a model means something, shape (n_rows, n_channels)."""
        there = np.column_stack([np.isfinite(series) for series in self.channels.values()])
        return there & self.informative[:, None]

    @cached_property
    def quanta(self) -> Array:
        """Standard deviation of what a sensor's steps leave on each channel, in its unit, shape (n_channels,); 0 without."""
        return np.array([quantum_of(series) for series in self.channels.values()]) / np.sqrt(12.0)


def read_measured(
    path: Path,
    parameters: Mapping[str, float] | None = None,
    output: Output | None = None,
    columns: Mapping[str, str] | None = None,
    *,
    with_files: Sequence[Path] = (),
) -> Measured:
    """The run of a log, from a file of any format; columns that are not needed are ignored.

    The arguments are those of `read_log`, and the channels those of `measured_from_log`. HarnessError, with line and column,
    for anything that cannot be used.
    """
    return measured_from_log(read_one(path, columns, output, parameters, with_files=with_files), parameters)


def measured_from_log(log: Log, parameters: Mapping[str, float] | None = None) -> Measured:
    """A run from a log; `parameters`: those set for this actuator, by port name.

    Of the log's channels those are taken that a fit can use: the position on the user's side, or, if that or a speed is
    missing, on the motor's; the speed; and the first of CURRENTS. HarnessError for a log that cannot be identified.
    """
    given = parameters or {}
    channels = _chosen(log)
    _check_time(log)
    bounds = shift_bounds(log, list(channels))
    trials = trials_of(log, beyond=float(bounds.max()))
    start = start_of(log, given)
    informative = ~resting(log, given)
    if start.moving:
        informative &= log.time >= log.time[0] + SETTLING
    if informative.sum() * float(log.time[-1] - log.time[0]) / len(log.time) < LEAST_WEIGHED:
        raise HarnessError(f"{log.source}: the shaft hardly moves; a run in motion is needed")
    remarks = log.remarks
    if not any(name in channels for names in CURRENTS for name in names) and not any(
        "no current" in line for line in remarks
    ):
        remarks += ("no current: friction and windings show in the position alone, if at all",)
    if "position" not in channels:
        remarks += (f"{ON_THE_MOTOR}: what lies behind it, such as backlash, shows only in part",)
    observer = observer_of(log, next(iter(trials.values())), tuple(channels))
    as_shown = {name: shown(name, channels, log.output, given) for name in channels}
    return Measured(
        log.name,
        log.time,
        trials,
        channels,
        start.initial,
        informative,
        observer,
        bounds,
        remarks,
        log.output,
        as_shown,
    )


def _chosen(log: Log) -> dict[str, Array]:
    """The channels that are fitted; HarnessError if there is no position, or one that holds nothing."""
    there = log.channels
    names = [name for name in ("position", "motor_speed") if name in there]
    if len(names) < 2 and "motor_position" in there:
        names.append("motor_position")
    if names in ([], ["motor_speed"]):
        lost = next((line for line in log.remarks if SAME in line and "position" in line), "")
        if lost:
            raise HarnessError(f"{log.source}, {lost}")
        found = ", ".join(there) or "none"
        raise HarnessError(f"{log.source}: no position; one on the user's or the motor's side is needed, found: {found}")
    names += next((list(wanted) for wanted in CURRENTS if all(name in there for name in wanted)), [])
    for name in names:
        values = there[name][np.isfinite(there[name])]
        if len(values) < 2 or np.ptp(values) == 0.0:
            raise HarnessError(f"{log.source}, column {name}: {SAME}")
    return {name: there[name] for name in names}


def _check_time(log: Log) -> None:
    """HarnessError if the log is too short, too long, too slow, or has a gap while its command moves."""
    seconds, where = float(log.time[-1] - log.time[0]), log.source
    if len(log.time) < 2 or log.rate < LEAST_RATE * (1.0 - 1e-6):
        raise HarnessError(f"{where}: {log.rate:.4g} rows a second; at least {LEAST_RATE:g} are needed (time in s)")
    if not LEAST_SECONDS <= seconds <= MOST_SECONDS:
        raise HarnessError(
            f"{where}: lasts {seconds:g} s; {LEAST_SECONDS:g} s to {MOST_SECONDS:g} s can be identified (time in s)"
        )
    command, gaps = log.inputs["command"], np.diff(log.time)
    most = max(0.01, MOST_ROWS_MISSING / log.rate) * (1.0 + 1e-6)
    wide = np.flatnonzero((gaps > most) & (np.abs(np.diff(command)) > 1e-3 * np.ptp(command)))
    if wide.size:
        raise HarnessError(
            f"{where}: {gaps[wide[0]]:.4g} s without a row after {log.time[wide[0]]:g} s, in which the command moves; "
            f"at most {most:.4g} s can be bridged"
        )


def measured(
    name: str, time: Array, inputs: Mapping[str, Array], channels: Mapping[str, Array], parameters: Mapping[str, float]
) -> Measured:
    """A run from arrays of shape (n_rows,), by port name."""
    return measured_from_log(Log(name, Path(name), time, inputs, channels), parameters)

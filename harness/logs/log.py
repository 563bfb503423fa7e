"""A log: what was commanded and measured in one run, in the ports' names and units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.actuators.actuator import Output

Array = NDArray[np.float64]


class Between(Enum):
    """What a command does between two rows."""

    HELD = "held"
    RAMPED = "ramped"
    SMOOTH = "smooth"
    """A curve through the rows: a slow log of a command that moves without corners, such as a planner's."""


@dataclass(frozen=True)
class Logger:
    """How a column was taken: "sampled" at the row's time, "averaged" since the row before, or "filtered" with `tau` [s]."""

    kind: str = "sampled"
    tau: float = 0.0


@dataclass(frozen=True)
class Log:
    """A measured run, all in the ports' names and units (rad, N.m, A, V).

    `time` [s], shape (n_rows,), rises. `inputs`: command, and load_torque, supply_voltage where there are any, shape
    (n_rows,), finite. `channels`: output ports that were measured; not a number where a row has none or is masked. A
    position that was measured on the motor is `motor_position`: the rotor's angle. `between`: what the command does
    between rows; None if nobody said. `loggers`: port -> how it was taken, "sampled" for those not named. `output`: how
    it is shown. `others`: what is no port: `temperature` [degC], and `target` [rad], the command before a path planner,
    where what is flown is its demand. `rows`: port -> which rows are its own, shape (n_rows,), where not all are: those of
    its file, or, where most cells are empty, those with a value. `remarks`: a line for each thing a user should know
    (rows masked, gaps, columns left out, what is open).
    """

    name: str
    source: Path
    time: Array = field(repr=False)
    inputs: Mapping[str, Array] = field(repr=False)
    channels: Mapping[str, Array] = field(repr=False)
    between: Between | None = None
    loggers: Mapping[str, Logger] = field(default_factory=dict)
    output: Output = field(default_factory=Output)
    group: str = ""
    others: Mapping[str, Array] = field(default_factory=dict, repr=False)
    remarks: tuple[str, ...] = ()
    rows: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict, repr=False)

    @property
    def rate(self) -> float:
        """Rows a second, of all columns together: one over the median of the rows' distances."""
        return 1.0 / float(np.median(np.diff(self.time)))

    def rows_of(self, name: str) -> NDArray[np.bool_]:
        """Which of the rows are those of the input or channel `name`, shape (n_rows,)."""
        return self.rows.get(name, np.ones(len(self.time), dtype=bool))

    def rate_of(self, name: str) -> float:
        """Rows a second of the input or channel `name`."""
        return 1.0 / float(np.median(np.diff(self.time[self.rows_of(name)])))


CHANNELS: tuple[str, ...] = (
    "position",
    "motor_position",
    "motor_speed",
    "equivalent_current",
    "equivalent_current_filtered",
    "phase_current_a",
    "phase_current_b",
    "phase_current_c",
    "supply_current",
)
"""Output ports that a log may hold and a twin can be compared by."""

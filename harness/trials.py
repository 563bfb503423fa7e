"""The trials: the command, and the loads, over time."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from harness.errors import unknown

STEP = 1e-4
"""Communication step [s]."""
DURATION = 2.5
"""Of the built-in trials [s]."""

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

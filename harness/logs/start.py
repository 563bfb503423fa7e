"""How a log begins, and where its shaft rests: by its speed where dense rows have one, else by its position.

A speed is never made by differencing a position: that of a count in a row's time says nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ema_fmu_src import ports
from harness.logs.log import Log
from harness.logs.noise import error_of, filled, noise_of
from harness.logs.stimulus import is_dense

Array = NDArray[np.float64]

START_WINDOW = 0.01
"""Time [s] from the first row on, whose rows give the state at the start."""
START_ROWS = 5
"""Rows that do so in a log without a speed, or with rows farther apart."""
AT_REST = 0.01
"""A run starts at rest if its speed there is within this fraction of its range of zero (ours: twice what a straight line
misses of a start from rest), or within four times the noise; and at its command likewise."""
STUCK = 0.02
"""Time at rest [s] from which rows carry no weight: the integral leaves the current anywhere in the stiction band, where two
right models differ."""
STANDING = 1e-6
"""Fraction of its range by which a command that stands still may move."""


@dataclass(frozen=True)
class Start:
    """`initial`: the parameters initial.*, by port name; empty if all are 0. `moving`: whether the shaft moves there."""

    initial: dict[str, float]
    moving: bool


def start_of(log: Log, parameters: Mapping[str, float]) -> Start:
    """How the log begins; `parameters` are those set for the actuator, by port name."""
    ratio = _ratio(parameters)
    if {"motor_speed", "position"} <= set(log.channels) and is_dense(log, "command", "motor_speed", "position"):
        x, w, moving = _by_speed(log, ratio)
    else:
        x, w, moving = _by_position(log.time, log.inputs["command"], user_position(log, parameters), ratio)
    state = {"initial.motor_position": ratio * x, "initial.position": x, "initial.motor_speed": w}
    return Start({} if x == 0.0 and w == 0.0 else state, moving)


def resting(log: Log, parameters: Mapping[str, float]) -> NDArray[np.bool_]:
    """Whether each row is part of a rest of STUCK or longer, shape (n_rows,)."""
    if "motor_speed" in log.channels and is_dense(log, "command", "motor_speed"):
        speed = filled(log.time, log.channels["motor_speed"])
        width = max(1, round(STUCK / 4.0 / float(np.median(np.diff(log.time)))))
        noise = noise_of(speed) / np.sqrt(width)
        still = np.abs(uniform_filter1d(speed, width)) < max(4.0 * noise, 1e-3 * float(np.ptp(speed)))
    else:
        still = _standing(log.time, log.inputs["command"], user_position(log, parameters))
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    stuck = np.zeros(len(log.time), dtype=bool)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if log.time[end - 1] - log.time[begin] >= STUCK:
            stuck[begin:end] = True
    return stuck


def user_position(log: Log, parameters: Mapping[str, float]) -> Array:
    """The position on the user's side [rad], as measured, or what a rigid gear makes of the motor's; shape (n_rows,)."""
    if "position" in log.channels:
        return filled(log.time, log.channels["position"])
    return filled(log.time, log.channels["motor_position"]) / _ratio(parameters)


def _ratio(parameters: Mapping[str, float]) -> float:
    return parameters.get("gear.ratio", ports.VARIABLES[ports.INDEX["gear.ratio"]].start)


def _by_speed(log: Log, ratio: float) -> tuple[float, float, bool]:
    """Position [rad] and motor speed [rad/s] from the first rows, and whether the shaft moves: a straight line through the
    speed; and through the position what follows with that speed at its start, as a command that jumps makes it: a cubic."""
    first = log.time <= log.time[0] + START_WINDOW
    t, command = log.time[first] - log.time[0], log.inputs["command"]
    first_rows, near = {}, {}
    for name in ("position", "motor_speed"):
        series = filled(log.time, log.channels[name])
        first_rows[name] = series[first]
        near[name] = max(AT_REST * np.ptp(series), 4.0 * np.std(np.diff(series)) / np.sqrt(first.sum()))
    speed = float(np.polynomial.polynomial.polyfit(t, first_rows["motor_speed"], 1)[0])
    w = 0.0 if abs(speed) <= near["motor_speed"] else speed
    basis = np.column_stack([np.ones(len(t)), t**2, t**3])
    position = float(np.linalg.lstsq(basis, first_rows["position"] - w / ratio * t, rcond=None)[0][0])
    settled = w == 0.0 and abs(position - command[0]) <= near["position"]
    x = float(command[0] if settled else position)  # a servo at rest stands at its command, unless that has just jumped
    return x, w, w != 0.0


def _by_position(time: Array, command: Array, position: Array, ratio: float) -> tuple[float, float, bool]:
    """The same from a parabola through the first rows: a start at the command is a rest, unless it surely has a speed."""
    first = np.arange(len(time)) < max(START_ROWS, int(np.sum(time <= time[0] + START_WINDOW)))
    t, x, error = time[first] - time[0], position[first], error_of(position)
    matrix = np.vander(t, 3, increasing=True)
    start, speed, _ = np.linalg.lstsq(matrix, x, rcond=None)[0]
    line = np.polynomial.polynomial.polyfit(t, x, 1)
    spread = abs(speed - line[1]) + 4.0 * error * np.sqrt(np.linalg.inv(matrix.T @ matrix)[1, 1])
    near = max(AT_REST * np.ptp(position), 4.0 * error)
    if abs(speed) <= spread and abs(x[0] - command[0]) <= near:
        return float(command[0]), 0.0, False
    if np.ptp(x[:3]) <= near:
        return float(np.mean(x[:3])), 0.0, False
    return float(start), ratio * float(speed), True


def _standing(time: Array, command: Array, position: Array) -> NDArray[np.bool_]:
    """Whether command and position both stand still about each row: a shaft that a moving
    command has not yet broken loose shows what holds it, and carries weight."""
    allowed = max(STANDING * float(np.ptp(command)), 4.0 * noise_of(command))
    before = np.abs(np.diff(command, prepend=command[0])) <= allowed
    after = np.r_[before[1:], True]
    moved = np.abs(np.r_[position[1:], position[-1]] - np.r_[position[0], position[:-1]])
    slow = 1e-3 * float(np.ptp(position)) * np.median(np.diff(time)) / START_WINDOW
    return before & after & (moved <= max(4.0 * np.sqrt(2.0) * error_of(position), slow))

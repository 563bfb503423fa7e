"""What sensors, loggers and unknown loads do to a log: each effect acts on the table of columns, or on the flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

from harness.bench.cases import NOISE, Array, Columns
from harness.inference.measured import CURRENT

Logged = Callable[[Columns, np.random.Generator], Columns]

COLOURED, CORRELATION = 0.01, 0.02
"""Deviation of coloured noise, in the channel's range, and its correlation time [s]."""
SPIKES, HEIGHT = 0.01, 0.5
"""Part of the rows that are spikes, and their height in the channel's range."""


@dataclass(frozen=True)
class Effect:
    """`logged`: what becomes of the table; `load`: torque [N.m] at the user shaft over time [s], which is not logged."""

    logged: Logged = lambda table, rng: table
    load: Callable[[Array], Array] | None = None


def _step(table: Columns) -> float:
    return float(table["time"][1] - table["time"][0])


def _shifted(name: str, seconds: float) -> Effect:
    """A column that shows what was so many seconds before."""
    return Effect(lambda table, rng: table | {name: np.interp(table["time"] - seconds, table["time"], table[name])})


def _scaled(name: str, gain: float, offset: float = 0.0) -> Effect:
    """A column with a wrong gain, and an offset in its unit."""
    return Effect(lambda table, rng: table | {name: gain * table[name] + offset})


def _low_pass(corner: float, names: Sequence[str]) -> Effect:
    """Columns behind a low-pass of first order with its corner [Hz], settled at the first row."""

    def logged(table: Columns, rng: np.random.Generator) -> Columns:
        b, a = butter(1, corner, fs=1.0 / _step(table))
        return table | {name: lfilter(b, a, table[name], zi=table[name][0] * lfilter_zi(b, a))[0] for name in names}

    return Effect(logged)


def _jittered(table: Columns, rng: np.random.Generator) -> Columns:
    """Rows taken 0.2 ms (one sigma) before or after the time that is logged."""
    taken = table["time"] + 2e-4 * rng.standard_normal(len(table["time"]))
    return table | {name: np.interp(taken, table["time"], table[name]) for name in ("command", *NOISE)}


def _coloured(table: Columns, rng: np.random.Generator) -> Columns:
    """An autoregression of first order on the current."""
    last = np.exp(-_step(table) / CORRELATION)
    noise = lfilter([np.sqrt(1.0 - last**2)], [1.0, -last], rng.standard_normal(len(table["time"])))
    return table | {CURRENT: table[CURRENT] + COLOURED * np.ptp(table[CURRENT]) * noise}


def _spiked(table: Columns, rng: np.random.Generator) -> Columns:
    """Spikes to either side on every channel."""
    channels = {}
    for name in NOISE:
        series = table[name].copy()
        hit = rng.random(len(series)) < SPIKES
        series[hit] += HEIGHT * np.ptp(series) * np.sign(rng.standard_normal(int(hit.sum())))
        channels[name] = series
    return table | channels


EFFECTS = {
    "command logged 1 ms early": _shifted("command", -1e-3),
    "low-pass 200 Hz on all": _low_pass(200.0, tuple(NOISE)),
    "low-pass 50 Hz on the current": _low_pass(50.0, (CURRENT,)),
    "low-pass 50 Hz on all": _low_pass(50.0, tuple(NOISE)),
    "current gain +2 %": _scaled(CURRENT, 1.02),
    "current offset 0.1 A": _scaled(CURRENT, 1.0, 0.1),
    "current delay 2 ms": _shifted(CURRENT, 2e-3),
    "position offset 1 mrad": _scaled("position", 1.0, 1e-3),
    "position gain +1 %": _scaled("position", 1.01),
    "position delay 2 ms": _shifted("position", 2e-3),
    "speed offset 1 rad/s": _scaled("motor_speed", 1.0, 1.0),
    "jitter 0.2 ms": Effect(_jittered),
    "coloured noise (20 ms) of 1 % on the current": Effect(_coloured),
    "1 % spikes of half the range": Effect(_spiked),
    "load 0.5 N.m": Effect(load=lambda time: np.full(time.shape, 0.5)),
    "load 2 N.m, a sine of 1 Hz": Effect(load=lambda time: 2.0 * np.sin(2.0 * np.pi * time)),
}
"""By name."""

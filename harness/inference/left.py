"""What a model leaves over of a run, and how much of it follows the motion: noise does not, a model that is wrong does."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from harness.inference.run import Run
from harness.logs.noise import filled, noise_of
from harness.logs.shown import value_of

Array = NDArray[np.float64]

SMOOTHING, SMOOTHED_ROWS = 0.01, 5
"""Window [s] of the moving average that separates what a model leaves from white noise, and its least rows."""
LAGS = (0.0, 0.02)
"""Times [s] by which the motion may lead what is left."""
CORRELATED = 0.04
"""Time [s] over which noise may hang together; what hangs together longer is held against the model (ours)."""
PICKED, SAME = 3, 0.05
"""Ways of following that are added up, and the part of one that the others have to leave of it."""
LEAST = 1e-100
"""Size below which a curve stands still."""
MOST_NOISE = 0.03
"""Rest, in ranges of the channel, that is too much for noise whatever it follows (ours)."""


@dataclass(frozen=True)
class Left:
    """What is left of each channel, shape (n_channels,), as a fraction of its range: `rms` of the smoothed rest beside white
    noise, and `following`, the part of it that the motion explains beyond chance."""

    rms: Array
    following: Array

    @property
    def unexplained(self) -> Array:
        """What counts against the model, shape (n_channels,)."""
        return np.where(self.rms > MOST_NOISE, self.rms, self.following)


def left(run: Run, rest: Array, curves: Array) -> Left:
    """What the `rest`, model minus data (n_rows, n_channels), shows; `curves`: the model's, same shape."""
    measured = run.measured
    used = run.weight > 0.0
    held = np.where(used, rest, 0.0)
    apart = float(np.median(np.diff(measured.time)))
    width = max(SMOOTHED_ROWS if measured.is_slow else 1, round(SMOOTHING / apart))
    smoothed = uniform_filter1d(held, width, axis=0)
    rows = np.maximum(used.sum(axis=0), 1)
    white = np.array(
        [noise_of(filled(measured.time, np.where(used[:, k], rest[:, k], np.nan))) for k in range(rest.shape[1])]
    )
    variance = white**2 / width
    if measured.is_slow:
        variance = variance * (1.0 + 3.0 * np.sqrt(2.0 * width / rows))
    square = np.sum(np.where(used, smoothed, 0.0) ** 2, axis=0) / rows
    rms = np.sqrt(np.maximum(square - np.maximum(variance, measured.quanta**2), 0.0))
    regressors = _regressors(curves, measured.time, _electrical_angle(run, curves))
    seconds = float(used.any(axis=1).mean() * (measured.time[-1] - measured.time[0]))
    following = np.array([_following(smoothed[:, k], used[:, k], regressors, seconds) for k in range(rest.shape[1])])
    return Left(rms / run.spans, np.minimum(following, rms) / run.spans)


def _electrical_angle(run: Run, curves: Array) -> Array:
    """Electrical angle of the rotor [rad] by the model's position, shape (n_rows,)."""
    names, given = list(run.measured.channels), run.model.parameters
    name = "motor_position" if "motor_position" in names else "position"
    ratio = 1.0 if name == "motor_position" else value_of("gear.ratio", given)
    return curves[:, names.index(name)] * ratio * value_of("motor.p", given)


def _regressors(curves: Array, time: Array, angle: Array) -> Array:
    """What a rest may follow, shape (n_rows, n): the model's curves, their signs and slopes, at LAGS, and the turning of the
    rotor's field with its harmonic."""
    parts = [np.ones(len(time)), *(wave(order * angle) for order in (1, 2) for wave in (np.sin, np.cos))]
    for k in range(curves.shape[1]):
        series = curves[:, k] / max(float(np.ptp(curves[:, k])), LEAST)
        slope = np.gradient(series, time)
        slope /= max(float(np.std(slope)), LEAST)
        for lag in LAGS:
            parts += [
                np.interp(time - lag, time, each) for each in (series, np.tanh(20.0 * series), np.clip(slope, -4.0, 4.0))
            ]
    found = np.column_stack(parts)
    return found / np.maximum(np.sqrt(np.mean(found**2, axis=0)), LEAST)


def _following(rest: Array, used: NDArray[np.bool_], regressors: Array, seconds: float) -> float:
    """Rms of the part of a smoothed rest, shape (n_rows,), that up to PICKED of the `regressors` explain, the best first,
    beyond what chance gives in `seconds`.

    The largest of m correlations with noise of n independent values has a square of 2 ln(m)/n on average; n is counted by
    the rest's own correlation, up to CORRELATED.
    """
    off, basis = rest[used].copy(), regressors[used].copy()
    total, count = float(np.mean(off**2)), len(off)
    independent = min(count, max(_effective(off), seconds / CORRELATED))
    chance = 2.0 * np.log(basis.shape[1]) / independent * total
    explained, most = 0.0, 0.0
    for picked in range(1, PICKED + 1):
        sizes = np.linalg.norm(basis, axis=0)
        basis = basis[:, sizes > SAME * np.sqrt(count)] / sizes[sizes > SAME * np.sqrt(count)]
        if not basis.shape[1]:
            break
        along = basis.T @ off
        best = int(np.argmax(np.abs(along)))
        explained += float(along[best] ** 2) / count
        most = max(most, explained - picked * chance)
        off = off - along[best] * basis[:, best]
        basis = (basis - np.outer(basis[:, best], basis[:, best] @ basis)) * np.sqrt(count)
    return float(np.sqrt(max(most, 0.0)))


def _effective(series: Array) -> float:
    """Effective number of independent values of a correlated series, at least 1."""
    off = series - series.mean()
    count = len(off)
    spectrum = np.abs(np.fft.rfft(off, 2 * count)) ** 2
    correlation = np.fft.irfft(spectrum)[: count // 2]
    correlation /= max(float(correlation[0]), 1e-300)
    first = int(np.argmax(correlation < 0.05)) or len(correlation)
    return max(1.0, count / float(1.0 + 2.0 * np.sum(correlation[1:first] ** 2)))

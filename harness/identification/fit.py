"""The fit of a measured run: the best coordinates, and how far to trust them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from harness.inference.measured import Measured
from harness.inference.flights import Model
from harness.identification.search import ORIGIN, Problem, explain, map_space, rms_beside_noise
from harness.logs.noise import noise_of

Array = NDArray[np.float64]

BLOCK, BLOCK_ROWS = 0.05, 3.0
"""Length [s] of the blocks whose scores are taken as independent: two periods of a slow run; its least rows."""
FULL_RANK = 1e-3
"""Part of the white-noise covariance that is added, so that fewer blocks than coordinates leave none without variance."""
STRAIGHT, CHECKED = 0.03, 4
"""Move of a coordinate, in spans, up to which slopes tell what HF's difference moves, for beyond the valley bends or a bound
is met; the searches, with that difference added, that then tell it."""


@dataclass(frozen=True)
class Fit:
    """The best fit.

    `z`: scaled coordinates, shape (n_coordinates,), in the order of COORDINATES; `covariance` of z, shape (n_coordinates,
    n_coordinates); `quantile`: half width of the 95 % intervals in standard deviations. `predicted` and `healthy`: the
    channels with the faults found and without any, shape (n_rows, n_channels), in their units. `noise` and `unexplained`,
    shape (n_channels,), in the channels' units: white noise, and rms of what is left beside it. `gap`: as `unexplained`, of
    the judge's difference from the model; zeros if the judge itself was fitted. `ripple`: the same of what the judge's
    flights, chaotic in rounding, differ by from each other. `bent`: HF's difference moves the faults by more than slopes can
    tell. `shifts` and `shift_sigma` [s], shape
    (n_channels,): how far each channel was shifted in time, with its standard deviation; empty if the run allows no shifts.
    """

    z: Array
    covariance: Array
    quantile: float
    predicted: Array = field(repr=False)
    healthy: Array = field(repr=False)
    noise: Array
    unexplained: Array
    gap: Array
    ripple: Array
    bent: bool
    shifts: Array
    shift_sigma: Array


def fit(model: Model, measured: Measured, judge: Model, *, corrected: bool = False) -> Fit:
    """The faults with which `model` explains the run best; if `corrected`, those with which `judge` does, through `model`.

    The judge, a better model, is flown several times with the faults found: how far its difference from the model moves
    them says what the model's simplifications and the chance of a ripple may have done, and the covariance grows by as much.
    """
    problem = Problem(model, measured)
    best, sigma = explain(problem, judge)
    if corrected:
        best, sigma = map_space(problem, judge, best.x)
    fitted = judge if corrected else model
    z, shifts = problem.split(best.x)
    predicted, healthy = fitted.predict(z, shifts), fitted.predict(ORIGIN, shifts)
    difference = predicted - measured.values
    apart = fitted.apart(judge, z, shifts)
    gap = np.zeros(difference.shape) if corrected else apart.mean(axis=0)

    n = len(ORIGIN)
    jacobian = best.jac[: -len(best.x)]  # without the rows of the pull towards healthy
    inverse = np.linalg.inv(best.jac.T @ best.jac)
    blocks = _block_sums(jacobian * problem.weigh(difference)[:, None], measured)
    freedom = len(blocks) - len(best.x)
    scarce = (len(blocks) / max(freedom, 1)) ** (2 if measured.is_slow else 1)  # as a jackknife over few blocks has it
    robust = scarce * inverse @ blocks.T @ blocks @ inverse
    moves = np.array([inverse @ jacobian.T @ problem.weigh(each) for each in apart])
    moved = np.mean(moves**2, axis=0)
    bent = bool(np.max(np.abs(moves[:, :n])) > STRAIGHT)
    if bent and not corrected:
        mapped, apart_too = map_space(problem, judge, best.x, CHECKED)
        moved = np.maximum(moved, (np.abs(mapped.x - best.x) + apart_too) ** 2)
    covariance = _larger(robust, inverse) + FULL_RANK * inverse + np.diag(sigma**2 + moved)
    return Fit(
        z=z,
        covariance=covariance[:n, :n],
        quantile=float(student.ppf(0.975, max(freedom, 4))),
        predicted=predicted,
        healthy=healthy,
        noise=np.array([noise_of(series) for series in difference.T]),
        unexplained=rms_beside_noise(difference, measured),
        gap=rms_beside_noise(gap, measured),
        ripple=_ripple(apart, measured, both=corrected),
        bent=bent,
        shifts=shifts[: len(best.x) - n],
        shift_sigma=np.sqrt(np.diag(covariance)[n:]) * measured.shift_bounds[: len(best.x) - n],
    )


def _ripple(flights: Array, measured: Measured, *, both: bool) -> Array:
    """Rms by which a flight is off the mean of all, beside noise, shape (n_channels,); by which two are apart, if `both`
    the model and the run have such a ripple."""
    off = np.array([rms_beside_noise(flight - flights.mean(axis=0), measured) for flight in flights])
    return np.asarray(np.sqrt((2.0 if both else 1.0) * np.sum(off**2, axis=0) / (len(flights) - 1)))


def _block_sums(scores: Array, measured: Measured) -> Array:
    """Scores (n_residuals, n) of the residuals, channel after channel, summed over blocks of BLOCK seconds or more: within
    one, errors may be correlated."""
    length = max(BLOCK, BLOCK_ROWS * float(np.median(np.diff(measured.time))))
    _, rows = np.nonzero(measured.weighed.T)
    block = ((measured.time[rows] - measured.time[0]) / length).astype(int)
    used, places = np.unique(block, return_inverse=True)
    sums = np.zeros((len(used), scores.shape[1]))
    np.add.at(sums, places, scores)
    return sums


def _larger(one: Array, other: Array) -> Array:
    """The covariance `one`, scaled up in those coordinates in which `other` has the larger variance."""
    scale = np.sqrt(np.maximum(1.0, np.diag(other) / np.maximum(np.diag(one), 1e-300)))
    return one * np.outer(scale, scale)

"""What was found, and how far to trust it: the covariance of a fit."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from harness.identification.measured import Measured, noise_of
from harness.identification.model import Monitor
from harness.identification.search import NOWHERE, Problem, explain, mapped, smooth_rms

Array = NDArray[np.float64]

BLOCK = 0.05
"""Length [s] of the blocks whose scores are taken as independent: two electrical periods of a slow run."""
FULL_RANK = 1e-3
"""Part of the white-noise covariance that is added, so that fewer blocks than coordinates leave none without variance."""


@dataclass(frozen=True)
class Fit:
    """What was found.

    `z` scaled coordinates, shape (8,); `covariance` (8, 8) of z; `quantile` of the 95 % intervals; `predicted` and
    `healthy` (n, n_channels) in the channels' units; `noise` and `unexplained` (n_channels,): the white noise of each
    channel and the rms of what is left beside it, in the channel's unit; `gap` (n_channels,) as `unexplained`, between the
    reference and the model, zeros if the reference itself was fitted.
    """

    z: Array
    covariance: Array
    quantile: float
    predicted: Array = field(repr=False)
    healthy: Array = field(repr=False)
    noise: Array
    unexplained: Array
    gap: Array


def fit(model: Monitor, measured: Measured, reference: Monitor, *, corrected: bool = False) -> Fit:
    """The faults with which `model` explains the run best; if `corrected`, those of `reference`, by way of the model.

    Else `reference`, a better model flown once with the faults found, says how far the model's own simplifications may have
    moved them: the covariance grows by that much.
    """
    problem = Problem(model, measured)
    best, doubt = explain(problem)
    if corrected:
        best, doubt = mapped(problem, reference, best.x)
    shown = reference if corrected else model
    predicted, healthy = shown.predict(best.x), shown.predict(NOWHERE)
    rest = predicted - measured.values
    gap = np.zeros(rest.shape) if corrected else reference.predict(best.x) - predicted

    weighed = best.jac[: -len(NOWHERE)].reshape(len(problem.noise), -1, len(NOWHERE))
    inverse = np.linalg.inv(best.jac.T @ best.jac)
    blocks = _block_sums(np.einsum("cnk,cn->nk", weighed, (rest / problem.noise)[measured.carries].T), measured)
    freedom = len(blocks) - len(NOWHERE)
    robust = len(blocks) / max(freedom, 1) * inverse @ blocks.T @ blocks @ inverse
    shift = inverse @ np.einsum("cnk,cn->k", weighed, (gap / problem.noise)[measured.carries].T)
    covariance = _larger(robust, inverse) + FULL_RANK * inverse + np.diag(doubt**2 + shift**2)
    return Fit(
        z=best.x,
        covariance=covariance,
        quantile=float(student.ppf(0.975, max(freedom, 4))),
        predicted=predicted,
        healthy=healthy,
        noise=np.array([noise_of(series) for series in rest.T]),
        unexplained=smooth_rms(rest, measured),
        gap=smooth_rms(gap, measured),
    )


def _block_sums(scores: Array, measured: Measured) -> Array:
    """Scores summed over blocks of BLOCK seconds: errors within one may hang together as they will."""
    block = ((measured.time[measured.carries] - measured.time[0]) / BLOCK).astype(int)
    used, places = np.unique(block, return_inverse=True)
    sums = np.zeros((len(used), scores.shape[1]))
    np.add.at(sums, places, scores)
    return sums


def _larger(one: Array, other: Array) -> Array:
    """Of two covariances that in which each variance is the larger: `one`, scaled up where `other` is wider."""
    scale = np.sqrt(np.maximum(1.0, np.diag(other) / np.maximum(np.diag(one), 1e-300)))
    return one * np.outer(scale, scale)

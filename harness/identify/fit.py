"""The search for the faults that explain a measured run best, and the covariance of what was found.

Residuals are weighted by the noise that the data show: first by that of the signals themselves, then by what the best model
leaves over. A first search starts from the healthy actuator; if a signal is left unexplained, others start from the best of
a Sobol screen of the whole fault space. Where stick and slip make the valley of good models so narrow and bent that all of
them stall in it, differential evolution crosses what they found.

HF itself is no model for least squares: hysteresis control is chaotic in rounding, which makes its residuals rough and hides
their slopes. It is fitted by space mapping (Bandler et al., IEEE Trans. Microwave Theory Tech. 42 (1994) 2536): ELF+ is
searched, with HF's difference from it, taken where the last search ended, added to what it predicts.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import differential_evolution, least_squares
from scipy.stats import qmc
from scipy.stats import t as student

from harness.identify import faults
from harness.identify.measured import Measured, noise_of
from harness.identify.monitor import Monitor

Array = NDArray[np.float64]

STEP = 0.01
"""Of the finite differences, in spans: wide enough for stiction's kinks, narrow enough for the curvature."""
PRIOR = 3.0
"""Standard deviation, in spans, of a pull to healthy: it decides only what the data leave open."""
FLOOR = 1e-4
"""Least noise of a channel, as a fraction of its range: no model is better."""
SMOOTH = 0.01
"""Window [s] of the mean that parts what a model left unexplained from white noise."""
EXPLAINED = 0.003
"""What may be left of a channel beside noise, as a fraction of its range, if the model explains it: three times what HF's
plant leaves to ELF+ with any of the faults in an unsaturated run, and less than a current sensor's offset of half an ampere
leaves (ours)."""
SCREENED, STARTS = 64, 4
"""Points of the global screen, and how many of them a search starts from at most."""
NEARLY = 5.0
"""What may be left after the searches, as a multiple of EXPLAINED, for a stalled search to be the likely reason."""
CROSSED, GENERATIONS = 24, 30
"""Population and generations of the evolution between stalled searches."""
BLOCK = 0.05
"""Length [s] of the blocks whose scores are taken as independent: two electrical periods of a slow run."""
CORRECTIONS, SETTLED = 6, 2e-3
"""Searches with the reference's difference at most, and the change of z at which there is no need for another."""
SEED = 20230612


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
    """Least squares from healthy, and from up to STARTS further starts if that leaves something unexplained.

    `reference`, a better model flown once with the faults found, says how far the model's own simplifications may have
    moved them: the covariance grows by that much. If `corrected`, the reference is what is fitted, by way of the model.
    """
    data, carries = measured.values, measured.carries
    spread = np.ptp(data, axis=0)
    noise = np.maximum([noise_of(series) for series in data.T], 1e-3 * spread)
    healthy = (reference if corrected else model).predict(np.zeros(len(faults.HEALTHY)))
    offset = np.zeros(data.shape)

    def rest_of(z: Array) -> Array:
        return model.predict(z) + offset - data

    def residuals(z: Array) -> Array:
        return ((rest_of(z) / noise)[carries]).T.ravel()

    def left_of(z: Array) -> float:
        return float(np.max(smooth_rms(rest_of(z), measured) / spread))

    found = [_search(residuals, np.zeros(len(faults.HEALTHY)))]
    best, vague = found[0], np.zeros(len(faults.HEALTHY))
    if left_of(best.x) > EXPLAINED:
        for start in _screen(residuals)[:STARTS]:
            found.append(_search(residuals, start))
            best = min(found, key=lambda result: float(result.cost))
            if left_of(best.x) <= EXPLAINED:
                break
        if EXPLAINED < left_of(best.x) <= NEARLY * EXPLAINED:
            start, vague = _crossed(residuals, [result.x for result in found])
            found.append(_search(residuals, start))
            best = min(found, key=lambda result: float(result.cost))
    noise = np.maximum(np.sqrt(np.mean(rest_of(best.x)[carries] ** 2, axis=0)), FLOOR * spread)
    best = _search(residuals, best.x)
    for _ in range(CORRECTIONS if corrected else 0):
        last = best.x
        offset = reference.predict(last) - model.predict(last)
        noise = np.maximum(np.sqrt(np.mean(rest_of(last)[carries] ** 2, axis=0)), FLOOR * spread)
        best = _search(residuals, last)
        vague = np.abs(best.x - last)
        if np.max(vague) < SETTLED:
            break
    predicted = (reference if corrected else model).predict(best.x)
    rest = predicted - data
    jacobian = best.jac[: -len(best.x)].reshape(len(noise), -1, len(best.x))
    inverse = np.linalg.inv(best.jac.T @ best.jac)
    scores = np.einsum("cnk,cn->nk", jacobian, (rest / noise)[carries].T)
    blocks = _block_sums(scores, measured)
    few = len(blocks) / max(len(blocks) - len(best.x), 1)
    covariance = _larger(few * inverse @ blocks.T @ blocks @ inverse, inverse)
    covariance += np.diag(vague**2)
    gap = np.zeros(data.shape)
    if not corrected:
        gap = reference.predict(best.x) - predicted
        shift = inverse @ np.einsum("cnk,cn->k", jacobian, (gap / noise)[carries].T)
        covariance += np.diag(shift**2)
    white = np.array([noise_of(series) for series in rest.T])
    quantile = float(student.ppf(0.975, max(len(blocks) - len(best.x), 4)))
    left_over = smooth_rms(rest, measured)
    return Fit(best.x, covariance, quantile, predicted, healthy, white, left_over, smooth_rms(gap, measured))


def smooth_rms(rest: Array, measured: Measured) -> Array:
    """Rms of the smoothed differences `rest` (n, n_channels) beyond what white noise leaves there, in their units."""
    width = max(1, round(SMOOTH / float(np.median(np.diff(measured.time)))))
    smoothed = uniform_filter1d(rest, width, axis=0)[measured.carries]
    white = np.array([noise_of(series) for series in rest.T]) ** 2 / width
    return np.sqrt(np.maximum(np.mean(smoothed**2, axis=0) - white, 0.0))


def _search(residuals: Callable[[Array], Array], start: Array) -> "least_squares.OptimizeResult":
    """Bounded least squares (scipy's trust region) from `start`, with the pull to healthy as further rows."""
    low, high = faults.scaled(faults.LOWEST), faults.scaled(faults.HIGHEST)

    def all_rows(z: Array) -> Array:
        return np.r_[residuals(z), z / PRIOR]

    def slopes(z: Array) -> Array:
        here = all_rows(z)
        columns = []
        for place in range(len(z)):
            step = STEP if z[place] + STEP <= high[place] else -STEP
            there = z.copy()
            there[place] += step
            columns.append((all_rows(there) - here) / step)
        return np.array(columns).T

    inside = np.clip(start, low + 1e-3, high - 1e-3)
    return least_squares(all_rows, inside, slopes, bounds=(low, high), xtol=1e-5, ftol=1e-6, max_nfev=30)


def _screen(residuals: Callable[[Array], Array]) -> list[Array]:
    """Points of the fault space, the best first; each fault alone at half of its limit, and a Sobol set of all together."""
    alone = [0.5 * sign * row for row in np.eye(len(faults.HEALTHY)) for sign in (1.0, -1.0)]
    low, high = np.array([0.0, 0.0, -1.0, -1.0, -1.0, -1.0, -1.0, -0.5]), np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.5])
    together = qmc.scale(qmc.Sobol(len(low), rng=SEED).random(SCREENED), low, high)
    ends = faults.scaled(faults.LOWEST), faults.scaled(faults.HIGHEST)
    points = [np.clip(point, *ends) for point in (*alone, *together)]
    return sorted(points, key=lambda point: float(np.sum(residuals(point) ** 2)))


def _crossed(residuals: Callable[[Array], Array], stalled: list[Array]) -> tuple[Array, Array]:
    """The best point of an evolution that starts between and beyond the points where searches have stalled, and how far its
    last population spreads: there the slopes say too little of what the run leaves open."""
    rng = np.random.default_rng(SEED)
    ends = faults.scaled(faults.LOWEST), faults.scaled(faults.HIGHEST)
    shares = rng.dirichlet(np.ones(len(stalled)), CROSSED)
    spread = 2.0 * shares - shares.mean(axis=0)  # twice as wide as what lies between them
    first = np.r_[stalled, (spread @ np.array(stalled))[len(stalled) :]]
    first[len(stalled) :] += STEP * rng.standard_normal(first[len(stalled) :].shape)
    last = differential_evolution(
        lambda z: float(np.sum(residuals(z) ** 2)),
        list(zip(*ends, strict=True)),
        strategy="currenttobest1bin",
        init=np.clip(first, *ends),
        maxiter=GENERATIONS,
        polish=False,
        rng=rng,
    )
    return np.asarray(last.x), np.std(last.population, axis=0)


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
    return (
        one * np.outer(scale, scale) + 1e-3 * other
    )  # which has full rank, also if there are fewer blocks than coordinates

"""The search for the faults that explain a measured run best.

Least squares start from the healthy actuator. If something is left unexplained, more of them start from the best points of a
Sobol screen of the whole fault space, until two agree. Where stick and slip make the valley of good models narrow and bent,
they stall in it, each elsewhere; then differential evolution goes on from where they ended.

HF itself is not fitted by least squares: hysteresis control is chaotic in rounding, which makes HF's residuals rough and
hides their slopes. It is fitted by space mapping (Bandler et al., IEEE Trans. Microwave Theory Tech. 42 (1994) 2536): ELF+
is searched, after HF's difference from it, taken where the last search ended, has been added to its prediction.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import differential_evolution, least_squares
from scipy.stats import qmc

from harness.identification import coordinates
from harness.identification.measured import Measured, noise_of
from harness.identification.model import Model

Array = NDArray[np.float64]

DIFFERENCE_STEP = 0.01
"""Step of the finite differences, in spans: wide enough for the kinks of stiction, narrow enough for the curvature."""
PRIOR_SIGMA = 3.0
"""Standard deviation, in spans, of a pull towards healthy: it decides only what the data leave open."""
NOISE_FLOOR = 1e-4
"""Least noise of a channel, as a fraction of its range: no model is better."""
SMOOTHING = 0.01
"""Window [s] of the moving average that separates what a model leaves unexplained from white noise."""
TOLERANCE = 0.003
"""Largest unexplained rest of a channel beside noise, as a fraction of its range, that counts as explained: three times what
HF's plant leaves to ELF+ with any of the faults in an unsaturated run, and less than what a current sensor's offset of half
an ampere leaves (ours)."""
SCREEN_POINTS, MOST_STARTS = 64, 4
"""Sobol points of the global screen, and the most of its points from which a search starts."""
AGREED = 1.05
"""Ratio of their costs up to which two searches have found the same."""
STALLED = 5.0
"""Multiple of TOLERANCE up to which what is left after searches that do not agree is taken for a sign that they stalled."""
POPULATION, GENERATIONS = 24, 30
"""Of the differential evolution after searches that have stalled."""
MOST_CORRECTIONS, CONVERGED = 6, 2e-3
"""Most searches of a space mapping, and the change of z below which it ends."""
SEED = 20230612
ORIGIN = np.zeros(len(coordinates.COORDINATES))
"""The healthy actuator in scaled coordinates."""
LOWEST, HIGHEST = coordinates.scaled(coordinates.LOWEST), coordinates.scaled(coordinates.HIGHEST)
"""Bounds of the search in scaled coordinates."""
SCREENED = np.round(coordinates.scaled(coordinates.STUDIED), 12)
"""Ends of the screened range, shape (2, n_coordinates); rounded to exact parts of a span, as 1 - 0.7 is not in binary."""


class Problem:
    """A model's residuals against a measured run, as functions of scaled coordinates `z` of shape (n_coordinates,).

    `noise` (n_channels,) weighs the channels: first the noise of the signals themselves, after `reweigh` what the model
    leaves. `offset` (n_rows, n_channels) is added to the model's prediction.
    """

    def __init__(self, model: Model, measured: Measured) -> None:
        self.model, self.measured = model, measured
        self.data = measured.values
        self.spread = np.ptp(self.data, axis=0)
        self.noise = np.maximum([noise_of(series) for series in self.data.T], 1e-3 * self.spread)
        self.offset = np.zeros(self.data.shape)

    def difference(self, z: Array) -> Array:
        """Model minus data, shape (n_rows, n_channels), in the channels' units."""
        return self.model.predict(z) + self.offset - self.data

    def residuals(self, z: Array) -> Array:
        """The difference over the noise, in the informative rows only, channel after channel."""
        return ((self.difference(z) / self.noise)[self.measured.informative]).T.ravel()

    def cost(self, z: Array) -> float:
        """Sum of the squared residuals."""
        return float(np.sum(self.residuals(z) ** 2))

    def unexplained(self, z: Array) -> float:
        """What is left of the worst channel beside noise, as a fraction of its range."""
        return float(np.max(rms_beside_noise(self.difference(z), self.measured) / self.spread))

    def reweigh(self, z: Array) -> None:
        """Take what the model leaves at `z` for the noise of the channels."""
        left = self.difference(z)[self.measured.informative]
        self.noise = np.maximum(np.sqrt(np.mean(left**2, axis=0)), NOISE_FLOOR * self.spread)

    def search(self, start: Array) -> Any:
        """Bounded least squares (SciPy's trust region) from `start`; the pull towards healthy is a residual a coordinate."""
        last: list[Array] = []  # the last point and its residuals: the slopes are taken from there

        def rows(z: Array) -> Array:
            if not last or not np.array_equal(last[0], z):
                last[:] = z.copy(), np.r_[self.residuals(z), z / PRIOR_SIGMA]
            return last[1]

        def slopes(z: Array) -> Array:
            here, columns = rows(z), []
            for place in range(len(z)):
                step = DIFFERENCE_STEP if z[place] + DIFFERENCE_STEP <= HIGHEST[place] else -DIFFERENCE_STEP
                beside = z.copy()
                beside[place] += step
                columns.append((np.r_[self.residuals(beside), beside / PRIOR_SIGMA] - here) / step)
            return np.array(columns).T

        inside = np.clip(start, LOWEST + 1e-3, HIGHEST - 1e-3)
        return least_squares(rows, inside, slopes, bounds=(LOWEST, HIGHEST), xtol=1e-5, ftol=1e-6, max_nfev=30)


def explain(problem: Problem) -> tuple[Any, Array]:
    """The best search, as SciPy returns it, and the standard deviation of each coordinate that its covariance does not show,
    shape (n_coordinates,)."""
    found, sigma = [problem.search(ORIGIN)], np.zeros(len(ORIGIN))
    best = found[0]
    if problem.unexplained(best.x) > TOLERANCE:
        for start in _screen(problem):
            found.append(problem.search(start))
            best = min(found, key=lambda result: float(result.cost))
            if problem.unexplained(best.x) <= TOLERANCE and _reached_twice(found):
                break
        if problem.unexplained(best.x) <= STALLED * TOLERANCE and not _reached_twice(found):
            start, sigma = _evolve(problem, [result.x for result in found])
            best = min(best, problem.search(start), key=lambda result: float(result.cost))
    problem.reweigh(best.x)
    return problem.search(best.x), sigma


def _reached_twice(found: list[Any]) -> bool:
    """Whether the best of the searches is confirmed by another: one alone, while others stalled, may have stalled nearer."""
    first, second = sorted(float(result.cost) for result in found)[:2]
    return second <= AGREED * first


def map_space(problem: Problem, target: Model, start: Array) -> tuple[Any, Array]:
    """As `explain`, but for the model `target`: space mapping from `start`, in which the problem's own model is searched."""
    for _ in range(MOST_CORRECTIONS):
        problem.offset = target.predict(start) - problem.model.predict(start)
        problem.reweigh(start)
        best = problem.search(start)
        change, start = np.abs(best.x - start), best.x
        if np.max(change) < CONVERGED:
            break
    return best, change


def rms_beside_noise(difference: Array, measured: Measured) -> Array:
    """Rms of the smoothed `difference` (n_rows, n_channels) beyond what white noise leaves there, in the channels' units."""
    width = max(1, round(SMOOTHING / float(np.median(np.diff(measured.time)))))
    smoothed = uniform_filter1d(difference, width, axis=0)[measured.informative]
    white = np.array([noise_of(series) for series in difference.T]) ** 2 / width
    return np.sqrt(np.maximum(np.mean(smoothed**2, axis=0) - white, 0.0))


def _screen(problem: Problem) -> list[Array]:
    """The best points of: each coordinate alone half a span to both sides, and a Sobol set of all together."""
    alone = [0.5 * sign * row for row in np.eye(len(ORIGIN)) for sign in (1.0, -1.0)]
    low, high = SCREENED
    together = qmc.scale(qmc.Sobol(len(low), rng=SEED).random(SCREEN_POINTS), low, high)
    points = [np.clip(point, LOWEST, HIGHEST) for point in (*alone, *together)]
    return sorted(points, key=problem.cost)[:MOST_STARTS]


def _evolve(problem: Problem, stalled: list[Array]) -> tuple[Array, Array]:
    """The best point of a differential evolution that starts between and beyond the points where searches have stalled, and
    the standard deviation of its last population: there the slopes say too little of what the run leaves open."""
    rng = np.random.default_rng(SEED)
    shares = rng.dirichlet(np.ones(len(stalled)), POPULATION)
    wide = 2.0 * shares - shares.mean(axis=0)  # twice as wide as what lies between them
    others = (wide @ np.array(stalled))[len(stalled) :]
    others += DIFFERENCE_STEP * rng.standard_normal(others.shape)
    last = differential_evolution(
        problem.cost,
        list(zip(LOWEST, HIGHEST, strict=True)),
        strategy="currenttobest1bin",
        init=np.clip(np.r_[stalled, others], LOWEST, HIGHEST),
        maxiter=GENERATIONS,
        polish=False,
        rng=rng,
    )
    return np.asarray(last.x), np.std(last.population, axis=0)

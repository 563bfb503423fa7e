"""The search for the faults that explain a measured run best.

Least squares start from the healthy actuator; if a signal is left unexplained, others start from the best of a Sobol screen
of the whole fault space. Where stick and slip make the valley of good models so narrow and bent that all of them stall in
it, differential evolution crosses what they found.

HF itself is no model for least squares: hysteresis control is chaotic in rounding, which makes its residuals rough and hides
their slopes. It is fitted by space mapping (Bandler et al., IEEE Trans. Microwave Theory Tech. 42 (1994) 2536): ELF+ is
searched, with HF's difference from it, taken where the last search ended, added to what it predicts.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import differential_evolution, least_squares
from scipy.stats import qmc

from harness.identification import faults
from harness.identification.measured import Measured, noise_of
from harness.identification.model import Monitor

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
CORRECTIONS, SETTLED = 6, 2e-3
"""Searches with the reference's difference at most, and the change of z at which there is no need for another."""
SEED = 20230612
LOWEST, HIGHEST = faults.scaled(faults.LOWEST), faults.scaled(faults.HIGHEST)
NOWHERE = np.zeros(len(faults.HEALTHY))
"""The healthy actuator; or no doubt about any coordinate."""


class Problem:
    """A model's residuals against a measured run, over scaled coordinates of shape (8,).

    `noise` (n_channels,) weighs the channels: at first it is that of the signals themselves, after `weigh` what a model
    leaves over. `offset` (n, n_channels) is added to what the model predicts.
    """

    def __init__(self, model: Monitor, measured: Measured) -> None:
        self.model, self.measured = model, measured
        self.data = measured.values
        self.spread = np.ptp(self.data, axis=0)
        self.noise = np.maximum([noise_of(series) for series in self.data.T], 1e-3 * self.spread)
        self.offset = np.zeros(self.data.shape)

    def rest(self, z: Array) -> Array:
        """Model minus data, shape (n, n_channels), in the channels' units."""
        return self.model.predict(z) + self.offset - self.data

    def residuals(self, z: Array) -> Array:
        """What carries weight of it, weighed, channel after channel."""
        return ((self.rest(z) / self.noise)[self.measured.carries]).T.ravel()

    def cost(self, z: Array) -> float:
        return float(np.sum(self.residuals(z) ** 2))

    def left(self, z: Array) -> float:
        """What is left of the worst channel beside noise, as a fraction of its range."""
        return float(np.max(smooth_rms(self.rest(z), self.measured) / self.spread))

    def weigh(self, z: Array) -> None:
        """Take for noise what the model leaves over at `z`."""
        left = self.rest(z)[self.measured.carries]
        self.noise = np.maximum(np.sqrt(np.mean(left**2, axis=0)), FLOOR * self.spread)

    def search(self, start: Array) -> Any:
        """Bounded least squares (scipy's trust region) from `start`, with the pull to healthy as further rows."""
        last: list[Array] = []  # where the rows have been computed last, and the rows: the slopes begin there

        def rows(z: Array) -> Array:
            if not last or not np.array_equal(last[0], z):
                last[:] = z.copy(), np.r_[self.residuals(z), z / PRIOR]
            return last[1]

        def slopes(z: Array) -> Array:
            here, columns = rows(z), []
            for place in range(len(z)):
                step = STEP if z[place] + STEP <= HIGHEST[place] else -STEP
                there = z.copy()
                there[place] += step
                columns.append((np.r_[self.residuals(there), there / PRIOR] - here) / step)
            return np.array(columns).T

        inside = np.clip(start, LOWEST + 1e-3, HIGHEST - 1e-3)
        return least_squares(rows, inside, slopes, bounds=(LOWEST, HIGHEST), xtol=1e-5, ftol=1e-6, max_nfev=30)


def explain(problem: Problem) -> tuple[Any, Array]:
    """The best of the searches, as scipy has it, and the doubt that is left about each coordinate beside its covariance."""
    found, doubt = [problem.search(NOWHERE)], NOWHERE
    best = found[0]
    if problem.left(best.x) > EXPLAINED:
        for start in _screen(problem):
            found.append(problem.search(start))
            best = min(found, key=lambda result: float(result.cost))
            if problem.left(best.x) <= EXPLAINED:
                break
        if EXPLAINED < problem.left(best.x) <= NEARLY * EXPLAINED:
            start, doubt = _crossed(problem, [result.x for result in found])
            best = min(best, problem.search(start), key=lambda result: float(result.cost))
    problem.weigh(best.x)
    return problem.search(best.x), doubt


def mapped(problem: Problem, reference: Monitor, start: Array) -> tuple[Any, Array]:
    """As `explain`, with `reference` for the model, by way of the problem's own model, from `start`."""
    for _ in range(CORRECTIONS):
        problem.offset = reference.predict(start) - problem.model.predict(start)
        problem.weigh(start)
        best = problem.search(start)
        doubt, start = np.abs(best.x - start), best.x
        if np.max(doubt) < SETTLED:
            break
    return best, doubt


def smooth_rms(rest: Array, measured: Measured) -> Array:
    """Rms of the smoothed differences `rest` (n, n_channels) beyond what white noise leaves there, in their units."""
    width = max(1, round(SMOOTH / float(np.median(np.diff(measured.time)))))
    smoothed = uniform_filter1d(rest, width, axis=0)[measured.carries]
    white = np.array([noise_of(series) for series in rest.T]) ** 2 / width
    return np.sqrt(np.maximum(np.mean(smoothed**2, axis=0) - white, 0.0))


def _screen(problem: Problem) -> list[Array]:
    """The best STARTS points of: each fault alone at half of its limit, and a Sobol set of all together."""
    alone = [0.5 * sign * row for row in np.eye(len(NOWHERE)) for sign in (1.0, -1.0)]
    low, high = np.array([0.0, 0.0, -1.0, -1.0, -1.0, -1.0, -1.0, -0.5]), np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.5])
    together = qmc.scale(qmc.Sobol(len(low), rng=SEED).random(SCREENED), low, high)
    points = [np.clip(point, LOWEST, HIGHEST) for point in (*alone, *together)]
    return sorted(points, key=problem.cost)[:STARTS]


def _crossed(problem: Problem, stalled: list[Array]) -> tuple[Array, Array]:
    """The best point of an evolution that starts between and beyond the points where searches have stalled, and how far its
    last population spreads: there the slopes say too little of what the run leaves open."""
    rng = np.random.default_rng(SEED)
    shares = rng.dirichlet(np.ones(len(stalled)), CROSSED)
    wide = 2.0 * shares - shares.mean(axis=0)  # twice as wide as what lies between them
    others = (wide @ np.array(stalled))[len(stalled) :]
    others += STEP * rng.standard_normal(others.shape)
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

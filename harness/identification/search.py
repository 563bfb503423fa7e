"""The search for the faults that explain a measured run best.

Least squares start from the healthy actuator. If more is left than HF leaves, more of them start from the best points of a
Sobol screen of the whole fault space. Where stick and slip make the valley of good models narrow and bent, all of them may
stall in it; then differential evolution goes on from where they ended.

HF itself is not fitted by least squares: hysteresis control is chaotic in rounding, which makes HF's residuals rough and
hides their slopes. It is fitted by space mapping (Bandler et al., IEEE Trans. Microwave Theory Tech. 42 (1994) 2536): ELF+
is searched, after HF's difference from it, taken where the last search ended, has been added to its prediction.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import differential_evolution, least_squares
from scipy.stats import chi2, qmc

from harness.faults import KINDS
from harness.inference import coordinates
from harness.inference.measured import Measured
from harness.inference.flights import HIGHEST, LOWEST, Model
from harness.logs.noise import noise_of

Array = NDArray[np.float64]

DIFFERENCE_STEP = 0.01
"""Step of the finite differences, in spans: wide enough for the kinks of stiction, narrow enough for the curvature."""
PRIOR_SIGMA = 3.0
"""Standard deviation, in spans, of a pull towards healthy: it decides only what the data leave open."""
NOISE_FLOOR = 1e-4
"""Least noise of a channel, as a fraction of its range: no model is better."""
SMOOTHING, SMOOTHED_ROWS = 0.01, 5
"""Window [s] of the moving average that separates what a model leaves unexplained from white noise, and its least rows."""
SHIFT_SIGMA = 1.0 / np.sqrt(3.0)
"""Standard deviation of the pull of a shift towards 0, in its bounds: that of a shift which is anywhere within them."""
TOLERANCE = 0.003
"""Largest unexplained rest of a channel beside noise, as a fraction of its range, that counts as explained: three times what
HF's plant leaves to ELF+ with any of the faults in an unsaturated run, and less than what a current sensor's offset of half
an ampere leaves (ours)."""
SETTLED = TOLERANCE / 2.0
"""Rest up to which a search is not begun again elsewhere: a false minimum of a shaft that sticks may leave as little as
TOLERANCE, the true one what HF's plant does (ours: 0.0007 in most unsaturated runs, 0.0015 at most)."""
SCREEN_POINTS, MOST_STARTS = 64, 4
"""Sobol points of the global screen, and the most of its points from which a search starts."""
ALIKE = float(chi2.ppf(0.99, len(coordinates.COORDINATES)))
"""Difference of two minima, in variances of the noise, up to which noise does not tell them apart."""
STALLED = 5.0
"""Multiple of TOLERANCE up to which what is left after the searches is taken for a sign that they have stalled."""
POPULATION, GENERATIONS = 24, 30
"""Of the differential evolution after searches that have stalled."""
MOST_CORRECTIONS, CONVERGED = 6, 2e-3
"""Most searches of a space mapping, and the change of z below which it ends."""
SEED = 20230612
ORIGIN = np.zeros(len(coordinates.COORDINATES))
"""The healthy actuator in scaled coordinates."""
SCREENED = np.round(coordinates.scaled(coordinates.STUDIED), 12)
"""Ends of the screened range, shape (2, n_coordinates); rounded to exact parts of a span, as 1 - 0.7 is not in binary."""


class Problem:
    """A model's residuals against a measured run, as functions of `x`, shape (n_coordinates + n_shifts,): scaled
    coordinates of the faults, then the channels' shifts in time in parts of their bound; none, if the run allows none.

    `noise` (n_channels,) weighs the channels: first the noise of the signals themselves, after `reweigh` what the model
    leaves, never less than what a sensor's steps leave. `offset` (n_rows, n_channels) is added to the model's prediction.
    """

    def __init__(self, model: Model, measured: Measured) -> None:
        self.model, self.measured = model, measured
        self.data = measured.values
        self.spread = np.ptp(self.data, axis=0)
        signals = np.maximum([noise_of(series) for series in self.data.T], measured.quanta)
        self.noise = np.maximum(signals, 1e-3 * self.spread)
        self.offset = np.zeros(self.data.shape)
        n_shifts = self.data.shape[1] if measured.is_slow else 0
        self.origin = np.zeros(len(ORIGIN) + n_shifts)
        self.lowest, self.highest = np.r_[LOWEST, -np.ones(n_shifts)], np.r_[HIGHEST, np.ones(n_shifts)]
        self._pull = 1.0 / np.r_[np.full(len(ORIGIN), PRIOR_SIGMA), np.full(n_shifts, SHIFT_SIGMA)]

    def split(self, x: Array) -> tuple[Array, Array]:
        """The faults' scaled coordinates, shape (n_coordinates,), and the channels' shifts [s], shape (n_channels,)."""
        shifts = x[len(ORIGIN) :] * self.measured.shift_bounds if len(x) > len(ORIGIN) else np.zeros(self.data.shape[1])
        return x[: len(ORIGIN)], shifts

    def aligned(self, x: Array) -> Array:
        """`x` with the shifts at which each channel is nearest to the data."""
        if len(x) == len(ORIGIN):
            return x
        z = x[: len(ORIGIN)]
        return np.r_[z, np.clip(self.model.aligned(z) / np.maximum(self.measured.shift_bounds, 1e-9), -1.0, 1.0)]

    def difference(self, x: Array) -> Array:
        """Model minus data, shape (n_rows, n_channels), in the channels' units."""
        return self.model.predict(*self.split(x)) + self.offset - self.data

    def weigh(self, values: Array) -> Array:
        """Values (n_rows, n_channels) over the noise, in the rows that carry weight, channel after channel."""
        return (values / self.noise).T[self.measured.weighed.T]

    def residuals(self, x: Array) -> Array:
        """The difference over the noise, in the rows that carry weight, channel after channel."""
        return self.weigh(self.difference(x))

    def cost(self, x: Array) -> float:
        """Sum of the squared residuals."""
        return float(np.sum(self.residuals(x) ** 2))

    def unexplained(self, x: Array) -> float:
        """What is left of the worst channel beside noise, as a fraction of its range."""
        return float(np.max(rms_beside_noise(self.difference(x), self.measured) / self.spread))

    def reweigh(self, x: Array) -> None:
        """Take what the model leaves at `x` for the noise of the channels."""
        left = np.where(self.measured.weighed, self.difference(x), 0.0)
        rms = np.sqrt(np.sum(left**2, axis=0) / np.maximum(self.measured.weighed.sum(axis=0), 1))
        self.noise = np.maximum(np.maximum(rms, self.measured.quanta), NOISE_FLOOR * self.spread)

    def search(self, start: Array, most: int = 30) -> Any:
        """Bounded least squares (SciPy's trust region) from `start`, of `most` trials at most; the pull towards healthy is a
        residual a coordinate."""
        last: list[Array] = []  # the last point and its residuals: the slopes are taken from there

        def rows(x: Array) -> Array:
            if not last or not np.array_equal(last[0], x):
                last[:] = x.copy(), np.r_[self.residuals(x), x * self._pull]
            return last[1]

        def slopes(x: Array) -> Array:
            here, columns = rows(x), self._shift_slopes(x)
            for place in reversed(range(len(ORIGIN))):
                step = DIFFERENCE_STEP if x[place] + DIFFERENCE_STEP <= HIGHEST[place] else -DIFFERENCE_STEP
                beside = x.copy()
                beside[place] += step
                columns.insert(0, (np.r_[self.residuals(beside), beside * self._pull] - here) / step)
            return np.array(columns).T

        inside = np.clip(start, self.lowest + 1e-3, self.highest - 1e-3)
        return least_squares(rows, inside, slopes, bounds=(self.lowest, self.highest), xtol=1e-5, ftol=1e-6, max_nfev=most)

    def _shift_slopes(self, x: Array) -> list[Array]:
        """Slopes of all residuals by each shift, without a flight of their own: each moves its own channel."""
        if len(x) == len(ORIGIN):
            return []
        slopes = self.model.slopes(*self.split(x)) * self.measured.shift_bounds
        columns = []
        for place in range(slopes.shape[1]):
            alone = np.zeros(slopes.shape)
            alone[:, place] = slopes[:, place]
            pull = np.zeros(len(x))
            pull[len(ORIGIN) + place] = self._pull[len(ORIGIN) + place]
            columns.append(np.r_[self.weigh(alone), pull])
        return columns


def explain(problem: Problem, judge: Model) -> tuple[Any, Array]:
    """The best search, as SciPy returns it, and the standard deviation of each coordinate that its covariance does not show,
    shape (n_coordinates + n_shifts,): that of minima, or of places where searches stall, which noise and the model's
    difference from the `judge` do not tell apart."""
    found = [problem.search(problem.aligned(problem.origin))]
    if problem.measured.is_slow:
        best, sigma = _all_minima(problem, found)
        bound = TOLERANCE
    else:
        best, sigma = _first_settled(problem, found), np.zeros(len(problem.origin))
        bound = SETTLED
    if bound < problem.unexplained(best.x) <= STALLED * TOLERANCE:
        start, sigma = _evolve(problem, [result.x for result in found])
        found.append(problem.search(start))
        best = _least(found)
        place = problem.split(best.x)
        gap = problem.weigh(np.mean(problem.model.apart(judge, *place), axis=0))
        sigma = np.maximum(sigma, _spread(best, found, float(gap @ gap)))
    problem.reweigh(best.x)
    return problem.search(best.x), sigma


def _first_settled(problem: Problem, found: list[Any]) -> Any:
    """The first search that leaves no more than SETTLED, or else the best; `found`, the searches so far, grows by more."""
    best = found[0]
    if problem.unexplained(best.x) > SETTLED:
        for start in _screen(problem, best.x):
            found.append(problem.search(start))
            best = _least(found)
            if problem.unexplained(best.x) <= SETTLED:
                break
    return best


def _least(found: list[Any]) -> Any:
    return min(found, key=lambda result: float(result.cost))


def _spread(best: Any, found: list[Any], allowed: float) -> Array:
    """How far from the best search, as a standard deviation, those have ended whose sum of squares is larger by less than
    `allowed`."""
    alike = [result for result in found if 2.0 * (result.cost - best.cost) <= allowed]
    return np.asarray(0.5 * np.max([np.abs(result.x - best.x) for result in alike], axis=0))


def _all_minima(problem: Problem, found: list[Any]) -> tuple[Any, Array]:
    """The best search in a slow log, and how far from it, as a standard deviation, those end that noise does not tell apart.

    Few rows, sampled more slowly than the windings turn, can be explained by one phase nearly as well as by another, and
    noise hides what a false minimum leaves: so every start of the screen is taken, and each fault of a group is tried on the
    other members of the group. `found`, the searches so far, grows by these.
    """
    found += [problem.search(start) for start in _screen(problem, found[0].x)]
    best = _least(found)
    for members in KINDS.values():
        places = [place for fault in members for place in coordinates.PLACES[fault.name]]
        for turn in range(1, len(members)):
            beside = best.x.copy()
            beside[places] = np.roll(best.x[places], turn)
            found.append(problem.search(beside))
    best = _least(found)
    return best, _spread(best, found, ALIKE * 2.0 * best.cost / best.fun.size)


def map_space(problem: Problem, target: Model, start: Array, most: int = MOST_CORRECTIONS) -> tuple[Any, Array]:
    """As `explain`, but for the model `target`: space mapping from `start`, in which the problem's own model is searched.

    The standard deviation is the last change, once that is small; else how far from the last search all `most` have ended:
    the ripple of the target, chaotic in rounding, moves them.
    """
    ends: list[Array] = []
    while len(ends) < most:
        place = problem.split(start)
        problem.offset = target.predict(*place) - problem.model.predict(*place)
        problem.reweigh(start)
        best = problem.search(start)
        change, start = np.abs(best.x - start), best.x
        ends.append(best.x)
        if np.max(change) < CONVERGED:
            return best, change
    return best, np.max(np.abs(np.array(ends) - best.x), axis=0)


def rms_beside_noise(difference: Array, measured: Measured) -> Array:
    """Rms of the smoothed `difference` (n_rows, n_channels) beyond what white noise and a sensor's steps leave there, in the
    channels' units.

    In slow logs, where few rows are left after smoothing, also beyond three standard deviations of what noise may leave.
    """
    apart = float(np.median(np.diff(measured.time)))
    width = max(SMOOTHED_ROWS if measured.is_slow else 1, round(SMOOTHING / apart))
    smoothed, weighed = uniform_filter1d(difference, width, axis=0), measured.weighed
    rows = np.maximum(weighed.sum(axis=0), 1)
    white = np.array([noise_of(series) for series in difference.T]) ** 2 / width
    if measured.is_slow:
        white *= 1.0 + 3.0 * np.sqrt(2.0 * width / rows)
    left = np.sum(np.where(weighed, smoothed, 0.0) ** 2, axis=0) / rows
    return np.sqrt(np.maximum(left - np.maximum(white, measured.quanta**2), 0.0))


def _screen(problem: Problem, best: Array) -> list[Array]:
    """The best points of: each coordinate alone half a span to both sides, and a Sobol set of all together; with the shifts
    of `best`."""
    alone = [0.5 * sign * row for row in np.eye(len(ORIGIN)) for sign in (1.0, -1.0)]
    low, high = SCREENED
    together = qmc.scale(qmc.Sobol(len(low), rng=SEED).random(SCREEN_POINTS), low, high)
    points = [np.r_[np.clip(point, LOWEST, HIGHEST), best[len(ORIGIN) :]] for point in (*alone, *together)]
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
        list(zip(problem.lowest, problem.highest, strict=True)),
        strategy="currenttobest1bin",
        init=np.clip(np.r_[stalled, others], problem.lowest, problem.highest),
        maxiter=GENERATIONS,
        polish=False,
        rng=rng,
    )
    return np.asarray(last.x), np.std(last.population, axis=0)

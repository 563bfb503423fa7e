"""One weighted least-squares problem for faults, parameters and nuisances: its cost, its slopes, its most likely place.

-2 log of the posterior is the sum of the squared residuals, made white, and of the prior's squares. Its minimum is the
maximum a posteriori (MAP); the inverse of the Gauss-Newton Hessian there is Laplace's approximation of the covariance
(MacKay, Information Theory, Inference, and Learning Algorithms, 27). Without a prior that inverse is the Cramer-Rao bound.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from harness.inference.flights import Setting
from harness.inference.prior import Prior
from harness.inference.run import Run
from harness.inference.sensors import SHIFT
from harness.inference.unknowns import N_FAULTS, Unknowns

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_STEPS, MOST_HALVINGS = 12, 6
"""Linearisations of a search, and shorter steps that are tried at each: stiction makes the cost rough."""
LATER = 8
"""The same of a search that starts where another has ended."""
ENOUGH = 0.3
"""Fall of -2 log likelihood that a step has to promise: less tells nothing apart."""
FAULT_REACH, REACH = 0.3, 2.0
"""Sizes of the first trust region: of faults in spans, of the others in standard deviations."""
ROWS = 1000
"""Rows of a product at a time."""
KEPT_PROMISE = 0.1
"""Part of what a step promised that it has to keep."""


@dataclass(frozen=True)
class Fit:
    """The most likely place `u`, shape (size,), with what was `free`; `cost`: -2 log of the posterior there, comparable
    while the noise is the same. `hessian` and `gradient`: halves of those of the cost; `data`: the data's part of the
    Hessian, without the prior. Rows and columns of what is not free hold nothing. `scores`, shape (n_blocks, size): the
    data's part of the gradient, summed over blocks of BLOCK, and `chances`, shape (n_flights, size): what each flight of
    the judge would add to it; none if they were not asked for. `unkept`: by how much the cost would have fallen, had the
    last step kept its promise; 0 where none was left to make."""

    u: Array
    cost: float
    hessian: Array = field(repr=False)
    gradient: Array = field(repr=False)
    data: Array = field(repr=False)
    free: Mask = field(repr=False)
    scores: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    chances: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    unkept: float = 0.0

    def covariance(self, free: Mask | None = None) -> Array:
        """Laplace's approximation over what is `free` (else what was free), shape (size, size); 0 for the rest."""
        chosen = np.flatnonzero(self.free if free is None else free)
        full = np.zeros(self.hessian.shape)
        full[np.ix_(chosen, chosen)] = np.linalg.inv(self.hessian[np.ix_(chosen, chosen)])
        return full

    def robust(self, free: Mask) -> Array:
        """The covariance over `free`, as by the scatter of the scores from block to block where that is more than the noise
        says (White, Econometrica 50 (1982) 1), for errors that the noise does not know have a correlation of their own;
        and by what the flights of the judge, chaotic in rounding, would move."""
        chosen = np.flatnonzero(free)
        laplace = self.covariance(free)
        inverse = laplace[np.ix_(chosen, chosen)]
        scores = self.scores[:, chosen]
        scattered = np.diag(inverse @ (scores.T @ scores) @ inverse)
        known = np.diag(inverse @ self.data[np.ix_(chosen, chosen)] @ inverse)
        if len(self.chances) > 1:  # a run of one's own has such a chance too
            moved = inverse @ (self.chances - self.chances.mean(axis=0))[:, chosen].T
            scattered = scattered + np.sum(moved**2, axis=1) / (len(self.chances) - 1)
        grown = np.ones(len(laplace))
        grown[chosen] = np.sqrt(np.maximum(1.0, (np.diag(inverse) + scattered - known) / np.diag(inverse)))
        return laplace * np.outer(grown, grown)

    def newton(self, free: Mask) -> Array:
        """Where the quadratic has its minimum over `free`, all else as it is, shape (size,); bounds are not looked at."""
        chosen = np.flatnonzero(free)
        u = self.u.copy()
        u[chosen] -= np.linalg.solve(self.hessian[np.ix_(chosen, chosen)], self.gradient[chosen])
        return u


class Problem:
    """The residuals of `runs` of one actuator as functions of the unknowns."""

    def __init__(self, runs: Sequence[Run], prior: Prior, *, shares: bool = True) -> None:
        self.runs = list(runs)
        self.unknowns = Unknowns(runs, prior, shares=shares)
        self.dead = np.zeros(self.unknowns.size, dtype=bool)
        self.start = self.unknowns.mean.copy()

    def setting(self, u: Array, r: int) -> Setting:
        """What run `r` is flown with at `u`."""
        return self.runs[r].setting(self.unknowns.parameters_of(u), u[self.unknowns.loads[r]])

    def curves(self, u: Array, r: int) -> Array:
        """The model's curves of run `r` on the trial's grid, shape (n_points, n_channels)."""
        return self.runs[r].model.fly(self.setting(u, r))

    def seen(self, u: Array, r: int, curves: Array | None = None) -> Array:
        """What the model would have logged in run `r`, shape (n_rows, n_channels), in the channels' units."""
        run = self.runs[r]
        flown = self.curves(u, r) if curves is None else curves
        return run.sensors.seen(flown, self.unknowns.nuisances_of(u, r), run.gap)

    def rest(self, u: Array, r: int) -> Array:
        """Model minus data, shape (n_rows, n_channels), in the channels' units."""
        return self.seen(u, r) - self.runs[r].data

    def cost(self, u: Array) -> float:
        """-2 log of the posterior, but for a constant; infinite where the model cannot fly."""
        return self.costs([u])[0]

    def costs(self, places: Sequence[Array]) -> list[float]:
        """The same of several places, flown on all cores."""
        totals = [self._pull(u) for u in places]
        for r, run in enumerate(self.runs):
            for n, curves in enumerate(run.model.fly_all([self.setting(u, r) for u in places])):
                rest = self.seen(places[n], r, curves) - run.data
                totals[n] += float(np.sum(run.white(rest) ** 2))
        return [total if np.isfinite(total) else np.inf for total in totals]

    def _pull(self, u: Array) -> float:
        off = u - self.unknowns.mean
        return float(off @ self.unknowns.precision @ off)

    def linear(self, u: Array, free: Mask, *, blocks: bool = False) -> Fit:
        """The quadratic at `u` over what is `free`; a flight for each unknown that needs one, of all runs on all cores. With
        `blocks`, its scores too."""
        own = self.unknowns
        data, gradient, cost = np.zeros((own.size, own.size)), np.zeros(own.size), self._pull(u)
        scores: list[Array] = []
        chances = np.zeros((0, own.size))
        for r, run in enumerate(self.runs):
            rest, columns, where = self.slopes(u, free, r)
            data[np.ix_(where, where)] += products(columns)
            gradient[where] += columns.T @ rest
            cost += float(rest @ rest)
            if blocks:
                of_blocks = run.blocks
                own_scores = np.zeros((of_blocks.max() + 1, own.size))
                for at, column in zip(where, columns.T, strict=True):
                    own_scores[:, at] = np.bincount(of_blocks, column * rest, len(own_scores))
                scores.append(own_scores)
                if run.flights is not None:
                    chances = chances if len(chances) else np.zeros((len(run.flights), own.size))
                    for n, flight in enumerate(run.flights):
                        chances[n, where] += columns.T @ run.white(flight)
        off = u - own.mean
        summed = np.vstack(scores) if scores else np.empty((0, 0))
        return Fit(u, cost, data + own.precision, gradient + own.precision @ off, data, free, summed, chances)

    def slopes(self, u: Array, free: Mask, r: int) -> tuple[Array, Array, NDArray[np.intp]]:
        """The white residuals of run `r` at `u`, shape (n_residuals,), their derivatives by what is `free` and acts on that
        run, shape (n_residuals, n), and the places of these unknowns, shape (n,)."""
        own, run = self.unknowns, self.runs[r]
        shared = {place: parts for place, parts in own.products(u).items() if free[place]}
        needed = {other for parts in shared.values() for other, _ in parts}
        flown = [at for at in range(own.size) if (free[at] or at in needed) and at not in shared and own.in_flight(at)]
        load = own.loads[r]
        here = [at for at in flown if (at < own.parameters.stop or load.start <= at < load.stop) and not self.dead[at]]
        base, slopes = self._slopes(u, r, here)
        for place, parts in shared.items():
            known = [factor * slopes[other] for other, factor in parts if other in slopes]
            if known:
                slopes[place] = np.sum(known, axis=0)
        places = [at for at in slopes if free[at]]
        rest = run.white(base - run.data)
        columns = run.white(np.stack([slopes[at] for at in places], axis=-1)) if places else np.empty((len(rest), 0))
        at_nuisances = np.flatnonzero(free[own.nuisances[r]]) + own.nuisances[r].start
        if at_nuisances.size:
            columns = np.hstack([columns, self._nuisance_columns(u, r, at_nuisances)])
            places = [*places, *at_nuisances.tolist()]
        return rest, columns, np.array(places, dtype=int)

    def _slopes(self, u: Array, r: int, places: list[int]) -> tuple[Array, dict[int, Array]]:
        """What run `r` would have logged at `u`, and its derivatives by the unknowns at `places`."""
        own, steps, beside = self.unknowns, [], []
        for at in places:
            step = own.step(at)
            step = -step if u[at] + step > own.high[at] else step
            other = u.copy()
            other[at] += step
            steps.append(step)
            beside.append(other)
        flights = self.runs[r].model.fly_all([self.setting(v, r) for v in (u, *beside)])
        base = self.seen(u, r, flights[0])
        slopes = {}
        for at, step, curves in zip(places, steps, flights[1:], strict=True):
            slope = (self.seen(u, r, curves) - base) / step
            slopes[at] = slope if np.isfinite(slope).all() else np.zeros(slope.shape)
        return base, slopes

    def _nuisance_columns(self, u: Array, r: int, places: NDArray[np.intp]) -> Array:
        """The white slopes of run `r` by the nuisances at `places`, each of which moves its own channel alone."""
        run, own = self.runs[r], self.unknowns
        slopes = run.sensors.slopes(self.curves(u, r), own.nuisances_of(u, r), run.gap) * own.nuisance_scales(r)
        count = slopes.shape[2]
        columns = np.zeros((*run.data.shape, len(places)))
        for n, at in enumerate((places - own.nuisances[r].start).tolist()):
            channel, kind = divmod(at, count)
            columns[:, channel, n] = slopes[:, channel, kind]
        return run.white(columns)

    def mark_dead(self, fit: Fit) -> None:
        """Take for dead, from now on, what has had no effect at all on any run: it costs no more flights."""
        self.dead |= fit.free & (np.diag(fit.data) == 0.0)

    def solve(self, u: Array, free: Mask, *, most: int = MOST_STEPS, enough: float = ENOUGH) -> Fit:
        """The most likely place over what is `free`, from `u`: Gauss-Newton within bounds and a trust region, of `most`
        linearisations, until a step promises less than `enough` (Nocedal and Wright, Numerical Optimization, 10.3)."""
        own = self.unknowns
        u, radius = np.clip(u, own.low, own.high), 1.0
        chosen = np.flatnonzero(free & ~self.dead)
        reach = np.where(chosen < N_FAULTS, FAULT_REACH, REACH)
        u = self._flyable(u)
        for left in reversed(range(most)):
            fit = self.linear(u, free)
            root = np.asarray(np.linalg.cholesky(fit.hessian[np.ix_(chosen, chosen)]).T, dtype=np.float64)
            target = np.asarray(-np.linalg.solve(root.T, fit.gradient[chosen]), dtype=np.float64)
            moved, hoped = None, 0.0
            for _ in range(MOST_HALVINGS if left else 0):
                step = _bounded(root, target, own, u, chosen, radius * reach)
                promised = -float(2.0 * fit.gradient[chosen] @ step + np.sum((root @ step) ** 2))
                if promised < enough:
                    return replace(fit, unkept=hoped)
                hoped = max(hoped, promised)
                beside = u.copy()
                beside[chosen] = np.clip(u[chosen] + step, own.low[chosen], own.high[chosen])
                if self.cost(beside) < fit.cost - KEPT_PROMISE * promised:
                    moved, radius = beside, min(1.0, 2.0 * radius)
                    break
                radius = 0.4 * min(radius, float(np.max(np.abs(step) / reach)))
            if moved is None:
                return replace(fit, unkept=hoped)
            u = moved
        raise AssertionError("a search of no step")

    def _flyable(self, u: Array) -> Array:
        """`u`, or, if the model cannot fly there, a place nearer to what was known before."""
        for _ in range(MOST_HALVINGS):
            if np.isfinite(self.cost(u)):
                return u
            u = 0.5 * (u + self.unknowns.mean)
        return self.unknowns.mean.copy()

    def aligned(self, u: Array) -> Array:
        """`u` with the shifts at which each channel of a slow log is nearest to the data."""
        out = u.copy()
        for r, run in enumerate(self.runs):
            measured = run.measured
            if measured.is_slow:
                curves = self.curves(u, r)
                found = measured.observer.aligned(curves, run.data, measured.weighed, measured.shift_bounds)
                scales = self.unknowns.nuisance_scales(r)
                slow = measured.shift_bounds > 0.0
                view = out[self.unknowns.nuisances[r]].reshape(scales.shape)
                view[slow, SHIFT] = (found / scales[:, SHIFT])[slow]
        return out


def products(columns: Array) -> Array:
    """The products of `columns` (n_rows, n) with each other, shape (n, n), some rows at a time: larger products BLAS shares
    out to threads, which on a busy machine takes it seconds."""
    parts = np.ascontiguousarray(columns)
    return np.asarray(
        sum((part.T @ part for part in np.split(parts, range(ROWS, len(parts), ROWS))), np.zeros(2 * columns.shape[1:]))
    )


def _bounded(root: Array, target: Array, own: Unknowns, u: Array, chosen: NDArray[np.intp], reach: Array) -> Array:
    """The step within bounds and reach that the quadratic |root s - target|^2 likes best, shape (n_chosen,)."""
    step = np.linalg.solve(root, target)
    low, high = np.maximum(own.low[chosen] - u[chosen], -reach), np.minimum(own.high[chosen] - u[chosen], reach)
    if (step >= low).all() and (step <= high).all():
        return np.asarray(step)
    found = lsq_linear(root, target, (low - 1e-12, high + 1e-12), method="bvls")
    return np.asarray(np.clip(found.x, low, high))

"""What runs tell of the parameters: the quadratic around the best fit, how much the residuals' own blocks and the runs among
each other say that it errs, and the parameters that keep what was known before."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from harness.calibration.search import unknown
from harness.inference.problem import Problem, products

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCKS, SHORTEST = 16, 0.1
"""Blocks of time into which a run is cut, and the least length of one [s]."""
TOLD = 0.7
"""Part of a prior's standard deviation below which a posterior's says that the runs tell the parameter."""
LINKED = 0.2
"""Correlation with one that is told from which a parameter that is not is written beside it."""
LEAST_MOVED = 0.1
"""Part of its variance by which a parameter is at least expected to vary when a run is left out that says little of it."""
MOST_INFLATION = 30.0
"""Beyond which a fit is no calibration, and blocks no measure of it."""


@dataclass(frozen=True)
class Told:
    """What the data say of the parameters, all in prior standard deviations, shape (n, n) and (n,): the `information` and
    the `gradient` at `u`, halves of those of -2 log likelihood, all nuisances left free; the prior's `precision`, with its
    mean at 0; the `scatter` of the blocks' own gradients, which would be the information if the noise were as it was learnt;
    and the same two for each run alone."""

    u: Array
    information: Array = field(repr=False)
    gradient: Array = field(repr=False)
    precision: Array = field(repr=False)
    scatter: Array = field(repr=False)
    alone: list[tuple[Array, Array]] = field(repr=False)

    def covariance(self) -> Array:
        """Laplace's approximation, shape (n, n)."""
        return np.asarray(np.linalg.inv(self.information + self.precision))

    def inflated(self, factor: float) -> "Told":
        """The same with all that the data say, `factor` times as uncertain."""
        shrunk = factor**-2
        return Told(
            self.u, shrunk * self.information, shrunk * self.gradient, self.precision, shrunk * self.scatter, self.alone
        )

    def mean(self) -> Array:
        """The most likely place, shape (n,)."""
        return self.u - self.covariance() @ (self.gradient + self.precision @ self.u)

    def by_blocks(self, told: Mask) -> float:
        """How many times as uncertain the `told` parameters are as the learnt noise says, by the blocks: the sandwich
        estimator (White 1982; Liang and Zeger 1986), root mean square over the parameters; at least 1."""
        own = self.covariance()
        sandwich = own @ (self.scatter + self.precision) @ own
        ratios = (np.diag(sandwich) / np.diag(own))[told]
        return float(np.clip(np.sqrt(ratios.mean()), 1.0, MOST_INFLATION)) if ratios.size else 1.0

    def by_runs(self, told: Mask) -> float:
        """The same by leaving out a run each: how far the others alone move them, to how far they should (Hausman 1978)."""
        ratios: list[float] = []
        own = self.covariance()
        for information, gradient in self.alone if len(self.alone) > 1 else []:
            less = np.linalg.inv(self.information - information + self.precision)
            moved = -less @ (self.gradient - gradient + self.precision @ self.u)
            expected = np.diag(less - own)
            ratios += (moved[told] ** 2 / np.maximum(expected[told], LEAST_MOVED * np.diag(own)[told])).tolist()
        return float(np.clip(np.sqrt(np.mean(ratios)), 1.0, MOST_INFLATION)) if ratios else 1.0


def told_by(problem: Problem, u: Array) -> Told:
    """What the runs say at `u`: a flight for each parameter and run."""
    own, free = problem.unknowns, unknown(problem)
    part = np.arange(own.parameters.start, own.parameters.stop)
    information, scatter = np.zeros((part.size, part.size)), np.zeros((part.size, part.size))
    gradient, alone = np.zeros(part.size), []
    for r in range(len(problem.runs)):
        rest, columns, places = problem.slopes(u, free, r)
        mine, others = _columns(columns, places, part), ~np.isin(places, part)
        beside, at = columns[:, others], places[others]
        inner = products(beside) + own.precision[np.ix_(at, at)]
        follows = np.linalg.solve(inner, beside.T @ mine)
        here = mine.T @ mine - mine.T @ beside @ follows
        slope = mine.T @ rest - follows.T @ (beside.T @ rest + own.precision[np.ix_(at, at)] @ (u - own.mean)[at])
        scores = _scores((mine - beside @ follows) * rest[:, None], _blocks(problem, r))
        information, gradient, scatter = information + here, gradient + slope, scatter + scores
        alone.append((here, slope))
    return Told(u[part], information, gradient, own.precision[np.ix_(part, part)], scatter, alone)


def _columns(columns: Array, places: NDArray[np.intp], wanted: NDArray[np.intp]) -> Array:
    """The columns at the places `wanted`, 0 for one that is not there."""
    out = np.zeros((len(columns), wanted.size))
    there = np.isin(places, wanted)
    out[:, np.searchsorted(wanted, places[there])] = columns[:, there]
    return out


def _blocks(problem: Problem, r: int) -> NDArray[np.intp]:
    """The block of time in which each white residual of run `r` lies."""
    measured = problem.runs[r].measured
    since = measured.time - measured.time[0]
    count = int(np.clip(since[-1] / SHORTEST, 2, BLOCKS))
    block = np.minimum((since / since[-1] * count).astype(int), count - 1)
    return np.concatenate([block[used] for used in measured.weighed.T])


def _scores(parts: Array, blocks: NDArray[np.intp]) -> Array:
    """Sum over the blocks of the outer squares of their gradients around the mean, shape (n, n), by each residual's part."""
    names = np.unique(blocks)
    sums = np.array([parts[blocks == name].sum(axis=0) for name in names])
    off = sums - sums.mean(axis=0)
    return np.asarray(off.T @ off) * len(names) / max(1, len(names) - 1)


def cut(mean: Array, covariance: Array, known: Array, told: Mask) -> tuple[Array, Array]:
    """Mean, shape (n,), and covariance, shape (n, n), with the parameters that are not `told` as they were `known` before:
    mean 0 and covariance `known`; the told follow them as the data say."""
    held, free = np.flatnonzero(~told), np.flatnonzero(told)
    values, joint = np.zeros(mean.size), known.copy()
    if not held.size or not free.size:
        return (mean.copy(), covariance.copy()) if free.size else (values, joint)
    gain = covariance[np.ix_(free, held)] @ np.linalg.inv(covariance[np.ix_(held, held)])
    values[free] = mean[free] - gain @ mean[held]
    prior = known[np.ix_(held, held)]
    rest = covariance[np.ix_(free, free)] - gain @ covariance[np.ix_(held, free)]
    joint[np.ix_(free, free)] = rest + gain @ prior @ gain.T
    joint[np.ix_(free, held)] = gain @ prior
    joint[np.ix_(held, free)] = joint[np.ix_(free, held)].T
    return values, joint


def linked(covariance: Array, told: Mask, able: Sequence[bool]) -> Mask:
    """Which parameters are written with their covariance, shape (n,): the told, and of the `able` others those that a told
    one hangs on."""
    sigmas = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance) / np.outer(sigmas, sigmas)
    return told | (np.array(able, dtype=bool) & (correlation[:, told] > LINKED).any(axis=1))

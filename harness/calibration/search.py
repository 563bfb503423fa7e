"""The most likely parameters of healthy runs: a robust fit, from several starts."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from harness.inference.explain import learn
from harness.inference.problem import Fit, Problem
from harness.inference.run import Run

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WEAK = 0.05
"""Information of the data on a parameter, in those of its prior, below which it is not searched: it stays where it is."""
STARTS, REACH, SEED = 5, 1.5, 20230612
"""Starts beside the values of the file, and how far they may be from these, in standard deviations."""
NEAR = 30.0
"""How far the cost of a start, after a step, may be above the best's for the search to go on from there."""
LEARNT, SETTLED = 3, 0.5
"""Most times that noise and gap are learnt, and the step of all parameters, in standard deviations after the fit, that ends it."""
LOSS = 3.0
"""Robust standard deviations from which the loss is rather linear than quadratic."""
LATER = 8
"""Linearisations of a fit that starts where another has ended."""


def search(problem: Problem, on_step: Callable[[str], object] = lambda text: None) -> tuple[Fit, list[float]]:
    """The best fit of all parameters and nuisances without a fault, its noise and gap learnt; and how far the costs of the
    other starts that were searched to their end are above its own."""
    own = problem.unknowns
    on_step("fitting")
    start = problem.aligned(problem.start)
    first = problem.linear(start, own.mask())
    problem.mark_dead(first)
    told = _informative(problem, first)
    fit = problem.solve(start, own.mask() & told)
    fit = learnt(problem, fit, told, on_step)
    best, others = _elsewhere(problem, fit, own.mask() & told, on_step)
    return (fit if best is fit else learnt(problem, best, told, on_step)), others


def learnt(problem: Problem, fit: Fit, told: Mask, on_step: Callable[[str], object]) -> Fit:
    """The fit with noise, gap and weights as it leaves them itself."""
    part = problem.unknowns.parameters
    for _ in range(LEARNT):
        on_step("learning the noise")
        before = fit.u
        learn(problem, fit.u)
        soften(problem, fit.u)
        fit = problem.solve(fit.u, problem.unknowns.mask() & told, most=LATER)
        sigmas = np.sqrt(np.diag(fit.covariance())[part])
        if np.all(np.abs(fit.u - before)[part] <= SETTLED * sigmas):
            break
    return fit


def _informative(problem: Problem, fit: Fit) -> Mask:
    """Everything but the parameters that the data hardly move, shape (size,)."""
    told, part = np.ones(problem.unknowns.size, dtype=bool), problem.unknowns.parameters
    told[part] = np.diag(fit.data)[part] >= WEAK
    return told


def soften(problem: Problem, u: Array) -> None:
    """Give rows less weight the further they are off: soft-L1, as iteratively reweighted least squares (Huber and Ronchetti,
    Robust Statistics, 7.8). A residual z counts 2*(sqrt(1 + z^2) - 1), z in units of LOSS robust deviations."""
    for r, run in enumerate(problem.runs):
        rest = problem.rest(u, r)
        for k in range(rest.shape[1]):
            run.weight[:, k] = np.where(run.weight[:, k] > 0.0, _weights(run, rest[:, k], k), 0.0)


def _weights(run: Run, rest: Array, k: int) -> Array:
    used = run.weight[:, k] > 0.0
    off = rest - np.median(rest[used])
    usual = max(1.4826 * float(np.median(np.abs(off[used]))), float(run.measured.quanta[k]), 1e-5 * float(run.spans[k]))
    return np.asarray((1.0 + (off / (LOSS * usual)) ** 2) ** -0.25)


def _elsewhere(problem: Problem, best: Fit, free: Mask, on_step: Callable[[str], object]) -> tuple[Fit, list[float]]:
    """The best of searches that start elsewhere: from each start a step, and to the end from where that has come near, or,
    if the logs are slow and the cost rough, from all. And the costs of those that ended, less the best's."""
    own, rng = problem.unknowns, np.random.default_rng(SEED)
    slow = any(run.measured.is_slow for run in problem.runs)
    part = np.flatnonzero(free & ~problem.dead)
    part = part[(part >= own.parameters.start) & (part < own.parameters.stop)]
    ends = [best]
    for n in range(STARTS):
        on_step(f"start {n + 1} of {STARTS}")
        u = best.u.copy()
        u[part] = own.mean[part] + np.clip(rng.standard_normal(part.size), -REACH, REACH)
        u = problem.aligned(np.clip(u, own.low, own.high))
        if not slow:
            u, cost = _stepped(problem, u, free)
            if cost > best.cost + NEAR:
                continue
        ends.append(problem.solve(u, free, most=LATER))
    first = min(ends, key=lambda fit: fit.cost)
    return first, [fit.cost - first.cost for fit in ends if fit is not first]


def _stepped(problem: Problem, u: Array, free: Mask) -> tuple[Array, float]:
    """The place a step of Gauss and Newton ahead, and its cost."""
    own = problem.unknowns
    try:
        fit = problem.linear(u, free)
        ahead = np.clip(fit.newton(free & ~problem.dead), own.low, own.high)
    except np.linalg.LinAlgError:
        return u, np.inf
    return ahead, problem.cost(ahead)

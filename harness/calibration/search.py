"""The most likely parameters of healthy runs: a robust fit, from several starts."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from harness.inference.explain import learn
from harness.inference.noise import about_median
from harness.inference.problem import LATER, Fit, Problem
from harness.inference.run import Run
from harness.inference.sensors import GAIN, LAG, NUISANCES, SHIFT

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WEAK = 0.05
"""Information of the data on a parameter, in those of its prior, below which it is not searched: it stays where it is."""
STARTS, REACH, SEED = 5, 1.5, 20230612
"""Starts beside the values of the file, and how far they may be from these, in standard deviations."""
SHIFTS = (0.3, 0.6, 0.0, -0.3)
"""Shifts in time that starts of slow logs have, in the bounds of these."""
NEAR = 30.0
"""How far the cost of a start, after a step, may be above the best's for the search to go on from there."""
LEARNT, SETTLED = 2, 0.5
"""Most times that noise and gap are learnt, and the step of all parameters, in their standard deviations, that ends it."""
LOSS = 3.0
"""Robust standard deviations from which the loss is rather linear than quadratic."""
ALIGNED = 3
"""Ends of searches of slow logs that are aligned once more, and searched on."""


def search(problem: Problem, on_step: Callable[[str], object] = lambda text: None) -> tuple[Fit, list[float]]:
    """The best fit of all parameters and nuisances without a fault, its noise and gap learnt; and how far what the other
    starts left is above what it left, as parts of it, for those that were searched to their end."""
    on_step("fitting")
    start = problem.aligned(problem.start)
    first = problem.linear(start, unknown(problem))
    problem.mark_dead(first)
    told = _informative(problem, first)
    if any(run.measured.is_slow for run in problem.runs):
        place, others = _from_all(problem, unknown(problem) & told, on_step)
        return learnt(problem, place, told, on_step), others
    fit = learnt(problem, problem.solve(start, unknown(problem) & told), told, on_step)
    best, others = _elsewhere(problem, fit, unknown(problem) & told, on_step)
    return (fit if best is fit else learnt(problem, best, told, on_step)), others


def unknown(problem: Problem) -> Mask:
    """What is unknown of healthy runs, shape (size,): parameters and nuisances; but where rows are so far apart that a shift
    in time is, no low-pass and no gain, which such rows do not tell from it and from the parameters."""
    free = problem.unknowns.mask()
    for run, place in zip(problem.runs, problem.unknowns.nuisances, strict=True):
        nuisances = free[place].reshape(run.sensors.count, len(NUISANCES))
        slow = run.measured.shift_bounds > 0.0
        nuisances[slow, LAG], nuisances[slow, GAIN] = False, False
        free[place] = nuisances.ravel()
    return free


def learnt(problem: Problem, fit: Fit, told: Mask, on_step: Callable[[str], object]) -> Fit:
    """The fit with noise, gap and weights as it leaves them itself."""
    part = problem.unknowns.parameters
    for _ in range(LEARNT):
        on_step("learning the noise")
        before = fit.u
        learn(problem, fit.u)
        soften(problem, fit.u)
        fit = problem.solve(fit.u, unknown(problem) & told, most=LATER)
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
    off, own = about_median(rest, run.weight[:, k] > 0.0)
    usual = max(own, float(run.measured.quanta[k]), 1e-5 * float(run.spans[k]))
    return np.asarray((1.0 + (off / (LOSS * usual)) ** 2) ** -0.25)


def _elsewhere(problem: Problem, best: Fit, free: Mask, on_step: Callable[[str], object]) -> tuple[Fit, list[float]]:
    """The best of searches that start elsewhere, to the end where the first step has come near; and the costs of those that
    ended."""
    ends = [best]
    for n, u in enumerate(_starts(problem, best.u, free)):
        on_step(f"start {n + 1} of {STARTS}")
        u, cost = _stepped(problem, u, free)
        if cost < best.cost + NEAR:
            ends.append(problem.solve(u, free, most=LATER))
    first = min(ends, key=lambda fit: fit.cost)
    return first, [(fit.cost - first.cost) / first.cost for fit in ends if fit is not first]


def _starts(problem: Problem, u: Array, free: Mask) -> list[Array]:
    """Places like `u` with the parameters that are `free` drawn around what was known of them."""
    own, rng = problem.unknowns, np.random.default_rng(SEED)
    part = np.flatnonzero(free & ~problem.dead)
    part = part[(part >= own.parameters.start) & (part < own.parameters.stop)]
    places = []
    for _ in range(STARTS):
        place = u.copy()
        place[part] = own.mean[part] + np.clip(rng.standard_normal(part.size), -REACH, REACH)
        places.append(np.clip(place, own.low, own.high))
    return places


def _from_all(problem: Problem, free: Mask, on_step: Callable[[str], object]) -> tuple[Fit, list[float]]:
    """The best of searches of slow logs, from what was known before and from elsewhere, each with shifts in time that are
    aligned, or all alike: a shift that is a row's part off makes a valley of its own. Each has the noise that it leaves; the
    best are aligned once more where they have ended."""
    elsewhere = _starts(problem, problem.start, free)
    places = [problem.aligned(place) for place in (problem.start, *elsewhere[: STARTS // 2])]
    places += [_shifted(problem, place, part) for place, part in zip(elsewhere, SHIFTS, strict=False)]
    noises = [list(run.noises) for run in problem.runs]
    ends: list[tuple[float, Fit]] = []
    for n, place in enumerate(places):
        on_step(f"start {n + 1} of {len(places)}")
        for run, own in zip(problem.runs, noises, strict=True):
            run.noises, run.weight = list(own), run.kept.astype(float)
        ends.append(_ended(problem, problem.solve(place, free).u, free))
    ends.sort(key=lambda end: end[0])
    for n, (_, fit) in enumerate(ends[:ALIGNED]):
        on_step(f"end {n + 1} of {ALIGNED}")
        ends.append(_ended(problem, problem.aligned(fit.u), free))
    ends.sort(key=lambda end: end[0])
    return ends[0][1], [float(np.expm1(left - ends[0][0])) for left, _ in ends[1 : len(places)]]


def _ended(problem: Problem, u: Array, free: Mask) -> tuple[float, Fit]:
    """What a search from `u` leaves over, with the noise that `u` leaves, and where it ends."""
    for r, run in enumerate(problem.runs):
        run.learn(problem.rest(u, r))
    soften(problem, u)
    fit = problem.solve(u, free, most=LATER)
    return _left_over(problem, fit.u), fit


def _shifted(problem: Problem, u: Array, part: float) -> Array:
    """`u` with all shifts of slow channels at this part of their bounds."""
    out = u.copy()
    for r, run in enumerate(problem.runs):
        scales = problem.unknowns.nuisance_scales(r)
        view = out[problem.unknowns.nuisances[r]].reshape(scales.shape)
        slow = run.measured.shift_bounds > 0.0
        view[slow, SHIFT] = (part * run.measured.shift_bounds / scales[:, SHIFT])[slow]
    return out


def _left_over(problem: Problem, u: Array) -> float:
    """Mean of the logarithms of what is left of each channel, in its range, without its outliers: the likelihood of noise
    that is not known (Seber and Wild, Nonlinear Regression, 2.2), the rows of all taken for one each."""
    logs: list[float] = []
    for r, run in enumerate(problem.runs):
        rest = problem.rest(u, r)
        for k in range(rest.shape[1]):
            used = run.weight[:, k] > 0.0
            logs.append(0.5 * float(np.log(np.mean((rest[used, k] * run.weight[used, k]) ** 2))))
    return float(np.mean(logs))


def _stepped(problem: Problem, u: Array, free: Mask) -> tuple[Array, float]:
    """The place a step of Gauss and Newton ahead, and its cost."""
    own = problem.unknowns
    try:
        fit = problem.linear(u, free)
        ahead = np.clip(fit.newton(free & ~problem.dead), own.low, own.high)
    except np.linalg.LinAlgError:
        return u, np.inf
    return ahead, problem.cost(ahead)

"""The explanations of runs: the fit of everything, and the sets of faults that fit as well with fewer.

The fit of everything teaches the noise and the gap to the judge. The sets of faults are ranked by its quadratic; the best are
fitted anew with the same noise, then those with one fault less, and at last the near ones from where the best has arrived,
for stiction makes the cost rough.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2

from harness.inference import coordinates
from harness.inference.evidence import ALIKE, Faults, Profile, penalised, probabilities
from harness.inference.left import Left, left
from harness.inference.problem import Fit, Problem
from harness.inference.sensors import NUISANCES
from harness.inference.starts import starts
from harness.inference.unknowns import N_FAULTS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

EXPLAINED = 0.003
"""Rest of a channel, as a fraction of its range, that counts as explained: three times what HF's plant leaves to ELF+ with any
of the faults in an unsaturated run (ours)."""
SETTLED = 0.5 * EXPLAINED
"""Rest up to which a search is not begun again elsewhere: a false minimum of a shaft that sticks may leave as little as
EXPLAINED (ours)."""
RIPPLE = 0.01
"""Window [s] over which the judge's difference from the model is averaged: many periods of the inverter, few of a run."""
FLIGHTS, HAIR = 4, 1e-9
"""Flights of the judge that are averaged, and by how much their faults differ, in spans: the ripple of hysteresis control is
chaotic in rounding, and is drawn anew by each."""
LEARNT = 4
"""Most times that noise and gap are learnt: until the best explanation stays the same."""
REFITTED, REACH = 3, 20.0
"""Sets of faults that are fitted anew, and how far their cost may be above the best's."""
NEAR = 10.0
"""How far the cost of a set of faults may be above the best's for it to be tried once more from where the best has arrived."""
CHEAP = 4.0 * REACH
"""What a fault may gain, by the quadratic, for it to be worth looking whether it can be left out."""
LATER = 8
"""Linearisations of a fit that starts where another has ended."""
SWITCH_PENALTY = float(chi2.isf(1e-3, 2))
"""What a low-pass of second order has to gain over one of first order."""


@dataclass(frozen=True)
class Explanation:
    """A set of faults that explains the runs, with its penalised -2 log likelihood."""

    cost: float
    faults: Faults
    fit: Fit = field(repr=False)


@dataclass
class Explained:
    """What the runs say: `explanations`, best first; the `probability` of each fault; the unknown `loads` (constant, spline)
    that the runs need; and the quadratic `around` the best explanation over everything."""

    problem: Problem
    explanations: list[Explanation]
    probability: dict[str, float]
    loads: tuple[str, ...]
    around: Fit

    @property
    def best(self) -> Explanation:
        """The best explanation."""
        return self.explanations[0]

    @property
    def alternatives(self) -> list[Explanation]:
        """Explanations that cannot be told from the best."""
        return [other for other in self.explanations[1:] if other.cost < self.best.cost + ALIKE]


def what_is_left(problem: Problem, u: Array) -> list[Left]:
    """What is left of each run at `u`."""
    out = []
    for r, run in enumerate(problem.runs):
        seen = problem.seen(u, r)
        out.append(left(run, seen - run.data, seen))
    return out


def worst(problem: Problem, u: Array) -> float:
    """The most that is left of any channel, as a fraction of its range."""
    return max(float(each.unexplained.max()) for each in what_is_left(problem, u))


def largest(
    problem: Problem, faults: Sequence[str], on_step: Callable[[str], object] = lambda text: None
) -> tuple[Fit, tuple[str, ...]]:
    """The fit of all `faults` with everything else, with the order of the low-pass and the loads that the runs show; and the
    loads."""
    on_step("fitting everything")
    best = problem.solve(problem.aligned(problem.start), problem.unknowns.mask(faults))
    problem.mark_dead(best)
    best, loads = _with_loads(problem, best, faults)
    free = problem.unknowns.mask(faults, loads)
    if faults and (any(run.measured.is_slow for run in problem.runs) or worst(problem, best.u) > SETTLED):
        on_step("searching elsewhere")
        best = _elsewhere(problem, best, free)
    return _order_of_lag(problem, best, free), loads


def _with_loads(problem: Problem, best: Fit, faults: Sequence[str]) -> tuple[Fit, tuple[str, ...]]:
    """The fit with the unknown loads that the runs need: by a score test (Rao 1948) of a constant one, then of one that
    varies, while something is left unexplained."""
    loads: tuple[str, ...] = ()
    for more in ("constant", "spline"):
        if worst(problem, best.u) <= EXPLAINED:
            break
        free = problem.unknowns.mask(faults, (*loads, more))
        if not (free & ~best.free).any():
            break
        at = problem.linear(best.u, free)
        added = free & ~problem.dead
        gained = best.cost - _quadratic(at, added)
        degrees = int((free & ~best.free).sum())
        if gained < float(chi2.isf(1e-4, degrees)):
            continue
        other = problem.solve(best.u, free)
        if other.cost < best.cost - float(chi2.isf(1e-4, degrees)):
            best, loads = other, (*loads, more)
    return best, loads


def _quadratic(fit: Fit, free: Mask) -> float:
    """The least cost that the quadratic of a fit has over `free`."""
    chosen = np.flatnonzero(free)
    gradient = fit.gradient[chosen]
    return fit.cost - float(gradient @ np.linalg.solve(fit.hessian[np.ix_(chosen, chosen)], gradient))


def _elsewhere(problem: Problem, best: Fit, free: Mask) -> Fit:
    """The best of searches that start elsewhere, and in the end where evolution has led, if `best` is a false minimum."""
    slow = any(run.measured.is_slow for run in problem.runs)
    for start in starts(problem, best.u):
        other = problem.solve(start, free)
        best = min(best, other, key=lambda fit: fit.cost)
        if not slow and worst(problem, best.u) <= SETTLED:
            break
    return best


def _order_of_lag(problem: Problem, best: Fit, free: Mask) -> Fit:
    """The fit with low-passes of second order, if that is clearly better."""
    if not any(
        problem.unknowns.nuisances_of(best.u, r)[:, NUISANCES.index("lag")].max() > 2e-4 for r in range(len(problem.runs))
    ):
        return best
    for run in problem.runs:
        run.order = 2
    other = problem.solve(best.u, free)
    if other.cost < best.cost - SWITCH_PENALTY:
        return other
    for run in problem.runs:
        run.order = 1
    return best


def update_gap(problem: Problem, u: Array, r: int) -> None:
    """Compare the judge of run `r` with the model at `u`."""
    run = problem.runs[r]
    if run.judge is None:
        return
    setting = problem.setting(u, r)
    own = run.model.fly(setting)
    beside = []
    for n in range(FLIGHTS):
        other = u.copy()
        other[:N_FAULTS] = np.clip(
            u[:N_FAULTS] + n * HAIR, problem.unknowns.low[:N_FAULTS], problem.unknowns.high[:N_FAULTS]
        )
        beside.append(problem.setting(other, r))
    flights = run.judge.fly_all(beside)
    width = max(1, round(RIPPLE / run.measured.trial.step))
    apart = uniform_filter1d(np.mean(flights, axis=0) - own, width, axis=0)
    shifts = np.zeros(apart.shape[1])
    run.gap = run.measured.observer.rows(apart, shifts)


def learn(problem: Problem, u: Array) -> None:
    """Learn noise and gap of all runs from what is left at `u`."""
    for r, run in enumerate(problem.runs):
        run.learn(problem.rest(u, r))
        update_gap(problem, u, r)


def explain(problem: Problem, faults: Sequence[str], on_step: Callable[[str], object] = lambda text: None) -> Explained:
    """The explanations of the problem's runs by any of the `faults`."""
    around, loads = largest(problem, faults, on_step)
    own = problem.unknowns
    free = own.mask(faults, loads)
    profile = Profile.of(around, own.low, own.high)
    chosen = profile.ranked()[0][1]
    u = problem.solve(profile.place(chosen), own.mask(chosen, loads), most=LATER).u
    found: dict[Faults, Fit] = {}
    for _ in range(LEARNT):
        on_step("learning the noise")
        learn(problem, u)
        free = own.mask(faults, loads)
        fit = problem.solve(u, own.mask(chosen, loads), most=LATER)
        around = problem.linear(fit.u, free)
        profile = Profile.of(around, own.low, own.high)
        ranked = profile.ranked()
        on_step("weighing explanations")
        found = _refitted(problem, profile, ranked, {chosen: fit}, loads)
        before, chosen = chosen, _best(found)
        u = found[chosen].u
        if chosen == before:
            break
    around = problem.linear(u, free)
    explanations = sorted(
        (Explanation(penalised(fit.cost, chosen), chosen, fit) for chosen, fit in found.items()), key=lambda item: item.cost
    )
    weighed = {chosen: cost for cost, chosen in ranked} | {item.faults: item.cost for item in explanations}
    probability = probabilities(sorted((cost, chosen) for chosen, cost in weighed.items()))
    return Explained(problem, explanations, probability, loads, around)


def _best(found: dict[Faults, Fit]) -> Faults:
    return min(found, key=lambda chosen: penalised(found[chosen].cost, chosen))


def _refitted(
    problem: Problem, profile: Profile, ranked: list[tuple[float, Faults]], found: dict[Faults, Fit], loads: Sequence[str]
) -> dict[Faults, Fit]:
    """The best of the sets of faults, each fitted anew; `found` holds the one around which the quadratic was taken."""

    def refit(chosen: Faults, u: Array) -> None:
        fit = problem.solve(u, problem.unknowns.mask(chosen, loads), most=LATER)
        if chosen not in found or fit.cost < found[chosen].cost:
            found[chosen] = fit

    for cost, chosen in ranked[:REFITTED]:
        if cost <= ranked[0][0] + REACH and chosen not in found:
            refit(chosen, profile.place(chosen))
    _with_one_less(found, refit)
    for chosen in list(found):
        first = _best(found)
        if chosen != first and penalised(found[chosen].cost, chosen) < penalised(found[first].cost, first) + NEAR:
            at = found[first]
            gone = [name for name in first if name not in chosen]
            subset = set(chosen) < set(first)
            refit(chosen, _without(at, gone) if subset else np.r_[found[chosen].u[:N_FAULTS], at.u[N_FAULTS:]])
    return found


def _with_one_less(found: dict[Faults, Fit], refit: Callable[[Faults, Array], None]) -> None:
    """Leave out, one at a time, each fault of the best explanation that may not be needed."""
    for _ in range(4):
        chosen, new = _best(found), False
        fit = found[chosen]
        covariance = fit.covariance()
        for out in chosen:
            places, less = coordinates.PLACES[out], tuple(name for name in chosen if name != out)
            gain = fit.u[places] @ np.linalg.solve(covariance[np.ix_(places, places)], fit.u[places])
            if less not in found and gain < CHEAP:
                new = True
                refit(less, _without(fit, [out]))
        if not new:
            break


def _without(fit: Fit, faults: Sequence[str]) -> Array:
    """The place of a fit with these faults healthy, and all else that is free where the quadratic says it follows."""
    out = np.array([place for name in faults for place in coordinates.PLACES[name]], dtype=int)
    others, u = np.setdiff1d(np.flatnonzero(fit.free), out), fit.u.copy()
    if others.size and out.size:
        u[others] += np.linalg.solve(fit.hessian[np.ix_(others, others)], fit.hessian[np.ix_(others, out)] @ u[out])
    u[out] = 0.0
    return u

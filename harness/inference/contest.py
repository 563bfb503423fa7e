"""The contest of explanations: sets of faults, each fitted with the judge's gap to the model where it lies itself.

A model with the gap of its own place is the judge there, to first order; compared with the gap of another's place, an
explanation would be held to that one's errors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from harness.faults import FAULTS
from harness.inference import coordinates
from harness.inference.evidence import ALIKE, PENALTIES, ROUGH, Faults, Profile, penalised, rarity, tellable
from harness.inference.gap import update_gap
from harness.inference.problem import ENOUGH, LATER, Fit, Problem
from harness.inference.unknowns import N_FAULTS, Load

Array = NDArray[np.float64]

REFITTED, REACH = 3, 20.0
"""Sets of faults that are fitted anew, and how far their cost may be above the best's."""
NEAR = 10.0
"""How far the cost of a set of faults may be above the best's for it to be tried once more from where the best has
arrived."""
CHEAP = 4.0 * REACH
"""What a fault may gain, by the quadratic, for it to be worth looking whether it can be left out."""
SWAPPED = 2
"""Other faults that each fault of the best explanation is exchanged for."""
SCANNED_IN, SCANNED = ("mechanics.T_static",), (-2.0, -1.5, -1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)
"""Parameters in which the cost is rough, and their values that are tried, in standard deviations."""
STRETCHED = (1.25, 1.5, 2.0)
"""Times as large as it was found, that a rare fault is tried."""
MOST_LESS = 6
"""Rounds in which faults are left out."""
MOVED, MOST_GAPS = 0.02, 6
"""Move of a fault, in spans, from which the gap is taken anew, and how often at most."""


@dataclass(frozen=True)
class Explanation:
    """A set of faults that explains the runs: `gaps`: the judge's difference from the model there, of each run."""

    faults: Faults
    fit: Fit = field(repr=False)
    gaps: tuple[Array | None, ...] = field(repr=False)


class Contest:
    """Explanations of a problem's runs with the noise and an unknown `load` as they are."""

    def __init__(self, problem: Problem, load: Load) -> None:
        self.problem, self.load = problem, load
        self.entries: dict[Faults, Explanation] = {}
        self.penalties: Mapping[str, float] = PENALTIES

    @property
    def best(self) -> Explanation:
        """The best so far."""
        return min(self.entries.values(), key=self.cost)

    def cost(self, item: Explanation) -> float:
        """Its penalised -2 log likelihood."""
        return penalised(item.fit.cost, item.faults, self.penalties)

    def enter(self, faults: Faults, u: Array) -> None:
        """Fit these faults from `u`, with the gap where the fit ends; the better of this and what was found before is
        kept."""
        free = self.problem.unknowns.mask(faults, self.load)
        fit = self._scanned(self.problem.solve(u, free, most=LATER))
        hopeless = bool(self.entries) and penalised(fit.cost, faults, self.penalties) > self.cost(self.best) + REACH
        if not hopeless:
            fit = self._with_own_gap(fit)
            for name in faults:
                if FAULTS[name].rare and not FAULTS[name].alone:
                    fit = self._stretched(fit, name)
        found = Explanation(faults, fit, tuple(run.gap for run in self.problem.runs))
        if faults not in self.entries or fit.cost < self.entries[faults].fit.cost:
            self.entries[faults] = found

    def _with_own_gap(self, fit: Fit) -> Fit:
        """The fit with the gap where it ends."""
        for _ in range(MOST_GAPS):
            at = fit.u
            self._take_gaps(at)
            fit = self.problem.solve(at, fit.free, most=LATER)
            if np.max(np.abs(fit.u[:N_FAULTS] - at[:N_FAULTS])) <= MOVED:
                break
        return fit

    def _stretched(self, fit: Fit, name: str) -> Fit:
        """The fit, or a better one where this fault is larger. To some that are rare the judge answers in another way than
        the model: with the gap of where it was, each fit is then drawn to where the gap was taken, short of the truth."""
        others = fit.free.copy()
        others[coordinates.PLACES[name]] = False
        for factor in STRETCHED:
            gaps, u = [run.gap for run in self.problem.runs], fit.u.copy()
            u[coordinates.PLACES[name]] *= factor
            u = np.clip(u, self.problem.unknowns.low, self.problem.unknowns.high)
            self._take_gaps(u)
            beside = self.problem.solve(u, others, most=LATER)
            if beside.cost < fit.cost - ROUGH:  # less is the chance of the judge's flights
                return self._stretched(self._with_own_gap(self.problem.solve(beside.u, fit.free, most=LATER)), name)
            for run, gap in zip(self.problem.runs, gaps, strict=True):
                run.gap = gap
        return fit

    def _take_gaps(self, u: Array) -> None:
        for r in range(len(self.problem.runs)):
            update_gap(self.problem, u, r)

    def _scanned(self, fit: Fit) -> Fit:
        """The fit, or a better one from other values of what is SCANNED_IN: there slopes do not tell where to go."""
        own = self.problem.unknowns
        for name in SCANNED_IN:
            if name not in own.prior.names:
                continue
            at = own.parameters.start + own.prior.names.index(name)
            beside = [fit.u.copy() for _ in SCANNED]
            for u, value in zip(beside, SCANNED, strict=True):
                u[at] = min(max(value, own.low[at]), own.high[at])
            costs = self.problem.costs(beside)
            best = int(np.argmin(costs))
            if costs[best] < fit.cost - ENOUGH:
                fit = min(fit, self.problem.solve(beside[best], fit.free, most=LATER), key=lambda each: each.cost)
        return fit

    def use(self, item: Explanation) -> None:
        """Take the gaps of an explanation."""
        for run, gap in zip(self.problem.runs, item.gaps, strict=True):
            run.gap = gap

    def profile(self, able: Sequence[str]) -> Profile:
        """The quadratic around the best, over all faults that are `able`, with its gaps, which stay in use."""
        own = self.problem.unknowns
        self.use(self.best)
        free = own.mask((*able, *self.best.faults), self.load)
        return Profile.of(self.problem.linear(self.best.fit.u, free, blocks=True), own.low, own.high)

    @property
    def near(self) -> list[Explanation]:
        """The best and those that come near it, whether their faults are rare or not; best first."""

        def plain(item: Explanation) -> float:
            return self.cost(item) - rarity(item.faults)

        def comes_near(item: Explanation) -> bool:
            within = ROUGH if any(FAULTS[name].alone for name in item.faults) else NEAR
            return plain(item) <= plain(self.best) + within

        return sorted(filter(comes_near, self.entries.values()), key=self.cost)

    def held(self, able: Sequence[str], *, again: bool) -> tuple[Profile, list[tuple[float, Faults]]]:
        """Hold the contest: enter what the quadratic ranks first, the best with one fault exchanged, and with one less; if
        `again`, only what it ranks before the best of those that have come near. The quadratic, and its ranking."""
        profile = self.profile(able)
        self.penalties = profile.penalties
        ranked = profile.ranked()
        first = self.best
        most = self.cost(first) if again else ranked[0][0] + REACH
        for cost, faults in ranked[:REFITTED]:
            if cost <= most and faults not in self.entries:
                self._enter_beside(first, faults, profile.place(faults))
        if again and self.best is first:
            self.use(first)
            return profile, ranked
        self._exchange(profile)
        self._with_one_less()
        for item in list(self.entries.values()):
            best = self.best
            if item is not best and self.cost(item) < self.cost(best) + NEAR:
                gone = [name for name in best.faults if name not in item.faults]
                subset = set(item.faults) < set(best.faults)
                place = without(best.fit, gone) if subset else np.r_[item.fit.u[:N_FAULTS], best.fit.u[N_FAULTS:]]
                self._enter_beside(best, item.faults, place)
        self.use(self.best)
        return profile, ranked

    def _enter_beside(self, other: Explanation, faults: Faults, u: Array) -> None:
        self.use(other)
        self.enter(faults, u)

    def _exchange(self, profile: Profile) -> None:
        """Try each fault of the best explanation exchanged for those that move much the same."""
        best = self.best
        for out in best.faults:
            twins = [name for name in FAULTS if FAULTS[name].alone == out]
            for other in (*twins, *profile.confusable(out)[:SWAPPED]):
                faults = tuple(name for name in FAULTS if name == other or (name in best.faults and name != out))
                if other not in best.faults and faults not in self.entries and tellable(faults):
                    place = profile.place(faults) if other in profile.able else without(best.fit, [out])
                    self._enter_beside(best, faults, place)

    def _with_one_less(self) -> None:
        """Leave out, one at a time, each fault of the best explanation that may not be needed; and of each other explanation
        those without which it may come near the best: one that has come from an exchange may hold faults that were needed
        beside what it was exchanged for alone."""
        for _ in range(MOST_LESS):
            best = self.best
            todo = [(out, best) for out in best.faults if self._gain(best, out) < CHEAP]
            for item in self.entries.values():
                todo += [(out, item) for out in item.faults if item is not best and self._promises(item, out)]
            new = [(out, item) for out, item in todo if _without(item, out) not in self.entries]
            if not new:
                break
            for out, item in new:
                if _without(item, out) not in self.entries:
                    self._enter_beside(item, _without(item, out), without(item.fit, [out]))

    def _gain(self, item: Explanation, out: str) -> float:
        """What this fault of an explanation gains, by the quadratic."""
        places = coordinates.PLACES[out]
        covariance = item.fit.covariance()[np.ix_(places, places)]
        return float(item.fit.u[places] @ np.linalg.solve(covariance, item.fit.u[places]))

    def _promises(self, item: Explanation, out: str) -> bool:
        """Whether an explanation without this fault is better, and near the best, by the quadratic."""
        less = self.cost(item) + self._gain(item, out) - self.penalties[out]
        return less < min(self.cost(item), self.cost(self.best) + ALIKE)


def _without(item: Explanation, out: str) -> Faults:
    return tuple(name for name in item.faults if name != out)


def without(fit: Fit, faults: Sequence[str]) -> Array:
    """The place of a fit with these faults healthy, and all else that is free where the quadratic says it follows."""
    out = np.array([place for name in faults for place in coordinates.PLACES[name]], dtype=int)
    others, u = np.setdiff1d(np.flatnonzero(fit.free), out), fit.u.copy()
    if others.size and out.size:
        u[others] += np.linalg.solve(fit.hessian[np.ix_(others, others)], fit.hessian[np.ix_(others, out)] @ u[out])
    u[out] = 0.0
    return u

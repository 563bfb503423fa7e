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
from harness.inference.evidence import PENALTIES, ROUGH, Faults, Profile, penalised, rarity, tellable
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
MOVED = 0.02
"""Move of a fault, in spans, from which the gap is taken anew."""


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
        for _ in range(0 if hopeless else 2):
            at = fit.u
            for r in range(len(self.problem.runs)):
                update_gap(self.problem, at, r)
            fit = self.problem.solve(at, free, most=LATER)
            if np.max(np.abs(fit.u[:N_FAULTS] - at[:N_FAULTS])) <= MOVED:
                break
        found = Explanation(faults, fit, tuple(run.gap for run in self.problem.runs))
        if faults not in self.entries or fit.cost < self.entries[faults].fit.cost:
            self.entries[faults] = found

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
        """Leave out, one at a time, each fault of the best explanation that may not be needed."""
        for _ in range(4):
            best, new = self.best, False
            covariance = best.fit.covariance()
            for out in best.faults:
                places, less = coordinates.PLACES[out], tuple(name for name in best.faults if name != out)
                gain = best.fit.u[places] @ np.linalg.solve(covariance[np.ix_(places, places)], best.fit.u[places])
                if less not in self.entries and gain < CHEAP:
                    new = True
                    self._enter_beside(best, less, without(best.fit, [out]))
            if not new:
                break


def without(fit: Fit, faults: Sequence[str]) -> Array:
    """The place of a fit with these faults healthy, and all else that is free where the quadratic says it follows."""
    out = np.array([place for name in faults for place in coordinates.PLACES[name]], dtype=int)
    others, u = np.setdiff1d(np.flatnonzero(fit.free), out), fit.u.copy()
    if others.size and out.size:
        u[others] += np.linalg.solve(fit.hessian[np.ix_(others, others)], fit.hessian[np.ix_(others, out)] @ u[out])
    u[out] = 0.0
    return u

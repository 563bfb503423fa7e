"""What each fault has to gain before it is believed, and how explanations with other faults compare.

A fault enters an explanation if it lowers -2 log likelihood by more than a penalty: the generalised likelihood-ratio test
(Wilks 1938) at a level of FALSE_ALARM in all, shared out among the faults (Bonferroni). Of explanations that fit alike, the
one with fewest faults is so the first.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.stats import chi2

from harness.faults import FAULTS
from harness.inference import coordinates
from harness.inference.problem import Fit
from harness.inference.unknowns import N_FAULTS

Array = NDArray[np.float64]

FALSE_ALARM = 0.01
"""Probability that a healthy run is alarmed, all faults together."""
RARE = 10.0
"""What a rare fault has to gain beyond that, so that of two that fit alike the common one is told first: as much as stiction
makes the cost rough (ours)."""
UNTOLD = 1e6
"""The same of a fault that no averaged model tells from another for certain: the other is told first, and this beside it."""
ALIKE = 6.0
"""Difference of penalised -2 log likelihood up to which explanations are told as alternatives: odds of 20, whether their
faults are rare or not."""
ROUGH = 30.0
"""The same of a fault that no averaged model tells from another: its errors of static friction are as large (ours)."""
BROAD, DEEP, MOST = 24, 12, 5
"""Explanations of one size from which larger ones are made: of two faults, of more; and the most faults of one."""
NEGLIGIBLE = 25.0
"""Difference of cost beyond which an explanation has no weight."""
CLOSE = 0.5
"""Cosine of the angle between what two faults move, all else following, from which one may be taken for the other."""
Faults = tuple[str, ...]


def rarity(faults: Sequence[str]) -> float:
    """What these faults have to gain because they are rare."""
    return sum(UNTOLD if FAULTS[name].alone else RARE if FAULTS[name].rare else 0.0 for name in faults)


def penalty(name: str) -> float:
    """What the fault `name` has to gain in -2 log likelihood."""
    degrees = len(coordinates.PLACES[name])
    return float(chi2.isf(FALSE_ALARM / len(FAULTS), degrees)) + rarity([name])


PENALTIES = {name: penalty(name) for name in FAULTS}


def penalised(cost: float, faults: Sequence[str], penalties: Mapping[str, float] | None = None) -> float:
    """-2 log likelihood with what its faults have to gain: `penalties`, or PENALTIES."""
    return cost + sum((penalties or PENALTIES)[name] for name in faults)


@dataclass(frozen=True)
class Profile:
    """The quadratic of a `fit` in which all faults were free, as a function of the faults alone, all other unknowns where
    they follow: |root z - target|^2 + floor, in scaled coordinates."""

    fit: Fit = field(repr=False)
    root: Array = field(repr=False)
    target: Array = field(repr=False)
    floor: float
    low: Array = field(repr=False)
    high: Array = field(repr=False)
    able: tuple[str, ...]
    penalties: Mapping[str, float] = field(repr=False)

    @classmethod
    def of(cls, fit: Fit, low: Array, high: Array) -> "Profile":
        """`low`, `high`: bounds of all unknowns."""
        z, others = np.arange(N_FAULTS), _others(fit)
        inner = fit.hessian[np.ix_(others, others)]
        cross = fit.hessian[np.ix_(others, z)]
        curvature = fit.hessian[np.ix_(z, z)] - cross.T @ np.linalg.solve(inner, cross)
        follows = np.linalg.solve(inner, fit.gradient[others])
        slope = fit.gradient[z] - cross.T @ follows
        root = np.asarray(np.linalg.cholesky(curvature + 1e-12 * np.eye(N_FAULTS)).T, dtype=np.float64)
        here = fit.u[z]
        target = root @ here - np.linalg.solve(root.T, slope)
        floor = fit.cost - float(np.sum((root @ here - target) ** 2)) - float(fit.gradient[others] @ follows)
        able = tuple(name for name in FAULTS if fit.free[coordinates.PLACES[name]].all())
        return cls(fit, root, target, floor, low[z], high[z], able, _penalties(fit, able))

    def cost(self, faults: Faults) -> tuple[float, Array]:
        """The least cost with these faults alone, and where, shape (n_coordinates,)."""
        places = [place for name in faults for place in coordinates.PLACES[name]]
        z = np.zeros(N_FAULTS)
        if places:
            columns = self.root[:, places]
            found = np.linalg.solve(columns.T @ columns, columns.T @ self.target)
            low, high = self.low[places], self.high[places]
            if (found < low).any() or (found > high).any():
                found = lsq_linear(columns, self.target, (low - 1e-9, high + 1e-9), method="bvls").x
            z[places] = found
        return self.floor + float(np.sum((self.root @ z - self.target) ** 2)), z

    def place(self, faults: Faults) -> Array:
        """Where the least cost with these faults alone is, with all else that follows, shape (size,)."""
        u, others = self.fit.u.copy(), _others(self.fit)
        z = self.cost(faults)[1]
        moved = z - u[:N_FAULTS]
        slope = self.fit.gradient[others] + self.fit.hessian[others, :N_FAULTS] @ moved
        u[others] -= np.linalg.solve(self.fit.hessian[np.ix_(others, others)], slope)
        u[:N_FAULTS] = z
        return u

    def confusable(self, name: str) -> list[str]:
        """The other faults that move what was measured much as `name` does, those that do most so first."""
        curvature = self.root.T @ self.root
        size = np.sqrt(np.diag(curvature))
        alike = np.abs(curvature) / np.outer(size, size)
        own = coordinates.PLACES[name]
        close = {other: float(alike[np.ix_(own, coordinates.PLACES[other])].max()) for other in self.able if other != name}
        return sorted((other for other in close if close[other] > CLOSE), key=lambda other: -close[other])

    def ranked(self) -> list[tuple[float, Faults]]:
        """(penalised cost, faults), best first: all sets of up to two faults, then larger ones made of the best."""
        found: dict[Faults, float] = {}
        curvature, slope = self.root.T @ self.root, self.root.T @ self.target
        most = self.floor + float(self.target @ self.target)

        def bound(faults: Faults) -> float:
            """What the cost is at least: without bounds."""
            places = [place for name in faults for place in coordinates.PLACES[name]]
            gained = slope[places] @ np.linalg.solve(curvature[np.ix_(places, places)], slope[places]) if places else 0.0
            return penalised(most - float(gained), faults, self.penalties)

        def try_all(sets: Sequence[Faults]) -> None:
            """Costs of the sets; of those that cannot come near the best, the bound (it saves four fifths of the time)."""
            bounds = sorted((bound(faults), faults) for faults in set(sets) - set(found) if tellable(faults))
            best = min(found.values(), default=np.inf)
            for least, faults in bounds:
                cost = least
                if least < best + NEGLIGIBLE:
                    cost = penalised(self.cost(faults)[0], faults, self.penalties)
                    best = min(best, cost)
                found[faults] = cost

        for size in range(3):
            try_all(list(combinations(self.able, size)))
        for size in range(3, MOST + 1):
            best = sorted((cost, faults) for faults, cost in found.items() if len(faults) == size - 1)
            grown = [
                tuple(name for name in self.able if name in faults or name == more)
                for _, faults in best[: BROAD if size == 3 else DEEP]
                for more in self.able
                if more not in faults
            ]
            before = min(found.values())
            try_all(grown)
            if min(found.values()) >= before:
                break
        return sorted((cost, faults) for faults, cost in found.items())


def tellable(faults: Faults) -> bool:
    """Whether a run can tell these faults together at all."""
    groups = [fault.group for name in faults if (fault := FAULTS[name]).group]
    many = any(groups.count(group) > group.most for group in groups if group)
    return not many and not any(FAULTS[name].alone in faults for name in faults)


def _penalties(fit: Fit, able: Sequence[str]) -> dict[str, float]:
    """PENALTIES, larger for a fault whose scores scatter more from block to block than the noise says: by the ratio of
    the two (Kent, Biometrika 69 (1982) 19), the other unknowns taken as following."""
    if not len(fit.scores):
        return PENALTIES
    others = _others(fit)
    found = dict(PENALTIES)
    for name in able:
        ratios = [1.0]
        for place in coordinates.PLACES[name]:
            follow = np.linalg.solve(fit.hessian[np.ix_(others, others)], fit.hessian[others, place])
            scores = fit.scores[:, place] - fit.scores[:, others] @ follow
            cross = fit.data[place, others] @ follow
            known = fit.data[place, place] - 2.0 * cross + follow @ fit.data[np.ix_(others, others)] @ follow
            if known > 0.0:
                ratios.append(float(scores @ scores) / float(known))
        found[name] = max(ratios) * (PENALTIES[name] - rarity([name])) + rarity([name])
    return found


def _others(fit: Fit) -> NDArray[np.intp]:
    return np.flatnonzero(fit.free & (np.arange(len(fit.u)) >= N_FAULTS))


def probabilities(ranked: Sequence[tuple[float, Faults]]) -> dict[str, float]:
    """Of each fault that it is there: the weights exp(-cost/2) of the explanations that hold it, over all weights."""
    best = ranked[0][0]
    weights = np.exp(-0.5 * np.array([cost - best for cost, _ in ranked]))
    return {
        name: float(
            sum(weight for weight, (_, faults) in zip(weights, ranked, strict=True) if name in faults) / weights.sum()
        )
        for name in FAULTS
    }

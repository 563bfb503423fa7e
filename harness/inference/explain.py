"""The explanations of runs: the fit of everything, and the sets of faults that fit as well with fewer.

The fit of everything teaches the noise and the gap to the judge. The sets of faults are ranked by its quadratic; the best
are fitted anew with the same noise, then those with one fault less, and at last the near ones from where the best has
arrived, for stiction makes the cost rough."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from harness.faults import FAULTS
from harness.inference import loads
from harness.inference.contest import Contest, Explanation
from harness.inference.evidence import ALIKE, ROUGH, Faults, Profile, probabilities, rarity
from harness.inference.gap import update_scatter
from harness.inference.left import Left, left
from harness.inference.misread import Misread, misread
from harness.inference.problem import LATER, Fit, Problem
from harness.inference.sensors import LAG
from harness.inference.starts import starts
from harness.inference.unknowns import Load

Array = NDArray[np.float64]
OnStep = Callable[[str], object]

EXPLAINED = 0.003
"""Rest of a channel, as a fraction of its range, that counts as explained: three times what HF's plant leaves to ELF+
with any of the faults in an unsaturated run (ours)."""
HOPELESS = 0.02
"""The same from which no set of faults is weighed against another: what was measured is something else (ours)."""
LOST = 0.1
"""The same from which no more than one search is begun elsewhere."""
SETTLED = 0.5 * EXPLAINED
"""Rest up to which a search is not begun again elsewhere: a false minimum of a shaft that sticks may leave as little as
EXPLAINED (ours)."""
LEARNT = 4
"""Most times that noise and gap are learnt: until the best explanation stays the same."""
ORDER_PENALTY = float(chi2.isf(1e-3, 2))
"""What a low-pass of second order has to gain over one of first order."""
SHORT_LAG = 5e-4
"""Time constants [s] of which the order does not show."""
NO_LOAD: Load = "none"


@dataclass(frozen=True)
class Explained:
    """What the runs say: `explanations`, best first, and the `costs` of sets of faults, penalised -2 log likelihood; the
    `probability` of each fault; the unknown `load` that the runs need; and the quadratic `around` the best explanation
    over everything; `misread`: sensors that would explain them without a fault."""

    problem: Problem
    explanations: list[Explanation]
    costs: Mapping[Faults, float]
    probability: dict[str, float]
    load: Load
    around: Fit
    misread: Misread | None = None

    @property
    def best(self) -> Explanation:
        """The best explanation."""
        return self.explanations[0]

    @property
    def alternatives(self) -> list[Explanation]:
        """Explanations that cannot be told from the best, and do not only add to it."""

        def alike(item: Explanation) -> bool:
            within = ROUGH if any(FAULTS[name].alone for name in item.faults) else ALIKE
            near = self.worse(item) < within and item.fit.cost < self.best.fit.cost + 2.0 * within
            return near and not set(self.best.faults) < set(item.faults)

        return [item for item in self.explanations[1:] if alike(item)]

    def worse(self, item: Explanation) -> float:
        """By how much its penalised -2 log likelihood is more than the best's, but for what faults that are rare have to
        gain."""
        own, best = (self.costs[each.faults] - rarity(each.faults) for each in (item, self.best))
        return own - best


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


def everything(problem: Problem, faults: Sequence[str], on_step: OnStep = lambda text: None) -> Fit:
    """The fit of all `faults` with all else, with the order of the low-pass that the runs show."""
    on_step("fitting everything")
    own = problem.unknowns
    common = [name for name in faults if not FAULTS[name].rare]
    best = problem.solve(problem.aligned(problem.start), own.mask(common))
    if faults and (any(run.measured.is_slow for run in problem.runs) or worst(problem, best.u) > SETTLED):
        on_step("searching elsewhere")
        best = _elsewhere(problem, problem.solve(best.u, own.mask(faults)))
    best = _order_of_lag(problem, best)
    around = problem.linear(best.u, own.mask(faults))
    problem.mark_dead(around)
    return around


def _elsewhere(problem: Problem, best: Fit) -> Fit:
    """The best of searches that start elsewhere, if `best` is a false minimum."""
    slow = any(run.measured.is_slow for run in problem.runs)
    for start in starts(problem, best.u):
        best = min(best, problem.solve(start, best.free), key=lambda fit: fit.cost)
        rest = worst(problem, best.u)
        if not slow and (rest <= SETTLED or rest > LOST):
            break
    return best


def _order_of_lag(problem: Problem, best: Fit) -> Fit:
    """The fit with low-passes of second order, if that is clearly better."""
    lags = [problem.unknowns.nuisances_of(best.u, r)[:, LAG].max() for r in range(len(problem.runs))]
    if max(lags) < SHORT_LAG:
        return best
    for run in problem.runs:
        run.order = 2
    other = problem.solve(best.u, best.free)
    if other.cost < best.cost - ORDER_PENALTY:
        return other
    for run in problem.runs:
        run.order = 1
    return best


def learn(problem: Problem, u: Array) -> None:
    """Learn noise and gap of all runs from what is left at `u`."""
    for r, run in enumerate(problem.runs):
        run.learn(problem.rest(u, r))
        update_scatter(problem, u, r)


def explain(problem: Problem, able: Sequence[str], on_step: OnStep = lambda text: None) -> Explained:
    """The explanations of the problem's runs by any of the faults that are `able`, and a load if they need one."""
    faults = [name for name in able if FAULTS[name].alone not in able]
    around, load = everything(problem, faults, on_step), NO_LOAD
    own = problem.unknowns
    profile = Profile.of(around, own.low, own.high)
    chosen = profile.ranked()[0][1]
    u = problem.solve(profile.place(chosen), own.mask(chosen), most=LATER).u
    near: list[Explanation] = []
    hopeless = worst(problem, around.u) > HOPELESS
    looked = hopeless
    for _ in range(LEARNT):
        on_step("learning the noise")
        learn(problem, u)
        contest = Contest(problem, load)
        contest.enter(chosen, u)
        for item in near:
            contest.enter(item.faults, item.fit.u)
        on_step("weighing explanations")
        profile, ranked = contest.held(faults, again=bool(near) or hopeless)
        before, chosen, u, near = (chosen, load), contest.best.faults, contest.best.fit.u, contest.near[1:]
        settled = worst(problem, u) <= SETTLED
        if not looked and (chosen or not settled):
            on_step("looking for a load")
            looked = True
            if loaded := loads.needed(problem, contest, explained=settled):
                (chosen, u, load), near = loaded, []
        if (chosen, load) == before or (hopeless and worst(problem, u) > HOPELESS):
            break
    if chosen != before[0]:
        profile = contest.profile(faults)
    explanations = sorted(contest.entries.values(), key=contest.cost)
    costs = {which: cost for cost, which in ranked} | {item.faults: contest.cost(item) for item in explanations}
    probability = probabilities(sorted((cost, which) for which, cost in costs.items()))
    sensors = None if hopeless else misread(problem, contest)
    return Explained(problem, explanations, costs, probability, contest.load, profile.fit, sensors)

"""Whether a sensor whose factor is far off would explain runs as well as their faults do.

A current sensor that reads some per cent too much looks like weaker magnets; its prior allows it one per cent or two."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from harness.inference.contest import Contest, without
from harness.inference.evidence import ALIKE, penalty, rarity
from harness.inference.gap import update_gap
from harness.inference.problem import LATER, Problem
from harness.inference.sensors import GAIN, GAIN_SIGMA, NUISANCES

WIDE = 0.08
"""Standard deviation of a factor that nobody has calibrated (ours)."""


@dataclass(frozen=True)
class Misread:
    """Factors that explain the runs without any fault: `gains`, the relative error of each channel's in each run that is
    beyond three of GAIN_SIGMA, by its port; `worse`: by how much -2 log likelihood, with what one fault would have to gain,
    is more than that of the faults."""

    gains: Mapping[str, float]
    worse: float


def misread(problem: Problem, contest: Contest) -> Misread | None:
    """Factors of the sensors that explain the runs as well as the faults of the `contest`'s best explanation; None if none
    do, or if there are no faults."""
    best, own = contest.best, problem.unknowns
    if not best.faults:
        return None
    gains = np.concatenate([np.arange(place.start + GAIN, place.stop, len(NUISANCES)) for place in own.nuisances])
    gains, known = gains[best.fit.free[gains]], own.precision
    own.precision = known.copy()
    own.precision[gains, gains] *= (GAIN_SIGMA / WIDE) ** 2
    try:
        u = without(best.fit, best.faults)
        for r in range(len(problem.runs)):
            update_gap(problem, u, r)
        fit = problem.solve(u, own.mask((), contest.load), most=LATER)
    finally:
        own.precision = known
        contest.use(best)
    found: dict[str, float] = {}
    for r, run in enumerate(problem.runs):
        values = own.nuisances_of(fit.u, r)[:, GAIN]
        found |= {name: float(value) for name, value in zip(run.measured.channels, values, strict=True)}
    found = {name: value for name, value in found.items() if abs(value) > 3.0 * GAIN_SIGMA}
    worse = fit.cost + penalty("friction") - (contest.cost(best) - rarity(best.faults))
    return Misread(found, worse) if found and worse < ALIKE else None

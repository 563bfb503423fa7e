"""Whether runs need an unknown load: none, a constant one, or one that varies.

None and a small load differ by a jump, for a load holds the shaft at one flank of its play: no slope at none tells what a
load would do. So loads of either sign are tried."""

from scipy.stats import chi2

from harness.inference.contest import Contest
from harness.inference.evidence import Faults, penalised
from harness.inference.problem import Array, Fit, Problem
from harness.inference.unknowns import Load

LEVEL = 1e-4
"""Level of the test for an unknown load."""
FEW = 5
"""Linearisations of a fit that only has to tell whether there is a load."""
TRIED = 0.5
"""Size of the loads that are tried, in standard deviations."""


def needed(problem: Problem, contest: Contest, *, explained: bool) -> tuple[Faults, Array, Load] | None:
    """The faults, a place and the load to go on from, if the runs are explained better by a load that is more than the
    `contest` had: with the faults of its best explanation, or without any. `explained`: whether that leaves nothing; then
    a load that varies is not looked for."""
    places = [place.start for place in problem.unknowns.loads if place.stop > place.start]
    if not places or contest.load == "varying":
        return None
    noises = [run.noises for run in problem.runs]
    if not explained:  # what the noise has learnt of a load would hide it
        for run in problem.runs:
            run.noises = list(run.white_noises)
    try:
        return _better(problem, contest, places, varying=not explained)
    finally:
        for run, own_noises in zip(problem.runs, noises, strict=True):
            run.noises = own_noises


def _better(problem: Problem, contest: Contest, places: list[int], *, varying: bool) -> tuple[Faults, Array, Load] | None:
    own, best, load = problem.unknowns, contest.best, contest.load
    fit = problem.solve(best.fit.u, own.mask(best.faults, load), most=FEW) if varying else best.fit
    least, found = penalised(fit.cost, best.faults, contest.penalties), None
    for faults in dict.fromkeys((best.faults, ())):
        u = best.fit.u.copy()
        if not faults:
            u[own.faults] = 0.0
        fits = [_from(problem, u, faults, places, sign) for sign in (1.0, -1.0)] if load == "none" else [fit]
        constant = min(fits, key=lambda each: each.cost)
        tries: list[tuple[Fit, Load, int]] = [(constant, "constant", 1)]
        if varying:
            other = problem.solve(constant.u, own.mask(faults, "varying"), most=FEW)
            tries.append((other, "varying", int((other.free & ~constant.free).sum()) + 1))
        for each, kind, degrees in tries:
            cost = penalised(each.cost, faults, contest.penalties) + float(chi2.isf(LEVEL, degrees))
            if kind != load and cost < least:
                least, found = cost, (faults, each.u, kind)
    return found


def _from(problem: Problem, u: Array, faults: Faults, places: list[int], sign: float) -> Fit:
    u = u.copy()
    u[places] = sign * TRIED
    return problem.solve(u, problem.unknowns.mask(faults, "constant"), most=FEW)

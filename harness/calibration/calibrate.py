"""Calibrates an actuator: from measured runs to its parameters with their covariance."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Actuator
from harness.calibration import remarks
from harness.calibration.bench import SCALE, Bench, flown, saturates, scale_is_open, stated_prior
from harness.calibration.result import Calibration, Curves, Inflation, Nuisance, Parameter, Rest
from harness.calibration.search import learnt, search, unknown
from harness.calibration.table import calibrated, kept_sigma
from harness.calibration.told import TOLD, Told, cut, linked, told_by
from harness.inference.explain import what_is_left
from harness.inference.measured import Measured
from harness.inference.prior import Prior
from harness.inference.problem import Problem
from harness.inference.sensors import GAP, NUISANCES, unit_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCE = 0.01
"""Rest of a channel, as a part of its range, that counts as explained: three times that of `ema identify`, for a bench's
sensors are not known beforehand (ours)."""
OF_CURRENT = 3.0
"""What a current may leave, in those: it switches, and slow rows alias that (ours)."""


@dataclass(frozen=True)
class Estimated:
    """What is believed of the parameters: which are `told`, shape (n,); their `values`, shape (n,), in the prior's
    deviations; the `names` of those that hang together, and their `covariance` in the ports' units; and how much that was
    inflated."""

    told: Mask
    values: Array = field(repr=False)
    names: tuple[str, ...]
    covariance: Array = field(repr=False)
    inflation: Inflation


def calibrate(
    measured: Sequence[Measured],
    actuator: Actuator,
    bench: Bench,
    *,
    tolerance: float = TOLERANCE,
    on_step: Callable[[str], object] = lambda text: None,
) -> Calibration:
    """The parameters of `actuator` that have a tolerance, from runs known to be healthy, and without a load that was not
    logged.

    `tolerance`: part of a channel's range that may be left unexplained, and OF_CURRENT times as much of a current's.
    `on_step`: is told what is being done. HarnessError if no parameter has a tolerance, or as from Twin.
    """
    began = time.perf_counter()
    prior = stated_prior(actuator, bench)
    with flown(measured, actuator, bench, prior, on_step) as runs:
        problem = Problem(runs, prior)
        fit, others = search(problem, on_step)
        on_step("uncertainty")
        at_best = problem.unknowns.parameters_of(fit.u)
        saturated = any([saturates(run, {**run.model.parameters, **at_best}, bench) for run in runs])
        scale_open = scale_is_open(prior, runs, saturated)
        found = _estimated(problem, fit.u, actuator, bench, scale_open)
        on_step("nuisances")
        alone = _bench_alone(problem)
        u = learnt(problem, problem.solve(_placed(problem, found.values), alone), alone, on_step).u
        result = _result(problem, u, found, actuator, bench, tolerance)
        lines = [*result.remarks, *_on_search(others, found.inflation)]
        lines += [remarks.SCALE_IS_OPEN] if scale_open else []
        lines += [] if saturated else [remarks.UNSATURATED]
        lines += remarks.rough(fit.unkept)
        result = replace(result, remarks=tuple(lines), seconds=time.perf_counter() - began)
        return replace(result, actuator=calibrated(actuator, result, bench.parameters))


def _estimated(problem: Problem, u: Array, actuator: Actuator, bench: Bench, scale_open: bool) -> Estimated:
    """What the runs tell at the best fit `u`; with an open scale its parameter keeps what was known of it."""
    prior = problem.unknowns.prior
    stated = np.array([name in actuator.tolerances and not (scale_open and name == SCALE) for name in prior.names])
    own_error = np.array([kept_sigma(name, actuator, bench.parameters) > 0.0 for name in prior.names])
    found, told, inflation = _believed(told_by(problem, u), stated, own_error, scale_open)
    known = np.asarray(np.linalg.inv(found.precision))
    values, covariance = cut(found.mean(), found.covariance(), known, told)
    names, joint = _written(prior, covariance, told, actuator, bench)
    return Estimated(told, values, names, joint, inflation)


def _result(problem: Problem, u: Array, found: Estimated, actuator: Actuator, bench: Bench, tolerance: float) -> Calibration:
    """All that is told at `u`, with the remarks on it."""
    runs, rests = problem.runs, _rests(problem, u)
    parameters = _parameters(problem, u, found, actuator)
    return Calibration(
        actuator=actuator,
        fidelity=bench.fidelity.name,
        parameters=parameters,
        linked=found.names,
        covariance=found.covariance,
        nuisances=_nuisances(problem, u, found),
        rests=rests,
        inflation=found.inflation,
        complaints=_complaints(rests, problem, tolerance),
        remarks=tuple(_remarks(problem, u, found, parameters)),
        flights=sum(run.model.count + (run.judge.count if run.judge else 0) for run in runs),
        seconds=0.0,
        curves=tuple(Curves(run.measured, problem.seen(u, r), run.weight.copy()) for r, run in enumerate(runs)),
    )


def _believed(raw: Told, stated: Mask, own_error: Mask, scale_open: bool) -> tuple[Told, Mask, Inflation]:
    """What the runs say as far as it is believed; which of the parameters that are `stated` to have a tolerance they tell,
    shape (n,); and how much less that is than the fit's own noise says: by those without an error of the model's own."""
    told = _tells(raw) & stated & ~own_error
    inflation = Inflation(raw.by_blocks(told), raw.by_runs(told), scale_open)
    found = raw.inflated(inflation.factor)
    return found, _tells(found) & stated, inflation


def _tells(found: Told) -> Mask:
    """Whether the data narrow each parameter clearly, shape (n,)."""
    before = np.diag(np.linalg.inv(found.precision))
    return np.asarray(np.sqrt(np.diag(found.covariance()) / before) < TOLD)


def _placed(problem: Problem, values: Array) -> Array:
    own, u = problem.unknowns, problem.start.copy()
    u[own.parameters] = np.clip(values, own.low[own.parameters], own.high[own.parameters])
    return problem.aligned(u)


def _bench_alone(problem: Problem) -> Mask:
    """The bench's nuisances without the parameters, shape (size,)."""
    free = unknown(problem)
    free[problem.unknowns.parameters] = False
    return free


def _written(prior: Prior, covariance: Array, told: Mask, actuator: Actuator, bench: Bench) -> tuple[tuple[str, ...], Array]:
    """Names of the parameters that are written with their covariance, and that, in the ports' units."""
    places = np.flatnonzero(linked(covariance, told, [name in actuator.tolerances for name in prior.names]))
    names = tuple(prior.names[place] for place in places)
    scales = np.where(prior.sigmas > 0.0, prior.sigmas, 1.0)[places]
    joint = covariance[np.ix_(places, places)] * np.outer(scales, scales)
    kept = np.array(
        [kept_sigma(name, actuator, bench.parameters) if told[prior.names.index(name)] else 0.0 for name in names]
    )
    return names, joint + np.diag(kept**2)


def _parameters(problem: Problem, u: Array, found: Estimated, actuator: Actuator) -> tuple[Parameter, ...]:
    """All that have a tolerance in the file."""
    prior, values, sigmas = problem.unknowns.prior, problem.unknowns.parameters_of(u), np.sqrt(np.diag(found.covariance))
    out = []
    for place, name in enumerate(prior.names):
        if name not in actuator.tolerances:
            continue
        start, before, told = float(prior.values[place]), float(prior.sigmas[place]), bool(found.told[place])
        sigma = float(sigmas[found.names.index(name)]) if name in found.names else before
        reason = "" if told else remarks.not_told(name)
        out.append(Parameter(name, start, before, values[name] if told else start, sigma, told, reason))
    return tuple(out)


def _nuisances(problem: Problem, u: Array, found: Estimated) -> tuple[Nuisance, ...]:
    """Of each channel, with the deviations that they have while the parameters are not known exactly either."""
    own, alone = problem.unknowns, np.flatnonzero(_bench_alone(problem))
    places = [own.prior.names.index(name) for name in found.names]
    free = unknown(problem)
    free[own.parameters][places] = True
    fit = problem.linear(u, free)
    inverse = np.linalg.inv(fit.hessian[np.ix_(alone, alone)])
    follows = inverse @ fit.data[np.ix_(alone, own.parameters.start + np.array(places, dtype=int))]
    known = found.covariance / np.outer(own.scales[places], own.scales[places])
    deviations = np.zeros(own.size)
    deviations[alone] = np.sqrt(np.diag(inverse + follows @ known @ follows.T))
    out = []
    for r, run in enumerate(problem.runs):
        values = own.nuisances_of(u, r)
        sigmas = deviations[own.nuisances[r]].reshape(values.shape) * own.nuisance_scales(r)
        for k, channel in enumerate(run.measured.channels):
            unit = ports.VARIABLES[ports.INDEX[channel]].unit
            for kind, name in enumerate(NUISANCES):
                if kind != GAP or run.gap is not None:
                    value, sigma = float(values[k, kind]), float(sigmas[k, kind])
                    out.append(Nuisance(run.measured.name, channel, name, value, sigma, unit_of(name, unit)))
    return tuple(out)


def _rests(problem: Problem, u: Array) -> tuple[Rest, ...]:
    out = []
    for r, (run, left) in enumerate(zip(problem.runs, what_is_left(problem, u), strict=True)):
        rest = problem.rest(u, r)
        for k, channel in enumerate(run.measured.channels):
            used = run.weight[:, k] > 0.0
            rms = float(np.sqrt(np.mean(rest[used, k] ** 2))) / float(run.spans[k])
            noise = run.noises[k]
            out.append(
                Rest(run.measured.name, channel, rms, float(left.unexplained[k]), noise.sigma, len(noise.coefficients))
            )
    return tuple(out)


def _complaints(rests: Sequence[Rest], problem: Problem, tolerance: float) -> tuple[str, ...]:
    """A line for each channel that is not explained."""
    names = {(run.measured.name, port): own.name for run in problem.runs for port, own in run.measured.shown.items()}
    lines = []
    for item in rests:
        most = tolerance * (OF_CURRENT if "current" in item.channel else 1.0)
        if item.unexplained > most:
            parts = f"{100 * item.unexplained:.2g} % of its range is left ({100 * most:.2g} %)"
            lines.append(f"{item.run}, {names[item.run, item.channel]}: not explained, {parts}")
    return tuple(lines)


def _remarks(problem: Problem, u: Array, found: Estimated, parameters: Sequence[Parameter]) -> list[str]:
    own = problem.unknowns
    part = np.arange(own.parameters.start, own.parameters.stop)[found.told]
    freed = [own.prior.names[place] for place in np.flatnonzero(found.told)]
    lines = [f"{run.measured.name}: {line}" for run in problem.runs for line in run.measured.remarks]
    lines += remarks.at_bound(freed, u[part], own.low[part], own.high[part])
    sigmas = np.sqrt(np.diag(found.covariance))
    lines += remarks.correlated(found.names, found.covariance / np.outer(sigmas, sigmas))
    lines += remarks.off_the_sheet(parameters)
    lines += remarks.not_physical(parameters)
    if not freed:
        lines.append("these runs tell none of the parameters better than the file")
    return list(dict.fromkeys(lines))


def _on_search(others: Sequence[float], inflation: Inflation) -> list[str]:
    lines = []
    if others:
        ends = ", ".join(f"{100 * other:.2g} %" for other in sorted(others))
        lines.append(f"searches from other starts left {ends} more")
    if inflation.factor > 1.0:
        which = "blocks of time" if inflation.blocks >= inflation.runs else "the runs one by one"
        lines.append(f"intervals are {inflation.factor:.3g} times as wide as the noise says: by what {which} say")
    if inflation.runs > remarks.CONTRADICT:
        lines.append(
            f"the logs contradict each other: fitted one by one they differ {inflation.runs:.2g} times as much as their "
            "noise says; are they of one actuator, in one state, with one drive?"
        )
    return lines

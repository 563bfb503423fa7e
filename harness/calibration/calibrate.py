"""Calibrates an actuator: from measured runs to its parameters with their covariance."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Actuator
from harness.calibration import remarks
from harness.calibration.between import decided
from harness.calibration.result import Calibration, Curves, Inflation, Nuisance, Parameter, Rest
from harness.calibration.search import learnt, search, unknown
from harness.calibration.table import calibrated, kept_sigma
from harness.calibration.told import TOLD, Told, cut, linked, told_by
from harness.errors import HarnessError
from ema_fmu_src.fidelities import FIDELITIES, REFERENCE, Fidelity
from harness.flight.twin import Twin
from harness.inference.explain import what_is_left
from harness.inference.flights import Flights
from harness.inference.measured import Measured
from harness.inference.prior import Prior, prior_of
from harness.inference.problem import Problem
from harness.inference.run import LOAD_SHARE, Run
from harness.inference.sensors import GAP, NUISANCES
from harness.logs.shown import value_of
from harness.parameters import merged

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCE = 0.01
"""Rest of a channel, as a part of its range, that counts as explained: three times that of `ema identify`, for a bench's
sensors are not known beforehand (ours)."""
SCALE = "motor.K_e"
"""The parameter that stands for the scale that it has in common with inertia and friction: it keeps what was known of it, and
the others follow it."""
KNOWN = (SCALE, "mechanics.J")
"""Those of which one that is exact tells the scale."""


@dataclass(frozen=True)
class Bench:
    """What runs are flown with: the folder of the `fmus`, the `fidelity` that is fitted, and the `parameters` set for all, by
    port name, over the actuator's; `own`: those set for the run at a place, over these."""

    fmus: Path
    fidelity: Fidelity
    parameters: Mapping[str, float] = field(default_factory=dict)
    own: Mapping[int, Mapping[str, float]] = field(default_factory=dict)

    def parameters_of(self, place: int, actuator: Actuator) -> dict[str, float]:
        """All parameters that are set for the run at `place`."""
        return {**actuator.parameters, **self.parameters, **self.own.get(place, {})}


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

    `tolerance`: part of a channel's range that may be left unexplained. `on_step`: is told what is being done. HarnessError
    if no parameter has a tolerance, or as from Twin.
    """
    began = time.perf_counter()
    prior = _prior(actuator, bench)
    with _flown(measured, actuator, bench, prior, on_step) as runs:
        problem = Problem(runs, prior)
        fit, others = search(problem, on_step)
        on_step("uncertainty")
        saturated = any([_saturates(run, {**run.model.parameters, **problem.unknowns.parameters_of(fit.u)}, bench)
                         for run in runs])  # fmt: skip
        scale_open = _scale_is_open(prior, runs, saturated)
        stated = np.array([name in actuator.tolerances and not (scale_open and name == SCALE) for name in prior.names])
        own_error = np.array([kept_sigma(name, actuator, bench.parameters) > 0.0 for name in prior.names])
        found, told, inflation = _believed(told_by(problem, fit.u), stated, own_error, scale_open)
        values, covariance = cut(found.mean(), found.covariance(), np.linalg.inv(found.precision), told)
        u = _placed(problem, values)
        on_step("nuisances")
        u = learnt(problem, problem.solve(u, _bench_alone(problem)), _bench_alone(problem), on_step).u
        names, joint = _written(prior, covariance, told, actuator, bench)
        parameters = _parameters(prior, problem, u, joint, names, told, actuator)
        lines = _remarks(measured, problem, u, told, names, joint, parameters)
        lines += [remarks.SCALE_IS_OPEN] if scale_open else []
        lines += _on_search(others, inflation)
        lines += [] if saturated else [remarks.UNSATURATED]
        rests = _rests(problem, u)
        result = Calibration(
            actuator=actuator,
            fidelity=bench.fidelity.name,
            parameters=parameters,
            linked=names,
            covariance=joint,
            nuisances=_nuisances(problem, u),
            rests=rests,
            inflation=inflation,
            complaints=tuple(_complaint(item, problem, tolerance) for item in rests if item.unexplained > tolerance),
            remarks=tuple(dict.fromkeys(lines)),
            flights=sum(run.model.count + (run.judge.count if run.judge else 0) for run in runs),
            seconds=time.perf_counter() - began,
            curves=tuple(Curves(run.measured, problem.seen(u, r), run.weight.copy()) for r, run in enumerate(runs)),
        )
        return replace(result, actuator=calibrated(actuator, result, bench.parameters))


def _prior(actuator: Actuator, bench: Bench) -> Prior:
    """What the file says; what is set for one run alone is exact there, and so for all."""
    alone = {name for own in bench.own.values() for name in own}
    averaged = bench.fidelity.name != REFERENCE.name
    prior = prior_of(actuator, {**actuator.parameters, **bench.parameters}, averaged=averaged).without(sorted(alone))
    if not any(name in actuator.tolerances for name in prior.names):
        raise HarnessError(
            f"actuator {actuator.name}: no tolerance is stated, so all is exact and there is nothing to calibrate; state "
            "them under [tolerances] of its file, or by --free, such as --free 'mechanics.J=5 %'"
        )
    return prior


@contextmanager
def _flown(
    measured: Sequence[Measured], actuator: Actuator, bench: Bench, prior: Prior, on_step: Callable[[str], object]
) -> Iterator[list[Run]]:
    """The runs, ready to be flown."""
    with ExitStack() as stack:

        def run_of(run: Measured, place: int) -> Run:
            given = bench.parameters_of(place, actuator)
            model = stack.enter_context(Flights(bench.fmus, bench.fidelity, run, given))
            judge = None
            if bench.fidelity.name != REFERENCE.name and not run.is_slow:  # what HF adds is lost between slow rows
                judge = stack.enter_context(Flights(bench.fmus, FIDELITIES[REFERENCE.name], run, given))
            made = Run(model, judge)
            made.loads = np.empty((len(run.trial.time), 0))  # a load is logged, or there is none
            return made

        runs = []
        for place, each in enumerate(measured):
            if len(each.trials) > 1:
                on_step(f"{each.name}: what the command does between rows")
            chosen = decided(each, lambda run, place=place: run_of(run, place), prior)  # type: ignore[misc]
            runs.append(run_of(chosen, place))
        yield runs


def _saturates(run: Run, parameters: Mapping[str, float], bench: Bench) -> bool:
    """Whether the voltage saturates in a flight of the run."""
    port = ports.VARIABLES[ports.INDEX["voltage_saturated"]]
    with Twin(bench.fmus / bench.fidelity.fmu) as twin:
        values, _ = twin.record(run.measured.trial, merged(bench.fidelity, parameters), [port])
    return bool((values[run.measured.trial.time >= run.measured.time[0]] > 0.5).any())


def _scale_is_open(prior: Prior, runs: Sequence[Run], saturated: bool) -> bool:
    """Whether the runs leave open a factor common to torque constant, inertia and friction: unless a load is known, the
    voltage saturates, or one of these is exact. What a fit says of it then is overconfident."""
    return all(name in prior.names for name in KNOWN) and not saturated and not any(map(_loaded, runs))


def _loaded(run: Run) -> bool:
    """Whether a load was logged that is more than nothing."""
    given, load = run.model.parameters, run.measured.trial.inputs.get("load_torque")
    if load is None:
        return False
    torque = 1.5 * value_of("motor.K_e", given) * value_of("controller.current_limit", given)
    return bool(np.ptp(load) + abs(load).max() > 4.0 * LOAD_SHARE * torque * value_of("gear.ratio", given))


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


def _written(
    prior: Prior, covariance: Array, told: Mask, actuator: Actuator, bench: Bench
) -> tuple[tuple[str, ...], Array]:
    """Names of the parameters that are written with their covariance, and that, in the ports' units."""
    places = np.flatnonzero(linked(covariance, told, [name in actuator.tolerances for name in prior.names]))
    names = tuple(prior.names[place] for place in places)
    scales = np.where(prior.sigmas > 0.0, prior.sigmas, 1.0)[places]
    joint = covariance[np.ix_(places, places)] * np.outer(scales, scales)
    kept = np.array([kept_sigma(name, actuator, bench.parameters) if told[prior.names.index(name)] else 0.0 for name in names])
    return names, joint + np.diag(kept**2)


def _parameters(
    prior: Prior, problem: Problem, u: Array, joint: Array, names: Sequence[str], told: Mask, actuator: Actuator
) -> tuple[Parameter, ...]:
    """All that have a tolerance in the file."""
    values = problem.unknowns.parameters_of(u)
    out = []
    for place, name in enumerate(prior.names):
        if name not in actuator.tolerances:
            continue
        before = float(prior.sigmas[place])
        sigma = float(np.sqrt(joint[names.index(name), names.index(name)])) if name in names else before
        reason = "" if told[place] else remarks.would_tell(name)
        value = values[name] if told[place] else float(prior.values[place])
        out.append(Parameter(name, float(prior.values[place]), before, value, sigma, bool(told[place]), reason))
    return tuple(out)


def _nuisances(problem: Problem, u: Array) -> tuple[Nuisance, ...]:
    """Of each channel, with the deviations that they have while the parameters are not known exactly either."""
    own = problem.unknowns
    fit = problem.linear(u, _bench_alone(problem))
    deviations = np.sqrt(np.diag(fit.covariance()))
    out = []
    for r, run in enumerate(problem.runs):
        values = own.nuisances_of(u, r)
        sigmas = deviations[own.nuisances[r]].reshape(values.shape) * own.nuisance_scales(r)
        for k, channel in enumerate(run.measured.channels):
            unit = ports.VARIABLES[ports.INDEX[channel]].unit
            for kind, name in enumerate(NUISANCES):
                if kind != GAP or run.gap is not None:
                    in_unit = {"offset": unit, "shift": "s", "lag": "s"}.get(name, "1")
                    out.append(
                        Nuisance(run.measured.name, channel, name, float(values[k, kind]), float(sigmas[k, kind]), in_unit)
                    )
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


def _complaint(item: Rest, problem: Problem, tolerance: float) -> str:
    run = next(run for run in problem.runs if run.measured.name == item.run)
    name = run.measured.shown[item.channel].name
    return f"{item.run}, {name}: not explained, {100 * item.unexplained:.2g} % of its range is left ({100 * tolerance:.2g} %)"


def _remarks(
    measured: Sequence[Measured],
    problem: Problem,
    u: Array,
    told: Mask,
    names: Sequence[str],
    joint: Array,
    parameters: Sequence[Parameter],
) -> list[str]:
    own = problem.unknowns
    part = np.arange(own.parameters.start, own.parameters.stop)[told]
    freed = [own.prior.names[place] for place in np.flatnonzero(told)]
    lines = [f"{run.measured.name}: {line}" for run in problem.runs for line in run.measured.remarks]
    lines += remarks.at_bound(freed, u[part], own.low[part], own.high[part])
    sigmas = np.sqrt(np.diag(joint))
    lines += remarks.correlated(names, joint / np.outer(sigmas, sigmas)) if len(names) else []
    lines += remarks.off_the_sheet(parameters)
    if not freed:
        lines.append("these runs tell none of the parameters better than the file")
    return lines


def _on_search(others: Sequence[float], inflation: Inflation) -> list[str]:
    lines = []
    if others:
        ends = ", ".join(f"{100 * other:.2g} %" for other in sorted(others))
        lines.append(f"searches from other starts left {ends} more")
    if inflation.factor > 1.0:
        which = "blocks of time" if inflation.blocks >= inflation.runs else "the runs one by one"
        lines.append(f"intervals are {inflation.factor:.3g} times as wide as the noise says: by what {which} say")
    return lines

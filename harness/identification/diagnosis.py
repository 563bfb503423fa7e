"""What a measured run says about an actuator: estimates, health, a verdict, and what the model cannot explain."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from harness.actuators.actuator import DEFAULT, Actuator
from harness.faults import FAULTS, THRESHOLD
from harness.fidelity import FIDELITIES, Fidelity
from harness.identification.between import begun, decided
from harness.identification.curves import Curves, curves_of
from harness.identification.estimates import Estimate, estimates_of, hidden, without_effect
from harness.identification.ripple import ripple
from harness.identification.switch import NO_SWITCH, PORT, open_switch
from harness.identification.told import alternatives_of, nuisances_of, parameters_of, remarks_of, shifts_of, verdict_of
from harness.identification.unexplained import left_without_faults, unexplained
from harness.inference.explain import EXPLAINED, HOPELESS, Explained, explain
from harness.inference.flights import Flights
from harness.inference.groups import Group, groups
from harness.inference.measured import Measured
from harness.inference.prior import Prior, prior_of
from harness.inference.problem import Problem
from harness.inference.run import Run
from harness.inference.thinned import thinned

TOLERANCE = EXPLAINED
SINGLE_PHASE = "LF"


@dataclass(frozen=True)
class Diagnosis:
    """What a measured run says about an actuator.

    `name`: the run's; `fidelity`: the model's. `complaints`: a line for each channel that the model cannot explain; then
    `health` is None, and else the least of the faults'. `parameters`, `nuisances`: what was estimated beside the faults: a
    value and its sigma by name, in SI units; `groups`: what the run cannot tell apart; `alternatives`: other faults that
    explain it as well; `open_switch`: the number of the one that stays open, 0 for none. `measured`: the run as it was
    fitted, with what its command does between rows decided. `evaluations`: runs of FMUs; `seconds` of wall time."""

    name: str
    fidelity: str
    estimates: list[Estimate]
    complaints: list[str]
    remarks: list[str]
    health: float | None
    verdict: str
    evaluations: int
    seconds: float
    parameters: dict[str, dict[str, Any]]
    nuisances: dict[str, dict[str, Any]]
    groups: list[Group]
    alternatives: list[dict[str, Any]]
    open_switch: int
    measured: Measured = field(repr=False)
    curves: Curves = field(repr=False)
    explained: Explained = field(repr=False)

    def estimate(self, fault: str) -> Estimate:
        """The estimate of a fault or an angle by its short name."""
        return next(item for item in self.estimates if item.fault == fault)

    def as_dict(self) -> dict[str, object]:
        """For JSON: estimates by fault, in SI units."""
        return {
            "run": self.name,
            "monitor": self.fidelity,
            "explained": not self.complaints,
            "verdict": self.verdict,
            "health": self.health,
            "complaints": self.complaints,
            "remarks": self.remarks,
            "faults": {item.fault: {k: v for k, v in vars(item).items() if k != "fault"} for item in self.estimates},
            "parameters": self.parameters,
            "nuisances": self.nuisances,
            "groups": [group.as_dict() for group in self.groups],
            "alternatives": self.alternatives,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
        }


def models_for(fidelity: Fidelity) -> tuple[Fidelity, Fidelity]:
    """The fidelity that is searched when `fidelity` is to be fitted, and the judge, HF. HF itself is fitted through ELF+."""
    judge = FIDELITIES["HF"]
    return (FIDELITIES["ELF+"] if fidelity == judge else fidelity), judge


def _able(model: Fidelity, parameters: Mapping[str, float]) -> list[str]:
    """The faults that are looked for with a model: those that do something; of the rare ones, which show in single
    phases, none with the model of one equivalent phase."""
    return [
        name
        for name, fault in FAULTS.items()
        if not fault.without_effect(parameters) and not (fault.rare and model.model == SINGLE_PHASE)
    ]


def _explained(
    measured: Measured,
    fmus: Path,
    models: tuple[Fidelity, Fidelity],
    given: Mapping[str, float],
    prior: Prior,
    able: Sequence[str],
    on_step: Callable[[str], object],
) -> tuple[Explained, Curves, int]:
    """What the run says, with the model and the judge in `models`; its curves; and the flights that it took."""
    searched, judging = models
    with Flights(fmus, searched, measured, given) as model, Flights(fmus, judging, measured, given) as judge:
        problem = Problem([Run(model, judge)], prior, shares=prior.averaged)
        found = explain(problem, able, on_step)
        return found, curves_of(found), model.count + judge.count


def identify(
    measured: Measured,
    *,
    fmus: Path,
    fidelity: Fidelity,
    parameters: Mapping[str, float] | None = None,
    actuator: Actuator = DEFAULT,
    limits: Mapping[str, float] | None = None,
    threshold: float = THRESHOLD,
    tolerance: float = TOLERANCE,
    on_step: Callable[[str], object] = lambda text: None,
) -> Diagnosis:
    """Identify the faults of a measured run with the model `fidelity`; the folder `fmus` holds the FMUs of `models_for` it.

    `parameters`: those set for this actuator, by port name; `actuator`: whose tolerances or calibration say how well they
    are known; `limits`: values at which health is 0, by short name, for faults where it is not their own limit;
    `threshold`: loss of health that alarms; `tolerance`: fraction of a channel's range that may be left unexplained;
    `on_step` is told what is being done. HarnessError as from Twin."""
    started = time.perf_counter()
    searched, judging = models_for(fidelity)
    given = dict(parameters or {})
    prior = prior_of(actuator, given, averaged=fidelity != judging)
    with threadpool_limits(1, "blas"):  # more threads of it cost 1.7 times the CPU, which the flights need
        measured = begun(thinned(measured), fmus, searched, given, prior)
        measured = decided(measured, fmus, searched, given, prior)
        able = _able(searched, given)
        found, curves, evaluations = _explained(measured, fmus, (searched, judging), given, prior, able, on_step)
        switch, rest = 0, float(curves.left.unexplained.max())
        if looked := rest > HOPELESS and not given.get(PORT):
            on_step("looking for an open switch")
            switch = open_switch(measured, fmus, searched, given, prior, rest)
        if switch:
            given[PORT] = float(switch)
            found, curves, more = _explained(measured, fmus, (searched, judging), given, prior, [], on_step)
            evaluations += more
    complaints = [] if switch else unexplained(curves, measured, tolerance, given, shifts_of(found))
    estimates = without_effect(estimates_of(found, limits or {}, threshold), given)
    rippled = "" if switch else ripple(curves, measured, given)
    untold = groups(found.around, found.problem.unknowns, able)
    if complaints:
        estimates = [replace(item, health=None, alarm=False) for item in estimates]
        remarks = [*left_without_faults(curves, measured), *([NO_SWITCH] if looked else [])]
    else:
        estimates = hidden(estimates) if rippled else estimates
        remarks = [*([rippled] if rippled else []), *remarks_of(found, estimates, untold, actuator)]
    healths = [item.health for item in estimates if item.health is not None]
    return Diagnosis(
        name=measured.name,
        fidelity=fidelity.name,
        estimates=estimates,
        complaints=complaints,
        remarks=[*measured.remarks, *remarks],
        health=None if complaints or not healths else min(healths),
        verdict=verdict_of(estimates, complaints, fidelity.name, threshold, switch),
        evaluations=evaluations,
        seconds=time.perf_counter() - started,
        parameters=parameters_of(found),
        nuisances=nuisances_of(found),
        groups=untold,
        alternatives=[] if complaints else alternatives_of(found),
        open_switch=switch,
        measured=measured,
        curves=curves,
        explained=found,
    )

"""What a measured run says about an actuator: estimates, health, a verdict, and what the model cannot explain."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from harness.faults import FAULTS, KINDS, THRESHOLD
from harness.fidelity import FIDELITIES, Fidelity
from harness.identification.between import decided
from harness.identification.estimates import Estimate, estimates_of, hidden, without_effect
from harness.identification.fit import Fit, fit
from harness.inference.measured import Measured
from harness.inference.flights import Model
from harness.identification.ripple import ripple
from harness.identification.search import TOLERANCE
from harness.identification.unexplained import left_without_faults, unexplained
from harness.logs.hints import at_bounds


@dataclass(frozen=True)
class Diagnosis:
    """What a measured run says about an actuator.

    `name`: the run's; `fidelity`: the model's. `complaints`: a line for each channel that the model cannot explain; then
    `health` is None, and else the least of the faults'. `nuisances`: what was estimated beside the faults, such as
    `shift.position` [s], by how much that channel, named as it is shown, was shifted in time: value, sigma, unit.
    `measured`: the run as it was fitted, with what its command does between rows decided. `evaluations`: runs of FMUs;
    `seconds` of wall time.
    """

    name: str
    fidelity: str
    estimates: list[Estimate]
    complaints: list[str]
    remarks: list[str]
    health: float | None
    verdict: str
    evaluations: int
    seconds: float
    nuisances: dict[str, dict[str, Any]]
    measured: Measured = field(repr=False)
    fit: Fit = field(repr=False)

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
            "nuisances": self.nuisances,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
        }


def models_for(fidelity: Fidelity) -> tuple[Fidelity, Fidelity]:
    """The fidelity that is searched when `fidelity` is to be fitted, and the judge, HF. HF itself is fitted through ELF+."""
    judge = FIDELITIES["HF"]
    return (FIDELITIES["ELF+"] if fidelity == judge else fidelity), judge


def identify(
    measured: Measured,
    *,
    fmus: Path,
    fidelity: Fidelity,
    parameters: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    threshold: float = THRESHOLD,
    tolerance: float = TOLERANCE,
) -> Diagnosis:
    """Identify the faults of a measured run with the model `fidelity`; the folder `fmus` holds the FMUs of `models_for` it.

    `parameters`: those set for this actuator, by port name; `limits`: values at which health is 0, by short name, for faults
    where it is not their own limit; `threshold`: loss of health that alarms; `tolerance`: fraction of a channel's range that
    may be left unexplained. HarnessError as from Twin.
    """
    started = time.perf_counter()
    searched, judging = models_for(fidelity)
    given = dict(parameters or {})
    measured = decided(measured, fmus, searched, given)
    with Model(fmus, searched, measured, given) as model, Model(fmus, judging, measured, given) as judge:
        found = fit(model, measured, judge, corrected=fidelity == judging)
        evaluations = model.evaluations + judge.evaluations
    complaints = [
        *unexplained(found, measured, tolerance, given),
        *at_bounds(
            [measured.shown[name].name for name in measured.channels], found.shifts.tolist(), measured.shift_bounds.tolist()
        ),
    ]
    estimates = without_effect(estimates_of(found, limits or {}, threshold), given)
    rippled = ripple(found, measured, given) if found.bent else ""
    if complaints:
        estimates = [replace(item, health=None, alarm=False) for item in estimates]
        remarks = left_without_faults(found, measured)
    else:
        estimates = hidden(estimates) if rippled else estimates
        remarks = [*([rippled] if rippled else []), *_remarks(estimates)]
    healths = [item.health for item in estimates if item.health is not None]
    return Diagnosis(
        name=measured.name,
        fidelity=fidelity.name,
        estimates=estimates,
        complaints=complaints,
        remarks=[*measured.remarks, *remarks],
        health=None if complaints or not healths else min(healths),
        verdict=_verdict(estimates, complaints, fidelity.name, threshold),
        evaluations=evaluations,
        seconds=time.perf_counter() - started,
        nuisances=_nuisances(found, measured),
        measured=measured,
        fit=found,
    )


def _nuisances(found: Fit, measured: Measured) -> dict[str, dict[str, Any]]:
    """The channels' shifts in time, by name."""
    shifts = zip(measured.channels, found.shifts.tolist(), found.shift_sigma.tolist(), measured.shift_bounds, strict=False)
    return {
        f"shift.{measured.shown[name].name}": {"value": value, "sigma": sigma, "unit": "s"}
        for name, value, sigma, bound in shifts
        if bound > 0.0
    }


def _remarks(estimates: Sequence[Estimate]) -> list[str]:
    """What else may be the cause of what was found, as the faults declare it."""
    by_name = {item.fault: item for item in estimates}
    remarks = []
    for members in KINDS.values():
        items = [by_name[fault.name] for fault in members]
        alike = max(item.low for item in items) < min(item.high for item in items)
        if (group := members[0].group) and alike and all(item.alarm for item in items):
            remarks.append(group.all_alike)
    for name, fault in FAULTS.items():
        item = by_name[name]
        if fault.better_than_healthy and item.alarm and fault.surely_better(item.low, item.high):
            remarks.append(fault.better_than_healthy)
    return remarks


def _verdict(estimates: Sequence[Estimate], complaints: Sequence[str], fidelity: str, threshold: float) -> str:
    if complaints:
        return f"not explained by {fidelity} and these faults: {'; '.join(complaints)}"
    alarms = [item for item in estimates if item.alarm]
    unknown = [e.fault for e in estimates if e.fault in FAULTS and e.effect and not e.identifiable and not e.alarm]
    rest = f"; not identifiable from this run: {', '.join(unknown)}" if unknown else ""
    if not alarms:
        return f"healthy: no identifiable fault has lost more than {100.0 * threshold:g} % of its health{rest}"
    listed = [
        f"{item.fault} = {item.value:.4g} (health {'' if item.identifiable else 'at most '}{item.health:.2f})"
        for item in sorted(alarms, key=lambda alarm: alarm.health or 0)
    ]
    return f"faulty: {', '.join(listed)}{rest}"

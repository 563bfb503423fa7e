"""From a fit to what a maintainer reads: estimates with intervals, health, a verdict, and what the model cannot explain."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.fidelity import FIDELITIES, Fidelity
from harness.identification import faults
from harness.identification.faults import FAULTS, Fault
from harness.identification.fit import Fit, fit
from harness.identification.measured import Measured
from harness.identification.model import Monitor
from harness.identification.search import EXPLAINED

Array = NDArray[np.float64]

THRESHOLD = 0.05
"""Loss of health from which a fault is alarmed, if its interval leaves the healthy value out."""
IDENTIFIABLE = 0.10
"""Half width of a 95 % interval, in spans, up to which a run is said to identify a fault."""
IDENTIFIABLE_PHI = 0.5
"""The same for phi [rad]; and times zeta, as a part of zeta's span, IDENTIFIABLE."""
TWO = 5.991
"""95 % quantile of chi-squared with two degrees of freedom: the eccentricity has two coordinates."""
FACTORS = {
    180.0 / math.pi: "degrees instead of rad",
    30.0 / math.pi: "rpm instead of rad/s",
    1000.0: "a thousandth of the unit (mrad, mA)",
    -1.0: "the other sign",
}
"""What a column looks like that is as many times what it should be."""
ALIKE, NEAR = 0.9, 1.4
"""Correlation from which two curves are taken to be the same quantity, and how near a factor must be to a known one: faults
change a curve too."""


LARGEST_GAP = 0.0025
"""Of a channel's range, up to which the monitor's own gap to HF is granted to it: LF's in unsaturated runs (ours)."""
BEYOND = 1.1
"""A position that is as many times the end stop's is no position in rad."""


@dataclass(frozen=True)
class Estimate:
    """One fault: value and ends of its 95 % interval in `unit`; if not identifiable, `reason` says why.

    `health` is 1 when healthy and 0 at the limit; that of the best end of the interval if the fault is not identifiable but
    surely there; None where it says nothing (else not identifiable, or phi).
    """

    fault: str
    unit: str
    value: float
    low: float
    high: float
    identifiable: bool
    reason: str
    health: float | None
    alarm: bool


@dataclass(frozen=True)
class Diagnosis:
    """What a measured run says about an actuator.

    `complaints`: what the model cannot explain, empty if it explains the run; then `health` is the least of the faults', and
    else None. `evaluations`: runs of FMUs; `seconds` of wall time.
    """

    name: str
    monitor: str
    estimates: list[Estimate]
    complaints: list[str]
    remarks: list[str]
    health: float | None
    verdict: str
    evaluations: int
    seconds: float
    fit: Fit = field(repr=False)

    def estimate(self, fault: str) -> Estimate:
        return next(item for item in self.estimates if item.fault == fault)

    def as_dict(self) -> dict[str, object]:
        """For JSON: estimates by fault, in SI units."""
        return {
            "run": self.name,
            "monitor": self.monitor,
            "explained": not self.complaints,
            "verdict": self.verdict,
            "health": self.health,
            "complaints": self.complaints,
            "remarks": self.remarks,
            "faults": {item.fault: {k: v for k, v in vars(item).items() if k != "fault"} for item in self.estimates},
            "evaluations": self.evaluations,
            "seconds": self.seconds,
        }


def flown_for(monitor: Fidelity) -> tuple[Fidelity, Fidelity]:
    """The fidelity that is searched with, and HF, which judges it; HF itself is fitted by way of ELF+."""
    judge = FIDELITIES["HF"]
    return (FIDELITIES["ELF+"] if monitor == judge else monitor), judge


def identify(
    measured: Measured,
    *,
    fmus: Path,
    monitor: Fidelity,
    parameters: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    threshold: float = THRESHOLD,
    tolerance: float = EXPLAINED,
) -> Diagnosis:
    """Identify the faults of `measured` with the fidelity `monitor`, from the FMUs of `flown_for` in the folder `fmus`.

    `parameters` are those of this actuator and its run, `limits` the faults' values at which health is 0. `threshold`: loss
    of health that alarms; `tolerance`: what may be left unexplained, as a fraction of a channel's range. HarnessError as
    from Twin.
    """
    begun = time.perf_counter()
    searched, judge = flown_for(monitor)
    given = dict(parameters or {})
    with Monitor(fmus, searched, measured, given) as model, Monitor(fmus, judge, measured, given) as reference:
        found = fit(model, measured, reference, corrected=monitor == judge)
        evaluations = model.evaluations + reference.evaluations
    end_stop = given.get("mechanics.end_stop", ports.VARIABLES[ports.INDEX["mechanics.end_stop"]].start)
    complaints = unexplained(found, measured, tolerance, end_stop)
    estimates = estimate(found, limits or {}, threshold)
    if complaints:
        estimates = [replace(item, health=None, alarm=False) for item in estimates]
    healths = [item.health for item in estimates if item.health is not None]
    health = None if complaints or not healths else min(healths)
    remarks = [] if complaints else _remarks(estimates)
    verdict = _verdict(estimates, complaints, monitor.name, threshold)
    seconds = time.perf_counter() - begun
    return Diagnosis(
        measured.name, monitor.name, estimates, complaints, remarks, health, verdict, evaluations, seconds, found
    )


def estimate(found: Fit, limits: Mapping[str, float], threshold: float) -> list[Estimate]:
    """The estimate of each of FAULTS, in their order."""
    values = faults.to_values(found.z)
    widths = (found.quantile * np.sqrt(np.diag(found.covariance)) * faults.SPAN).tolist()
    estimates = []
    for name, fault in FAULTS.items():
        if name in ("zeta", "phi"):
            continue
        place = faults.COORDINATES.index(name)
        low = max(values[name] - widths[place], float(faults.LOWEST[place]))
        high = min(values[name] + widths[place], float(faults.HIGHEST[place]))
        estimates.append(_judged(fault, (values[name], low, high), widths[place], limits, threshold))
    zeta, phi = _eccentricity(found, values, limits, threshold)
    estimates[-1:-1] = [zeta, phi]
    return estimates


def _judged(
    fault: Fault, interval: tuple[float, float, float], width: float, limits: Mapping[str, float], threshold: float
) -> Estimate:
    value, low, high = interval
    limit, sick = limits.get(fault.name), fault.excludes_healthy(low, high)
    identifiable = width <= IDENTIFIABLE * fault.span
    health = fault.health(value, limit) if identifiable else max(fault.health(end, limit) for end in (low, high))
    alarm = sick and 1.0 - health > threshold
    reason = ""
    if not identifiable:
        reason = f"this run leaves it open by {100.0 * width / fault.span:.0f} % of its range, to each side"
        reason += ", yet it is there" if alarm else ""
    return Estimate(
        fault.name, fault.unit, value, low, high, identifiable, reason, health if identifiable or alarm else None, alarm
    )


def _eccentricity(
    found: Fit, values: Mapping[str, float], limits: Mapping[str, float], threshold: float
) -> tuple[Estimate, Estimate]:
    """zeta and phi from the vector's two coordinates, the variance along it and across it."""
    pair = slice(faults.ZETA[0], faults.ZETA[1] + 1)
    covariance = found.covariance[pair, pair] * np.outer(faults.SPAN[pair], faults.SPAN[pair])
    zeta, phi = values["zeta"], values["phi"]
    along = np.array([math.cos(phi), math.sin(phi)])
    across = np.array([-along[1], along[0]])
    width = found.quantile * math.sqrt(along @ covariance @ along)
    vector = zeta * along
    length = math.sqrt(max(0.0, zeta**2 - float(np.trace(covariance))))  # noise makes a vector longer (Rice)
    some = float(vector @ np.linalg.solve(covariance, vector)) > TWO * (found.quantile / 1.96) ** 2
    low, high = (zeta - width if some else 0.0), zeta + width
    first = _judged(FAULTS["zeta"], (length, max(low, 0.0), high), width, limits, threshold)
    turn = found.quantile * math.sqrt(across @ covariance @ across) / max(zeta, 1e-12)
    reason = ""
    if not some:
        reason = "zeta cannot be told from 0"
    elif turn > IDENTIFIABLE_PHI or zeta * turn > IDENTIFIABLE * FAULTS["zeta"].span:
        reason = f"this run leaves it open by {turn:.2g} rad, to each side"
    turn = min(turn, math.pi)
    second = Estimate("phi", "rad", phi, phi - turn, phi + turn, not reason, reason, None, False)
    return first, second


def unexplained(found: Fit, measured: Measured, tolerance: float, end_stop: float) -> list[str]:
    """A line for each channel of which more is left than noise, `tolerance` and the monitor's own gap to HF."""
    lines = []
    spread = np.ptp(measured.values, axis=0)
    for place, name in enumerate(measured.channels):
        share, gap = (float(part[place] / spread[place]) for part in (found.unexplained, found.gap))
        accepted = tolerance + min(gap, LARGEST_GAP)
        if share > accepted:
            hint = _hint(place, found, measured, end_stop)
            if not hint and gap > LARGEST_GAP:
                hint = f"HF differs from this model by {100.0 * gap:.2g} % in such a run; a slower one says more"
            lines.append(
                f"{100.0 * share:.2g} % of the range of {name} ({100.0 * accepted:.2g} % can be accepted)"
                f"{'; ' + hint if hint else ''}"
            )
    return lines


def _hint(place: int, found: Fit, measured: Measured, end_stop: float) -> str:
    """What a channel that is not explained looks like, if it looks like something."""
    names = list(measured.channels)
    data = measured.values[:, place]
    if names[place] == "position":
        command = np.interp(measured.time, measured.trial.time, measured.trial.inputs["command"])
        if meaning := _meaning(data, command, "the command"):
            return meaning
    if meaning := _meaning(data, found.healthy[:, place], "what the model expects"):
        return meaning
    likeness = [abs(_likeness(data, model)) for model in found.healthy.T]
    other = int(np.argmax(likeness))
    if likeness[other] > ALIKE and likeness[other] > likeness[place] + 0.1:
        return f"it looks like {names[other]}: columns interchanged?"
    if names[place] == "position" and (reached := float(np.max(np.abs(data)))) > BEYOND * end_stop:
        return f"it reaches {reached:.3g} rad, beyond the end stops at {end_stop:g} rad: degrees instead of rad?"
    return ""


def _likeness(one: Array, other: Array) -> float:
    a, b = one - one.mean(), other - other.mean()
    return float(a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300))


def _meaning(data: Array, expected: Array, what: str) -> str:
    """What it means if `data` is one of FACTORS times what was `expected`, or one of them divides it; else nothing."""
    likeness = _likeness(data, expected)
    if abs(likeness) < ALIKE:
        return ""
    factor = likeness * float(np.std(data) / np.std(expected))
    for known, meaning in FACTORS.items():
        if 1.0 / NEAR < factor / known < NEAR:
            return f"it is {factor:.3g} times {what}: {meaning}?"
        if known > 1.0 and 1.0 / NEAR < factor * known < NEAR:
            return f"it is {factor:.3g} times {what}: is that in {meaning}?"
    return ""


def _remarks(estimates: list[Estimate]) -> list[str]:
    """What else could look like that: faults that the set does not part."""
    by_name = {item.fault: item for item in estimates}
    turns = [by_name[name] for name in ("N_a", "N_b", "N_c")]
    remarks = []
    if all(item.alarm for item in turns) and max(item.low for item in turns) < min(item.high for item in turns):
        remarks.append(
            "all three phases have lost alike: weaker magnets (fault.magnet) or a larger mechanics.J look the same"
        )
    friction = by_name["friction"]
    if friction.alarm and friction.high < 1.0:
        remarks.append("friction is below that of a healthy actuator: another actuator, or parameters to be set with --set?")
    return remarks


def _verdict(estimates: list[Estimate], complaints: list[str], monitor: str, threshold: float) -> str:
    if complaints:
        return f"not explained by {monitor} and these faults: {'; '.join(complaints)}"
    alarms = [item for item in estimates if item.alarm]
    open_ones = [item.fault for item in estimates if not item.identifiable and not item.alarm and item.fault != "phi"]
    rest = f"; not identifiable from this run: {', '.join(open_ones)}" if open_ones else ""
    if not alarms:
        return f"healthy: no identifiable fault has lost more than {100.0 * threshold:g} % of its health{rest}"
    told = [
        f"{item.fault} = {item.value:.4g} (health {'' if item.identifiable else 'at most '}{item.health:.2f})"
        for item in sorted(alarms, key=lambda alarm: alarm.health or 0)
    ]
    return f"faulty: {', '.join(told)}{rest}"


def unit_of(channel: str) -> str:
    """The unit of a measured channel."""
    return ports.VARIABLES[ports.INDEX[channel]].unit

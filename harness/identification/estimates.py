"""From explanations to estimates: each fault's value with its 95 % interval, whether the run identifies it, and its
health."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from harness.faults import FAULTS, Angle, Fault
from harness.inference import coordinates
from harness.inference.explain import Explained
from harness.inference.unknowns import N_FAULTS

Array = NDArray[np.float64]

IDENTIFIABLE = 0.10
"""Half width of a 95 % interval, in spans, up to which a run is said to identify a fault."""
IDENTIFIABLE_ANGLE = 0.5
"""The same for an angle [rad]; times the amplitude, IDENTIFIABLE holds too."""
CHI_SQUARED_95 = float(chi2.ppf(0.95, 2))
"""95 % quantile of chi-squared with two degrees of freedom: an amplitude with an angle is a vector of two coordinates."""
NOTHING_SHOWS = "nothing shows it"
NORMAL_95 = 1.96
"""Half width of the 95 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Estimate:
    """One fault, or the angle of one: value and ends of its 95 % interval in `unit`.

    `low` and `high` hold if the best explanation does, and this fault beside it; `full`: the same if every fault may be
    there; None where nothing was looked for. `probability` that the fault is there, by the weights of the explanations.
    `reason` says why it is not identifiable, empty if it is. `health` is 1 when healthy and 0 at the limit. For a fault
    that is surely there but not identifiable it is that of the best end of the interval. It is None for any other fault
    that is not identifiable, and for an angle. `alarm`: the fault is part of the best explanation and has lost more
    health than the threshold. `effect`: False for a fault that does nothing in this actuator or model, as `reason` says.
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
    effect: bool = True
    probability: float = 0.0
    full: tuple[float, float] | None = None


@dataclass(frozen=True)
class _Found:
    """What is known of a fault's coordinates, in its units: `values`, `covariance`, and `full` of all faults together; and
    whether it is `chosen`: part of the best explanation."""

    values: Array
    covariance: Array
    full: tuple[Array, Array]
    chosen: bool
    probability: float


def estimates_of(explained: Explained, limits: Mapping[str, float], threshold: float) -> list[Estimate]:
    """The estimates of all of `harness.faults.ESTIMATED`, in their order.

    `limits`: the faults' values at which health is 0, where not their own; `threshold`: loss of health that alarms.
    """
    estimates: list[Estimate] = []
    everything = explained.around.free & ~explained.problem.dead
    full = explained.around.newton(everything), explained.around.robust(everything)
    for name, fault in FAULTS.items():
        found = _found(name, explained, full)
        if found is None:
            estimates += _untold(fault, _why_untold(fault))
        elif fault.angle is not None:
            estimates += _vector(fault, fault.angle, found, limits.get(name), threshold)
        else:
            estimates.append(_scalar(fault, found, limits.get(name), threshold))
    return estimates


def _found(name: str, explained: Explained, full: tuple[Array, Array]) -> _Found | None:
    """Of a fault: at the best explanation if it is part of it, else where a step of Newton's takes it alone beside that;
    None if the model knows nothing of it."""
    places = coordinates.PLACES[name]
    around, dead = explained.around, explained.problem.dead
    if dead[places].all() or not around.free[places].all():
        return None
    chosen = name in explained.best.faults
    beside = around.free & ~dead
    beside[:N_FAULTS] = False
    for other in (*explained.best.faults, name):
        beside[coordinates.PLACES[other]] = True
    u = explained.best.fit.u if chosen else around.newton(beside)
    span, healthy = coordinates.SPAN[places], coordinates.HEALTHY[places]
    scale = np.outer(span, span)
    low, high = explained.problem.unknowns.low[places], explained.problem.unknowns.high[places]
    return _Found(
        healthy + span * np.clip(u[places], low, high),
        around.robust(beside)[np.ix_(places, places)] * scale,
        (healthy + span * np.clip(full[0][places], low, high), full[1][np.ix_(places, places)] * scale),
        chosen,
        explained.probability[name],
    )


def without_effect(estimates: Sequence[Estimate], parameters: Mapping[str, float]) -> list[Estimate]:
    """The estimates, healthy where a fault does nothing in an actuator with these `parameters`, by port name."""
    why = {name: FAULTS[name].without_effect(parameters) for name in FAULTS}
    return [_still(item, why[item.fault]) if why.get(item.fault) else item for item in estimates]


def _still(item: Estimate, reason: str) -> Estimate:
    healthy = FAULTS[item.fault].healthy
    return Estimate(item.fault, item.unit, healthy, healthy, healthy, False, reason, None, False, False)


def _why_untold(fault: Fault) -> str:
    if fault.alone:
        return f"told beside {fault.alone} only"
    return NOTHING_SHOWS


def _untold(fault: Fault, reason: str) -> list[Estimate]:
    """The estimates of a fault of which the run, or the model, tells nothing."""
    parts = [part for part in (fault, fault.angle) if part is not None]
    low, high = fault.searched
    return [
        Estimate(part.name, part.unit, part.healthy, low, high, False, reason, None, False)
        if part is fault
        else Estimate(part.name, part.unit, 0.0, -math.pi, math.pi, False, reason, None, False)
        for part in parts
    ]


def hidden(estimates: Sequence[Estimate]) -> list[Estimate]:
    """The estimates of a run whose ripple hides what shows in the current: there nothing is identified or alarmed."""
    names = {part.name for fault in FAULTS.values() if fault.in_current for part in (fault, fault.angle) if part}
    return [
        replace(item, identifiable=False, reason="hidden by the current's ripple", health=None, alarm=False)
        if item.fault in names
        else item
        for item in estimates
    ]


def _scalar(fault: Fault, found: _Found, limit: float | None, threshold: float) -> Estimate:
    value, width = float(found.values[0]), NORMAL_95 * math.sqrt(float(found.covariance[0, 0]))
    lowest, highest = fault.searched
    beside, wide = float(found.full[0][0]), NORMAL_95 * math.sqrt(float(found.full[1][0, 0]))
    full = max(beside - wide, lowest), min(beside + wide, highest)
    interval = value, max(value - width, lowest), min(value + width, highest)
    return _severity(fault, interval, width, found, full, limit, threshold)


def _severity(
    fault: Fault,
    interval: tuple[float, float, float],
    width: float,
    found: _Found,
    full: tuple[float, float],
    limit: float | None,
    threshold: float,
) -> Estimate:
    """The estimate of a fault from its value and interval; `width`: half of the interval before it was bounded."""
    value, low, high = interval
    identifiable = width <= IDENTIFIABLE * fault.span
    health = fault.health(value, limit) if identifiable else max(fault.health(end, limit) for end in (low, high))
    alarm = found.chosen and 1.0 - health > threshold
    reason = ""
    if not identifiable:
        reason = f"this run leaves it open by {100.0 * width / fault.span:.0f} % of its range, to each side"
        reason += ", yet it is there" if alarm else ""
    return Estimate(
        fault=fault.name,
        unit=fault.unit,
        value=value,
        low=low,
        high=high,
        identifiable=identifiable,
        reason=reason,
        health=health if identifiable or alarm else None,
        alarm=alarm,
        probability=found.probability,
        full=full,
    )


def _vector(fault: Fault, angle: Angle, found: _Found, limit: float | None, threshold: float) -> tuple[Estimate, Estimate]:
    """Amplitude and angle from a vector's two coordinates, by its variance along and across its direction."""
    amplitude, direction = math.hypot(*found.values), math.atan2(found.values[1], found.values[0])
    along = np.array([math.cos(direction), math.sin(direction)])
    across = np.array([-along[1], along[0]])
    width = NORMAL_95 * math.sqrt(float(along @ found.covariance @ along))
    unbiased = math.sqrt(max(0.0, amplitude**2 - float(np.trace(found.covariance))))  # noise lengthens a vector (Rice)
    distance = float(found.values @ np.linalg.solve(found.covariance, found.values))
    present = distance > CHI_SQUARED_95
    low, high = (amplitude - width if present else 0.0), amplitude + width
    beside, wide = math.hypot(*found.full[0]), NORMAL_95 * math.sqrt(float(np.max(np.linalg.eigvalsh(found.full[1]))))
    full = max(beside - wide, 0.0), min(beside + wide, fault.searched[1])
    size = _severity(fault, (unbiased, max(low, 0.0), high), width, found, full, limit, threshold)
    turn = NORMAL_95 * math.sqrt(float(across @ found.covariance @ across)) / max(amplitude, 1e-12)
    reason = ""
    if not present:
        reason = f"{fault.name} cannot be told from 0"
    elif turn > IDENTIFIABLE_ANGLE or amplitude * turn > IDENTIFIABLE * fault.span:
        reason = f"this run leaves it open by {turn:.2g} rad, to each side"
    turn = min(turn, math.pi)
    ends = direction - turn, direction + turn
    return size, Estimate(
        angle.name, angle.unit, direction, *ends, not reason, reason, None, False, True, found.probability, ends
    )

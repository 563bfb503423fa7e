"""From a fit to estimates: each fault's value with its 95 % interval, whether the run identifies it, and its health."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from harness.faults import FAULTS, Angle, Fault
from harness.identification import coordinates
from harness.identification.fit import Fit

Array = NDArray[np.float64]

IDENTIFIABLE = 0.10
"""Half width of a 95 % interval, in spans, up to which a run is said to identify a fault."""
IDENTIFIABLE_ANGLE = 0.5
"""The same for an angle [rad]; times the amplitude, IDENTIFIABLE holds too."""
CHI_SQUARED_95 = float(chi2.ppf(0.95, 2))
"""95 % quantile of chi-squared with two degrees of freedom: an amplitude with an angle is a vector of two coordinates."""
NORMAL_95 = 1.96
"""Half width of the 95 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Estimate:
    """One fault, or the angle of one: value and ends of its 95 % interval in `unit`.

    `reason` says why it is not identifiable, empty if it is. `health` is 1 when healthy and 0 at the limit. For a fault that
    is surely there but not identifiable it is that of the best end of the interval. It is None for any other fault that is
    not identifiable, and for an angle. `effect`: False for a fault that does nothing in this actuator, as `reason` says.
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


def estimates_of(found: Fit, limits: Mapping[str, float], threshold: float) -> list[Estimate]:
    """The estimates of all of `harness.faults.ESTIMATED`, in their order.

    `limits`: the faults' values at which health is 0, where not their own; `threshold`: loss of health that alarms.
    """
    values = coordinates.to_values(found.z)
    widths = (found.quantile * np.sqrt(np.diag(found.covariance)) * coordinates.SPAN).tolist()
    estimates: list[Estimate] = []
    for name, fault in FAULTS.items():
        limit = limits.get(name)
        if fault.angle is not None:
            estimates += _vector(fault, fault.angle, found, values, limit, threshold)
            continue
        (place,) = coordinates.PLACES[name]
        low = max(values[name] - widths[place], float(coordinates.LOWEST[place]))
        high = min(values[name] + widths[place], float(coordinates.HIGHEST[place]))
        estimates.append(_severity(fault, (values[name], low, high), widths[place], limit, threshold))
    return estimates


def without_effect(estimates: list[Estimate], parameters: Mapping[str, float]) -> list[Estimate]:
    """The estimates, healthy where a fault does nothing in an actuator with these `parameters`, by port name."""
    why = {name: FAULTS[name].without_effect(parameters) for name in FAULTS}
    return [_still(item, why[item.fault]) if why.get(item.fault) else item for item in estimates]


def _still(item: Estimate, reason: str) -> Estimate:
    healthy = FAULTS[item.fault].healthy
    return Estimate(item.fault, item.unit, healthy, healthy, healthy, False, reason, None, False, False)


def hidden(estimates: list[Estimate]) -> list[Estimate]:
    """The estimates of a run whose ripple hides what shows in the current: there nothing is identified or alarmed."""
    names = {part.name for fault in FAULTS.values() if fault.in_current for part in (fault, fault.angle) if part}
    return [
        replace(item, identifiable=False, reason="hidden by the current's ripple", health=None, alarm=False)
        if item.fault in names
        else item
        for item in estimates
    ]


def _severity(
    fault: Fault, interval: tuple[float, float, float], width: float, limit: float | None, threshold: float
) -> Estimate:
    """The estimate of a fault from its value and interval; `width`: half of the interval before it was bounded."""
    value, low, high = interval
    identifiable = width <= IDENTIFIABLE * fault.span
    health = fault.health(value, limit) if identifiable else max(fault.health(end, limit) for end in (low, high))
    alarm = fault.excludes_healthy(low, high) and 1.0 - health > threshold
    reason = ""
    if not identifiable:
        reason = f"this run leaves it open by {100.0 * width / fault.span:.0f} % of its range, to each side"
        reason += ", yet it is there" if alarm else ""
    return Estimate(
        fault.name, fault.unit, value, low, high, identifiable, reason, health if identifiable or alarm else None, alarm
    )


def _vector(
    fault: Fault, angle: Angle, found: Fit, values: Mapping[str, float], limit: float | None, threshold: float
) -> tuple[Estimate, Estimate]:
    """Amplitude and angle from a vector's two coordinates, by its variance along and across its direction."""
    places = coordinates.PLACES[fault.name]
    span = coordinates.SPAN[places]
    covariance = found.covariance[np.ix_(places, places)] * np.outer(span, span)
    amplitude, direction = values[fault.name], values[angle.name]
    along = np.array([math.cos(direction), math.sin(direction)])
    across = np.array([-along[1], along[0]])
    vector = amplitude * along
    width = found.quantile * math.sqrt(along @ covariance @ along)
    unbiased = math.sqrt(max(0.0, amplitude**2 - float(np.trace(covariance))))  # noise lengthens a vector (Rice)
    distance = float(vector @ np.linalg.solve(covariance, vector))
    present = distance > CHI_SQUARED_95 * (found.quantile / NORMAL_95) ** 2
    low, high = (amplitude - width if present else 0.0), amplitude + width
    size = _severity(fault, (unbiased, max(low, 0.0), high), width, limit, threshold)
    turn = found.quantile * math.sqrt(across @ covariance @ across) / max(amplitude, 1e-12)
    reason = ""
    if not present:
        reason = f"{fault.name} cannot be told from 0"
    elif turn > IDENTIFIABLE_ANGLE or amplitude * turn > IDENTIFIABLE * fault.span:
        reason = f"this run leaves it open by {turn:.2g} rad, to each side"
    turn = min(turn, math.pi)
    return size, Estimate(
        angle.name, angle.unit, direction, direction - turn, direction + turn, not reason, reason, None, False
    )

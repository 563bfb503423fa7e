"""The faults that are identified, and the coordinates in which they are searched."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError, unknown

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fault:
    """A fault parameter: its port, its value when healthy and at its limit, both in `unit`.

    `span` is the width of the range over which it is studied (ours, after the paper's ranges): the unit of errors.
    `limit` None: the fault has no severity of its own (phi).
    """

    name: str
    port: str
    unit: str
    healthy: float
    limit: float | None
    span: float

    def health(self, value: float, limit: float | None = None) -> float:
        """Health index of `value`: 1 healthy, 0 at or beyond the limit; to both sides of healthy."""
        end = self.limit if limit is None else limit
        if end is None:
            return 1.0
        return min(1.0, max(0.0, 1.0 - abs(value - self.healthy) / abs(end - self.healthy)))

    def excludes_healthy(self, low: float, high: float) -> bool:
        """Whether the interval low to high leaves the healthy value out."""
        return not low <= self.healthy <= high


FAULTS: dict[str, Fault] = {
    fault.name: fault
    for fault in (
        Fault("friction", "fault.friction", "1", 1.0, 3.0, 2.0),
        Fault("backlash", "fault.backlash", "1", 1.0, 100.0, 99.0),
        Fault("N_a", "fault.N_a", "1", 1.0, 0.7, 0.3),
        Fault("N_b", "fault.N_b", "1", 1.0, 0.7, 0.3),
        Fault("N_c", "fault.N_c", "1", 1.0, 0.7, 0.3),
        Fault("zeta", "fault.zeta", "1", 0.0, 0.15, 0.15),
        Fault("phi", "fault.phi", "rad", 0.0, None, 2.0 * math.pi),
        Fault("gain", "fault.gain", "1", 1.0, 0.5, 1.0),
    )
}
"""By short name, in the order in which they are told."""

COORDINATES = ("friction", "backlash", "N_a", "N_b", "N_c", "zeta_cos_phi", "zeta_sin_phi", "gain")
"""What is searched: phi has no meaning where zeta is 0, so the eccentricity is a vector. All are smooth there."""
HEALTHY = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0])
SPAN = np.array([FAULTS[name.split("_cos")[0].split("_sin")[0]].span for name in COORDINATES])
LOWEST = np.array([0.2, 0.0, 0.3, 0.3, 0.3, -0.34, -0.34, 0.2])
HIGHEST = np.array([10.0, 300.0, 1.0, 1.0, 1.0, 0.34, 0.34, 3.0])
"""Ends of the search; the eccentricity's corners keep p*zeta < 1."""
ZETA = (5, 6)
"""Places of the eccentricity's two coordinates."""


def scaled(values: Array) -> Array:
    """Coordinates in spans from healthy: 0 is healthy, 1 a whole range away."""
    return (values - HEALTHY) / SPAN


def unscaled(z: Array) -> Array:
    return HEALTHY + SPAN * z


def to_values(z: Array) -> dict[str, float]:
    """Short name -> value of each of FAULTS, from scaled coordinates of shape (8,)."""
    x = unscaled(z)
    values = {name: float(x[place]) for place, name in enumerate(COORDINATES) if place not in ZETA}
    c, s = (float(x[place]) for place in ZETA)
    values["zeta"], values["phi"] = math.hypot(c, s), math.atan2(s, c)
    return {name: values[name] for name in FAULTS}


def from_values(values: Mapping[str, float]) -> Array:
    """Scaled coordinates of shape (8,), from short names; a fault that is not named is healthy."""
    given = {name: values.get(name, fault.healthy) for name, fault in FAULTS.items()}
    x = [given.get(name, 0.0) for name in COORDINATES]
    x[ZETA[0]] = given["zeta"] * math.cos(given["phi"])
    x[ZETA[1]] = given["zeta"] * math.sin(given["phi"])
    return scaled(np.array(x))


def to_parameters(z: Array) -> dict[str, float]:
    """Port name -> value, as the FMUs take them."""
    return {FAULTS[name].port: value for name, value in to_values(z).items()}


def parse_limits(texts: Sequence[str]) -> dict[str, float]:
    """Limits of the health index from texts NAME=VALUE, such as friction=2; HarnessError for one that makes no sense."""
    limits: dict[str, float] = {}
    known = [name for name, fault in FAULTS.items() if fault.limit is not None]
    for text in texts:
        name, equals, number = (part.strip() for part in text.partition("="))
        name = name.removeprefix("fault.")
        if not equals:
            raise HarnessError(f"--limit {text}: NAME=VALUE is needed, such as friction=2")
        if name not in known:
            raise unknown("fault", name, known)
        try:
            value = float(number)
        except ValueError:
            raise HarnessError(f"--limit {text}: '{number}' is not a number") from None
        if not math.isfinite(value) or value == FAULTS[name].healthy:
            raise HarnessError(f"--limit {text}: a number other than {FAULTS[name].healthy:g}, which is healthy, is needed")
        limits[name] = value
    return limits

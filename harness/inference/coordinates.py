"""The coordinates in which faults are searched, derived from `harness.faults`.

A fault of a single value is one coordinate. An amplitude A with an angle phi is the two coordinates A*cos(phi) and
A*sin(phi): the models are smooth there, also at amplitude 0, where the angle means nothing. Scaled coordinates `z` count
spans from healthy: 0 is healthy, 1 is a whole studied range away.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.faults import ESTIMATED, FAULTS, Fault

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinate:
    """One coordinate of the search, in the unit of its `fault`; the fields are those of `Fault`."""

    fault: str
    healthy: float
    span: float
    searched: tuple[float, float]
    studied: tuple[float, float]


def _coordinates(fault: Fault) -> list[Coordinate]:
    if fault.angle is None:
        return [Coordinate(fault.name, fault.healthy, fault.span, fault.searched, fault.studied)]
    bound, largest = fault.searched[1], fault.studied[1]
    return 2 * [Coordinate(fault.name, 0.0, fault.span, (-bound, bound), (-largest, largest))]


COORDINATES = tuple(coordinate for fault in FAULTS.values() for coordinate in _coordinates(fault))
PLACES = {name: [place for place, item in enumerate(COORDINATES) if item.fault == name] for name in FAULTS}
"""Short name of a fault -> places of its coordinates."""
HEALTHY = np.array([item.healthy for item in COORDINATES])
SPAN = np.array([item.span for item in COORDINATES])
LOWEST, HIGHEST = np.array([item.searched for item in COORDINATES]).T
"""Bounds of the search, shape (n_coordinates,)."""
STUDIED = np.array([item.studied for item in COORDINATES]).T
"""Ends of the studied ranges, shape (2, n_coordinates)."""


MOST_ECCENTRIC, MOST_TURNED = 0.97 / math.sqrt(2.0), 1.2
"""Of motor.p times fault.zeta along each coordinate, and of motor.p times fault.resolver_offset [rad], beyond which the
back-EMF or the torque changes its sign: more pole pairs leave less room than the search has."""


def bounds(pairs: float) -> tuple[Array, Array]:
    """Lowest and highest scaled coordinates, shape (n_coordinates,) each, of a search in a motor of so many pole pairs."""
    low, high = LOWEST.copy(), HIGHEST.copy()
    for name, most in (("zeta", MOST_ECCENTRIC), ("resolver_offset", MOST_TURNED)):
        places = PLACES[name]
        low[places], high[places] = np.maximum(low[places], -most / pairs), np.minimum(high[places], most / pairs)
    return scaled(low), scaled(high)


def scaled(values: Array) -> Array:
    """Scaled coordinates of unscaled ones, shape (..., n_coordinates) both."""
    return (values - HEALTHY) / SPAN


def unscaled(z: Array) -> Array:
    """The inverse of `scaled`."""
    return HEALTHY + SPAN * z


def to_values(z: Array) -> dict[str, float]:
    """Short name -> value of each of ESTIMATED, from scaled coordinates of shape (n_coordinates,)."""
    x = unscaled(z)
    values: dict[str, float] = {}
    for name, fault in FAULTS.items():
        own = x[PLACES[name]].tolist()
        if fault.angle is None:
            (values[name],) = own
        else:
            values[name], values[fault.angle.name] = math.hypot(*own), math.atan2(own[1], own[0])
    return values


def from_values(values: Mapping[str, float]) -> Array:
    """Scaled coordinates of shape (n_coordinates,), from short names; what is not named is healthy."""
    x = HEALTHY.copy()
    for name, fault in FAULTS.items():
        value = values.get(name, fault.healthy)
        if fault.angle is None:
            x[PLACES[name]] = value
        else:
            angle = values.get(fault.angle.name, fault.angle.healthy)
            x[PLACES[name]] = value * math.cos(angle), value * math.sin(angle)
    return scaled(x)


def to_parameters(z: Array) -> dict[str, float]:
    """Port name -> value, as the FMUs take them."""
    return {ESTIMATED[name].port: value for name, value in to_values(z).items()}

"""What a calibration has written into an actuator file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.actuators.values import Stated, stated_for
from harness.errors import HarnessError, unknown
from harness.files.toml import flat
from harness.parameters import settable

KEYS = ("names", "values", "covariance", "nuisances", "noise", "inflation", "model", "files", "date", "by", "remarks")
KINDS = {port.name.partition(".")[0] for port in ports.PARAMETERS}
LEAST_EIGENVALUE = 1e-10
"""Of a matrix of correlations: with less, a combination of the values would be known exactly."""
WIDTH = 1.96
"""Standard deviations from the middle of a 95 % interval to its ends."""


def read_calibration(table: Mapping[str, Any], where: str) -> dict[str, Stated]:
    """The calibrated values, port -> value in its unit, with the half width of the 95 % interval from the covariance.

    `values`: port = value; `names`: what the rows of `covariance` stand for, those of `values` unless it is there; names
    that are no ports are the bench's own. The other KEYS are kept as written. HarnessError, beginning with `where`.
    """
    for key in table:
        if key not in KEYS:
            raise unknown(f"key in {where}:", key, KEYS)
    values = table.get("values", {})
    if not isinstance(values, dict):
        raise HarnessError(f"{where} values: a table of ports is needed, not {values!r}")
    found = {
        name: stated_for(settable(name, f"{where} {name}"), value, Output(), f"{where} {name}")
        for name, value in flat(values, f"{where} values").items()
    }
    names = table.get("names", list(found))
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise HarnessError(f"{where} names: a list of names is needed, not {names!r}")
    _check_names(names, found, where)
    if "covariance" not in table:
        return found
    sigmas = dict(zip(names, np.sqrt(np.diag(_covariance(table["covariance"], len(names), where))), strict=True))
    return {
        name: Stated(item.value, WIDTH * float(sigmas[name]) if name in sigmas else item.tolerance)
        for name, item in found.items()
    }


@dataclass(frozen=True)
class Calibrated:
    """What a calibration found together: `names`, and their `covariance`, shape (n, n), in the units of the names."""

    names: tuple[str, ...]
    covariance: NDArray[np.float64]


def covariance_of(table: Mapping[str, Any]) -> Calibrated:
    """The covariance of a calibration that `read_calibration` has accepted; of no names where it has none."""
    if "covariance" not in table:
        return Calibrated((), np.empty((0, 0)))
    names = tuple(table.get("names", list(flat(table.get("values", {}), "values"))))
    return Calibrated(names, np.array(table["covariance"], dtype=np.float64))


def _check_names(names: list[str], values: Mapping[str, Stated], where: str) -> None:
    """Each name once, every port of `values` among them, and no other name of a port's kind."""
    for place, name in enumerate(names):
        if name in names[:place]:
            raise HarnessError(f"{where} names: {name} is there twice")
        if name not in values and (name in ports.INDEX or name.partition(".")[0] in KINDS):
            raise unknown(f"port in {where} names:", name, values)
    for name in values:
        if name not in names:
            raise HarnessError(f"{where} names: {name} is missing, which is among the values")


def _covariance(given: object, size: int, where: str) -> Any:
    try:
        matrix = np.array(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise HarnessError(f"{where} covariance: {size} rows of {size} numbers are needed, one for each of names")
    largest = math.sqrt(float(np.max(np.abs(np.diag(matrix)), initial=0.0)))
    if (np.diag(matrix) < 0.0).any() or not np.allclose(matrix, matrix.T, rtol=1e-6, atol=1e-12 * largest**2):
        raise HarnessError(f"{where} covariance: it has to be symmetric, with no negative number on its diagonal")
    widths = np.sqrt(np.diag(matrix))
    known = widths > 0.0
    scaled = matrix[np.ix_(known, known)] / np.outer(widths[known], widths[known])
    if matrix[~known].any() or float(np.linalg.eigvalsh(scaled)[0] if known.any() else 1.0) < LEAST_EIGENVALUE:
        raise HarnessError(
            f"{where} covariance: no covariance is like that; some sum of the values would vary not at all, or less than not"
        )
    return matrix

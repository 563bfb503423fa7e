"""Values of a column in its port's own unit, and within what the port accepts."""

import math

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.logs.find import Found
from harness.logs.mapping import LIKE
from harness.units import conversion

Array = NDArray[np.float64]


def inside(found: Found, output: Output, ratio: float) -> Array:
    """The values in the port's own unit, shape (n_rows,), not a number where a cell is empty.

    A column without a unit is in the unit that the port has outside (m and N for an actuator with a lead). A motor speed
    in mm/s is that of the rod: by the lead and the gear's `ratio` it is the rotor's. HarnessError for a unit that measures
    something else, for a column without a number, and for what an input does not accept.
    """
    key = LIKE.get(found.spec.key, found.spec.key)
    values = found.numbers()
    if not np.isfinite(values).any():
        raise HarnessError(f"{found.where}: holds no number in any row")
    if key == "temperature":
        scale, offset = conversion(found.unit, "degC", found.where) if found.unit else (1.0, 0.0)
        return values * scale + offset
    if key == "motor_speed" and output.lead is not None and found.unit and _measures(found, "m/s"):
        scale, _ = conversion(found.unit, "m/s", found.where)
        return values * (scale / output.scale("position") * ratio)
    outside, own = output.unit(key), ports.VARIABLES[ports.INDEX[key]].unit
    if outside != own and found.unit and _measures(found, own):
        scale, offset = conversion(found.unit, own, found.where)
        converted = values * scale + offset
    else:
        scale, offset = conversion(found.unit, outside, found.where) if found.unit else (1.0, 0.0)
        converted = output.inside(key, values if (scale, offset) == (1.0, 0.0) else values * scale + offset)
    if found.spec.key != "position_error":
        check_range(found, key, converted, values)
    return converted


def _measures(found: Found, unit: str) -> bool:
    """Whether the column's unit measures what `unit` does."""
    try:
        conversion(found.unit, unit, "")
    except HarnessError:
        return False
    return True


def check_range(found: Found, key: str, values: Array, written: Array) -> None:
    """HarnessError, with the line, if a value of an input, as `written` in the file, is one that the FMUs refuse."""
    port = ports.VARIABLES[ports.INDEX[key]]
    if port.causality != "input":
        return
    low = -math.inf if port.minimum is None else port.minimum
    high = math.inf if port.maximum is None else port.maximum
    wrong = np.flatnonzero((values < low) | (values > high))
    if wrong.size:
        row = int(wrong[0])
        stated = "" if values[row] == written[row] else f" (as {written[row]:g} {found.unit})"
        raise HarnessError(f"{found.cell(row)}: {values[row]:g}{stated} is out of range, {low:g} to {high:g} {port.unit}")

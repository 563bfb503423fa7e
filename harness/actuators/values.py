"""Values as users state them: a number in the port's unit, or a text with a unit and a tolerance."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.files.toml import flat
from harness.parameters import also_in, check_unit, check_value, settable
from harness.units import conversion, split

LEAST_LEAD, MOST_LEAD = 1e-6, 1e3
"""Leads [m a turn] that are accepted."""
LONGEST_NAME = 100
PLUS_MINUS = re.compile(r"\+\s*/?\s*-|±")


@dataclass(frozen=True)
class Stated:
    """A value, and the half width of the interval around it, None if none is stated; both in the unit that was asked for."""

    value: float
    tolerance: float | None = None

    @property
    def relative(self) -> float | None:
        """The half width as a fraction of the value."""
        return self.tolerance / abs(self.value) if self.tolerance is not None and self.value else None

    def times(self, factor: float) -> "Stated":
        """This value, scaled."""
        return Stated(self.value * factor, None if self.tolerance is None else self.tolerance * abs(factor))


def stated(given: object, unit: str, where: str, *, outside: tuple[str, float] | None = None) -> Stated:
    """What `given`, a number or a text such as "600 g.cm2 +- 5 %", means in `unit`.

    `outside`: another unit that it may be in, and what a value in that unit is divided by to be in `unit`. HarnessError,
    beginning with `where`, if it is no finite number, or in a unit that measures something else.
    """
    if isinstance(given, bool) or not isinstance(given, str | int | float):
        raise HarnessError(f"{where}: {given!r} is not a number, or a text with a unit such as '{f'1 {unit}'.strip()}'")
    if not isinstance(given, str):
        return Stated(_number(given, where))
    parts = PLUS_MINUS.split(given)
    if len(parts) > 2:
        raise HarnessError(f"{where}: '{given}' has more than one tolerance")
    value, own = split(parts[0], unit, where)
    if len(parts) == 1:
        scale, offset = _conversion(own, unit, where, outside)
        return Stated(_finite(value * scale + offset, given, where))
    width, of_width = split(parts[1], unit, where)
    if width < 0.0:
        raise HarnessError(f"{where}: '{given}': a tolerance of 0 or more is needed")
    relative = of_width in ("%", "percent") and own != of_width
    scale, offset = _conversion(own or ("" if relative else of_width), unit, where, outside)
    centre = _finite(value * scale + offset, given, where)
    if relative:
        return Stated(centre, _finite(abs(centre) * width / 100.0, given, where))
    return Stated(centre, _finite(width * abs(_conversion(of_width or own, unit, where, outside)[0]), given, where))


def _number(given: float, where: str) -> float:
    try:
        value = float(given)
    except OverflowError:
        raise HarnessError(f"{where}: a whole number of {len(str(given))} digits is too large") from None
    if not math.isfinite(value):
        raise HarnessError(f"{where}: {given} is not a finite number")
    return value


def _conversion(given: str, unit: str, where: str, outside: tuple[str, float] | None) -> tuple[float, float]:
    return conversion(given, unit, where, outside) if given else (1.0, 0.0)


def _finite(value: float, given: str, where: str) -> float:
    if not math.isfinite(value):
        raise HarnessError(f"{where}: '{given}' is not a finite number")
    return value


def stated_lead(given: object, where: str) -> float:
    """A lead [m a turn]; HarnessError, beginning with `where`, for a tolerance, or one that no screw has."""
    lead = stated(given, "m/turn", where, outside=("m", 1.0))
    if lead.tolerance is not None:
        raise HarnessError(f"{where}: a length without a tolerance is needed; gear.ratio may have one")
    if not LEAST_LEAD <= lead.value <= MOST_LEAD:
        raise HarnessError(f"{where}: {lead.value:g} m a turn is out of range, {LEAST_LEAD:g} to {MOST_LEAD:g} m")
    return lead.value


def checked_name(name: str, where: str) -> str:
    """The name of an actuator, which also names files; HarnessError, beginning with `where`, for one that cannot."""
    if not name.isprintable() or "/" in name or "\\" in name or name in (".", "..") or len(name) > LONGEST_NAME:
        raise HarnessError(
            f"{where}: {name[:LONGEST_NAME]!r} cannot name a file; a name without / and \\, of at most {LONGEST_NAME} "
            "characters, is needed"
        )
    return name


def stated_for(variable: ports.Variable, given: object, output: Output, where: str) -> Stated:
    """What `given` means for a port; an Enumeration takes the name of an item, a Boolean true or false.

    With a lead, user-side angles may be lengths, and a load torque a force. HarnessError, beginning with `where`, as from
    `stated`, or if the port does not accept the value.
    """
    words: Mapping[str, float] = {"true": 1.0, "false": 0.0} if variable.kind == "Boolean" else variable.items
    if variable.kind == "Boolean" and isinstance(given, bool):
        found = Stated(float(given))
    elif isinstance(given, str) and given.strip().lower() in words:
        found = Stated(float(words[given.strip().lower()]))
    elif variable.kind == "Boolean" or (isinstance(given, str) and words):
        wanted = "true or false" if variable.kind == "Boolean" else " or ".join(["a number", *words])
        raise HarnessError(f"{where}: {given!r} is not {wanted}")
    else:
        if isinstance(given, str):
            check_unit(variable, PLUS_MINUS.split(given)[0], where)
        own, scale = output.unit(variable.name), output.scale(variable.name)
        found = stated(given, variable.unit, where, outside=(own, scale) if own != variable.unit else also_in(variable))
    check_value(variable, found.value, where)
    return found


def tolerances_of(table: Mapping[str, Any], values: Mapping[str, float], output: Output, where: str) -> dict[str, float]:
    """Port -> half width of the interval around its value, in the port's unit, from a table of numbers and texts.

    A number is in the port's unit; a text has a unit, or is a percentage of the value: that in `values`, or the port's
    default. HarnessError, beginning with `where`, as from `stated`, or for a port whose value cannot be off by a little.
    """
    return {
        name: tolerance_for(name, given, values, output, f"{where} {name}") for name, given in flat(table, where).items()
    }


def tolerance_for(name: str, given: object, values: Mapping[str, float], output: Output, where: str) -> float:
    """The half width that `given` means for the port `name`; arguments and errors as for `tolerances_of`."""
    variable = settable(name, where)
    if variable.kind != "Real":
        raise HarnessError(f"{where}: {variable.kind} has no tolerance, its value is exact")
    text = PLUS_MINUS.sub("", given).strip() if isinstance(given, str) else given
    if isinstance(text, str) and text.endswith("%"):
        share, value = stated(text.removesuffix("%"), "", where), values.get(name, variable.start)
        if value == 0.0:
            raise HarnessError(f"{where}: {given} of 0 is nothing; a tolerance in {variable.unit} is needed")
        width = abs(value) * share.value / 100.0
    else:
        own, scale = output.unit(name), output.scale(name)
        other = (own, scale) if own != variable.unit else also_in(variable)
        if isinstance(text, str):
            check_unit(variable, text, where)
        width = stated(text, variable.unit, where, outside=other).value
    if not width > 0.0:
        raise HarnessError(f"{where}: a tolerance of more than 0 is needed, not {given}")
    return width

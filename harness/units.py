"""Quantities with units, as users write them (`600 g.cm2`, `135 rpm/V`, `-4,5 mm`), in the unit that is needed.

By pint. A dot or a middle dot between units multiplies, a number behind a unit is its power, as on data sheets.
"""

import re
from functools import cache

import pint

from harness.errors import HarnessError

PERIODS = re.compile(r"\b[kMG]?hz\b|\bhertz\b", re.IGNORECASE)
_PER_MINUTE = re.compile(r"(?<![A-Za-z])min(?:ute)?(?![A-Za-z])", re.IGNORECASE)
_ANGLES = re.compile(r"rad|deg|°|rpm|rev|turn", re.IGNORECASE)
_NUMBER = re.compile(r"\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL)


@cache
def _registry() -> pint.UnitRegistry:
    registry: pint.UnitRegistry = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    registry.define("Ohm = ohm")
    return registry


@cache
def conversion(unit: str, target: str, where: str) -> tuple[float, float]:
    """(scale, offset): a value in `unit`, times scale, plus offset, is the value in `target`.

    An empty unit, "-" and "1" are dimensionless. HarnessError, beginning with `where`, for a unit that is unknown or
    measures something else; a frequency in Hz is no angular speed: it is off by 2*pi, and refused.
    """
    if bool(PERIODS.search(unit)) != bool(PERIODS.search(target)) and "rad" in unit + target:
        raise HarnessError(f"{where}: [{unit}] counts periods, [{target}] radians; 1 Hz is 6.2832 rad/s, convert it first")
    if _PER_MINUTE.search(unit) and not _ANGLES.search(unit) and "rad" in target:
        raise HarnessError(f"{where}: [{unit}] counts turns a minute, [{target}] radians; write rpm for 1/min")
    registry = _registry()
    try:
        zero, one = (registry.Quantity(value, _spelled(unit)).to(_spelled(target)).magnitude for value in (0.0, 1.0))
    except pint.DimensionalityError:
        raise HarnessError(f"{where}: [{unit}] does not measure what [{target}] does") from None
    except Exception as error:  # noqa: BLE001 (pint passes on what its tokenizer raises)
        raise HarnessError(f"{where}: '{unit}' is not a known unit ({error}); such as {target or '%'}") from None
    return float(one) - float(zero), float(zero)


def split(text: str, target: str, where: str) -> tuple[float, str]:
    """The number of `text`, and the unit behind it as written, "" if there is none.

    HarnessError, beginning with `where`, if it begins with no number; `target` is the unit of the example that is given.
    """
    match = _NUMBER.fullmatch(text)
    if not match:
        raise HarnessError(f"{where}: '{text}' is not a number with a unit, such as '{f'1 {target}'.strip()}'")
    return float(match[1].replace(",", ".")), match[2].strip()


def quantity(text: str, target: str, where: str) -> float:
    """The number of `text`, a value with a unit or without (then it is in `target`), in `target`.

    HarnessError, beginning with `where`, if it is no number, or as from `conversion`.
    """
    value, unit = split(text, target, where)
    if not unit:
        return value
    scale, offset = conversion(unit, target, where)
    return value * scale + offset


def _spelled(unit: str) -> str:
    """The unit as pint reads it."""
    if unit.strip() in ("", "-", "1"):
        return "dimensionless"
    text = unit.strip().replace("Ω", "ohm").replace("µ", "u").replace("μ", "u").replace("²", "2").replace("³", "3")
    text = text.replace("°C", "degC").replace("°", "deg").replace("%", "percent")
    text = re.sub(r"(?<=[A-Za-z0-9)])\s*[.·⋅*]\s*(?=[A-Za-z(])", "*", text)
    return re.sub(r"(?<=[A-Za-z])\^?(-?\d+)", r"**\1", text)


@cache
def is_unit(text: str) -> bool:
    """Whether `text` names a unit, such as `mm/s` or `%`."""
    try:
        _registry().parse_units(_spelled(text).replace("dimensionless", ""))
    except Exception:  # noqa: BLE001 (pint passes on what its tokenizer raises)
        return False
    return bool(text.strip())

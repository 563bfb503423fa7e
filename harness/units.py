"""Quantities with units, as users write them (`600 g.cm2`, `135 rpm/V`, `-4,5 mm`), in the unit that is needed.

By pint, with the units of units.txt. A dot or a middle dot between units multiplies, a number behind a unit is its power,
and Nm, mNm/A, gcm2, U/min are read as on data sheets. Angles, counts and periods are dimensions: what becomes rad is an
angle, what becomes rad/s an angle over a time; a count, a ratio or a frequency is refused with a word on what to write. Only
a bandwidth may be in Hz, too, for which its port asks (harness/parameters.py): it turns with no shaft.
"""

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from harness.errors import HarnessError

if TYPE_CHECKING:
    import pint

_ALSO = {"N.m.s/rad": "N.m.s", "1/s": "rad/s", "1/turn": "count/turn"}
"""Unit -> one that is the same without its radian or count, or with one, and is as usual."""
_NUMBER = re.compile(r"\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL)
_FACTOR = re.compile(r"\s*([+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)\s+(\S.*)", re.DOTALL)
_TWO_WAYS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_TURNS_A_MINUTE = re.compile(r"\b(?:Upm|(?:U|Umdr|Umdrehungen|r|tr)\.?\s*(?:/\s*[Mm]in\b\.?|[Mm]in\^?-1))")
_OTHER_COUNTS = re.compile(r"pulse|ppr|inc|bit|byte|digit|line|edge|Hz|period", re.IGNORECASE)
"""What may be a part, or a power, of the counts in a turn."""
_SIGNS = {
    "°C": "degC", "º": "°", "˚": "°", "°F": "degF", "°": "deg", "\u03a9": "ohm", "\u2126": "ohm", "µ": "u", "μ": "u",
    "²": "2", "³": "3", "⁻": "-", "¹": "1", "−": "-", "‰": "permille", "%": "percent",
}  # fmt: skip
_UNKNOWN = {
    r"[gG]rad": "write deg, or gon for 400 a turn",
    r"[ck]ps|[ck]pr": "counts or cycles? write rps, rad/s or deg/s, or what one count is, such as [0.01 deg/s]",
    r"[mk]?[AV] ?[rR][mM][sS]|[mk]?[AV]eff": "a root mean square: write the amplitude, sqrt(2) times it, in A or V",
    r"k?gf?[.*]?c?m": "write kgf.cm for a torque",
    r"ozin": "write ozf.in for a torque",
    r"(lb|in)(in|ft|lb)": "write lbf.in or lbf.ft for a torque",
}
"""Spellings that mean several things, or are no unit here -> what to write."""


@cache
def _registry() -> "pint.UnitRegistry":
    import pint  # here, for it takes longer to import than to show a command's help

    return pint.UnitRegistry(str(Path(__file__).with_name("units.txt")), autoconvert_offset_to_baseunit=True)


@cache
def conversion(unit: str, target: str, where: str, also: tuple[str, float] | None = None) -> tuple[float, float]:
    """(scale, offset): a value in `unit`, times scale, plus offset, is the value in `target`.

    `unit` may have a number before it, such as `0.01 deg`; empty, "-" and "1" are dimensionless. `also`: another unit that
    it may be in, and what a value in that unit is divided by to be in `target`. HarnessError, beginning with `where` and
    ending with what to write, for a unit that is unknown, measures something else, or does not say what it counts.
    """
    try:
        return _conversion(unit, target, where)
    except HarnessError:
        if also is None:
            raise
    scale, offset = _conversion(unit, also[0], where)
    return scale / also[1], offset / also[1]


def _conversion(unit: str, target: str, where: str) -> tuple[float, float]:
    from pint import DimensionalityError

    match = _FACTOR.fullmatch(unit)
    factor, bare = (float(match[1]), match[2]) if match else (1.0, unit)
    if target == "1/turn" and _OTHER_COUNTS.search(bare):
        raise HarnessError(f"{where}: [{unit}] can be read in two ways; write counts/turn, all edges of all tracks counted")
    for aim in (target, _ALSO.get(target, target)):
        try:
            zero, one = (_quantity(value, bare).to(_spelled(aim)).magnitude for value in (0.0, 1.0))
        except DimensionalityError:
            continue
        except Exception:  # noqa: BLE001 (pint passes on what its tokenizer raises)
            advice = _advice_on(bare) or f"write one such as {target or '%'}"
            raise HarnessError(f"{where}: '{bare}' is not a known unit; {advice}") from None
        return factor * (float(one) - float(zero)), float(zero)
    raise HarnessError(f"{where}: {_mismatch(unit, bare, target)}")


def split(text: str, target: str, where: str) -> tuple[float, str]:
    """The number of `text`, and the unit behind it as written, "" if there is none.

    HarnessError, beginning with `where`, if it begins with no number, or with one that can be read in two ways; `target` is
    the unit of the example that is given.
    """
    match = _NUMBER.fullmatch(text)
    if not match or re.match(r"(?!1(?:/|\s*$))[\d.,'+]", match[2]):
        raise HarnessError(f"{where}: '{text}' is not a number with a unit, such as '{f'1 {target}'.strip()}'")
    if _TWO_WAYS.fullmatch(match[1]):
        plain, decimal = match[1].replace(",", ""), match[1].replace(",", ".")
        raise HarnessError(f"{where}: '{text}' may have thousands or decimals behind its comma; write {plain} or {decimal}")
    return float(match[1].replace(",", ".")), match[2].strip()


def quantity(text: str, target: str, where: str, also: tuple[str, float] | None = None) -> float:
    """The number of `text`, a value with a unit or without (then it is in `target`), in `target`; `also` as `conversion`.

    HarnessError, beginning with `where`, if it is no number, or as from `conversion`.
    """
    value, unit = split(text, target, where)
    if not unit:
        return value
    scale, offset = conversion(unit, target, where, also)
    return value * scale + offset


@cache
def is_unit(text: str) -> bool:
    """Whether `text` names a unit, such as `mm/s` or `%`; also one that `conversion` refuses with advice, such as `Arms`."""
    bare = text.strip()
    if bare in ("", "-", "1"):
        return False
    try:
        _registry().parse_units(_spelled(bare))
    except Exception:  # noqa: BLE001 (pint passes on what its tokenizer raises)
        return bool(_advice_on(bare))
    return True


def _quantity(value: float, unit: str) -> "pint.Quantity":  # type: ignore[type-arg]
    return _registry().Quantity(value, _spelled(unit))


def _dimensions(unit: str) -> dict[str, object]:
    return {str(name): power for name, power in _quantity(1.0, unit).dimensionality.items()}


def _spelled(unit: str) -> str:
    """The unit as pint reads it; ValueError for a tower of powers, which would be computed for ever."""
    text = unit.strip()
    if text in ("", "-", "1"):
        return "dimensionless"
    for sign, meant in _SIGNS.items():
        text = text.replace(sign, meant)
    text = _TURNS_A_MINUTE.sub("rpm", text)
    text = re.sub(r"/\s*1000\s*rpm\b", "/krpm", text)
    text = re.sub(r"\b(k?g)(c?m|mm)\^?2\b", r"\1*\2**2", text)
    text = re.sub(r"(?<=[A-Za-z])-(?=[A-Za-z])", "*", text)
    text = re.sub(r"(?<=[A-Za-z0-9)])\s*[.·⋅*]\s*(?=[A-Za-z(])", "*", text)
    text = re.sub(r"(?<=[A-Za-z])\^?(-?\d+)", r"**\1", text)
    if len(text) > 80 or re.search(r"[\d)]\s*(\*\*|\^)|(\*\*|\^)\s*\(", text):
        raise ValueError(text)
    return text


def _advice_on(unit: str) -> str:
    return next((advice for pattern, advice in _UNKNOWN.items() if re.fullmatch(pattern, unit.strip())), "")


def _mismatch(unit: str, bare: str, target: str) -> str:
    """What is wrong with a unit that measures something else than `target`, and what would do."""
    of = _dimensions(bare)
    missing = _dimensions(target)
    angle = missing.get("[angle]", 0) != 0
    if "[period]" in of:
        return f"[{unit}] counts periods, not what [{target}] does; 1 Hz is 6.2832 rad/s, convert it first"
    if target == "rad" and (not of or "[count]" in of):
        return f"[{unit}] is no angle, [{target}] is needed; state what one of it is, such as [0.01 deg]"
    if "[count]" in of and target in ("", "1"):
        return f"[{unit}] counts; a number without a unit is needed, or one in %"
    if "[count]" in of and target == "1/turn":
        return f"[{unit}] counts, but not by turns of the motor; write counts/turn"
    if "[count]" in of:
        return f"[{unit}] counts, [{target}] is needed; state what one of it is, such as [0.01 {target}]"
    told = f"[{unit}] does not measure what [{target}] does"
    if "[period]" in missing:
        return f"{told}; periods in a time are needed, such as [kHz]: 1 Hz is 6.2832 rad/s"
    without = {name: power for name, power in missing.items() if name != "[angle]"}
    if {name: power for name, power in of.items() if name != "[angle]"} == without:
        if angle and "min" in bare:
            return f"{told}: is it turns a minute? write rpm for 1/min"
        return f"{told}: {'an angle is missing in it' if angle else 'there is an angle in it'}"
    if target.startswith("rad") and of == {"[length]": 1, **without}:
        return f"{told}; for a linear actuator, state [output] lead in its file"
    weights = re.sub(r"(?<![A-Za-z])(kg|g|oz|lb)(?![A-Za-z])", r"\1f", bare)
    if weights != bare and _dimensions(weights) == missing:
        return f"{told}; for weights write {weights}"
    return told

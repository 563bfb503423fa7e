"""Which column is what: texts such as `2 [mm] held`, from `--column PORT=...` and from an actuator's `[log]`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from harness.errors import HarnessError, unknown
from harness.logs.log import CHANNELS, Between, Logger
from harness.units import conversion, quantity

INPUTS = ("command", "load_torque", "supply_voltage")
OTHERS = ("run", "group", "position_error", "position_demand", "temperature")
KEYS: tuple[str, ...] = ("time", *INPUTS, *CHANNELS, *OTHERS)
"""What a column can be: an input, an output that is compared, and what says how rows belong together."""
SIDED = ("position", "position_error")
"""What may be measured on the motor and given on the user's side."""
_BRACKET = re.compile(r"(?P<column>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*(?P<words>[^\[\]]*)")
_WORDS = re.compile(
    r"(?P<column>.*?)(?P<words>(?:\s+(?:held|ramped|motor|user|sampled|averaged|filtered\s+[\d.,eE+-]+\s*[a-zµ]*))+)",
    re.DOTALL,
)
_FILTERED = re.compile(r"filtered\s+([\d.,eE+-]+\s*[a-zµ]*)")


@dataclass(frozen=True)
class ColumnSpec:
    """A column as a user names it.

    `key`: one of KEYS; `column`: header word, 1-based number or dotted path; `unit`: "" if not stated. `between`: what a
    command does between rows. `motor`: measured on the motor. `logger`: how the rows were taken. `text`: as written.
    """

    key: str
    column: str
    unit: str = ""
    between: Between | None = None
    motor: bool = False
    logger: Logger | None = None
    text: str = ""


def parse_columns(texts: Sequence[str], log: Mapping[str, str] | None = None) -> dict[str, str]:
    """Key -> text, from options `PORT=COLUMN [unit] words` over an actuator's `[log]`; HarnessError for an unknown port."""
    columns = dict(log or {})
    given: set[str] = set()
    for text in texts:
        key, equals, rest = (part.strip() for part in text.partition("="))
        if not equals or not key or not rest:
            raise HarnessError(f"--column {text}: PORT=COLUMN [unit] is needed, such as 'position=4 [mm]'")
        if key in given:
            raise HarnessError(f"--column {text}: {key} is given twice")
        given.add(key)
        columns[key] = rest
        parse_spec(key, rest, f"--column {text}")
    return columns


def parse_specs(columns: Mapping[str, str]) -> dict[str, ColumnSpec]:
    """The specs of texts by key."""
    return {key: parse_spec(key, text, f"column {key}={text}") for key, text in columns.items()}


def parse_spec(key: str, text: str, where: str) -> ColumnSpec:
    """The spec that `COLUMN [unit] words` means for `key`; HarnessError, beginning with `where`, if it means none."""
    if key not in KEYS:
        raise unknown(f"port in {where}:", key, KEYS)
    match = _BRACKET.fullmatch(text.strip()) or _WORDS.fullmatch(text.strip())
    parts = match.groupdict() if match else {"column": text.strip()}
    column, unit, words = parts["column"].strip(), parts.get("unit") or "", parts.get("words") or ""
    if not column:
        raise HarnessError(f"{where}: a column is needed before the unit, by its word or number")
    spec = {"unit": unit.strip(), "text": text}
    return ColumnSpec(key, column, **spec, **_parsed(key, words, where))  # type: ignore[arg-type]


def _parsed(key: str, words: str, where: str) -> dict[str, object]:
    """What the words behind the unit say."""
    found: dict[str, object] = {}
    if match := _FILTERED.search(words):
        tau = quantity(match[1], "s", where)
        if not tau > 0.0:
            raise HarnessError(f"{where}: a filter's time constant is more than 0")
        found["logger"] = Logger("filtered", tau)
        words = words.replace(match[0], " ")
    for word in words.split():
        if word in ("held", "ramped") and key in ("command", "position_demand"):
            found["between"] = Between(word)
        elif word in ("motor", "user") and key in SIDED:
            found["motor"] = word == "motor"
        elif word in ("sampled", "averaged") and key in CHANNELS:
            found["logger"] = Logger(word)
        else:
            raise HarnessError(
                f"{where}: '{word}' says nothing of {key}; held or ramped goes with the command, motor or user with the "
                "position, sampled, averaged or 'filtered 2 ms' with what is measured"
            )
    if "logger" in found and key not in CHANNELS:
        raise HarnessError(f"{where}: sampled, averaged or filtered goes with what is measured, not with {key}")
    return found


TURNS_A_MINUTE = re.compile(r"Upm|(?:U|Umdr?\.?|Umdrehungen)(?:\s*/\s*[Mm]in\.?|\s*[Mm]in\^?-1)")
"""Turns a minute, as German drives write them; by pint, U/min would be an enzyme's."""
GIGA = re.compile(r"[GM]rad\b")
"""Degrees or gons, and milliradians, to whoever writes it; giga- and megaradians by pint."""
DIMENSIONLESS = re.compile(r"%|percent|ppm|counts?|1|bits?|incs?|increments?", re.IGNORECASE)


def in_unit(unit: str, target: str, where: str) -> tuple[float, float]:
    """As `units.conversion`; but counts and per cent are no angles, and a length where an angle is due needs a lead."""
    if "rad" in target and DIMENSIONLESS.fullmatch(unit.strip()):
        raise HarnessError(
            f"{where}: [{unit}] is no angle, [{target}] is needed; state what one of it is, such as [0.01 deg]"
        )
    if "rad" in target and GIGA.match(unit.strip()):
        raise HarnessError(f"{where}: [{unit}] can be read in two ways; write deg, gon, rad or mrad")
    if target == "rad/s" and TURNS_A_MINUTE.fullmatch(unit.strip()):
        unit = "rpm"
    try:
        return _scaled(unit, target, where)
    except HarnessError as error:
        if "does not measure" in str(error) and _fits(unit, target.replace("rad", "m")):
            raise HarnessError(f"{error}; for a linear actuator, state [output] lead in its file") from None
        raise


def _scaled(unit: str, target: str, where: str) -> tuple[float, float]:
    """A unit may have a number before it: `0.01 deg`."""
    match = re.fullmatch(r"\s*([+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)\s+(\S.*)", unit)
    factor, bare = (float(match[1]), match[2]) if match else (1.0, unit)
    scale, offset = conversion(bare, target, where)
    return factor * scale, offset


def _fits(unit: str, target: str) -> bool:
    try:
        conversion(unit, target, "")
    except HarnessError:
        return False
    return True

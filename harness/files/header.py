"""Header words with units: `position [rad]`, `speed (rpm)`, `current/A`, `Weg in mm`, `t_ms`, `angle °`."""

import re
from collections.abc import Sequence

from ema_fmu_src import ports
from harness.units import is_unit

_BRACKETS = re.compile(
    r"(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\)|\{(?P<curly>[^{}]*)\}|<(?P<angle>[^<>]*)>)\s*"
)
_SPLIT = re.compile(r"(?P<name>.+?)(?:\s*/\s*|\s+in\s+|\s*,\s+)(?P<unit>[^,\s]+)")
_FACTOR = re.compile(r"[+-]?[\d.,]+(?:[eE][+-]?\d+)?\s+")
"""Before a unit: (0.1 N.m)."""
_SIGN = re.compile(r"(?P<name>.*?[A-Za-z0-9)])[\s_]*(?P<unit>[°º˚]\s?[CF]?|℃|[%‰])")
_TAILS = {
    "s": "s", "sec": "s", "ms": "ms", "us": "us", "ns": "ns", "rad": "rad", "mrad": "mrad", "deg": "deg", "mm": "mm",
    "um": "um", "cm": "cm", "rpm": "rpm", "rads": "rad/s", "rad_s": "rad/s", "rad_per_s": "rad/s", "deg_s": "deg/s",
    "degs": "deg/s", "deg_per_s": "deg/s", "mm_s": "mm/s", "mms": "mm/s", "mm_per_s": "mm/s", "m_s": "m/s",
    "m_per_s": "m/s", "mA": "mA", "Nm": "N.m", "mNm": "mN.m", "kN": "kN", "mV": "mV", "degC": "degC", "A": "A",
    "V": "V", "N": "N", "Ncm": "N.cm", "RPM": "rpm", "DEG": "deg", "RAD": "rad", "MM": "mm", "MS": "ms", "SEC": "s",
    "volts": "V", "amps": "A", "N_m": "N.m", "mN_m": "mN.m", "N_mm": "N.mm",
}  # fmt: skip
"""Endings of header words that are units, as they are written there."""
_LETTERS = {"A", "V", "N"}
"""Endings that may also name a phase."""
_PHASES = {"B", "C", "U", "W"}
OWN = {variable.name for variable in (*ports.INPUTS, *ports.OUTPUTS)}


def parse_words(words: Sequence[str]) -> list[tuple[str, str]]:
    """(name, unit as written) of each header word; the unit is "" where the word holds none."""
    ends = {re.split(r"[_ -]", word.strip())[-1] for word in words}
    phases = bool(ends & _PHASES)
    return [_parsed(word.strip().strip('"').strip(), phases) for word in words]


def _parsed(word: str, phases: bool) -> tuple[str, str]:
    if word.lower().replace(" ", "_") in OWN:
        return word, ""
    if match := _BRACKETS.fullmatch(word):
        square = match["square"]
        unit = next(part for part in (square, match["round"], match["curly"], match["angle"]) if part is not None)
        unit = _with_one_degree(unit.strip())
        if match["name"] and (square is not None or not re.search(r"\w", unit) or is_unit(_FACTOR.sub("", unit))):
            return match["name"], unit
        return word, ""
    if match := _SIGN.fullmatch(word):
        return match["name"], _with_one_degree(match["unit"])
    if (match := _SPLIT.fullmatch(word)) and is_unit(match["unit"]):
        return match["name"], match["unit"]
    for sign in re.finditer(r"(?<=.)[_ -]", word):
        tail = word[sign.end() :]
        if tail in _TAILS and (tail not in _LETTERS or not phases):
            return word[: sign.start()], _TAILS[tail]
    return word, ""


def _with_one_degree(unit: str) -> str:
    """The unit with the sign of degrees in place of its doubles, the masculine ordinal and the ring."""
    return re.sub("[º˚]", "°", unit).replace("° ", "°").replace("℃", "°C")


def is_port(word: str) -> bool:
    """Whether a word is the own name of a port, in any case, or the time."""
    return parse_words([word])[0][0].lower().replace(" ", "_") in {*OWN, "time"}

"""Which column is what: texts such as `2 [mm] held`, from `--column PORT=...` and from an actuator's `[log]`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.errors import HarnessError, unknown
from harness.logs.log import CHANNELS, Between, Logger
from harness.units import conversion, quantity

INPUTS = ("command", "load_torque", "supply_voltage")
OTHERS = ("run", "group", "position_error", "position_demand", "temperature")
KEYS: tuple[str, ...] = ("time", *INPUTS, *CHANNELS, *OTHERS)
"""What a column can be: an input, an output that is compared, and what says how rows belong together."""
LABELS = ("run", "group")
LIKE = {"position_error": "position", "position_demand": "command"}
"""The port whose unit another key has."""
SIDED = ("position", "position_error")
"""What may be measured on the motor and given on the user's side."""
_BRACKET = re.compile(r"(?P<column>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*(?P<words>[^\[\]]*)")
_WORDS = re.compile(
    r"(?P<column>.*?)(?P<words>(?:\s+(?:held|ramped|motor|user|sampled|averaged|filtered\s+[\d.,eE+-]+\s*[a-zµ]*))+)",
    re.DOTALL,
)
MOST_TAU = 10.0
"""Largest time constant of a filter [s] that is taken for one (ours): a drive's is some milliseconds."""
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
    for key, other in (("position", "position_error"), ("position_error", "position")):
        if key in given and other not in given:
            columns.pop(other, None)  # the one of [log] is what the option replaces
    return columns


def parse_specs(columns: Mapping[str, str]) -> dict[str, ColumnSpec]:
    """The specs of texts by key."""
    return {key: parse_spec(key, text, f"column {key}={text}") for key, text in columns.items()}


def check_layout(log: Mapping[str, str], output: Output, where: str) -> None:
    """HarnessError, beginning with `where` and the key, for a text of an actuator's `[log]` that no log can be read by."""
    taken: dict[str, str] = {}
    for key, text in log.items():
        spec = parse_spec(key, text, f"{where} {key}")
        if spec.column == "0":
            raise HarnessError(f"{where} {key}: columns are numbered from 1")
        other = taken.setdefault(spec.column, key) if key not in LABELS else key
        if other != key:
            raise HarnessError(f"{where} {key}: '{spec.column}' is the column of {other} too; it can be one of them")
        if spec.unit and key not in LABELS:
            _check_unit(spec, output, f"{where} {key}")


def _check_unit(spec: ColumnSpec, output: Output, where: str) -> None:
    """A unit has to be one of those that are accepted: the port's own, that outside, and a rod's speed for the motor's."""
    if spec.key in ("time", "temperature"):
        accepted = ["s" if spec.key == "time" else "degC"]
    else:
        port = LIKE.get(spec.key, spec.key)
        accepted = [ports.VARIABLES[ports.INDEX[port]].unit, output.unit(port)]
        accepted += ["m/s"] if port == "motor_speed" and output.lead is not None else []
    refusals = []
    for unit in accepted:
        try:
            conversion(spec.unit, unit, where)
        except HarnessError as error:
            refusals.append(error)
    if len(refusals) == len(accepted):
        raise refusals[0]


def parse_spec(key: str, text: str, where: str) -> ColumnSpec:
    """The spec that `COLUMN [unit] words` means for `key`; HarnessError, beginning with `where`, if it means none."""
    if key not in KEYS:
        raise unknown(f"port in {where}:", key, KEYS)
    match = _BRACKET.fullmatch(text.strip()) or _WORDS.fullmatch(text.strip())
    parts = match.groupdict() if match else {"column": text.strip()}
    column, unit, words = parts["column"].strip(), parts.get("unit") or "", parts.get("words") or ""
    if not column:
        raise HarnessError(f"{where}: a column is needed before the unit, by its word or number")
    if column.count("[") != column.count("]"):
        raise HarnessError(f"{where}: '{text}' has a bracket without the other; 'COLUMN [unit] words' is needed")
    spec = {"unit": unit.strip(), "text": text}
    return ColumnSpec(key, column, **spec, **_parsed(key, words, where))  # type: ignore[arg-type]


def _parsed(key: str, words: str, where: str) -> dict[str, object]:
    """What the words behind the unit say."""
    found: dict[str, object] = {}
    if match := _FILTERED.search(words):
        tau = quantity(match[1], "s", where)
        if not 0.0 < tau <= MOST_TAU:
            raise HarnessError(f"{where}: a filter's time constant is more than 0, and at most {MOST_TAU:g} s")
        found["logger"] = Logger("filtered", tau)
        words = words.replace(match[0], " ")
    for word in words.split():
        told = len(found)
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
        if len(found) == told:
            raise HarnessError(f"{where}: '{word}' comes after a word that says the same or the contrary; one is needed")
    if "logger" in found and key not in CHANNELS:
        raise HarnessError(f"{where}: sampled, averaged or filtered goes with what is measured, not with {key}")
    return found

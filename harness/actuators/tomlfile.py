"""An actuator from a TOML file: every table and key is known, every value checked; README.md here describes the format."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ema_fmu_src import ports
from harness.actuators.actuator import Actuator, Output
from harness.actuators.calibrated import read_calibration
from harness.actuators.derived import no_load_current
from harness.actuators.doubts import doubts
from harness.actuators.sheet import CLOSE, WORDS, from_sheet
from harness.actuators.values import Stated, checked_name, stated, stated_for, stated_lead, tolerances_of
from harness.errors import HarnessError, unknown
from harness.faults import checked_limit
from harness.files.toml import flat, read_toml
from harness.parameters import check_drive, check_together, settable

TABLES = ("parameters", "tolerances", "sheet", "output", "log", "limits", "calibration", "provenance")
KEYS = ("name", "description", *TABLES)
LOG_WORDS = ("time", "run", "group", "position_error", "position_demand", "temperature")
"""Keys of `[log]` that are no ports."""
LOG_KEYS = (*LOG_WORDS, *(port.name for port in (*ports.INPUTS, *ports.OUTPUTS)))
SOURCES = "sources"
"""Table in `[provenance]`: where each number comes from."""


def read_actuator_toml(path: Path) -> Actuator:
    """The actuator in the file at `path`; HarnessError, with file and key, for whatever cannot be used.

    What is stated under `[parameters]` wins over what follows from `[sheet]`, and what is calibrated over both; tolerances
    beside values win over those under `[tolerances]`.
    """
    content = read_toml(path)
    _known(content, KEYS, f"key in {path}:")
    tables = {name: _table(content, name, path) for name in TABLES}
    output = _output(tables["output"], path)
    given = _parameters(tables["parameters"], output, f"{path}, [parameters]")
    sources = _sources(tables["provenance"], path)
    derived = from_sheet(tables["sheet"], given, f"{path}, [sheet]", output)
    calibrated = read_calibration(tables["calibration"], f"{path}, [calibration]")
    values = derived.values | given | calibrated
    origins = (
        {port: _with_source(text, derived.words[port], sources) for port, text in derived.formulas.items()}
        | {port: _with_source("stated", [port], sources) for port in given}
        | dict.fromkeys(calibrated, "calibrated")
    )
    parameters = {port: found.value for port, found in values.items()}
    widths = {port: found.tolerance for port, found in values.items() if found.tolerance is not None}
    check_together(parameters, str(path))
    check_drive(parameters, str(path))
    actuator = Actuator(
        name=checked_name(_text(content, "name", path) or path.stem, f"{path}, name"),
        description=_text(content, "description", path),
        parameters=parameters,
        tolerances=tolerances_of(tables["tolerances"], parameters, output, f"{path}, [tolerances]") | widths,
        origins=origins,
        output=output,
        log=_log(tables["log"], f"{path}, [log]"),
        limits=_limits(tables["limits"], f"{path}, [limits]"),
        calibration=tables["calibration"],
        provenance=tables["provenance"],
        warnings=(*derived.warnings, *doubts(parameters, output)),
    )
    return replace(actuator, warnings=(*actuator.warnings, *_no_load(actuator, tables["sheet"])))


def _no_load(actuator: Actuator, words: Mapping[str, Any]) -> list[str]:
    """A line if the sheet's no-load current, of which it does not state the speed, is not what the friction needs."""
    if "no_load_current" not in words or "no_load_speed" in words:
        return []
    sheet, own = stated(words["no_load_current"], WORDS["no_load_current"], "").value, no_load_current(actuator)
    if abs(own - sheet) <= CLOSE * max(own, sheet):
        return []
    line = f"no-load current {own:.4g} A at the no-load speed, (T_coulomb + C*w_0)/K_t, but no_load_current is {sheet:.4g} A"
    return [f"{line}; state no_load_speed beside it, or both frictions"]


def _known(names: Iterable[str], choices: Iterable[str], what: str) -> None:
    listed = list(choices)
    for name in names:
        if name not in listed:
            raise unknown(what, name, listed)


def _table(content: Mapping[str, Any], name: str, path: Path) -> dict[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise HarnessError(f"{path}, {name}: a table [{name}] is needed, not {table!r}")
    return table


def _text(content: Mapping[str, Any], key: str, path: Path) -> str:
    text = content.get(key, "")
    named = key != "name" or (key not in content) or (isinstance(text, str) and text.strip() and text.isprintable())
    if not isinstance(text, str) or not named:
        raise HarnessError(f"{path}, {key}: a text is needed, not {text!r}")
    return text.strip()


def _output(table: Mapping[str, Any], path: Path) -> Output:
    _known(table, ("lead",), f"key in {path}, [output]:")
    if "lead" not in table:
        return Output()
    return Output(stated_lead(table["lead"], f"{path}, [output] lead"))


def _parameters(table: Mapping[str, Any], output: Output, where: str) -> dict[str, Stated]:
    return {
        name: stated_for(settable(name, f"{where} {name}"), value, output, f"{where} {name}")
        for name, value in flat(table, where).items()
    }


def _log(table: Mapping[str, Any], where: str) -> dict[str, str]:
    found = {}
    for key, value in table.items():
        if key not in LOG_KEYS:
            raise unknown(f"key in {where}:", key, LOG_KEYS)
        if isinstance(value, bool) or not isinstance(value, str | int) or not str(value).strip():
            raise HarnessError(f"{where} {key}: a text 'COLUMN [unit]' is needed, not {value!r}")
        found[key] = str(value).strip()
    return found


def _limits(table: Mapping[str, Any], where: str) -> dict[str, float]:
    limits: dict[str, float] = {}
    for name, value in flat(table, where).items():
        limits |= checked_limit(name, stated(value, "", f"{where} {name}").value, f"{where} {name}")
    return limits


def _sources(provenance: Mapping[str, Any], path: Path) -> dict[str, str]:
    """Where numbers come from, by port, data-sheet word or `output.lead`."""
    where = f"{path}, [provenance.{SOURCES}]"
    table = provenance.get(SOURCES, {})
    if not isinstance(table, dict):
        raise HarnessError(f"{where}: a table is needed, not {table!r}")
    sources = flat(table, where)
    settables = [port.name for port in (*ports.PARAMETERS, *ports.INPUTS)]
    _known(sources, [*settables, *WORDS, "output.lead"], f"key in {where}:")
    return {name: str(text) for name, text in sources.items()}


def _with_source(text: str, words: Iterable[str], sources: Mapping[str, str]) -> str:
    found = [sources[word] for word in words if word in sources]
    return f"{text}; {', '.join(dict.fromkeys(found))}" if found else text

"""The actuator with what a calibration has found, and its file."""

import datetime
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ema_fmu_src import __version__
from harness.actuators.actuator import Actuator
from harness.actuators.calibrated import WIDTH
from harness.actuators.read import LIBRARY, library
from harness.files.toml import flat, read_toml, toml_text
from harness.inference.prior import SHAKEN, T_STATIC, prior_of
from harness.logs.shown import value_of

ORDER = ("name", "description", "sheet", "parameters", "tolerances", "output", "log", "limits", "provenance", "calibration")
"""The tables of an actuator file, as they are written."""

if TYPE_CHECKING:
    from harness.calibration.result import Calibration


def kept_sigma(name: str, actuator: Actuator, settings: Mapping[str, float]) -> float:
    """Deviation of the model's own error that a parameter keeps however well the runs tell it, in the port's unit: that of
    the static friction in an averaged model at hysteresis control, else 0."""
    if name != T_STATIC:
        return 0.0
    exact = replace(actuator, tolerances={}, calibration={})
    given = {**actuator.parameters, **settings}
    if T_STATIC not in prior_of(exact, given).names:
        return 0.0
    return SHAKEN * value_of(T_STATIC, given)


def calibrated(actuator: Actuator, found: "Calibration", settings: Mapping[str, float]) -> Actuator:
    """`actuator` with the values, tolerances and table of what was found; `settings`: parameters set over its own."""
    from harness.calibration.result import nested

    values = {name: found.parameter(name).value for name in found.linked}
    widths = {name: WIDTH * found.parameter(name).sigma for name in found.linked}
    table: dict[str, Any] = {
        "date": datetime.date.today(),
        "by": f"ema calibrate {__version__}",
        "model": found.fidelity,
        "names": list(found.linked),
        "covariance": found.covariance.tolist(),
        "remarks": list(found.remarks),
        "values": values,
        "inflation": found.inflation.as_dict(),
        "nuisances": nested(found.nuisances),
        "noise": {
            run: {item.channel: {"sigma": item.noise, "order": item.order} for item in found.rests if item.run == run}
            for run in dict.fromkeys(item.run for item in found.rests)
        },
    }
    tolerances = {name: width for name, width in actuator.tolerances.items() if name not in settings}
    return replace(
        actuator,
        parameters={**actuator.parameters, **settings, **values},
        tolerances={**tolerances, **widths},
        origins={**actuator.origins, **dict.fromkeys(settings, "stated"), **dict.fromkeys(values, "calibrated")},
        calibration=table,
    )


def with_files(actuator: Actuator, logs: Sequence[Path]) -> Actuator:
    """The same, with names and SHA-256 of the logs in its table."""
    files = [{"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()} for path in logs]
    return replace(actuator, calibration={**actuator.calibration, "files": files})


def file_text(actuator: Actuator, start: str | None, settings: Mapping[str, float], freed: Mapping[str, float]) -> str:
    """The text of the file of a calibrated `actuator`: what stands in the file, or in the library, under `start`, the name
    that `--actuator` gave; over it the parameters of `settings` and the tolerances `freed`, by port name; and the
    calibration.

    HarnessError if `start` cannot be read any more.
    """
    content = _content(actuator, start)
    stated = flat(content.get("parameters", {}), "[parameters]")
    widths = flat(content.get("tolerances", {}), "[tolerances]")
    before = flat(content.get("calibration", {}).get("values", {}), "[calibration] values")
    values = actuator.calibration["values"]
    for port in before:
        if port not in values:  # it stays as it was, with the width of its own interval
            stated[port] = actuator.value(port)
            widths |= {port: actuator.tolerances[port]} if port in actuator.tolerances else {}
    stated |= settings
    for port, width in freed.items():
        if isinstance(stated.get(port), str):
            stated[port] = actuator.value(port)
        widths[port] = width
    content["parameters"] = stated
    content["tolerances"] = {port: width for port, width in widths.items() if port not in settings}
    content["calibration"] = dict(actuator.calibration)
    return toml_text({key: content[key] for key in ORDER if content.get(key)})


def _content(actuator: Actuator, start: str | None) -> dict[str, Any]:
    """What stands in the file of the start; of what has no TOML, what it says."""
    if start is not None and Path(start).suffix.lower() == ".toml":
        return {"name": actuator.name, **read_toml(Path(start))}
    if start is not None and start in library():
        return {**read_toml(LIBRARY / f"{start}.toml"), "name": actuator.name}
    own = {port: value for port, value in actuator.parameters.items() if port not in actuator.calibration["values"]}
    output = {} if actuator.output.lead is None else {"lead": actuator.output.lead}
    return {"name": actuator.name, "description": actuator.description, "parameters": own, "output": output}

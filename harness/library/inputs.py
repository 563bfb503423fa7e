"""What a script gives, names, paths and datasets, as what the rooms take."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ema_fmu_src import ports
from harness import scratch
from harness.actuators.actuator import DEFAULT, Actuator
from harness.actuators.read import read_actuator
from harness.errors import HarnessError
from harness.files import results
from harness.logs.mapping import check_layout, parse_columns
from harness.logs.trialfile import read_trial
from harness.parameters import check_drive, check_together, parse_settings
from harness.trials import BUILT_IN, Trial, trial

Settings = Mapping[str, float | str | bool]
"""Port name -> a number in the port's unit, a text with a unit, or the name of an item; True and False of a Boolean."""
Given = str | Path | xr.Dataset
"""A file in any format, or a dataset over time [s] with the ports' names, in their units or as its `units` say."""


def actuator_of(given: str | Path | Actuator | None) -> Actuator:
    """An actuator of the library by name, one from a file, or one that is there; None: the default one."""
    if given is None or isinstance(given, Actuator):
        return given or DEFAULT
    found = read_actuator(str(given))
    check_layout(found.log, found.output, f"{given}, [log]")
    return found


def parameters_of(actuator: Actuator, settings: Settings | None) -> dict[str, float]:
    """The parameters of `actuator`, over which `settings` win; HarnessError as from `parse_settings`."""
    parameters = {**actuator.parameters, **stated(settings)}
    check_together(parameters, "set")
    check_drive(parameters, "set")
    return parameters


def stated(settings: Settings | None) -> dict[str, float]:
    """`settings` as numbers, checked against the ports."""
    if isinstance(settings, str) or not isinstance(settings or {}, Mapping):
        raise HarnessError(f"set={settings!r}: a mapping is needed, such as {{'fault.N_a': 0.9}}")
    texts = [f"{name}={_text(value)}" for name, value in (settings or {}).items()]
    return parse_settings(texts)


def _text(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    return repr(float(value)) if isinstance(value, float | np.floating) else str(value)


def columns_of(columns: Mapping[str, str] | None, actuator: Actuator) -> dict[str, str]:
    """Port -> column, unit and words: the actuator's `[log]`, and `columns` over it."""
    return parse_columns([f"{port}={text}" for port, text in (columns or {}).items()], actuator.log)


def trial_of(given: str | Path | xr.Dataset | Trial, actuator: Actuator, columns: Mapping[str, str] | None) -> Trial:
    """A built-in trial by name, one from a file or a dataset, or one that is there.

    A text with a dot or a slash is a file's.
    """
    if isinstance(given, Trial):
        return given
    if isinstance(given, str) and (given.upper() in BUILT_IN or ("." not in given and "/" not in given)):
        return trial(given)
    own = parse_columns([f"{port}={text}" for port, text in (columns or {}).items()], None)
    with log_file(given) as path:
        return read_trial(path, actuator.output, own, actuator.log)


@contextmanager
def log_file(given: Given) -> Iterator[Path]:
    """The path of a file with what is `given`: its own, or that of a copy for as long as it is needed.

    HarnessError for what is no file and no dataset over time.
    """
    if isinstance(given, str | Path):
        yield Path(given)
        return
    if not isinstance(given, xr.Dataset):
        raise HarnessError(f"{type(given).__name__}: a path or an xarray.Dataset over time is needed")
    name = str(given.attrs.get("trial", "dataset")).replace("/", "_")
    with scratch.folder("log") as folder:
        path = folder / f"{name}.csv"
        results.write(path, _csv(given))
        try:
            yield path
        except HarnessError as error:
            raise HarnessError(str(error).replace(str(path), f"dataset {name}")) from None


def _csv(data: xr.Dataset) -> str:
    """A dataset as CSV, the unit of each column in its header where it is not the port's."""
    if "time" not in data.coords or data.time.ndim != 1:
        raise HarnessError(f"the dataset has no coordinate time; it has {', '.join(map(str, data.coords)) or 'none'}")
    wrong = [str(name) for name, series in data.data_vars.items() if series.dims != ("time",)]
    if wrong:
        raise HarnessError(f"the dataset's {', '.join(wrong)}: one dimension is needed, time; choose one run, as by .isel")
    columns = {_header(data, "time"): data.time.values.astype(np.float64)}
    return results.csv_text(columns | {_header(data, str(name)): data[name].values for name in data.data_vars})


def _header(data: xr.Dataset, name: str) -> str:
    unit = data[name].attrs.get("units", "")
    own = "s" if name == "time" else ports.VARIABLES[ports.INDEX[name]].unit if name in ports.INDEX else ""
    return name if unit in ("", own) else f"{name} [{unit}]"


def plain(run: xr.Dataset, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The attributes of a run as a NetCDF file can hold them, without what differs from run to run; `settings` as JSON."""
    kept = {name: value for name, value in run.attrs.items() if isinstance(value, str)}
    return kept | {"parameters": json.dumps(dict(settings))}


def names(given: str | Sequence[str]) -> list[str]:
    """One name or several, also between commas, as a list."""
    return [
        part.strip() for text in ([given] if isinstance(given, str) else given) for part in text.split(",") if part.strip()
    ]

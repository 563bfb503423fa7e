"""What a campaign's dataset is before any case is flown: dimensions, units, parameters of each case, where it comes from."""

import json
from collections.abc import Collection, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr

from ema_fmu_src import __version__, ports
from harness.campaigns.names import names
from harness.campaigns.plan import Plan
from harness.provenance import Provenance

EVERY_CHUNK = {"array.write_empty_chunks": True}
"""Of Zarr: a file for every chunk, also of values that are those of chunks without one; so one that is missing is lost."""
REASON_LENGTH = 200
"""Characters kept of the reason why a case failed."""


def create(path: Path, plan: Plan, digest: str, fmus: Mapping[str, str], record: Provenance | None) -> None:
    """Create the empty dataset as a Zarr store at `path`, in place of what is there; OSError if it cannot be written.

    `fmus`: file name -> hash of each FMU; `record`: how the dataset is made, among its attributes.
    """
    dataset = _coordinates(plan, digest, fmus)
    if record:
        dataset = dataset.assign_attrs(provenance=record.as_text())
    whole = {name: {"chunks": variable.shape or (1,)} for name, variable in dataset.coords.items()}
    with zarr.config.set(EVERY_CHUNK):
        dataset.to_zarr(path, mode="w", encoding=whole, zarr_format=2, consolidated=False)
    add_arrays(zarr.open_group(path, mode="r+"), plan, len(dataset["case"]))
    zarr.consolidate_metadata(path, zarr_format=2)


def add_arrays(group: zarr.Group, plan: Plan, cases: int) -> None:
    """Add the arrays over `cases`, which take no space until they are filled, chunk by chunk."""
    for name in plan.outputs:
        _add(group, plan, cases, name, "float32", np.nan, _attributes(plan, name), time=len(plan.time))
    _add(group, plan, cases, "features", "float64", np.nan, {}, feature=len(names(plan.outputs)))
    _add(group, plan, cases, "failure", f"<U{REASON_LENGTH}", None, {"long_name": "Why the case failed; empty if not"})
    _add(group, plan, cases, "done", "bool", None, {"long_name": "Whether the case has been flown"})


def _add(
    group: zarr.Group, plan: Plan, cases: int, name: str, kind: str, fill: Any, attributes: dict[str, str], **others: int
) -> None:
    """Add an array over the cases and the dimensions `others` (name = size)."""
    group.create_array(
        name,
        shape=(cases, *others.values()),
        chunks=(plan.chunk, *others.values()),
        dtype=kind,
        fill_value=fill,
        attributes={"_ARRAY_DIMENSIONS": ["case", *others], **attributes},
    )


def arrays(outputs: Collection[str]) -> dict[str, int]:
    """The arrays over the cases, and how many dimensions each has."""
    return {**dict.fromkeys(outputs, 2), "features": 2, "failure": 1, "done": 1}


def begun(coordinates: Collection[str], outputs: Collection[str]) -> list[str]:
    """Every file of the empty dataset, by its path in it."""
    described = [f"{name}/{part}" for name in (*coordinates, *arrays(outputs)) for part in (".zarray", ".zattrs")]
    return [".zgroup", ".zattrs", ".zmetadata", *described, *(f"{name}/0" for name in coordinates)]


def coordinates_of(plan: Plan) -> list[str]:
    """Names of the dataset's coordinates."""
    return [*_AXES, *_parameters(plan)]


_AXES = ("case", "time", "feature", "trial", "fidelity")


def _coordinates(plan: Plan, digest: str, fmus: Mapping[str, str]) -> xr.Dataset:
    """Coordinates and attributes of the dataset, which are known before any case is flown."""
    table = plan.table()
    coordinates: dict[str, Any] = {
        "case": np.arange(len(table)),
        "time": ("time", plan.time, {"units": "s"}),
        "feature": np.array(names(plan.outputs)),
        "trial": ("case", np.array([trial.name for trial in plan.trials])[table.trial]),
        "fidelity": ("case", np.array([fidelity.name for fidelity in plan.fidelities])[table.fidelity]),
    }
    for name, series in _parameters(plan).items():
        coordinates[name] = ("case", plan.actuator.output.outside(name, series), _attributes(plan, name))
    attributes = {
        "campaign_sha256": digest,
        "fmu_sha256": json.dumps(dict(sorted(fmus.items()))),
        "seed": plan.seed,
        "actuator": plan.actuator.name,
        "actuator_sha256": plan.actuator.sha256,
        "noise": json.dumps({name: vars(noise) for name, noise in plan.noise.items()}),
        "versions": json.dumps({"ema-twins": __version__} | {name: version(name) for name in ("fmpy", "numpy", "scipy")}),
    }
    return xr.Dataset(coords=coordinates, attrs=attributes)


def _attributes(plan: Plan, name: str) -> dict[str, str]:
    """Unit and meaning of a port as the data set has it: outside, for an actuator with a rod."""
    return {"units": plan.actuator.output.unit(name), "long_name": plan.actuator.output.meaning(name)}


def _parameters(plan: Plan) -> dict[str, np.ndarray]:
    """Every parameter, and every input that is held: its value in each case, by default the start of the case's fidelity."""
    table = plan.table()
    models = [fidelity.fmu.removeprefix("EMA_").removesuffix(".fmu") for fidelity in plan.fidelities]
    held = [port for port in ports.INPUTS if port.name in table.names]
    values = {}
    for variable in (*ports.PARAMETERS, *held):
        if variable.name in table.names:
            series = table.values[:, table.names.index(variable.name)]
        else:
            series = np.array([variable.start_for(model) for model in models])[table.fidelity]
        for place, fidelity in enumerate(plan.fidelities):
            if variable.name in fidelity.parameters:
                series = np.where(table.fidelity == place, fidelity.parameters[variable.name], series)
        values[variable.name] = series
    return values

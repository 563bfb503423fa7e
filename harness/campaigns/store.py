"""The dataset of a campaign on disk: a Zarr store that plain xarray opens, filled batch by batch, and features as Parquet.

A batch is written as whole chunks. Its chunk of `done` comes last, so that a batch that was interrupted is flown again.
"""

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import xarray as xr
import zarr

from ema_fmu_src import __version__, ports
from harness.campaigns import features
from harness.campaigns.plan import Plan
from harness.campaigns.worker import Result
from harness.errors import HarnessError

BATCH = 64
"""Cases in a batch, and in a chunk."""
PARQUET_ROWS = 65536
"""Cases that are in memory at a time while the Parquet file is written."""
REASON_LENGTH = 200
"""Characters kept of the reason why a case failed."""
STORE, FEATURES = "campaign.zarr", "features.parquet"


class Store:
    """The dataset of a plan in `folder`, created, or opened where it was left; `fmus`: file name -> hash of each FMU.

    HarnessError if the folder holds the dataset of another plan.
    """

    def __init__(self, folder: Path, plan: Plan, fmus: Mapping[str, str]) -> None:
        self.path = folder / STORE
        self._features = folder / FEATURES
        self.plan, self.table = plan, plan.table()
        self.digest = digest = plan.digest(fmus)
        if self.path.exists():
            group = self._opened(digest)
        else:
            self._create(digest, fmus)
            group = zarr.open_group(self.path, mode="r+")
        self._arrays: dict[str, Any] = dict(group.arrays())

    def _opened(self, digest: str) -> zarr.Group:
        try:
            group = zarr.open_group(self.path, mode="r+")
            held = group.attrs.get("campaign_sha256")
        except Exception as error:  # noqa: BLE001 - zarr raises whatever its codecs and stores raise
            raise HarnessError(f"{self.path}: cannot be opened: {error}; delete it or choose another --out") from None
        if held != digest:
            raise HarnessError(
                f"{self.path}: holds another campaign (other cases, seed, FMUs or outputs); choose another --out"
            )
        return group

    def _create(self, digest: str, fmus: Mapping[str, str]) -> None:
        """Create the empty store, under another name until it is whole."""
        made = self.path.with_suffix(".new")
        dataset = _coordinates(self.plan, digest, fmus)
        whole = {name: {"chunks": variable.shape or (1,)} for name, variable in dataset.coords.items()}
        features_of_each = len(features.names(self.plan.outputs))
        try:
            dataset.to_zarr(made, mode="w", encoding=whole, zarr_format=2, consolidated=False)
            group = zarr.open_group(made, mode="r+")
            for name in self.plan.outputs:
                attributes = _attributes(self.plan, name)
                self._add(group, name, "float32", np.nan, attributes, time=len(self.plan.time))
            self._add(group, "features", "float64", np.nan, {}, feature=features_of_each)
            self._add(group, "failure", f"<U{REASON_LENGTH}", None, {"long_name": "Why the case failed; empty if not"})
            self._add(group, "done", "bool", None, {"long_name": "Whether the case has been flown"})
            zarr.consolidate_metadata(made, zarr_format=2)
            made.rename(self.path)
        except OSError as error:
            raise HarnessError(f"{self.path}: cannot be written: {error.strerror}") from None

    def _add(self, group: zarr.Group, name: str, kind: str, fill: Any, attributes: dict[str, str], **others: int) -> None:
        """Add an array over the cases and the dimensions `others` (name = size); it takes no space until it is filled."""
        group.create_array(
            name,
            shape=(len(self.table), *others.values()),
            chunks=(BATCH, *others.values()),
            dtype=kind,
            fill_value=fill,
            attributes={"_ARRAY_DIMENSIONS": ["case", *others], **attributes},
        )

    def batches(self) -> list[range]:
        """The cases of each batch that is not yet done."""
        done = np.asarray(self._arrays["done"][:])
        count = len(self.table)
        whole = [range(first, min(first + BATCH, count)) for first in range(0, count, BATCH)]
        return [cases for cases in whole if not done[cases.start]]

    def write(self, cases: range, result: Result) -> None:
        """Write the result of a batch; it counts as done when all of it is written."""
        rows = slice(cases.start, cases.stop)
        for place, name in enumerate(self.plan.outputs):
            self._arrays[name][rows] = result.values[:, place]
        self._arrays["features"][rows] = result.features
        if any(result.failures):
            self._arrays["failure"][rows] = np.array(
                [reason[:REASON_LENGTH] for reason in result.failures], dtype=f"<U{REASON_LENGTH}"
            )
        self._arrays["done"][rows] = True

    def finish(self) -> list[tuple[int, str]]:
        """Write the features as Parquet; returns number and reason of each case that failed."""
        made, failed = self._features.with_suffix(".new"), []
        writer: pq.ParquetWriter | None = None
        for first in range(0, len(self.table), PARQUET_ROWS):
            part = self._dataframe(slice(first, first + PARQUET_ROWS))
            writer = writer or pq.ParquetWriter(made, part.schema)
            writer.write_table(part)
            reasons = enumerate(part.column("failure").to_pylist(), start=first)
            failed += [(case, reason) for case, reason in reasons if reason]
        assert writer is not None  # a plan has at least one case
        writer.close()
        made.replace(self._features)
        return failed

    def _dataframe(self, cases: slice) -> pa.Table:
        """Parameters, failures and features of some cases, for the Parquet file."""
        dataset = xr.open_zarr(self.path).isel(case=cases)
        columns: dict[str, Any] = {"case": dataset["case"].values}
        columns |= {name: dataset[name].values for name in ("trial", "fidelity", *self.table.names, "failure")}
        values = dataset["features"].values
        columns |= {str(name): values[:, place] for place, name in enumerate(dataset["feature"].values)}
        return pa.table(columns).replace_schema_metadata({"campaign_sha256": self.digest})


def _coordinates(plan: Plan, digest: str, fmus: Mapping[str, str]) -> xr.Dataset:
    """Coordinates and attributes of the dataset, which are known before any case is flown."""
    table = plan.table()
    coordinates: dict[str, Any] = {
        "case": np.arange(len(table)),
        "time": ("time", plan.time, {"units": "s"}),
        "feature": np.array(features.names(plan.outputs)),
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

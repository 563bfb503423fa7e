"""Trajectories in the formats of the field: CSV, Parquet, NetCDF, MATLAB, MDF; units in the files that hold them."""

import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from harness import scratch
from harness.errors import HarnessError, required_extra
from harness.files.results import trajectory_csv


def encode(run: xr.Dataset, suffix: str) -> bytes:
    """A run as the bytes of a file: time, inputs and outputs. HarnessError if the library of that format is missing."""
    with required_extra("files", f"--format {suffix}"):
        return FORMATS[suffix](run)


def check_format(suffix: str) -> str:
    """The format, in small letters; HarnessError if there is none of that name, or its library is missing."""
    name = suffix.lower().lstrip(".")
    if name not in FORMATS:
        raise HarnessError(f"--format {suffix}: {', '.join(FORMATS)} can be written")
    with required_extra("files", f"--format {name}"):
        for library in LIBRARIES[name]:
            __import__(library)
    return name


def _csv(run: xr.Dataset) -> bytes:
    return trajectory_csv(run).encode()


def _parquet(run: xr.Dataset) -> bytes:
    """A column's unit stands in its field's metadata, as `units`; what is known of the run in the schema's."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = ["time", *map(str, run.data_vars)]
    fields = [
        pa.field(name, pa.from_numpy_dtype(run[name].dtype), metadata={"units": run[name].attrs["units"]}) for name in names
    ]
    schema = pa.schema(fields, metadata=_attributes(run))
    buffer = io.BytesIO()
    pq.write_table(pa.table([run[name].values for name in names], schema=schema), buffer)
    return buffer.getvalue()


def _netcdf(run: xr.Dataset) -> bytes:
    """NetCDF 4 with CF's attribute `units`."""
    import h5netcdf  # noqa: F401 (the engine; a missing one is told apart from a broken run)

    plain = run.drop_attrs(deep=False).assign_attrs(_attributes(run))
    for name in plain.data_vars:
        if plain[name].dtype.kind == "b":
            plain[name] = plain[name].astype(np.int8).assign_attrs(run[name].attrs)
    with scratch.folder("write") as folder:
        path = folder / "run.nc"
        plain.to_netcdf(path, engine="h5netcdf")
        return path.read_bytes()


def _matlab(run: xr.Dataset) -> bytes:
    """MATLAB 5: a column vector each, and the structs `units` and `about`."""
    from scipy.io import savemat

    names = ["time", *map(str, run.data_vars)]
    content: dict[str, Any] = {name: run[name].values.astype(np.float64) for name in names}
    content["units"] = {name: run[name].attrs["units"] for name in names}
    content["about"] = _attributes(run)
    buffer = io.BytesIO()
    savemat(buffer, content, do_compression=True, oned_as="column", long_field_names=True)
    return buffer.getvalue()


def _mdf(run: xr.Dataset) -> bytes:
    """ASAM MDF 4.10, one group."""
    from asammdf import MDF, Signal

    time = run.time.values
    signals = [
        Signal(run[name].values.astype(np.float64), time, unit=run[name].attrs["units"], name=str(name), comment="")
        for name in run.data_vars
    ]
    with MDF(version="4.10") as file, scratch.folder("write") as folder:
        file.append(signals, comment=json.dumps(_attributes(run)))
        file.save(folder / "run.mf4", overwrite=True)
        return (folder / "run.mf4").read_bytes()


def _attributes(run: xr.Dataset) -> dict[str, str]:
    """What is known of the run, as texts."""
    return {
        str(key): value if isinstance(value, str) else json.dumps(value, default=float) for key, value in run.attrs.items()
    }


FORMATS: dict[str, Callable[[xr.Dataset], bytes]] = {
    "csv": _csv, "parquet": _parquet, "nc": _netcdf, "mat": _matlab, "mf4": _mdf,
}  # fmt: skip
"""Suffix of the file -> what makes its content."""
LIBRARIES: dict[str, tuple[str, ...]] = {
    "csv": (), "parquet": ("pyarrow",), "nc": ("h5netcdf",), "mat": (), "mf4": ("asammdf",),
}  # fmt: skip

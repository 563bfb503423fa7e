"""NetCDF 4 and 3, by xarray; and our own datasets of campaigns, Zarr stores of many cases."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.files.containers.arrays import Array, table_of
from harness.files.table import Table


def read(path: Path, data: bytes) -> Table:
    """Each variable of one dimension; its times are the coordinate of that dimension."""
    import xarray as xr

    engine = "scipy" if data.startswith(b"CDF") else "h5netcdf"
    with xr.open_dataset(BytesIO(data), engine=engine, decode_times=False) as dataset:
        return table_of(path, _flat(dataset.load()))


def read_zarr(path: Path) -> Table:
    """A dataset over cases and times as one long table, with the case as a column."""
    import xarray as xr

    with xr.open_zarr(path, consolidated=None) as dataset:
        if set(dataset.sizes) >= {"case", "time"}:
            own = [name for name in dataset.data_vars if dataset[name].dims == ("case", "time")]
            rows = dataset[own].load()
            cases, times = np.meshgrid(rows["case"].values, rows["time"].values, indexing="ij")
            arrays = [Array("case", cases.ravel()), Array("time", times.ravel(), "s")]
            units = {str(name): str(rows[name].attrs.get("units", "")) for name in own}
            return table_of(path, [*arrays, *(Array(str(n), rows[n].values.ravel(), units[str(n)]) for n in own)])
        return table_of(path, _flat(dataset.load()))


def _flat(dataset: Any) -> list[Array]:
    arrays = []
    for name in (*dataset.coords, *dataset.data_vars):
        variable = dataset[name]
        if variable.ndim != 1 or variable.dtype.kind not in "biufM":
            continue
        unit, since, _ = str(variable.attrs.get("units", variable.attrs.get("unit", ""))).partition(" since ")
        arrays.append(
            Array(str(name), variable.values, {"seconds": "s"}.get(unit, unit) if since else unit, str(variable.dims[0]))
        )
    if not arrays:
        raise HarnessError(f"{dataset.encoding.get('source', 'the dataset')}: holds no variable of one dimension")
    return arrays

"""HDF5, by h5py: any layout of groups; and MATLAB's 7.3, which is HDF5 with structs as groups."""

from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.files.containers import netcdf
from harness.files.containers.arrays import Array, table_of
from harness.files.containers.units import with_units
from harness.files.table import Table

LARGEST = 2_000_000_000
"""Bytes of a data set beyond which it is no column."""


def read(path: Path, data: bytes) -> Table:
    """Every data set of numbers by its dotted path; the attribute `units` or `unit`, in any case, is its unit."""
    import h5py

    with h5py.File(BytesIO(data), "r") as file:
        if "_NCProperties" in file.attrs:
            return netcdf.read(path, data)
        found = list(_walk(file, ""))
    return table_of(path, with_units(found))


def _walk(group: Any, before: str) -> Iterator[Array]:
    import h5py

    for key, item in group.items():
        name = f"{before}{key}"
        if isinstance(item, h5py.Group):
            yield from _walk(item, f"{name}.")
        elif item.dtype.kind in "biufV" and item.nbytes < LARGEST and item.ndim in (1, 2):
            attributes = {key.lower(): value for key, value in item.attrs.items()}
            unit = attributes.get("units", attributes.get("unit", ""))
            yield Array(name, _physical(item[()], attributes), _as_text(unit))
        elif h5py.check_string_dtype(item.dtype) is not None and item.shape == ():
            yield Array(name, np.array(item.asstr()[()]))


def _as_text(attribute: Any) -> str:
    """An attribute that is a text: one of bytes, or the first of an array of them, too."""
    first = attribute.ravel()[0] if isinstance(attribute, np.ndarray) and attribute.size else attribute
    return first.decode("utf-8", "replace") if isinstance(first, bytes) else str(first)


def _physical(values: Any, attributes: Mapping[str, Any]) -> Any:
    """The values that NetCDF's attributes make of those written: scale_factor, add_offset, and _FillValue for none."""
    numbers = {
        key: float(np.ravel(attributes[key])[0]) for key in ("scale_factor", "add_offset", "_fillvalue") if key in attributes
    }
    if not numbers or values.dtype.kind not in "iuf":
        return values
    known = np.where(values == numbers.get("_fillvalue", np.nan), np.nan, values)
    return known * numbers.get("scale_factor", 1.0) + numbers.get("add_offset", 0.0)


def read_matlab(path: Path, data: bytes) -> Table:
    """Every vector and matrix of a MATLAB 7.3 file, through structs, struct arrays and cells."""
    import h5py

    with h5py.File(BytesIO(data), "r") as file:
        found = [array for key in file if not key.startswith("#") for array in _matlab(file, file[key], key)]
        opaque = [key for key in file if not key.startswith("#") and file[key].attrs.get("MATLAB_object_decode", 0)]
    if opaque and not any(array.values.size > 1 and array.values.dtype.kind != "U" for array in found):
        raise HarnessError(
            f"{path}: '{opaque[0]}' is a MATLAB object (a table or timetable), which only MATLAB can read; "
            "save a struct of vectors (table2struct(..., 'ToScalar', true)), or writetimetable(...) to a text file"
        )
    return table_of(path, with_units(found))


def _matlab(file: Any, item: Any, name: str) -> Iterator[Array]:
    import h5py

    if item.attrs.get("MATLAB_object_decode", 0) or item.attrs.get("MATLAB_empty", 0):
        return
    if isinstance(item, h5py.Group):
        for key, below in item.items():
            yield from _matlab(file, below, f"{name}.{key}")
    elif item.dtype == h5py.ref_dtype:
        references = item[()].ravel()
        for place, reference in enumerate(references, start=1):
            yield from _matlab(file, file[reference], name if len(references) == 1 else f"{name}.{place}")
    elif item.attrs.get("MATLAB_class", b"") == b"char":
        yield Array(name, np.array("".join(map(chr, item[()].ravel(order="F").astype(int)))))
    elif item.dtype.kind in "biuf":
        yield Array(name, item[()].T)

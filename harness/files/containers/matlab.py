"""MATLAB's .mat files up to version 7, by SciPy; those of version 7.3 are HDF5."""

import warnings
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.files.containers.arrays import Array, table_of
from harness.files.containers.units import with_units
from harness.files.table import Table


def read(path: Path, data: bytes) -> Table:
    """Every vector and matrix by its dotted path through structs, struct arrays and cells."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MatReadWarning)
        content = loadmat(BytesIO(data), simplify_cells=True)
    names = [name for name in content if not name.startswith("__") and name != "None"]
    found = [array for name in names for array in _walk(content[name], name)]
    if not any(array.values.size > 1 and array.values.dtype.kind != "U" for array in found) and _opaque(content):
        raise HarnessError(
            f"{path}: holds a MATLAB object (a table or timetable), which only MATLAB can read; "
            "save a struct of vectors (table2struct(..., 'ToScalar', true)), or writetimetable(...) to a text file"
        )
    return table_of(path, with_units(found))


def _opaque(content: dict[str, Any]) -> bool:
    return "__function_workspace__" in content or any(
        getattr(value, "dtype", None) is not None and value.dtype.kind == "V" for value in content.values()
    )


def _walk(value: Any, name: str) -> Iterator[Array]:
    if isinstance(value, dict):
        for key, below in value.items():
            yield from _walk(below, f"{name}.{key}")
    elif isinstance(value, str):
        yield Array(name, np.array(value))
    elif isinstance(value, list | np.ndarray) and getattr(value, "dtype", np.dtype(object)).kind == "O":
        for place, below in enumerate(value, start=1):
            yield from _walk(below, f"{name}.{place}")
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        yield Array(name, value)

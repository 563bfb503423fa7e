"""Writes results, each file whole or not at all."""

import io
import json
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import xarray as xr

from harness.comparison import Comparison
from harness.errors import HarnessError


def prepare(folder: Path) -> None:
    """Make `folder` and see that it can be written; HarnessError if not. Called before the runs begin."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None


def prepare_file(path: Path) -> None:
    """As `prepare`, for a file: its folder, and that the path is not a folder itself."""
    if path.is_dir():
        raise HarnessError(f"{path}: is a folder, the name of a file is needed")
    prepare(path.absolute().parent)


def write(path: Path, content: str | bytes) -> None:
    """Write `content` to `path`, through a file beside it that takes its place."""
    file = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(content.encode() if isinstance(content, str) else content)
        os.chmod(file.name, 0o644)
        os.replace(file.name, path)
    except OSError as error:
        raise HarnessError(f"{path}: cannot be written: {error.strerror}") from None
    finally:
        if file is not None:
            Path(file.name).unlink(missing_ok=True)


def write_json(path: Path, content: object) -> None:
    """Write `content` to `path` as JSON, as `write` does."""
    write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def trajectory_csv(run: xr.Dataset) -> str:
    """A run as CSV: time, command and every output, in SI units, 9 significant digits."""
    columns = [run.time.values, *(run[name].values.astype(float) for name in run.data_vars)]
    buffer = io.StringIO()
    header = ",".join(["time", *map(str, run.data_vars)])
    np.savetxt(buffer, np.column_stack(columns), fmt="%.9g", delimiter=",", header=header, comments="")
    return buffer.getvalue()


def as_json(runs: Iterable[tuple[str, str, xr.Dataset]], comparisons: Iterable[Comparison]) -> str:
    """Runs (trial, fidelity, dataset) and comparisons as JSON."""
    return json.dumps(
        {
            "runs": [
                {
                    "trial": trial,
                    "fidelity": fidelity,
                    "wall_s": run.attrs["wall_s"],
                    "simulated_s": run.attrs["simulated_s"],
                }
                for trial, fidelity, run in runs
            ],
            "comparisons": [
                {
                    key: getattr(item, key)
                    for key in (
                        "trial",
                        "candidate",
                        "reference",
                        "variable",
                        "unit",
                        "nrmse",
                        "max_abs",
                        "t_max_abs",
                    )
                }
                for item in comparisons
            ],
        },
        indent=1,
        allow_nan=False,
    )

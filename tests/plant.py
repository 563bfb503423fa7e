"""Measured runs for the tests: HF with known faults, noisy, as arrays and as CSV."""

from pathlib import Path

import numpy as np

from harness.flight.twin import Twin
from harness.inference.coordinates import from_values, to_parameters
from harness.inference.measured import CURRENT, Measured, measured
from harness.trials import trial

NOISE = {"position": 0.001, "motor_speed": 0.001, CURRENT: 0.01}
PHASES = ("phase_current_a", "phase_current_b", "phase_current_c")


def columns(
    fmu: Path,
    name: str,
    faults: dict[str, float],
    parameters: dict[str, float] | None = None,
    *,
    seed: int = 1,
    rate: float = 2000.0,
    noisy: bool = True,
) -> dict[str, np.ndarray]:
    """Columns of a measured run of a trial; `faults` by short name, other `parameters` by port name."""
    with Twin(fmu) as plant:
        run = plant.run(trial(name), to_parameters(from_values(faults)) | (parameters or {}))
    every = round(1e4 / rate)
    rng = np.random.default_rng(seed)
    table = {"time": run.time.values[::every], "command": run["command"].values[::every]}
    for channel in (*NOISE, *PHASES):
        series = run[channel].values[::every]
        sigma = NOISE.get(channel, 0.01) * float(np.ptp(series)) if noisy else 0.0
        table[channel] = series + sigma * rng.standard_normal(series.size)
    return table


def as_run(table: dict[str, np.ndarray], channels: tuple[str, ...] = tuple(NOISE)) -> Measured:
    """The columns as a measured run."""
    picked = {name: table[name] for name in channels}
    return measured("run", table["time"], {"command": table["command"]}, picked, {})


def write(path: Path, table: dict[str, np.ndarray]) -> Path:
    """The columns as a CSV file."""
    data = np.column_stack(list(table.values()))
    np.savetxt(path, data, fmt="%.9g", delimiter=",", header=",".join(table), comments="")
    return path

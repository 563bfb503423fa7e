"""A log in the dialect of position drives: 100 rows a second, mm and mA, tabs, no header. HF is the plant."""

import math
from pathlib import Path

import numpy as np

from harness.flight.twin import Twin
from harness.inference.coordinates import from_values, to_parameters
from harness.trials import STEP, Trial, grid

LEAD = 0.01
ACTUATOR = {"gear.ratio": 20.0, "mechanics.end_stop": 50.0}
"""The default motor on a screw of 10 mm."""
COUNTS = 96
"""Of the Hall sensor, a motor's turn."""
EARLY = 0.004
"""The command takes effect so much before its row [s]."""
LATE = {"motor_position": 0.001, "equivalent_current": -0.002}
"""Each row shows the plant so much later than its time [s]."""
COLUMNS = {
    "time": "1 [ms]",
    "command": "2 [mm] held",
    "position": "3 [mm] motor",
    "equivalent_current": "4 [mA]",
}
FORMATS = ("%d", "%.4f", "%.4f", "%d")
SHIFTS = {name: EARLY + late for name, late in LATE.items()}
"""What a comparison should find."""


def command_of(time: np.ndarray) -> np.ndarray:
    """A sine that rises from 0.3 to 2.5 Hz over 4 s, +-1 rad of the screw."""
    return np.sin(2.0 * math.pi * (0.3 * time + 0.275 * time**2))


def plant(fmu: Path, faults: dict[str, float], other: dict[str, float] | None = None, rate: float = 100.0) -> np.ndarray:
    """What HF does, at the rows of the log: time [s], command [rad], motor_position [rad], equivalent_current [A]."""
    rows = np.arange(0.0, 4.0, 1.0 / rate)
    points = grid(-0.02, 40500, STEP)
    held = np.clip(np.floor((points + EARLY) * rate + 1e-6).astype(int), 0, len(rows) - 1)
    trial = Trial("drive", -0.02, STEP, {"command": command_of(rows)[held]}, "held")
    with Twin(fmu) as twin:
        run = twin.run(trial, {**ACTUATOR, **(other or {}), **to_parameters(from_values(faults))})
    seen = [np.interp(rows + late, run.time, run[name]) for name, late in LATE.items()]
    return np.column_stack([rows, command_of(rows), *seen])


def write(path: Path, clean: np.ndarray, seed: int = 1) -> Path:
    """The log as a drive writes it: Hall counts, 1 % of noise on the current."""
    time, command, motor, current = clean.T
    count = 2.0 * math.pi / COUNTS
    travel = 1e3 * LEAD / (2.0 * math.pi)
    noisy = current + 0.01 * np.ptp(current) * np.random.default_rng(seed).standard_normal(current.size)
    columns = (1e3 * time, travel * command, travel / ACTUATOR["gear.ratio"] * count * np.rint(motor / count), 1e3 * noisy)
    rows = zip(*(np.char.mod(form, column) for form, column in zip(FORMATS, columns, strict=True)), strict=True)
    path.write_text("".join("\t".join(row) + "\n" for row in rows))
    return path


def actuator(path: Path) -> Path:
    """The actuator's file, with the log's columns."""
    parameters = [f'"{name}" = {value}' for name, value in ACTUATOR.items()]
    log = [f'{port} = "{column}"' for port, column in COLUMNS.items()]
    path.write_text("\n".join(["[parameters]", *parameters, "[output]", f"lead = {LEAD}", "[log]", *log, ""]))
    return path

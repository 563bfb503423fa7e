"""The cases of the identification bench: HF as the plant, with known faults and noise."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness import trials
from harness.faults import FAULTS, KINDS
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.inference import coordinates
from harness.inference.measured import CURRENT, Measured, measured

Array = NDArray[np.float64]
Columns = dict[str, Array]
"""What was logged, by port name, with the time [s]: shape (n_rows,) each."""

TRIALS = ("SIN", "STEP-RAMP", "CHIRP")
NOISE = {"position": 0.001, "motor_speed": 0.001, CURRENT: 0.01}
"""Standard deviation of the white noise, as a fraction of the channel's range."""
COMMON_KINDS = {kind: members for kind, members in KINDS.items() if not members[0].rare}
"""The kinds of faults that the cases have."""


@dataclass(frozen=True)
class Case:
    """One run: its trial, the true faults by short name (those not named are healthy), the seed of its noise."""

    number: int
    trial: str
    truth: dict[str, float]
    seed: int


def cases(count: int, healthy: int, seed: int) -> list[Case]:
    """`count` faulted cases, every other one with a single fault, the rest with two or three kinds; then `healthy` ones.

    Values are drawn from the studied ranges, angles from a full turn.
    """
    rng = np.random.default_rng(seed)
    drawn = []
    for number in range(count):
        kinds = rng.choice(list(COMMON_KINDS), size=1 if number % 2 == 0 else int(rng.integers(2, 4)), replace=False)
        truth: dict[str, float] = {}
        for members in (COMMON_KINDS[str(kind)] for kind in kinds):
            value = float(rng.uniform(*members[0].studied))
            truth[str(rng.choice([fault.name for fault in members]))] = value
        for angle in [FAULTS[name].angle for name in truth]:
            if angle is not None:
                truth[angle.name] = float(rng.uniform(-math.pi, math.pi))
        drawn.append(Case(number, TRIALS[number % len(TRIALS)], truth, int(rng.integers(2**32))))
    sound = [Case(count + n, TRIALS[n % len(TRIALS)], {}, int(rng.integers(2**32))) for n in range(healthy)]
    return drawn + sound


def flown(trial: trials.Trial, fmus: Path, rate: float, parameters: Mapping[str, float]) -> Columns:
    """HF, from the folder `fmus`, flown with `parameters` by port name: time, command and the channels of NOISE, at `rate`
    rows a second, as perfect sensors show them."""
    outputs = [port for port in ports.OUTPUTS if port.name in NOISE]
    with Twin(fmus / FIDELITIES["HF"].fmu) as plant:
        values, _ = plant.record(trial, parameters, outputs)
    every = round(1.0 / (rate * trial.step))
    channels = {port.name: values[::every, place] for place, port in enumerate(outputs)}
    return {"time": trial.time[::every], "command": trial.inputs["command"][::every], **channels}


def noisy(table: Columns, seed: int) -> Columns:
    """The table with white noise on its channels."""
    names = [name for name in table if name in NOISE]
    values = np.column_stack([table[name] for name in names])
    sigma = np.ptp(values, axis=0) * [NOISE[name] for name in names]
    noise = np.random.default_rng(seed).normal(size=values.shape) * sigma
    return table | dict(zip(names, (values + noise).T, strict=True))


def as_measured(name: str, table: Columns, parameters: Mapping[str, float]) -> Measured:
    """The table as a measured run; `parameters`: what is known of the actuator, by port name."""
    return measured(name, table["time"], {"command": table["command"]}, {name: table[name] for name in NOISE}, parameters)


def ports_of(truth: Mapping[str, float]) -> dict[str, float]:
    """Port name -> value of faults by short name; those not named are healthy."""
    return coordinates.to_parameters(coordinates.from_values(truth))


def measure(case: Case, fmus: Path, rate: float, parameters: Mapping[str, float] | None = None) -> Measured:
    """HF, from the folder `fmus`, flown with the faults of the case; its outputs with noise, at `rate` rows a second.

    `parameters`: those of the actuator, by port name.
    """
    own = dict(parameters or {})
    table = flown(trials.trial(case.trial), fmus, rate, own | ports_of(case.truth))
    return as_measured(case.trial, noisy(table, case.seed), own)

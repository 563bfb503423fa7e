"""The cases of the identification bench: HF as the plant, with known faults and noise."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ema_fmu_src import ports
from harness import trials
from harness.faults import FAULTS, KINDS
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.inference import coordinates
from harness.inference.measured import CURRENT, Measured, measured

TRIALS = ("SIN", "STEP-RAMP", "CHIRP")
NOISE = {"position": 0.001, "motor_speed": 0.001, CURRENT: 0.01}
"""Standard deviation of the white noise, as a fraction of the channel's range."""


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
        kinds = rng.choice(list(KINDS), size=1 if number % 2 == 0 else int(rng.integers(2, 4)), replace=False)
        truth: dict[str, float] = {}
        for members in (KINDS[str(kind)] for kind in kinds):
            value = float(rng.uniform(*members[0].studied))
            truth[str(rng.choice([fault.name for fault in members]))] = value
        for angle in [FAULTS[name].angle for name in truth]:
            if angle is not None:
                truth[angle.name] = float(rng.uniform(-math.pi, math.pi))
        drawn.append(Case(number, TRIALS[number % len(TRIALS)], truth, int(rng.integers(2**32))))
    sound = [Case(count + n, TRIALS[n % len(TRIALS)], {}, int(rng.integers(2**32))) for n in range(healthy)]
    return drawn + sound


def measure(case: Case, fmus: Path, rate: float, parameters: Mapping[str, float] | None = None) -> Measured:
    """HF, from the folder `fmus`, flown with the faults of the case; its outputs with noise, at `rate` rows a second.

    `parameters`: those of the actuator, by port name.
    """
    own = dict(parameters or {})
    trial = trials.trial(case.trial)
    outputs = [port for port in ports.OUTPUTS if port.name in NOISE]
    with Twin(fmus / FIDELITIES["HF"].fmu) as plant:
        values, _ = plant.record(trial, own | coordinates.to_parameters(coordinates.from_values(case.truth)), outputs)
    every = round(1.0 / (rate * trial.step))
    values, time = values[::every], trial.time[::every]
    sigma = np.ptp(values, axis=0) * [NOISE[port.name] for port in outputs]
    noisy = values + np.random.default_rng(case.seed).normal(size=values.shape) * sigma
    channels = {name: noisy[:, [port.name for port in outputs].index(name)] for name in NOISE}
    return measured(case.trial, time, {"command": trial.inputs["command"][::every]}, channels, own)

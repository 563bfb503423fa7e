"""Random actuators: parameters that nobody knows exactly, and what a data sheet or a calibration knows of them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from harness import trials
from harness.actuators.actuator import DEFAULT, Actuator
from harness.actuators.calibrated import WIDTH
from harness.bench.cases import as_measured, flown, noisy
from harness.calibration.bench import Bench
from harness.calibration.calibrate import calibrate
from harness.errors import HarnessError
from harness.fidelity import FIDELITIES

SIGMAS = {
    "motor.K_e": 0.02,
    "mechanics.J": 0.04,
    "motor.R": 0.04,
    "motor.L": 0.05,
    "mechanics.T_coulomb": 0.10,
    "mechanics.T_static": 0.10,
    "mechanics.C": 0.30,
    "gear.backlash": 0.20,
    "gear.eta_opposing": 0.02,
    "gear.eta_aiding": 0.02,
}
"""Port -> standard deviation from the default actuator's value, as a part of it: ordinary tolerances (ours)."""
MOST = 3.0
"""Standard deviations at which a draw is cut off: friction stays friction."""
HEALTHY_RUNS = ("CHIRP", "SIN")
"""Trials that a calibration has."""


def seed_of(*where: int) -> int:
    """A seed of its own for each place, so that any case can be done alone."""
    return int(np.random.SeedSequence(where).generate_state(1)[0])


def hidden(number: int, seed: int) -> dict[str, float]:
    """The parameters of the random actuator `number`, by port name."""
    drawn = np.random.default_rng(seed_of(seed, number)).normal(size=len(SIGMAS)).clip(-MOST, MOST)
    return {
        name: DEFAULT.value(name) * (1.0 + sigma * float(off))
        for (name, sigma), off in zip(SIGMAS.items(), drawn, strict=True)
    }


def distance(parameters: Mapping[str, float]) -> float:
    """How far these are from the default actuator's: root mean square, in standard deviations."""
    off = [(parameters[name] / DEFAULT.value(name) - 1.0) / sigma for name, sigma in SIGMAS.items()]
    return float(np.sqrt(np.mean(np.square(off))))


def data_sheet() -> Actuator:
    """What is known without a calibration: the default actuator's values, and how far they may be off."""
    widths = {name: WIDTH * sigma * DEFAULT.value(name) for name, sigma in SIGMAS.items()}
    return Actuator("data-sheet", "the default actuator, known to ordinary tolerances", tolerances=widths)


def calibrated(number: int, seed: int, fmus: Path, rate: float) -> dict[str, Any]:
    """What a calibration of the random actuator `number` on HEALTHY_RUNS finds, for JSON; `error` if it cannot be done."""
    own = hidden(number, seed)
    runs = [
        as_measured(name, noisy(flown(trials.trial(name), fmus, rate, own), seed_of(seed, number, place)), {})
        for place, name in enumerate(HEALTHY_RUNS, start=1)
    ]
    try:
        found = calibrate(runs, data_sheet(), Bench(fmus, FIDELITIES["ELF+"]))
    except HarnessError as error:
        return {"hidden": own, "error": str(error)}
    table = found.actuator.calibration
    return {
        "hidden": own,
        "parameters": dict(found.actuator.parameters),
        "tolerances": dict(found.actuator.tolerances),
        "calibration": {key: table[key] for key in ("names", "values", "covariance", "inflation")},
        "complaints": list(found.complaints),
    }


def known(content: Mapping[str, Any]) -> Actuator:
    """The actuator as `calibrated` has found it; HarnessError if it could not."""
    if "error" in content:
        raise HarnessError(f"its calibration: {content['error']}")
    return Actuator(
        "calibrated",
        parameters=content["parameters"],
        tolerances=content["tolerances"],
        calibration=content["calibration"],
    )

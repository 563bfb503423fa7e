"""Features of a run, as diagnosis by learning takes them.

Of each output that is kept: `OUTPUT_rms` and `OUTPUT_range` (its unit). `tracking_error_rms`, `tracking_error_max` [rad]:
command minus position. `current_harmonic_K` [A]: amplitude of the equivalent current's K-th harmonic of the electrical
angle, weighted by the angle that is turned, the current counted in the sense of rotation (shorts show in K = 2,
eccentricity in K = 3). `energy_supply`, `energy_copper` [J]: drawn from the bus, and lost in the windings.
`saturated_part`: part of the run in which the voltage limits.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports

Array = NDArray[np.float64]

HARMONICS = 6
NEEDED = (
    "position", "motor_position", "motor_speed", "equivalent_current_filtered", "supply_current", "copper_loss",
    "voltage_saturated",
)  # fmt: skip
"""Outputs that the features are made from."""
PAIRS = float(ports.VARIABLES[ports.INDEX["motor.p"]].start)


def names(kept: Sequence[str]) -> list[str]:
    """Names of the features when the outputs `kept` are kept, in order."""
    of_outputs = [f"{name}_{kind}" for name in kept for kind in ("rms", "range")]
    harmonics = [f"current_harmonic_{k}" for k in range(1, HARMONICS + 1)]
    return [*of_outputs, "tracking_error_rms", "tracking_error_max", *harmonics, "energy_supply", "energy_copper",
            "saturated_part"]  # fmt: skip


def features(
    kept: Mapping[str, Array], at_rate: Mapping[str, Array], whole: Mapping[str, Array], *, step: float, pairs: float = PAIRS
) -> list[float]:
    """Features of one run, in the order of `names`.

    `kept`: outputs as they are kept, with noise; `at_rate`: command, supply_voltage and NEEDED at the same times;
    `whole`: supply_voltage, supply_current, copper_loss and voltage_saturated at all communication points, `step` [s] apart.
    """
    found = [value for series in kept.values() for value in (_rms(series), float(np.ptp(series)))]
    error = at_rate["command"] - at_rate["position"]
    found += [_rms(error), float(np.max(np.abs(error)))]
    found += harmonics(
        at_rate["equivalent_current_filtered"], at_rate["motor_position"], at_rate["motor_speed"], pairs
    ).tolist()
    found.append(float(whole["supply_voltage"][1:] @ whole["supply_current"][1:]) * step)
    found.append(float(whole["copper_loss"][1:].sum()) * step)
    found.append(float(np.mean(whole["voltage_saturated"][1:])))
    return found


def harmonics(current: Array, motor_position: Array, motor_speed: Array, pairs: float) -> Array:
    """Amplitudes [A] of the first HARMONICS harmonics of the electrical angle, shape (HARMONICS,)."""
    weight = np.abs(motor_speed)
    signed = (current * np.sign(motor_speed) - _mean(current * np.sign(motor_speed), weight)) * weight
    turn = np.exp(-1j * pairs * motor_position)
    total, power = max(float(weight.sum()), 1e-300), np.ones_like(turn)
    amplitudes = []
    for _ in range(HARMONICS):
        power = power * turn
        amplitudes.append(2.0 * abs(complex(signed @ power)) / total)
    return np.array(amplitudes)


def _mean(series: Array, weight: Array) -> float:
    return float(series @ weight) / max(float(weight.sum()), 1e-300)


def _rms(series: Array) -> float:
    return float(np.sqrt(series @ series / len(series)))

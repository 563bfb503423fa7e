"""Features of a run, for diagnosis by machine learning.

For each output that is kept: `OUTPUT_rms` and `OUTPUT_range`, in its unit. `tracking_error_rms`, `tracking_error_max` [rad;
m of a linear actuator]: of command minus position. `current_harmonic_K` [A]: amplitude of the K-th harmonic of the
equivalent current over the electrical angle, weighted by the angle turned, with the current counted in the sense of
rotation; shorts show in K = 2, eccentricity in K = 3. `energy_supply`, `energy_copper` [J]: drawn from the bus, and lost in
the windings. `saturated_part`: part of the run in which the voltage saturates.

The sums are compiled: between two runs the caches are cold, and many calls of NumPy took twice as long.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.campaigns.names import HARMONICS
from harness.compiled import compiled

Array = NDArray[np.float64]
NEEDED = (
    "position", "motor_position", "motor_speed", "equivalent_current_filtered", "supply_current", "copper_loss",
    "voltage_saturated",
)  # fmt: skip
"""Outputs from which features are computed."""
PAIRS = float(ports.VARIABLES[ports.INDEX["motor.p"]].start)


def features(
    kept: Mapping[str, Array],
    at_rate: Mapping[str, Array],
    whole: Mapping[str, Array],
    supply: Array | float,
    *,
    step: float,
    pairs: float = PAIRS,
) -> list[float]:
    """Features of one run, in the order of `names`.

    `kept`: the outputs that are kept, with noise, shape (n_times,) each; `at_rate`: command and NEEDED at the same times;
    `whole`: supply_current, copper_loss and voltage_saturated at all communication points, `step` [s] apart; `supply`: the
    voltage [V] at those points, or one for all; `pairs`: pole pairs.
    """
    found = [figure for series in kept.values() for figure in _rms_and_range(series)]
    error = at_rate["command"] - at_rate["position"]
    found += [_rms_and_range(error)[0], float(np.max(np.abs(error)))]
    found += harmonics(
        at_rate["equivalent_current_filtered"], at_rate["motor_position"], at_rate["motor_speed"], pairs
    ).tolist()
    steps = len(whole["supply_current"]) - 1
    volts = np.broadcast_to(supply, steps + 1)
    drawn, lost, saturated = _sums(volts, *(whole[name] for name in ("supply_current", "copper_loss", "voltage_saturated")))
    return [*found, drawn * step, lost * step, saturated / steps]


@compiled()
def harmonics(current, motor_position, motor_speed, pairs):  # type: ignore[no-untyped-def]
    """Amplitudes [A] of the first HARMONICS harmonics of the current over the electrical angle, shape (HARMONICS,)."""
    turned, mean = 0.0, 0.0
    for n in range(len(current)):
        turned += abs(motor_speed[n])
        mean += current[n] * motor_speed[n]  # in the sense of rotation, weighted by the angle
    turned = max(turned, 1e-300)
    mean /= turned
    along, across = np.zeros(HARMONICS), np.zeros(HARMONICS)
    for n in range(len(current)):
        weighted = current[n] * motor_speed[n] - mean * abs(motor_speed[n])
        cos, sin = math.cos(pairs * motor_position[n]), math.sin(pairs * motor_position[n])
        cos_k, sin_k = cos, sin
        for k in range(HARMONICS):
            along[k] += weighted * cos_k
            across[k] += weighted * sin_k
            cos_k, sin_k = cos_k * cos - sin_k * sin, sin_k * cos + cos_k * sin
    return 2.0 * np.hypot(along, across) / turned


@compiled()
def _sums(supply_voltage, supply_current, copper_loss, saturated):  # type: ignore[no-untyped-def]
    """Sums over the steps of the power drawn, the power lost and the saturation, in one pass."""
    drawn, lost, limited = 0.0, 0.0, 0.0
    for n in range(1, len(supply_current)):
        drawn += supply_voltage[n] * supply_current[n]
        lost += copper_loss[n]
        limited += saturated[n]
    return drawn, lost, limited


@compiled()
def _rms_and_range(series):  # type: ignore[no-untyped-def]
    total, low, high = 0.0, series[0], series[0]
    for value in series:
        total += value * value
        low, high = min(low, value), max(high, value)
    return math.sqrt(total / len(series)), high - low

"""Whether the ripple of hysteresis control hides what a run could say."""

from collections.abc import Mapping

import numpy as np

from ema_fmu_src import ports
from harness.identification.curves import Curves
from harness.inference.measured import CURRENT, PHASES, Measured
from harness.logs.shown import value_of

BAND, MODULATION = "inverter.hysteresis", "inverter.modulation"
HYSTERESIS = float(ports.VARIABLES[ports.INDEX[MODULATION]].items["hysteresis"])


def ripple(found: Curves, measured: Measured, parameters: Mapping[str, float]) -> str:
    """What is wrong with a run in whose rows the motion mostly needs less current than half the band of the hysteresis
    control; empty if nothing is, if no current was measured, or at a carrier, whose ripple does not depend on the motion.
    `parameters`: those set, by port name."""
    if value_of(MODULATION, parameters) != HYSTERESIS:
        return ""
    band = value_of(BAND, parameters)
    needed = _needed(found, measured)
    if needed is None or needed >= band:
        return ""
    return (
        f"half of the time the motion needs less than {needed:.2g} A, within the ripple of the current "
        f"(+-{band:g} A, {BAND}): a run with more load or acceleration says more"
    )


def _needed(found: Curves, measured: Measured) -> float | None:
    """Median of the model's equivalent current in the rows that carry weight [A]; None without a current."""
    names = list(measured.channels)
    rows = measured.informative
    for name in (CURRENT, "equivalent_current"):
        if name in names:
            return float(np.median(np.abs(found.predicted[rows, names.index(name)])))
    if all(name in names for name in PHASES):
        phases = found.predicted[rows][:, [names.index(name) for name in PHASES]]
        return float(np.median(np.sqrt(2.0 / 3.0 * np.sum(phases**2, axis=1))))
    return None

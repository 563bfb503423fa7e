"""What the model cannot explain of a measured run, and what such a channel looks like: other units, signs or columns."""

import math

import numpy as np
from numpy.typing import NDArray

from harness.identification.fit import Fit
from harness.identification.measured import Measured

Array = NDArray[np.float64]

MOST_GAP = 0.0025
"""Fraction of a channel's range up to which the model's own gap to HF is accepted: LF's in unsaturated runs (ours)."""
FACTORS = {
    180.0 / math.pi: "degrees instead of rad",
    30.0 / math.pi: "rpm instead of rad/s",
    1000.0: "a thousandth of the unit (mrad, mA)",
    -1.0: "the other sign",
}
"""Factor by which a column is too large -> what it then looks like."""
SAME_QUANTITY = 0.9
"""Correlation from which two curves are taken for the same quantity."""
FACTOR_TOLERANCE = 1.4
"""Ratio within which a factor is taken for a known one: faults change a curve too."""
END_STOP_TOLERANCE = 1.1
"""A position beyond so many times the end stop's is not in rad."""


def unexplained(found: Fit, measured: Measured, tolerance: float, end_stop: float) -> list[str]:
    """A line for each channel of which more is left than noise, `tolerance` and the model's own gap to HF.

    `tolerance`: fraction of the channel's range; `end_stop` [rad].
    """
    lines = []
    spread = np.ptp(measured.values, axis=0)
    for place, name in enumerate(measured.channels):
        share, gap = (float(part[place] / spread[place]) for part in (found.unexplained, found.gap))
        accepted = tolerance + min(gap, MOST_GAP)
        if share > accepted:
            hint = _hint(place, found, measured, end_stop)
            if not hint and gap > MOST_GAP:
                hint = f"HF differs from this model by {100.0 * gap:.2g} % in such a run; a slower one says more"
            lines.append(
                f"{100.0 * share:.2g} % of the range of {name} ({100.0 * accepted:.2g} % can be accepted)"
                f"{'; ' + hint if hint else ''}"
            )
    return lines


def _hint(place: int, found: Fit, measured: Measured, end_stop: float) -> str:
    """What the channel at `place` looks like; empty if it looks like nothing known."""
    names = list(measured.channels)
    data = measured.values[:, place]
    if names[place] == "position":
        command = np.interp(measured.time, measured.trial.time, measured.trial.inputs["command"])
        if hint := _scaled(data, command, "the command"):
            return hint
    if hint := _scaled(data, found.healthy[:, place], "what the model expects"):
        return hint
    correlations = [abs(_correlation(data, model)) for model in found.healthy.T]
    other = int(np.argmax(correlations))
    if correlations[other] > SAME_QUANTITY and correlations[other] > correlations[place] + 0.1:
        return f"it looks like {names[other]}: columns interchanged?"
    if names[place] == "position" and (reached := float(np.max(np.abs(data)))) > END_STOP_TOLERANCE * end_stop:
        return f"it reaches {reached:.3g} rad, beyond the end stops at {end_stop:g} rad: degrees instead of rad?"
    return ""


def _correlation(one: Array, other: Array) -> float:
    a, b = one - one.mean(), other - other.mean()
    return float(a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300))


def _scaled(data: Array, expected: Array, what: str) -> str:
    """What it means if `data` is what was `expected`, multiplied or divided by one of FACTORS; empty if it is not."""
    correlation = _correlation(data, expected)
    if abs(correlation) < SAME_QUANTITY:
        return ""
    factor = correlation * float(np.std(data) / np.std(expected))
    for known, meaning in FACTORS.items():
        if 1.0 / FACTOR_TOLERANCE < factor / known < FACTOR_TOLERANCE:
            return f"it is {factor:.3g} times {what}: {meaning}?"
        if known > 1.0 and 1.0 / FACTOR_TOLERANCE < factor * known < FACTOR_TOLERANCE:
            return f"it is {factor:.3g} times {what}: is that in {meaning}?"
    return ""

"""What the model cannot explain of a measured run, and what such a channel looks like."""

from collections.abc import Mapping

import numpy as np

from harness.identification.fit import Fit
from harness.inference.measured import CURRENTS, Measured
from harness.identification.ripple import ripple
from harness.logs.hints import Seen, percent
from harness.logs.shown import value_of

MOST_GAP = 0.0025
"""Fraction of a channel's range up to which the model's own gap to HF is accepted: LF's in unsaturated runs (ours)."""
MUCH = 0.03
"""Share of a channel's range from which what the healthy model leaves points to another actuator (ours)."""
MOSTLY = 2.0
"""A rest up to so many times the model's own gap may come of it."""


def unexplained(found: Fit, measured: Measured, tolerance: float, parameters: Mapping[str, float]) -> list[str]:
    """A line for each channel of which more is left than noise, `tolerance`, the model's own gap to HF, and HF's ripple.

    `tolerance`: fraction of the channel's range; `parameters`: those set, by port name.
    """
    lines = []
    seen = _seen(found, measured, parameters)
    spread = np.ptp(measured.values, axis=0)
    rippled = ripple(found, measured, parameters)
    currents = [name in {each for names in CURRENTS for each in names} for name in measured.channels]
    for place, name in enumerate(seen.names):
        parts = (found.unexplained, found.gap, found.ripple)
        share, gap, chance = (float(part[place] / spread[place]) for part in parts)
        accepted = tolerance + min(gap, MOST_GAP) + chance
        if share > accepted:
            hint = seen.hint(place)
            if not hint and rippled and currents[place] and share <= MOSTLY * (gap + chance):
                hint = rippled
            elif not hint and gap > MOST_GAP and share <= MOSTLY * gap:
                hint = f"HF itself differs from this model by {percent(gap, 2)} in such a run; a slower run says more"
            lines.append(
                f"{percent(share, 2)} of the range of {name} ({percent(accepted, 2)} can be accepted)"
                f"{'; ' + hint if hint else ''}"
            )
    return lines


def left_without_faults(found: Fit, measured: Measured) -> list[str]:
    """A line that says what the healthy model leaves of each channel, and, where that is much, what may be the cause."""
    off = np.where(measured.weighed, found.healthy - measured.values, 0.0)
    rms = np.sqrt(np.sum(off**2, axis=0) / np.maximum(measured.weighed.sum(axis=0), 1))
    shares = (rms / np.ptp(measured.values, axis=0)).tolist()
    names = [measured.shown[name].name for name in measured.channels]
    listed = ", ".join(f"{percent(share, 2)} of {name}" for share, name in zip(shares, names, strict=True))
    line = f"without faults the model leaves {listed} (rms over the range)"
    if max(shares) > MUCH:
        line += "; the drive, the supply voltage or the friction may be another than the twin's: ema replay shows where"
    return [line]


def _seen(found: Fit, measured: Measured, parameters: Mapping[str, float]) -> Seen:
    """The run beside what the healthy model makes of it, as shown."""
    channels = [measured.shown[name] for name in measured.channels]
    scales = np.array([channel.scale for channel in channels])
    command = np.interp(measured.time, measured.trial.time, measured.trial.inputs["command"])
    travel = measured.output.scale("position")
    stop = travel * value_of("mechanics.end_stop", parameters)
    return Seen(channels, scales * measured.values, scales * found.healthy, travel * command, stop)

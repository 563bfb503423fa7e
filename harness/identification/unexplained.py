"""What the model cannot explain of a measured run, and what such a channel looks like."""

from collections.abc import Mapping

import numpy as np

from harness.identification.fit import Fit
from harness.identification.measured import Measured
from harness.logs.hints import Seen, percent
from harness.logs.shown import value_of

MOST_GAP = 0.0025
"""Fraction of a channel's range up to which the model's own gap to HF is accepted: LF's in unsaturated runs (ours)."""
MOSTLY = 2.0
"""A rest up to so many times the model's own gap may come of it."""


def unexplained(found: Fit, measured: Measured, tolerance: float, parameters: Mapping[str, float]) -> list[str]:
    """A line for each channel of which more is left than noise, `tolerance` and the model's own gap to HF.

    `tolerance`: fraction of the channel's range; `parameters`: those set, by port name.
    """
    lines = []
    seen = _seen(found, measured, parameters)
    spread = np.ptp(measured.values, axis=0)
    for place, name in enumerate(seen.names):
        share, gap = (float(part[place] / spread[place]) for part in (found.unexplained, found.gap))
        accepted = tolerance + min(gap, MOST_GAP)
        if share > accepted:
            hint = seen.hint(place)
            if not hint and gap > MOST_GAP and share <= MOSTLY * gap:
                hint = f"HF itself differs from this model by {percent(gap, 2)} in such a run; a slower run says more"
            lines.append(
                f"{percent(share, 2)} of the range of {name} ({percent(accepted, 2)} can be accepted)"
                f"{'; ' + hint if hint else ''}"
            )
    return lines


def _seen(found: Fit, measured: Measured, parameters: Mapping[str, float]) -> Seen:
    """The run beside what the healthy model makes of it, as shown."""
    channels = [measured.shown[name] for name in measured.channels]
    scales = np.array([channel.scale for channel in channels])
    command = np.interp(measured.time, measured.trial.time, measured.trial.inputs["command"])
    travel = measured.output.scale("position")
    stop = travel * value_of("mechanics.end_stop", parameters)
    return Seen(channels, scales * measured.values, scales * found.healthy, travel * command, stop)

"""What the model cannot explain of a measured run, where it shows, and what such a channel looks like."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from harness.identification.curves import Curves
from harness.identification.ripple import ripple
from harness.inference.measured import CURRENTS, Measured
from harness.logs.hints import Seen, at_bounds, percent
from harness.logs.shown import value_of

MUCH = 0.03
"""Share of a channel's range from which what the healthy model leaves points to another actuator (ours)."""
WINDOW = 0.1
"""Width [s] of the window in which most of a rest is looked for."""


def unexplained(
    curves: Curves, measured: Measured, tolerance: float, parameters: Mapping[str, float], shifts: Sequence[float]
) -> list[str]:
    """A line for each channel of which more is left than noise and `tolerance`, with the time and the frequency at which it
    shows, and for each of the `shifts` [s] of a slow log that has come to its bound.

    `tolerance`: fraction of the channel's range; `parameters`: those set, by port name.
    """
    lines = []
    seen = _seen(curves, measured, parameters)
    rippled = ripple(curves, measured, parameters)
    currents = {name for names in CURRENTS for name in names}
    for place, name in enumerate(measured.channels):
        share = float(curves.left.unexplained[place])
        if share > tolerance:
            hint = seen.hint(place) or (rippled if name in currents else "")
            lines.append(
                f"{percent(share, 2)} of the range of {seen.names[place]} ({percent(tolerance, 2)} can be accepted), "
                f"{_where(curves, measured, place)}{'; ' + hint if hint else ''}"
            )
    return lines + at_bounds(seen.names, list(shifts), measured.shift_bounds.tolist())


def _where(curves: Curves, measured: Measured, place: int) -> str:
    """When most of a channel's rest shows, and the frequency of its largest wave."""
    rest = np.where(measured.weighed[:, place], curves.predicted[:, place] - measured.values[:, place], 0.0)
    step = float(np.median(np.diff(measured.time)))
    width = max(1, round(WINDOW / step))
    energy = np.convolve(rest**2, np.ones(width), mode="same")
    spectrum = np.abs(np.fft.rfft(rest - rest.mean()))
    frequency = float(np.fft.rfftfreq(len(rest), step)[int(np.argmax(spectrum))])
    return f"most at {measured.time[int(np.argmax(energy))]:.3g} s, mainly at {frequency:.3g} Hz"


def left_without_faults(curves: Curves, measured: Measured) -> list[str]:
    """A line that says what the healthy model leaves of each channel, and, where that is much, what may be the cause."""
    off = np.where(measured.weighed, curves.healthy - measured.values, 0.0)
    rms = np.sqrt(np.sum(off**2, axis=0) / np.maximum(measured.weighed.sum(axis=0), 1))
    shares = (rms / np.ptp(measured.values, axis=0)).tolist()
    names = [measured.shown[name].name for name in measured.channels]
    listed = ", ".join(f"{percent(share, 2)} of {name}" for share, name in zip(shares, names, strict=True))
    line = f"without faults the model leaves {listed} (rms over the range)"
    if max(shares) > MUCH:
        line += "; the drive, the supply voltage or the friction may be another than the twin's: ema replay shows where"
    return [line]


def _seen(curves: Curves, measured: Measured, parameters: Mapping[str, float]) -> Seen:
    """The run beside what the healthy model makes of it, as shown."""
    channels = [measured.shown[name] for name in measured.channels]
    scales: NDArray[np.float64] = np.array([channel.scale for channel in channels])
    command = np.interp(measured.time, measured.trial.time, measured.trial.inputs["command"])
    travel = measured.output.scale("position")
    stop = travel * value_of("mechanics.end_stop", parameters)
    return Seen(channels, scales * measured.values, scales * curves.healthy, travel * command, stop)

"""How far a twin is from a log: the figures of each channel, and those of the tracking error."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

Array = NDArray[np.float64]

MOST_LAG = 0.05
"""Largest lag that is looked for [s], either way."""
LOW_PASS = 20.0
"""Cut-off [Hz] of the low-passed figures: what moves a structure, without what switches."""
LEAST_RATE = 50.0
"""Rows a second from which they can be given."""


@dataclass(frozen=True)
class Channel:
    """A channel, in `unit`, the one outside, with its own `rate` of rows a second; `measured`, `twin`, and the twin
    `unshifted`, shape (n_rows,), at the log's rows.

    `shift` [s]: the twin's curve is taken so much later than the rows say, as far as a row's distance allows; `rms` of the
    difference after that, `nrmse`: over the measured range, `nrmse_20hz`: with both low-passed, None below 50 rows a second;
    `nrmse_unshifted`: without the shift. `lag` [s]: by how much the twin would have to be moved to lie on the measured curve
    best, positive if the twin comes later; it may be more than a shift may be.
    """

    name: str
    unit: str
    rate: float
    rms: float
    nrmse: float
    nrmse_20hz: float | None
    nrmse_unshifted: float
    shift: float
    lag: float
    measured: Array = field(repr=False)
    twin: Array = field(repr=False)
    unshifted: Array = field(repr=False)

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        names = ("unit", "rate", "rms", "nrmse", "nrmse_20hz", "nrmse_unshifted", "shift", "lag")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True)
class TrackingError:
    """Position minus command, in `unit`: rms `measured` and of the `twin`, rms of their `difference`, and that over the
    measured one, the `ratio`; None if nothing was measured that differs from the command. `ratio_unshifted`: without the
    shift in time, which hides a part of what a wrong loop does."""

    unit: str
    measured: float
    twin: float
    difference: float
    ratio: float | None
    ratio_unshifted: float | None


def rms(values: Array) -> float:
    """Root of the mean square of the values that are numbers."""
    return float(np.sqrt(np.nanmean(values**2)))


def nrmse(measured: Array, twin: Array) -> float:
    """Rms of the difference over the range of what was measured; rows that are not a number are left out."""
    return rms(twin - measured) / float(np.nanmax(measured) - np.nanmin(measured))


def nrmse_20hz(time: Array, measured: Array, twin: Array) -> float | None:
    """The same of both low-passed at LOW_PASS, forth and back, which shifts nothing; None below LEAST_RATE rows a second.

    The rows are the channel's own; those of uneven times are interpolated onto even ones, and masked ones between their
    neighbours, in both.
    """
    rate = 1.0 / float(np.median(np.diff(time)))
    if rate < LEAST_RATE * (1.0 - 1e-6):
        return None
    there = np.isfinite(measured)
    even = np.linspace(time[0], time[-1], round((time[-1] - time[0]) * rate) + 1)
    sections = butter(2, LOW_PASS, fs=rate, output="sos")
    series = [np.interp(even, time[there], each[there]) for each in (measured, twin)]
    pad = min(9, len(even) - 1)
    return nrmse(*(np.asarray(sosfiltfilt(sections, each, padlen=pad)) for each in series))


def tracking_error(command: Array, measured: Array, twin: Array, unshifted: Array, unit: str) -> TrackingError:
    """The tracking errors of two positions, shape (n_rows,), in `unit` all."""
    own, other = rms(measured - command), rms((twin - command)[np.isfinite(measured)])
    difference, before = rms(twin - measured), rms(unshifted - measured)
    ratios = (difference / own, before / own) if own > 0.0 else (None, None)
    return TrackingError(unit, own, other, difference, *ratios)

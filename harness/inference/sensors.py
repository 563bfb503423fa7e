"""What sensors and loggers make of a model's curves: offset, gain, shift in time, low-pass; and a share of a better model.

These nuisances act on the curves that a flight has given: they cost no flight of their own.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, lfilter_zi

from harness.inference.measured import Measured

Array = NDArray[np.float64]

NUISANCES = ("offset", "gain", "shift", "lag", "gap")
"""Of each channel, in the order of all arrays: what is added, the relative error of a factor, how much later [s] the twin's
time is that a row shows, the time constant [s] of a low-pass, and the share of the judge's difference from the model."""
OFFSET, GAIN, SHIFT, LAG, GAP = range(len(NUISANCES))
OFFSET_SIGMA, GAIN_SIGMA, SHIFT_SIGMA, LAG_SIGMA, GAP_SIGMA = 0.02, 0.01, 2e-3, 2e-3, 0.5
"""Standard deviations before a run is looked at (ours): the offset's in ranges of the channel."""
MOST = 8.0
"""Bounds of a nuisance, in standard deviations."""
LAG_STEP = 1e-4
"""Step [s] of the slope by the low-pass."""
NO_LAG = 0.4
"""Time constants below so many steps of the grid are none."""


def unit_of(kind: str, channel: str) -> str:
    """The unit of a nuisance, where `channel` is that of what it is of."""
    return channel if kind == "offset" else "s" if kind in ("shift", "lag") else "1"


@dataclass(frozen=True)
class Sensors:
    """The sensors of a measured run. `order`: that of their low-pass, 1 or 2 (Butterworth).

    Nuisances `nu` have the shape (n_channels, len(NUISANCES)), in their own units.
    """

    measured: Measured
    order: int = 1

    @property
    def spans(self) -> Array:
        """Range of each channel without its outermost rows, in its unit, shape (n_channels,)."""
        run = self.measured
        return np.array([np.ptp(np.quantile(run.values[run.weighed[:, k], k], [0.002, 0.998])) for k in range(self.count)])

    @property
    def count(self) -> int:
        """Number of channels."""
        return len(self.measured.channels)

    def sigmas(self) -> Array:
        """Standard deviations of the nuisances before the run is looked at, shape (n_channels, len(NUISANCES)).

        A shift of a slow log is anywhere within its bounds.
        """
        out = np.empty((self.count, len(NUISANCES)))
        out[:, OFFSET] = OFFSET_SIGMA * self.spans
        out[:, GAIN], out[:, LAG], out[:, GAP] = GAIN_SIGMA, LAG_SIGMA, GAP_SIGMA
        out[:, SHIFT] = np.where(self.measured.shift_bounds > 0.0, self.measured.shift_bounds / np.sqrt(3.0), SHIFT_SIGMA)
        return out

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest nuisances, shapes as `sigmas`: a low-pass does not lead."""
        high = MOST * self.sigmas()
        slow = self.measured.shift_bounds > 0.0
        high[slow, SHIFT] = self.measured.shift_bounds[slow]
        low = -high
        low[:, LAG] = 0.0
        return low, high

    def seen(self, curves: Array, nu: Array, gap: Array | None) -> Array:
        """What the log shows of `curves` (n_points, n_channels) on the trial's grid, shape (n_rows, n_channels).

        `gap`: the judge's difference from the model in the log's rows, same shape; None for none.
        """
        out = np.empty((len(self.measured.time), self.count))
        for k in range(self.count):
            here = self._row(self._lagged(curves[:, k], nu[k, LAG]), k, nu[k, SHIFT])
            out[:, k] = (1.0 + nu[k, GAIN]) * here + nu[k, OFFSET]
            if gap is not None:
                out[:, k] += nu[k, GAP] * gap[:, k]
        return out

    def slopes(self, curves: Array, nu: Array, gap: Array | None) -> Array:
        """Derivative of each channel of `seen` by each of its own nuisances, shape (n_rows, n_channels, len(NUISANCES))."""
        out = np.zeros((len(self.measured.time), self.count, len(NUISANCES)))
        step = self.measured.trial.step
        for k in range(self.count):
            lagged = self._lagged(curves[:, k], nu[k, LAG])
            here = self._row(lagged, k, nu[k, SHIFT])
            more = max(nu[k, LAG], NO_LAG * step) + LAG_STEP
            later = self._row(self._lagged(curves[:, k], more), k, nu[k, SHIFT])
            out[:, k, OFFSET], out[:, k, GAIN] = 1.0, here
            out[:, k, SHIFT] = (1.0 + nu[k, GAIN]) * self._row(np.gradient(lagged, step), k, nu[k, SHIFT])
            out[:, k, LAG] = (1.0 + nu[k, GAIN]) * (later - here) / (more - nu[k, LAG])
            if gap is not None:
                out[:, k, GAP] = gap[:, k]
        return out

    def _row(self, series: Array, place: int, shift: float) -> Array:
        return self.measured.observer.row(series, place, float(shift))

    def _lagged(self, series: Array, tau: float) -> Array:
        step = self.measured.trial.step
        if tau < NO_LAG * step:
            return series
        if self.order == 1:
            pole = np.exp(-step / tau)
            filtered, _ = lfilter([1.0 - pole], [1.0, -pole], series, zi=[pole * series[0]])
        else:
            b, a, zi = _second_order(tau, step)
            filtered, _ = lfilter(b, a, series, zi=series[0] * zi)
        return np.asarray(filtered)


@lru_cache(maxsize=64)
def _second_order(tau: float, step: float) -> tuple[Array, Array, Array]:
    """Butterworth's low-pass of second order, and its state after a constant 1; designed once for all flights of a
    linearisation (an eighth of the time of a diagnosis)."""
    b, a = butter(2, 1.0 / (2.0 * np.pi * tau), fs=1.0 / step)
    return b, a, lfilter_zi(b, a)

"""The noise of a channel: an autoregression, learnt from what a model leaves over, by which residuals are made white.

Rows that follow each other closely repeat much of each other's error. Least squares that take them for independent are
overconfident by the root of how many rows say the same; filtered by the autoregression they are independent.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ORDERS = (0, 1, 2, 4, 8, 16, 32)
"""Orders of the autoregression that are tried; the Bayesian information criterion (Schwarz 1978) takes one."""
ROWS_AN_ORDER = 20
"""Rows that each coefficient needs."""
WHITE = 0.1
"""Part of a coloured noise's variance that is taken for white at least: behind a low-pass all weight would else go to
frequencies at which no model is right (ours)."""
OUTLIER = 6.0
"""Robust standard deviations beyond which a row is an outlier."""
FLOOR, STILL = 1e-4, 1e-5
"""Least deviations, in ranges of the channel: of what an outlier lies beyond, and of the noise."""


@dataclass(frozen=True)
class Noise:
    """An autoregression of a channel's noise: `sigma`, the deviation of what it leaves, in the channel's unit, its
    `coefficients`, shape (order,), and the `total` deviation, that of white noise being `sigma`."""

    sigma: float
    coefficients: Array = field(default_factory=lambda: np.empty(0))
    total: float = 0.0

    def white(self, rest: Array) -> Array:
        """Rest (n_rows, ...) in the channel's unit, filtered to white noise of deviation one."""
        if not len(self.coefficients):
            return rest / self.sigma
        return np.asarray(lfilter(np.r_[1.0, -self.coefficients], [1.0], rest, axis=0)) / self.sigma

    @property
    def variance(self) -> float:
        """Of the noise itself."""
        return max(self.total, self.sigma) ** 2


def about_median(rest: Array, weighed: Mask) -> tuple[Array, float]:
    """Rest (n_rows,) about its median in the rows `weighed`, and its robust deviation there."""
    off = rest - np.median(rest[weighed])
    return off, 1.4826 * float(np.median(np.abs(off[weighed])))


def outliers(rest: Array, weighed: Mask, span: float) -> Mask:
    """Which of the rows `weighed` are far outside what the others leave, shape (n_rows,); `span`: range of the channel."""
    off, usual = about_median(rest, weighed)
    return np.asarray(weighed & (np.abs(off) > OUTLIER * usual + FLOOR * span))


def learnt(rest: Array, weighed: Mask, span: float, least: float) -> Noise:
    """The noise of `rest`, shape (n_rows,), in the rows `weighed`: by Yule and Walker's equations (Brockwell and Davis, Time
    Series, 8.1), its order by the Bayesian information criterion. `span`: range of the channel; `least`: deviation that a
    sensor's steps leave at least, in its unit."""
    count = int(weighed.sum())
    off = np.where(weighed, rest - np.median(rest[weighed]), 0.0)
    orders = [order for order in ORDERS if order * ROWS_AN_ORDER <= count]
    moments = np.array([off[lag:] @ off[: len(off) - lag] for lag in range(max(orders) + 1)]) / count
    moments[0] = max(moments[0] + (STILL * span) ** 2, least**2)

    def model(order: int) -> tuple[Array, float]:
        if not order:
            return np.empty(0), float(moments[0])
        coefficients = solve_toeplitz(moments[:order], moments[1 : order + 1])
        return coefficients, float(max(moments[0] - coefficients @ moments[1 : order + 1], 1e-6 * moments[0]))

    best = min(orders, key=lambda order: count * np.log(model(order)[1]) + order * np.log(count))
    if best:
        moments[0] *= 1.0 + WHITE
    coefficients, variance = model(best)
    return Noise(float(np.sqrt(variance)), coefficients, float(np.sqrt(moments[0])))

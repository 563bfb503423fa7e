"""A densely logged run with fewer rows, each the mean of several: it says the same and costs less."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from harness.inference.measured import Measured
from harness.logs.log import Logger
from harness.logs.noise import filled

Array = NDArray[np.float64]

ENOUGH_ROWS = 2000.0
"""Rows a second that say all of what motion and windings do (ours)."""
EVEN = 1e-3
"""Part of a row's distance by which distances may differ."""


def thinned(measured: Measured) -> Measured:
    """The run with rows that are means of several, at ENOUGH_ROWS a second or a little more; itself if it has no more, or if
    its rows are not evenly apart or not all sampled.

    A row of the mean over (t - d, t] is at t, which is half a distance of the old rows after the last it is made of.
    """
    apart = np.diff(measured.time)
    step = float(np.median(apart))
    width = int(1.0 / (ENOUGH_ROWS * step) + 1e-6)
    observer = measured.observer
    sampled = all(logger.kind == "sampled" for logger in observer.loggers) and all(own.all() for own in observer.own)
    if width < 2 or not sampled or np.max(np.abs(apart - step)) > EVEN * step:
        return measured
    count = len(measured.time) // width

    def means(series: Array) -> Array:
        return np.asarray(filled(measured.time, series)[: count * width].reshape(count, width).mean(axis=1))

    time = means(measured.time) + 0.5 * width * step
    channels = {}
    for name, series in measured.channels.items():
        gone = ~np.isfinite(series)[: count * width].reshape(count, width).all(axis=1)
        channels[name] = np.where(gone, np.nan, means(series))
    informative = np.asarray(measured.informative[: count * width].reshape(count, width).all(axis=1), dtype=np.bool_)
    seen = replace(observer, time=time, loggers=(Logger("averaged"),) * len(observer.loggers), own=())
    return replace(measured, time=time, channels=channels, informative=informative, observer=seen)

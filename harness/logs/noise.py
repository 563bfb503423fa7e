"""The noise on a measured series: what is white on it, and what its sensor's steps leave."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REGULAR = 0.9
"""Share of the distances between neighbouring values that are whole multiples of a step, from which values are quantised."""
REPEATED = 0.5
"""Distinct values a row, up to which a series may be quantised at all."""


def noise_of(series: Array) -> float:
    """Standard deviation of the white noise on a smooth series, from its third differences; robust against jumps."""
    difference = np.diff(series, 3)
    return float(1.4826 * np.median(np.abs(difference)) / np.sqrt(20.0))


def quantum_of(series: Array) -> float:
    """Step of a series of shape (n_rows,) whose values are counts of a sensor, in its unit; 0 if they are not.

    Counts that were rounded when they were written are seen too (0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16 of 0.0196). A
    step much finer than what the rows tell apart is not found, and does not matter.
    """
    values = np.unique(series[np.isfinite(series)])
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-9 * np.ptp(values)] if values.size else gaps  # the same count, written with other last digits
    if len(gaps) < 2 or len(gaps) + 1 > REPEATED * np.isfinite(series).sum():
        return 0.0
    step = float(np.median(gaps[gaps < 1.5 * np.median(gaps)]))
    counts = gaps / step
    regular = (np.abs(counts - np.rint(counts)) < 0.3) & (np.rint(counts) >= 1.0)
    return step if regular.mean() >= REGULAR else 0.0


def error_of(series: Array) -> float:
    """Standard deviation of what the sensor adds to a series, in its unit: white noise, or its steps if those are more."""
    return max(noise_of(series), quantum_of(series) / np.sqrt(12.0))


def filled(time: Array, series: Array) -> Array:
    """The series, shape (n_rows,), with rows that are not a number interpolated between their neighbours."""
    there = np.isfinite(series)
    return series if there.all() else np.interp(time, time[there], series[there])

"""Rows that cannot be: a single value far outside all others, between neighbours that know nothing of it."""

import numpy as np
from numpy.typing import NDArray

LEAST_ROWS = 50
"""Rows from which a column tells what is usual in it."""
FAR = 0.5
"""How far outside the range of the other rows a spike lies, in parts of that range (ours: inrush currents stay within)."""
AGREE = 0.2
"""Most difference between its neighbours, in parts of the spike's height."""
MOST = 0.005
"""Part of the rows that may be spikes; what comes more often belongs to the run."""


def spikes(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each row is an isolated spike, shape (n_rows,); rows that are not a number are none."""
    masked = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < LEAST_ROWS:
        return masked
    series = values[known]
    one, other = np.r_[series[2], series[:-1]], np.r_[series[1:], series[-3]]  # an end's are the two beside it
    height = np.abs(series - 0.5 * (one + other))
    alone = np.abs(one - other) < AGREE * height
    most = max(1, int(MOST * len(series)))
    candidates = np.flatnonzero(alone)
    candidates = candidates[np.argsort(-height[candidates], kind="stable")][: most + 1]
    rest = np.ones(len(series), dtype=bool)
    rest[candidates] = False
    low, high = float(series[rest].min()), float(series[rest].max())
    far = FAR * (high - low)
    found = (
        candidates[(series[candidates] > high + far) | (series[candidates] < low - far)] if high > low else candidates[:0]
    )
    if len(found) <= most:
        masked[known[found]] = True
    return masked

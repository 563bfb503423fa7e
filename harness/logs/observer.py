"""A twin's outputs as a log would have taken them: by the logger's model, at the log's rows, shifted in time.

A shift s of a channel means: the row of time t shows what the twin has at t + s. It is bounded by a row's distance, and
stands for all that a log leaves open about when things happened: a column stamped late, or a command that takes effect
before its row.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from harness.errors import HarnessError
from harness.logs.log import Log, Logger
from harness.logs.stimulus import is_dense
from harness.trials import Trial

Array = NDArray[np.float64]

MOST_SHIFT = 0.01
"""Largest shift of a channel [s]."""
SLOPE_STEP = 2.5e-4
"""Half the width [s] over which the slope of a channel by its shift is taken."""
SCANNED = 2.5e-4
"""Distance [s] of the shifts that are tried before the best is refined."""


def shift_bounds(log: Log, names: Sequence[str]) -> Array:
    """Largest shift of each channel of `names`, either way [s], shape (n_channels,): as far as its own rows, or those of the
    command, are apart; 0 where both are dense, and show when things happen."""
    dense = np.array([is_dense(log, name, "command") for name in names])
    apart = np.array([1.0 / min(log.rate_of(name), log.rate_of("command")) for name in names])
    return np.where(dense, 0.0, np.minimum(apart, MOST_SHIFT))


@dataclass(frozen=True, eq=False)
class Observer:
    """Sees a twin's outputs on the points `start` + n*`step` [s] as the log does at `time` [s], shape (n_rows,).

    `loggers`: how each channel is taken, in their order; `own`: which rows are its own, shape (n_rows,), all where there is
    none. Before the first point and after the last the twin stands still.
    """

    time: Array
    start: float
    step: float
    loggers: tuple[Logger, ...]
    own: tuple[NDArray[np.bool_], ...] = ()

    def rows(self, values: Array, shifts: Array) -> Array:
        """Channels (n_points, n_channels) as the log has them, shape (n_rows, n_channels); `shifts` [s], (n_channels,)."""
        return np.column_stack(
            [self.row(values[:, place], place, float(shifts[place])) for place in range(len(self.loggers))]
        )

    def slopes(self, values: Array, shifts: Array) -> Array:
        """Derivative of `rows` by the shift of each channel [1/s], shape (n_rows, n_channels)."""
        ahead, behind = (self.rows(values, shifts + side * SLOPE_STEP) for side in (1.0, -1.0))
        return (ahead - behind) / (2.0 * SLOPE_STEP)

    def row(self, series: Array, place: int, shift: float) -> Array:
        """The channel at `place`, shape (n_points,), as the log has it, shape (n_rows,)."""
        return self._taken(self._before(series, place), place, shift)

    def aligned(self, values: Array, data: Array, weighed: NDArray[np.bool_], bounds: Array) -> Array:
        """The shifts within +-`bounds` [s], (n_channels,), at which each channel is nearest to `data` (n_rows, n_channels),
        in the rows that are `weighed` (same shape); shape (n_channels,)."""
        return np.array(
            [self._best_shift(values[:, n], n, data[:, n], weighed[:, n], bounds[n]) for n in range(len(self.loggers))]
        )

    def _best_shift(self, series: Array, place: int, data: Array, weighed: NDArray[np.bool_], bound: float) -> float:
        if bound == 0.0 or not weighed.any():
            return 0.0
        prepared = self._before(series, place)

        def misfit(shift: float) -> float:
            return float(np.sum((self._taken(prepared, place, shift) - data)[weighed] ** 2))

        tried = np.linspace(-bound, bound, 2 * max(1, round(bound / SCANNED)) + 1)
        costs = [misfit(shift) for shift in tried]
        best = int(np.argmin(costs))
        around = (tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)])
        refined = minimize_scalar(misfit, bounds=around, method="bounded", options={"xatol": 1e-6})
        return float(refined.x if refined.fun < costs[best] else tried[best])

    def _before(self, series: Array, place: int) -> Array:
        """What the logger does to the channel before rows are taken: nothing, its low-pass, or its integral."""
        logger = self.loggers[place]
        if logger.kind == "filtered" and logger.tau > 0.0:
            pole = np.exp(-self.step / logger.tau)
            low_passed, _ = lfilter([1.0 - pole], [1.0, -pole], series, zi=[pole * series[0]])
            return np.asarray(low_passed)
        if logger.kind == "averaged":
            return np.r_[0.0, np.cumsum(0.5 * (series[1:] + series[:-1])) * self.step]
        return series

    def _taken(self, prepared: Array, place: int, shift: float) -> Array:
        places = _places(self, place, shift, len(prepared))
        here = prepared[places.before]
        if places.part is not None:
            here = here + places.part * (prepared[places.before + 1] - here)
        return here if places.since is None else (here[0] - here[1]) / places.since


@dataclass(frozen=True)
class _Places:
    """Where rows are taken from a series: linearly between the points `before` and the next, the `part` of the way (None: at
    the points), shape (n_rows,); of an integral at both ends of the time [s] `since` the channel's own row before, shape
    (2, n_rows)."""

    before: NDArray[np.intp]
    part: Array | None
    since: Array | None = None


@lru_cache(maxsize=8)
def _places(observer: Observer, place: int, shift: float, count: int) -> _Places:
    """Where the rows of the channel at `place` are in a series of `count` points: one search for the many flights of a
    linearisation (a sixth of the time of a diagnosis)."""
    places, since = (observer.time - observer.start + shift) / observer.step, None
    if observer.loggers[place].kind == "averaged":
        since = _since(observer, place)
        places = np.stack([places, places - since / observer.step])  # outside, its first and last slopes go on
    else:
        whole = np.rint(places).astype(np.intp)
        if 0 <= whole[0] and whole[-1] < count and np.abs(places - whole).max() <= 1e-3:
            return _Places(whole, None)
        places = np.clip(places, 0, count - 1)
    before = np.clip(np.floor(places).astype(np.intp), 0, count - 2)
    return _Places(before, places - before, since)


def _since(observer: Observer, place: int) -> Array:
    """Time [s] from the channel's own row before each row, shape (n_rows,); the usual one at its first."""
    own = observer.time[observer.own[place]] if observer.own else observer.time
    before = np.searchsorted(own, observer.time) - 1
    return np.where(before < 0, np.median(np.diff(own)), observer.time - own[np.maximum(before, 0)])


def observer_of(log: Log, trial: Trial, names: tuple[str, ...]) -> Observer:
    """The observer of the channels `names` of a log; HarnessError for a logger of no known kind."""
    loggers = tuple(log.loggers.get(name, Logger()) for name in names)
    for name, logger in zip(names, loggers, strict=True):
        if logger.kind not in ("sampled", "averaged", "filtered") or not 0.0 <= logger.tau < np.inf:
            raise HarnessError(
                f"{log.source}, {name}: '{logger.kind}' is no logger; sampled, averaged or filtered is needed"
            )
    return Observer(log.time, trial.start, trial.step, loggers, tuple(log.rows_of(name) for name in names))

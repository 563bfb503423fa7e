"""The growth of a fault, and when it reaches its limit: a progpy model, filter and predictor.

The fault's value drifts at a rate that itself does a random walk: level' = rate, rate' = white noise of density q (a local
linear trend; ours). progpy's Kalman filter follows it, each run weighted by its interval; q is the most likely of a grid.
progpy's Monte Carlo predictor carries samples of level and rate forward. The event is the limit, the event state the health
index.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from progpy import LinearModel
from progpy.predictors import MonteCarlo
from progpy.state_estimators import KalmanFilter
from progpy.uncertain_data import MultivariateNormalDist

from harness.faults import Fault

Array = NDArray[np.float64]

EVENT = "limit"
SAMPLES, STEPS = 400, 200
"""Samples of the Monte Carlo prediction, and its steps to the horizon."""
MOST_HISTORIES, MOST_LIVES = 10.0, 4.0
"""Horizon of the prediction: the lesser of so many lengths of the history, and of so many times the remaining life at the
present rate."""
FEWEST_RUNS = 3
"""Runs that a trend needs."""
SIGNIFICANT, LEAST_GROWTH = 3.0, 0.01
"""A fault is said to grow if its rate towards the limit is above zero by so many standard deviations (as several faults are
tested), and if it has gone this part of the way from healthy to its limit over the history."""
LIKELIHOOD_GAIN = 1.92
"""Gain in log-likelihood from which the rate is taken to change: half the 95 % quantile of chi-squared, one degree of
freedom."""
SEED = 20230612


@dataclass(frozen=True)
class Trend:
    """How a fault has grown, and how it is predicted to grow. Times are in the unit of the history, from its first run.

    `at`, `values`, `sigmas`, shape (n_runs,): time, estimate and standard deviation of the runs that identify the fault.
    `level`, within the searched range, `rate` and their `covariance` (2, 2): at the last run.
    `scatter`: standard deviation of the runs beyond what
    their intervals say. `health`: the event state at the last run. `times_of_event`: of each sample that reaches the limit
    within `horizon` after the last run; `reached`: the part of the samples that does. `forecast`: times, shape (n_times,),
    and 5, 50, 95 % quantiles of the predicted value, shape (3, n_times). Nothing is predicted for a fault that does not
    grow.
    """

    fault: Fault
    limit: float
    at: Array = field(repr=False)
    values: Array = field(repr=False)
    sigmas: Array = field(repr=False)
    level: float
    rate: float
    covariance: Array
    scatter: float
    health: float
    horizon: float
    times_of_event: Array = field(repr=False)
    reached: float
    forecast: tuple[Array, Array] = field(repr=False)

    @property
    def grows(self) -> bool:
        """Whether the fault moves towards its limit significantly."""
        return _grows(self.fault, self.limit, self.rate, self.covariance, float(self.at[-1] - self.at[0]))

    def life(self, *parts: float) -> list[float | None]:
        """Quantiles `parts` of the remaining useful life; None where too few samples reach the limit."""
        now, count = float(self.at[-1]), round(len(self.times_of_event) / self.reached) if self.reached else 0
        ordered = np.sort(self.times_of_event) - now
        places = [math.ceil(part * count) - 1 for part in parts]
        return [float(ordered[max(place, 0)]) if count and place < len(ordered) else None for place in places]


class Growth(LinearModel):
    """progpy's linear model of a fault: states level and rate, output level, event `limit`, whose state is the health."""

    inputs: list[str] = []  # noqa: RUF012 - progpy's declaration
    states = ["level", "rate"]  # noqa: RUF012
    outputs = ["level"]  # noqa: RUF012
    events = [EVENT]  # noqa: RUF012
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    C = np.array([[1.0, 0.0]])
    F = None
    default_parameters = {"healthy": 0.0, "limit": 1.0, "x0": {"level": 0.0, "rate": 0.0}}  # noqa: RUF012

    def event_state(self, x: Any) -> dict[str, float]:
        """Health on the way from healthy to the limit: 1 healthy, 0 at the limit, not bounded."""
        healthy, limit = self.parameters["healthy"], self.parameters["limit"]
        return {EVENT: 1.0 - (float(x["level"]) - healthy) / (limit - healthy)}

    def threshold_met(self, x: Any) -> dict[str, bool]:
        return {EVENT: self.event_state(x)[EVENT] <= 0.0}


def follow(fault: Fault, limit: float, at: Array, values: Array, sigmas: Array) -> Trend:
    """The trend of a fault towards `limit` from `values` with standard deviations `sigmas` at the times `at`.

    Shape (n_runs,) each, n_runs FEWEST_RUNS or more; the times increase.
    """
    span = abs(limit - fault.healthy)
    floor = 1e-4 * span  # no identification is better
    sigmas = np.maximum(sigmas, floor)
    scatter = _scatter(at, values, sigmas)
    duration = float(at[-1] - at[0])
    densities = [0.0, *(span / duration * np.geomspace(1e-3, 1.0, 7) / math.sqrt(duration))]
    constant, *changing = (_filtered(fault, limit, at, values, np.hypot(sigmas, scatter), q) for q in densities)
    best = max(changing, key=lambda found: found[0])
    _, q, state = best if best[0] > constant[0] + LIKELIHOOD_GAIN else constant
    level, rate, covariance = float(state.mean["level"]), float(state.mean["rate"]), np.array(state.cov, dtype=float)
    horizon, remaining = MOST_HISTORIES * duration, limit - level
    if remaining * rate > 0.0:
        horizon = min(horizon, MOST_LIVES * remaining / rate)
    times, reached, forecast = np.empty(0), 0.0, (np.empty(0), np.empty((3, 0)))
    if _grows(fault, limit, rate, covariance, duration):
        times, reached, forecast = _predict(fault, limit, state, q, float(at[-1]), horizon)
    return Trend(
        fault=fault,
        limit=limit,
        at=at,
        values=values,
        sigmas=sigmas,
        level=min(max(level, fault.searched[0]), fault.searched[1]),
        rate=rate,
        covariance=covariance,
        scatter=scatter,
        health=fault.health(level, limit),
        horizon=horizon,
        times_of_event=times,
        reached=reached,
        forecast=forecast,
    )


def _grows(fault: Fault, limit: float, rate: float, covariance: Array, duration: float) -> bool:
    towards = rate / (limit - fault.healthy)
    significant = towards * abs(limit - fault.healthy) > SIGNIFICANT * math.sqrt(covariance[1, 1])
    return significant and towards * duration > LEAST_GROWTH


def _scatter(at: Array, values: Array, sigmas: Array) -> float:
    """Standard deviation of the runs beyond `sigmas`, from the second differences of neighbours; robust against outliers."""
    if len(at) < 5:
        return 0.0
    before, after = at[1:-1] - at[:-2], at[2:] - at[1:-1]
    share = after / (before + after)
    off = values[1:-1] - share * values[:-2] - (1.0 - share) * values[2:]
    expected = np.sqrt(sigmas[1:-1] ** 2 + (share * sigmas[:-2]) ** 2 + ((1.0 - share) * sigmas[2:]) ** 2)
    gain = np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    excess = np.median(np.abs(off) / gain) ** 2 * 1.4826**2 - np.median(expected / gain) ** 2
    return math.sqrt(max(0.0, float(excess)))


def _model(fault: Fault, limit: float, **parameters: Any) -> Growth:
    return Growth(healthy=fault.healthy, limit=limit, **parameters)


def _filtered(fault: Fault, limit: float, at: Array, values: Array, sigmas: Array, q: float) -> tuple[float, float, Any]:
    """Log-likelihood of the density `q`, q itself, and the filtered state at the last run."""
    fastest = 3.0 * abs(limit - fault.healthy) / float(at[-1] - at[0])
    first = MultivariateNormalDist(
        ["level", "rate"], [float(values[0]), 0.0], np.diag([float(sigmas[0]) ** 2, fastest**2]).tolist()
    )
    kalman = KalmanFilter(_model(fault, limit), first, t0=float(at[0]), dt=float(at[-1] - at[0]) + 1.0)
    likelihood = 0.0
    for now, value, sigma in zip(at[1:], values[1:], sigmas[1:], strict=True):
        gap = float(now) - kalman.t
        kalman.filter.Q = q**2 * np.array([[gap**3 / 3.0, gap**2 / 2.0], [gap**2 / 2.0, gap]])
        kalman.filter.R = np.array([[float(sigma) ** 2]])
        kalman.estimate(float(now), {}, {"level": float(value)})
        likelihood += float(kalman.filter.log_likelihood)
    return likelihood, q, kalman.x


def _predict(
    fault: Fault, limit: float, state: Any, q: float, now: float, horizon: float
) -> tuple[Array, float, tuple[Array, Array]]:
    """Times of the event, the part of the samples that reach it, and the forecast, by progpy's Monte Carlo predictor."""
    step = horizon / STEPS
    model = _model(fault, limit, process_noise={"level": 0.0, "rate": q / math.sqrt(step)})
    np.random.seed(SEED)  # noqa: NPY002 - progpy draws from numpy's global generator
    result = MonteCarlo(model).predict(
        state, n_samples=SAMPLES, t0=now, dt=step, horizon=horizon, save_freq=step, events=[EVENT]
    )
    ends = [sample[EVENT] for sample in result.time_of_event]
    grid, times = np.array(result.times), []
    levels = np.full((len(ends), len(grid)), limit)  # where a sample has reached it
    for row, (run, end) in enumerate(zip(result.states, ends, strict=True)):
        series = [float(x["level"]) for x in run]
        levels[row, : len(series)] = series
        if end is not None:  # the first step beyond the limit; the last state before it says where in between
            before = float(grid[len(series) - 1])
            crossed = before + (limit - series[-1]) / (float(run[-1]["rate"]) or math.inf)
            times.append(min(max(crossed, before), float(end)))
    return np.array(times), len(times) / len(ends), (grid, np.percentile(levels, [5, 50, 95], axis=0))

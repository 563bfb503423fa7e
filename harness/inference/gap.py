"""The gap between the judge, a better model, and the model that is searched."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from harness.inference.problem import Problem
from harness.inference.run import Run
from harness.inference.unknowns import N_FAULTS

Array = NDArray[np.float64]

RIPPLE, SLOW_RIPPLE = 2e-3, 0.01
"""Window [s] over which the judge's difference from the model is averaged: many periods of the inverter, few of the field's
turning; and for rows so far apart that they take the ripple by chance."""
SCATTER = 0.05
"""Window [s] over which the scatter of the judge's flights is averaged."""
FLIGHTS, HAIR = 4, 1e-9
"""Flights of the judge that are averaged, and by how much their faults differ, in spans: the ripple of hysteresis control is
chaotic in rounding, and is drawn anew by each."""


def update_gap(problem: Problem, u: Array, r: int) -> None:
    """Compare the judge of run `r` with the model at `u`: the mean of several flights, smoothed, in the log's rows."""
    run = problem.runs[r]
    apart = _apart(problem, u, r)
    if apart is not None:
        run.gap, run.flights = apart.mean(axis=0), apart


def update_scatter(problem: Problem, u: Array, r: int) -> None:
    """Take from the judge of run `r` at `u` how far its flights are from each other, and the gap."""
    run = problem.runs[r]
    apart = _apart(problem, u, r)
    if apart is None:
        return
    run.gap, run.flights = apart.mean(axis=0), apart
    rows = float(np.median(np.diff(run.measured.time)))
    width = max(1, round(SCATTER / rows))
    variance = uniform_filter1d(apart.var(axis=0, ddof=1), width, axis=0)
    run.scatter = variance * max(1.0, _ripple(run) / rows)


def _ripple(run: Run) -> float:
    return SLOW_RIPPLE if run.measured.is_slow else RIPPLE


def _apart(problem: Problem, u: Array, r: int) -> Array | None:
    """The judge's difference from the model in each of FLIGHTS flights, shape (FLIGHTS, n_rows, n_channels), smoothed; None
    without a judge, or where it cannot fly."""
    run, own = problem.runs[r], problem.unknowns
    if run.judge is None:
        return None
    beside = []
    for n in range(FLIGHTS):
        other = u.copy()
        other[:N_FAULTS] = np.clip(u[:N_FAULTS] + n * HAIR, own.low[:N_FAULTS], own.high[:N_FAULTS])
        beside.append(problem.setting(other, r))
    flights = np.array(run.judge.fly_all(beside))
    if not np.isfinite(flights).all():
        return None
    width = max(1, round(_ripple(run) / run.measured.trial.step))
    smooth = uniform_filter1d(flights - problem.curves(u, r), width, axis=1)
    shifts = np.zeros(smooth.shape[2])
    return np.array([run.measured.observer.rows(each, shifts) for each in smooth])

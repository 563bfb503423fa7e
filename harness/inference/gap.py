"""The gap between the judge, a better model, and the model that is searched."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from harness.inference.problem import Problem
from harness.inference.unknowns import N_FAULTS

Array = NDArray[np.float64]

RIPPLE = 0.01
"""Window [s] over which the judge's difference from the model is averaged: many periods of the inverter, few of a run."""
FLIGHTS, HAIR = 4, 1e-9
"""Flights of the judge that are averaged, and by how much their faults differ, in spans: the ripple of hysteresis control is
chaotic in rounding, and is drawn anew by each."""


def update_gap(problem: Problem, u: Array, r: int) -> None:
    """Compare the judge of run `r` with the model at `u`: the mean of several flights, smoothed, in the log's rows."""
    run, own = problem.runs[r], problem.unknowns
    if run.judge is None:
        return
    beside = []
    for n in range(FLIGHTS):
        other = u.copy()
        other[:N_FAULTS] = np.clip(u[:N_FAULTS] + n * HAIR, own.low[:N_FAULTS], own.high[:N_FAULTS])
        beside.append(problem.setting(other, r))
    flights = run.judge.fly_all(beside)
    if not np.isfinite(flights).all():
        return
    width = max(1, round(RIPPLE / run.measured.trial.step))
    apart = uniform_filter1d(np.mean(flights, axis=0) - problem.curves(u, r), width, axis=0)
    run.gap = run.measured.observer.rows(apart, np.zeros(apart.shape[1]))

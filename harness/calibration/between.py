"""What the command did between the rows of a log that does not say so: what a short fit explains best."""

from collections.abc import Callable
from dataclasses import replace

from harness.calibration.search import unknown
from harness.inference.between import nearest
from harness.inference.measured import Measured
from harness.inference.prior import Prior
from harness.inference.problem import Problem
from harness.inference.run import Run
from harness.logs.log import Between

MOST = 4
"""Linearisations of each fit: it only has to tell which comes nearer."""


def decided(measured: Measured, run_of: Callable[[Measured], Run], prior: Prior) -> Measured:
    """The run with that of its trials alone that a fit of the parameters, from their start values, explains best, and a
    remark that says so; the run itself if it has only one. `run_of`: makes a run that can be flown."""
    if len(measured.trials) == 1:
        return measured
    costs: dict[Between, float] = {}
    for between, trial in measured.trials.items():
        problem = Problem([run_of(replace(measured, trials={between: trial}))], prior)
        costs[between] = problem.solve(problem.aligned(problem.start), unknown(problem), most=MOST).cost
    return nearest(measured, costs)

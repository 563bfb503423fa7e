"""What the command did between the rows of a log that does not say so: what explains the run best."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from harness.fidelity import Fidelity
from harness.inference.measured import Measured
from harness.inference.flights import Model
from harness.identification.search import Problem
from harness.logs.log import Between

MOST_TRIALS = 12
"""Of each search: it only has to tell which comes nearer."""


def decided(measured: Measured, fmus: Path, fidelity: Fidelity, parameters: Mapping[str, float]) -> Measured:
    """The run with that of its trials alone with which a search from the healthy actuator comes nearest to it, and a remark
    that says so; the run itself if it has only one."""
    if len(measured.trials) == 1:
        return measured
    costs: dict[Between, float] = {}
    nearest = None
    for again in (False, True):  # from where the nearest has ended, once more: a search may have stalled for another reason
        for between, trial in measured.trials.items():
            alone = replace(measured, trials={between: trial})
            with Model(fmus, fidelity, alone, parameters) as model:
                problem = Problem(model, alone)
                start = problem.origin if nearest is None or not again else nearest
                end = problem.search(problem.aligned(start), most=MOST_TRIALS)
            if end.cost < min(costs.values(), default=np.inf):
                nearest = end.x
            costs[between] = min(float(end.cost), costs.get(between, np.inf))
    best, *others = sorted(costs, key=lambda between: costs[between])
    ratios = ", ".join(f"{other.value} is {(costs[other] / costs[best]) ** 0.5:.3g} times as far off" for other in others)
    remark = f"nothing says what the command does between rows: {best.value} fits best ({ratios})"
    return replace(measured, trials={best: measured.trials[best]}, remarks=(*measured.remarks, remark))

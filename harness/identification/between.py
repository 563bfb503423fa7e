"""What a log leaves open, decided by what explains the run best: what its command did between rows, and where it began."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from harness.faults import FAULTS
from harness.fidelity import Fidelity
from harness.inference.between import nearest
from harness.inference.flights import Flights
from harness.inference.measured import Measured
from harness.inference.prior import Prior
from harness.inference.problem import Problem
from harness.inference.run import Run
from harness.logs.log import Between
from harness.logs.shown import value_of

MOST_STEPS = 5
"""Linearisations of each search: it only has to tell which comes nearer."""


def decided(measured: Measured, fmus: Path, fidelity: Fidelity, parameters: Mapping[str, float], prior: Prior) -> Measured:
    """The run with that of its trials alone with which a search from the healthy actuator comes nearest to it, and a remark
    that says so; the run itself if it has only one."""
    if len(measured.trials) == 1:
        return measured
    costs: dict[Between, float] = {}
    least = None
    for again in (False, True):  # from where the nearest has ended, once more: a search may have stalled for another reason
        for between, trial in measured.trials.items():
            with Flights(fmus, fidelity, replace(measured, trials={between: trial}), parameters) as model:
                problem = Problem([Run(model)], prior)
                start = problem.start if least is None or not again else least
                found = problem.solve(problem.aligned(start), problem.unknowns.mask(tuple(FAULTS)), most=MOST_STEPS)
            if found.cost < min(costs.values(), default=float("inf")):
                least = found.u
            costs[between] = min(found.cost, costs.get(between, float("inf")))
    return nearest(measured, costs)


def begun(measured: Measured, fmus: Path, fidelity: Fidelity, parameters: Mapping[str, float], prior: Prior) -> Measured:
    """The run as it is, or, if that comes nearer to it, begun where it is commanded to be and not where its position is:
    a sensor may have an offset."""
    if not measured.initial or measured.initial.get("initial.motor_speed"):
        return measured
    command = float(measured.trial.inputs["command"][0])
    ratio = value_of("gear.ratio", parameters)
    there = {"initial.position": command, "initial.motor_position": ratio * command} if command else {}
    costs = []
    for run in (measured, other := replace(measured, initial=there)):
        with Flights(fmus, fidelity, run, parameters) as model:
            problem = Problem([Run(model)], prior)
            costs.append(problem.solve(problem.aligned(problem.start), problem.unknowns.mask(), most=MOST_STEPS).cost)
    return other if costs[1] < costs[0] else measured

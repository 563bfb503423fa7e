"""An open switch: a fault that is there or not, so that no slope leads to it; each of the six is tried."""

from collections.abc import Mapping
from pathlib import Path

from ema_fmu_src import ports
from harness.fidelity import Fidelity
from harness.inference.explain import worst
from harness.inference.flights import Flights
from harness.inference.measured import Measured
from harness.inference.prior import Prior
from harness.inference.problem import Problem
from harness.inference.run import Run

PORT = "fault.open_switch"
FEW = 4
"""Linearisations of a fit that only has to tell which switch it may be."""
CLEARLY = 0.7
"""What is left with the switch open, in parts of what is left without, and with any other."""
MOST = 0.1
"""The same, in ranges of the channel: the averaged models are off by some per cent with a switch open."""


NO_SWITCH = (
    "one of the six switches that stays open was looked for and not found, though with a slow or stalled motor none shows "
    "clearly: a run in which it turns steadily would tell"
)


def open_switch(
    measured: Measured,
    fmus: Path,
    fidelity: Fidelity,
    parameters: Mapping[str, float],
    prior: Prior,
    left: float,
) -> int:
    """The number of the switch that stays open, 0 for none: that with which the healthy actuator leaves least, if that is
    clearly less than any other leaves, and than `left`, the rest of the best explanation without."""
    rests = {}
    for number in range(1, int(ports.VARIABLES[ports.INDEX[PORT]].maximum or 0) + 1):
        given = {**parameters, PORT: float(number)}
        with Flights(fmus, fidelity, measured, given) as model:
            problem = Problem([Run(model)], prior)
            rests[number] = worst(problem, problem.solve(problem.start, problem.unknowns.mask(), most=FEW).u)
    best, second = sorted(rests, key=lambda number: rests[number])[:2]
    return best if rests[best] < min(CLEARLY * left, CLEARLY * rests[second], MOST) else 0

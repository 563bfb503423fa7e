"""Differential evolution on a case of the identification bench, as the literature on this actuator uses it.

It has the model and the sum of squares with which the least squares of `harness.identification` begin: no nuisances.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from harness.bench.cases import Case, measure
from harness.fidelity import FIDELITIES
from harness.identification.diagnosis import identify
from harness.inference import coordinates
from harness.inference.flights import Flights
from harness.inference.prior import Prior
from harness.inference.problem import Problem
from harness.inference.run import Run
from harness.inference.starts import COMMON

POPULATION, GENERATIONS = 15, 160
"""SciPy's default population for each coordinate, and the generations after which it is given up."""


@dataclass(frozen=True)
class Evolved:
    """Differential evolution on a case, until its sum of squares was within half a percent of that of the least squares.

    `evaluations` until then; `reached` is False if it was given up before. `least_squares`: evaluations of the least
    squares. `error` and `least_squares_error`: of each, the largest |estimate - truth| of any coordinate, in spans.
    """

    case: int
    trial: str
    evaluations: int
    reached: bool
    error: float
    least_squares: int
    least_squares_error: float


def evolve(case: Case, fmus: Path, rate: float, parameters: Mapping[str, float]) -> Evolved:
    """Differential evolution of ELF+ over the common faults within their studied ranges, until it is as good as the least
    squares; `parameters`: the actuator's."""
    run = measure(case, fmus, rate, parameters)
    diagnosis = identify(run, fmus=fmus, fidelity=FIDELITIES["ELF+"], parameters=parameters)
    found = coordinates.from_values({item.fault: item.value for item in diagnosis.estimates})
    with Flights(fmus, FIDELITIES["ELF+"], run, parameters) as model:
        problem = Problem([Run(model)], Prior())

        def cost(common: np.ndarray) -> float:
            u = problem.start.copy()
            u[COMMON] = common
            return problem.cost(u)

        goal = 1.005 * cost(found[COMMON])
        model.count = 0
        reached: list[tuple[int, np.ndarray]] = []

        def counted(common: np.ndarray) -> float:
            value = cost(common)
            if value <= goal and not reached:
                reached.append((model.count, common.copy()))
            return value

        last = differential_evolution(
            counted,
            list(zip(*coordinates.scaled(coordinates.STUDIED)[:, COMMON], strict=True)),
            popsize=POPULATION,
            maxiter=GENERATIONS,
            polish=False,
            rng=case.seed,
            callback=lambda *_, **__: bool(reached),
        )
        evaluations, best = reached[0] if reached else (model.count, last.x)
    truth = coordinates.from_values(case.truth)[COMMON]
    error, least_squares_error = (float(np.max(np.abs(z - truth))) for z in (best, found[COMMON]))
    return Evolved(
        case=case.number,
        trial=case.trial,
        evaluations=evaluations,
        reached=bool(reached),
        error=error,
        least_squares=diagnosis.evaluations,
        least_squares_error=least_squares_error,
    )

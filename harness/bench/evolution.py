"""Differential evolution on a case of the identification bench, as the literature on this actuator uses it.

It has the same model, coordinates and sum of squares as the least squares of `harness.identification`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from harness.bench.cases import Case, measure
from harness.fidelity import FIDELITIES
from harness.inference import coordinates
from harness.identification.diagnosis import identify
from harness.inference.flights import Model
from harness.identification.search import Problem

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
    """Differential evolution of ELF+ within the studied ranges, until it is as good as the least squares; `parameters`: the
    actuator's."""
    run = measure(case, fmus, rate, parameters)
    diagnosis = identify(run, fmus=fmus, fidelity=FIDELITIES["ELF+"], parameters=parameters)
    with Model(fmus, FIDELITIES["ELF+"], run, parameters) as model:
        problem = Problem(model, run)
        goal = 1.005 * problem.cost(diagnosis.fit.z)
        model.evaluations = 0
        reached: list[tuple[int, np.ndarray]] = []

        def counted(z: np.ndarray) -> float:
            value = problem.cost(z)
            if value <= goal and not reached:
                reached.append((model.evaluations, z.copy()))
            return value

        last = differential_evolution(
            counted,
            list(zip(*coordinates.scaled(coordinates.STUDIED), strict=True)),
            popsize=POPULATION,
            maxiter=GENERATIONS,
            polish=False,
            rng=case.seed,
            callback=lambda *_, **__: bool(reached),
        )
        evaluations, best = reached[0] if reached else (model.evaluations, last.x)
    truth = coordinates.from_values(case.truth)
    error, least_squares_error = (float(np.max(np.abs(z - truth))) for z in (best, diagnosis.fit.z))
    return Evolved(
        case=case.number,
        trial=case.trial,
        evaluations=evaluations,
        reached=bool(reached),
        error=error,
        least_squares=diagnosis.evaluations,
        least_squares_error=least_squares_error,
    )

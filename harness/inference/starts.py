"""Other places from which a search may start: what a screen of the whole fault space likes best."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from harness.faults import FAULTS, KINDS
from harness.inference import coordinates
from harness.inference.problem import Problem
from harness.inference.unknowns import N_FAULTS

Array = NDArray[np.float64]

SCREEN_POINTS, MOST_STARTS = 64, 4
"""Sobol points of the global screen, and the most of its points from which a search starts."""
ALONE = 0.5
"""How far from healthy each coordinate is tried alone, in spans."""
SEED = 20230612
COMMON = [place for name, fault in FAULTS.items() if not fault.rare for place in coordinates.PLACES[name]]
"""Coordinates of the faults that the screen tries together."""


def starts(problem: Problem, best: Array) -> list[Array]:
    """The best places of: each coordinate alone, to both sides; a Sobol set of the common faults together; and the faults of
    `best` moved to the other parts of their kind. All else is as in `best`."""
    own = problem.unknowns
    alone = [ALONE * sign * row for row in np.eye(N_FAULTS) for sign in (1.0, -1.0)]
    low, high = np.round(coordinates.scaled(coordinates.STUDIED), 12)
    together = np.zeros((SCREEN_POINTS, N_FAULTS))
    sobol = qmc.Sobol(len(COMMON), rng=SEED).random(SCREEN_POINTS)
    together[:, COMMON] = qmc.scale(sobol, low[COMMON], high[COMMON])
    points = [np.r_[np.clip(z, own.low[:N_FAULTS], own.high[:N_FAULTS]), best[N_FAULTS:]] for z in (*alone, *together)]
    points += _turned(best)
    costs = problem.costs(points)
    order = np.argsort(costs, kind="stable")
    return [points[place] for place in order[:MOST_STARTS] if np.isfinite(costs[place])]


def _turned(best: Array) -> list[Array]:
    """`best` with the faults of each kind moved to the kind's other parts."""
    moved = []
    for members in KINDS.values():
        places = [place for fault in members for place in coordinates.PLACES[fault.name]]
        for turn in range(1, len(members)):
            other = best.copy()
            other[places] = np.roll(best[places], turn)
            moved.append(other)
    return moved

"""The curves of a diagnosis: what was measured, what the healthy and the identified model would have logged, what is
left."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from harness.inference.explain import HOPELESS, Explained
from harness.inference.left import Left, left
from harness.inference.unknowns import N_FAULTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curves:
    """Of one run: `predicted` and `healthy`, with the faults found and without any, shape (n_rows, n_channels), in the
    channels' units; and what is `left` of each channel."""

    predicted: Array = field(repr=False)
    healthy: Array = field(repr=False)
    left: Left


def curves_of(explained: Explained, r: int = 0) -> Curves:
    """The curves of run `r` at the best explanation; the healthy ones with its nuisances, or, where it explains next to
    nothing, with none."""
    problem, u = explained.problem, explained.best.fit.u
    run = problem.runs[r]
    predicted = problem.seen(u, r)
    rest = left(run, predicted - run.data, predicted)
    healthy = u.copy()
    healthy[:N_FAULTS] = 0.0
    without = problem.seen(healthy, r)
    if rest.unexplained.max() > HOPELESS:  # the gap was taken elsewhere
        without = run.sensors.seen(problem.curves(problem.start, r), problem.unknowns.nuisances_of(problem.start, r), None)
    return Curves(predicted, without, rest)

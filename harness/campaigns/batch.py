"""What goes to a worker and what comes back: plain data, so that who only hands it on loads no compiled code."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.actuators.actuator import DEFAULT, Output
from harness.campaigns.names import names
from harness.campaigns.plan import Noise
from harness.fidelity import Fidelity
from harness.trials import Trial

Array = NDArray[np.float64]

DIED = "the worker's process ended each time it was flown"


@dataclass(frozen=True)
class Shared:
    """What all cases of a campaign share. `digest`: the campaign's; `fmus`: file name -> SHA-256 and content; `output`: the
    actuator's, in whose units outside everything is kept."""

    digest: str
    trials: tuple[Trial, ...]
    fidelities: tuple[Fidelity, ...]
    fmus: dict[str, tuple[str, bytes]]
    outputs: tuple[str, ...]
    noise: dict[str, Noise]
    every: int
    seed: int
    output: Output = DEFAULT.output

    @property
    def times(self) -> int:
        """Number of times that are kept of a run."""
        return len(self.trials[0].time[:: self.every])


@dataclass(frozen=True)
class Batch:
    """Consecutive cases of the campaign `digest`.

    `cases`: their numbers; `trial`, `fidelity`: of each, its place among the campaign's; `values`, shape (n_cases,
    n_names): the parameters `names` of each.
    """

    digest: str
    cases: tuple[int, ...]
    trial: tuple[int, ...]
    fidelity: tuple[int, ...]
    names: tuple[str, ...]
    values: Array

    def __len__(self) -> int:
        return len(self.cases)

    def alone(self, place: int) -> "Batch":
        """The case at `place`, as a batch of its own."""
        one = slice(place, place + 1)
        return Batch(
            self.digest, self.cases[one], self.trial[one], self.fidelity[one], self.names, np.atleast_2d(self.values[place])
        )


@dataclass(frozen=True)
class Result:
    """What a batch gives.

    `values`, shape (n_cases, n_outputs, n_times); `features`, shape (n_cases, n_features); `failures`: a line for each case,
    empty if it was flown; a failed one's values are NaN. `fmu_seconds`: spent inside the FMUs, all cases.
    """

    values: NDArray[np.float32]
    features: Array
    failures: list[str]
    fmu_seconds: float


def blank(cases: int, outputs: int, times: int, features: int, reason: str = "") -> Result:
    """A result in which nothing is filled in yet; or, with a `reason`, that of cases that cannot be flown."""
    values = np.full((cases, outputs, times), np.nan, dtype=np.float32)
    return Result(values, np.full((cases, features), np.nan), [reason] * cases, 0.0)


def died(part: Batch, shared: Shared) -> Result:
    """The result of a part that no worker has survived."""
    return blank(len(part), len(shared.outputs), shared.times, len(names(shared.outputs)), DIED)

"""What a campaign flies: the plan, and the table of its cases, which follows from the plan alone."""

import hashlib
import itertools
import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from harness.actuators.actuator import DEFAULT, Actuator
from harness.fidelity import Fidelity
from harness.trials import Trial

SAMPLINGS = {"lhs": "LatinHypercube", "sobol": "Sobol"}
"""Names, and the classes of `scipy.stats.qmc` that draw them."""
OUTPUTS = ("position", "motor_speed", "equivalent_current_filtered")
RATE = 500.0
MOST_TOGETHER = 64
"""Cases in a chunk of the dataset, at most."""
TOGETHER = 160.0
"""Simulated seconds in a chunk of the dataset, at most, if that is more than one case: what a kill can cost."""


@dataclass(frozen=True)
class Noise:
    """White noise on an output: its standard deviation, in the output's unit or, if `relative`, as a fraction of the range
    of the output in a run."""

    sigma: float
    relative: bool


@dataclass(frozen=True)
class Table:
    """The cases: `values` of the parameters `names`, shape (n_cases, n_names), and the places of each case's trial and
    fidelity in the plan, shape (n_cases,)."""

    names: tuple[str, ...]
    values: NDArray[np.float64]
    trial: NDArray[np.intp]
    fidelity: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True)
class Plan:
    """A campaign: each trial is flown with each fidelity, at each point of the grid and each sample (or row of a file).

    `ranges`: parameter -> low, high of the samples; `grid`: parameter -> values, of which all combinations are flown;
    `listed`: parameter -> values, the columns of a file of cases; `fixed`: parameter -> value in all cases; `noise` by
    output, in its unit outside; `rate` [Hz] of what is kept. `actuator`: the one that is flown, whose parameters are among
    those that are fixed, sampled or listed.
    """

    trials: tuple[Trial, ...]
    fidelities: tuple[Fidelity, ...]
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    grid: dict[str, tuple[float, ...]] = field(default_factory=dict)
    listed: dict[str, tuple[float, ...]] = field(default_factory=dict)
    fixed: dict[str, float] = field(default_factory=dict)
    noise: dict[str, Noise] = field(default_factory=dict)
    outputs: tuple[str, ...] = OUTPUTS
    samples: int = 1
    sampling: str = "lhs"
    seed: int = 0
    rate: float = RATE
    actuator: Actuator = DEFAULT

    @property
    def every(self) -> int:
        """Number of communication steps from one time that is kept to the next."""
        return round(1.0 / (self.rate * self.trials[0].step))

    @property
    def time(self) -> NDArray[np.float64]:
        """Times that are kept [s], shape (n_times,)."""
        return self.trials[0].time[:: self.every]

    @property
    def chunk(self) -> int:
        """Cases in a chunk of the dataset; the plan alone decides, so that the bytes are the same on every machine."""
        duration = float(self.trials[0].time[-1] - self.trials[0].time[0])
        return max(1, min(MOST_TOGETHER, int(TOGETHER / max(duration, 1e-9))))

    def table(self) -> Table:
        """All cases, by fidelity, then by trial; the same table for the same plan on every machine."""
        blocks = [self._samples()] if not self.listed else [np.array(list(self.listed.values())).T]
        names = [*(self.listed or self.ranges), *self.grid, *self.fixed]
        fixed = list(self.fixed.values())
        rows = [
            np.hstack([block, np.tile([*point, *fixed], (len(block), 1))])
            for block in blocks
            for point in itertools.product(*self.grid.values())
        ]
        values = np.vstack(rows)
        runs = len(self.trials) * len(self.fidelities)
        which = np.repeat(np.arange(runs), len(values))
        return Table(tuple(names), np.tile(values, (runs, 1)), which % len(self.trials), which // len(self.trials))

    def _samples(self) -> NDArray[np.float64]:
        """Points of the ranges, shape (samples, n_ranges)."""
        if not self.ranges:
            return np.empty((self.samples, 0))
        from scipy.stats import qmc  # a second to load, and needed for ranges only

        draw = getattr(qmc, SAMPLINGS[self.sampling])
        with np.errstate(all="ignore"):
            points = draw(len(self.ranges), rng=np.random.default_rng(self.seed)).random(self.samples)
        low, high = np.array(list(self.ranges.values())).T
        return low + np.asarray(points) * (high - low)

    def digest(self, fmus: Mapping[str, str]) -> str:
        """SHA-256 of all that determines the data: cases, inputs of the trials, noise, what is kept, and the hashes `fmus`
        of the FMUs by file name."""
        table = self.table()
        described = json.dumps([
            table.names, [(f.name, f.parameters, fmus[f.fmu]) for f in self.fidelities],
            [(t.name, t.start, t.step, sorted(t.continuous)) for t in self.trials],
            [(name, noise.sigma, noise.relative) for name, noise in self.noise.items()],
            self.outputs, self.every, self.seed,
            *([self.actuator.output.lead] if self.actuator.output.lead is not None else []),
            *([{"chunk": self.chunk}] if self.chunk != MOST_TOGETHER else []),
        ])  # fmt: skip
        whole = hashlib.sha256(described.encode())
        for trial in self.trials:
            for name, series in trial.inputs.items():
                whole.update(name.encode() + np.ascontiguousarray(series).tobytes())
        for part in (table.values, table.trial.astype("<i8"), table.fidelity.astype("<i8")):
            whole.update(np.ascontiguousarray(part).tobytes())
        return whole.hexdigest()

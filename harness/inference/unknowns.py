"""The unknowns of one inference, side by side: faults, parameters of the actuator, nuisances and loads of each run.

All are scaled: faults count spans from healthy, the others standard deviations from what was known before.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.faults import FAULTS
from harness.inference import coordinates
from harness.inference.prior import Prior
from harness.inference.run import Run
from harness.inference.sensors import GAP, NUISANCES
from harness.logs.shown import value_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

Load = Literal["none", "constant", "varying"]
"""What an unknown load may be. None and a small one differ by a jump, for a load holds the shaft at one flank of its
play."""
FAULT_SIGMA = 3.0
"""Standard deviation, in spans, of a pull towards healthy: it decides only what the data leave open."""
MOST = 8.0
"""Bounds of a parameter or a load, in standard deviations."""
FAULT_STEP, STEP, MOST_STEP = 0.01, 0.2, 0.02
"""Steps of the finite differences: of faults in spans, of the others in standard deviations, and of a parameter at most so
much of its value. Wide enough for the kinks of stiction, narrow enough for the curvature."""
LEAST_SCALE = 1e-3
"""Value of a scale below which it is taken for this, where a slope is divided by it."""
N_FAULTS = len(coordinates.COORDINATES)


class Unknowns:
    """Places, scales, bounds and prior of the unknowns `u`, shape (size,), of runs of one actuator.

    The prior is normal: `mean` (size,) and `precision` (size, size). `low`, `high` (size,): bounds.
    """

    def __init__(self, runs: Sequence[Run], prior: Prior, *, shares: bool = True) -> None:
        """`shares`: whether the share of the judge's gap is unknown; else it is all."""
        self.prior, self.runs = prior, runs
        n = len(prior.names)
        self.faults, self.parameters = slice(0, N_FAULTS), slice(N_FAULTS, N_FAULTS + n)
        self.nuisances: list[slice] = []
        self.loads: list[slice] = []
        end = N_FAULTS + n
        for run in runs:
            middle = end + run.sensors.count * len(NUISANCES)
            self.nuisances.append(slice(end, middle))
            end = middle + run.loads.shape[1]
            self.loads.append(slice(middle, end))
        self.size = end
        self.scales = np.where(prior.sigmas > 0.0, prior.sigmas, 1.0) if n else np.empty(0)
        self.mean, self.precision = np.zeros(end), np.eye(end)
        self.precision[self.faults, self.faults] /= FAULT_SIGMA**2
        if n:
            self.precision[self.parameters, self.parameters] = np.linalg.inv(
                prior.covariance / np.outer(self.scales, self.scales)
            )
        pairs = value_of("motor.p", runs[0].model.parameters)
        self.low, self.high = np.full(end, -MOST), np.full(end, MOST)
        self.low[self.faults], self.high[self.faults] = coordinates.bounds(pairs)
        self._bound_parameters()
        self._sigmas = [run.sensors.sigmas() for run in runs]
        for run, place, sigma in zip(runs, self.nuisances, self._sigmas, strict=True):
            low, high = run.sensors.bounds()
            self.low[place], self.high[place] = (low / sigma).ravel(), (high / sigma).ravel()
            self.mean[place][GAP :: len(NUISANCES)] = 1.0 / sigma[0, GAP]  # the judge is the better guess
        self.shares = shares

    def _bound_parameters(self) -> None:
        for place, name in enumerate(self.prior.names):
            port = ports.VARIABLES[ports.INDEX[name]]
            value, scale = float(self.prior.values[place]), float(self.scales[place])
            least = -math.inf if port.minimum is None else port.minimum
            if port.minimum is not None and value > 0.0:  # a positive quantity stays one
                least = max(least, 0.05 * value)
            most = math.inf if port.maximum is None else port.maximum
            at = N_FAULTS + place
            self.low[at] = max(self.low[at], (least - value) / scale)
            self.high[at] = min(self.high[at], (most - value) / scale)

    def parameters_of(self, u: Array) -> dict[str, float]:
        """Port name -> value of the faults and the parameters of a flight."""
        z = np.clip(u[self.faults], self.low[self.faults], self.high[self.faults])
        values = self.prior.values + self.scales * u[self.parameters]
        return dict(zip(self.prior.names, values.tolist(), strict=True)) | coordinates.to_parameters(z)

    def nuisances_of(self, u: Array, r: int) -> Array:
        """Those of run `r` in their units, shape (n_channels, len(NUISANCES))."""
        return u[self.nuisances[r]].reshape(self._sigmas[r].shape) * self._sigmas[r]

    def nuisance_scales(self, r: int) -> Array:
        """What a scaled nuisance of run `r` is multiplied with, shape (n_channels, len(NUISANCES))."""
        return self._sigmas[r]

    def step(self, at: int) -> float:
        """Step of a finite difference by the unknown `at`."""
        if at < N_FAULTS:
            return FAULT_STEP
        if at >= self.parameters.stop:
            return STEP
        place = at - N_FAULTS
        value = abs(float(self.prior.values[place]))
        return min(STEP, MOST_STEP * value / float(self.scales[place])) if value else STEP

    def mask(self, faults: Sequence[str] = (), load: Load = "none") -> Mask:
        """Which unknowns are free: parameters and nuisances always, the `faults` named, and a `load`."""
        free = np.ones(self.size, dtype=bool)
        free[self.faults] = False
        for name in faults:
            free[coordinates.PLACES[name]] = True
        for run, nuisances, place in zip(self.runs, self.nuisances, self.loads, strict=True):
            free[nuisances][GAP :: len(NUISANCES)] = self.shares and run.gap is not None
            free[place.start : place.stop] = load == "varying"
            if place.stop > place.start:
                free[place.start] = load != "none"
        return free

    def in_flight(self, at: int) -> bool:
        """Whether the unknown `at` acts on the flight, and not only on what the sensors make of it."""
        return at < self.parameters.stop or any(load.start <= at < load.stop for load in self.loads)

    def products(self, u: Array) -> dict[int, list[tuple[int, float]]]:
        """Columns of the Jacobian that others give exactly, at `u`: place -> [(other place, factor)].

        The models know only the product of a scale's fault and the parameters it scales, such as friction * T_coulomb. By
        differences of a rough model they would look as if a run could tell them apart.
        """
        shared: dict[int, list[tuple[int, float]]] = {}
        for name, fault in FAULTS.items():
            scaled = [port for port in fault.scales if not port.startswith("controller.")]
            if not scaled or any(port not in self.prior.names for port in scaled):
                continue
            (place,) = coordinates.PLACES[name]
            value = float(coordinates.unscaled(u[self.faults])[place])
            others = []
            for port in scaled:
                at = self.prior.names.index(port)
                here = float(self.prior.values[at] + self.scales[at] * u[N_FAULTS + at])
                others.append((N_FAULTS + at, fault.span * here / (float(self.scales[at]) * max(value, LEAST_SCALE))))
            if len(others) == 1:
                shared[others[0][0]] = [(place, 1.0 / others[0][1])]
            else:
                shared[place] = others
        return shared

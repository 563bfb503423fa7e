"""A measured run as the inference sees it: flights, sensors, noise, an unknown load, and the judge's gap to the model."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from harness.inference import noise
from harness.inference.flights import Flights, Setting
from harness.inference.measured import Measured
from harness.inference.noise import Noise
from harness.inference.sensors import Sensors
from harness.logs.noise import noise_of
from harness.logs.shown import value_of
from harness.logs.spikes import spikes

Array = NDArray[np.float64]

LOAD_SHARE = 0.015
"""Standard deviation of an unknown load, as a part of what the current limit holds at the user's side (ours): 2 N.m for the
default actuator."""
KNOT, MOST_KNOTS = 0.125, 40
"""Distance [s] of the knots of an unknown load, a cubic spline: it follows 2 Hz within 1 %; and the most of them."""
BLOCK, BLOCK_ROWS = 0.05, 3.0
"""Length [s] of the blocks whose scores are taken as independent, and its least rows."""
NOISE_FLOOR, CURRENT_FLOOR = 5e-4, 3e-3
"""Least noise of a channel, in its ranges: no model is better (ours), and of a current, whose ripple is chance, none is
better than what counts as explained."""
FIRST_NOISE = 1e-3
"""Least noise of a channel, in its ranges, before any is learnt: no model is better."""


@dataclass
class Run:
    """A measured run with the `model` that is searched for it and the `judge`, a better model, which is flown now and then.

    `weight` (n_rows, n_channels): 0 in rows that say nothing, 1 in others, less in rows that a robust loss holds back.
    `noises`: of each channel. `gap` (n_rows, n_channels): the judge's difference from the model where it was last
    compared, and `flights` (n_flights, n_rows, n_channels) the same of each of its flights; `scatter`, same shape:
    variance of the chance in the judge's flights, as white noise that says as little. It lowers the weight of rows in
    which one right model differs from another."""

    model: Flights
    judge: Flights | None = None
    order: int = 1
    noises: list[Noise] = field(init=False)
    weight: Array = field(init=False)
    gap: Array | None = field(init=False, default=None)
    flights: Array | None = field(init=False, default=None)
    scatter: Array | float = field(init=False, default=0.0)
    loads: Array = field(init=False)

    def __post_init__(self) -> None:
        run = self.measured
        self.data = run.values
        self.spans = self.sensors.spans
        self.kept = run.weighed & ~np.column_stack([spikes(series) for series in self.data.T])
        self.weight = self.kept.astype(float)
        white = np.array([noise_of(self.data[:, k]) for k in range(self.sensors.count)])
        least = np.maximum(np.maximum(white, run.quanta), FIRST_NOISE * self.spans)
        self.white_noises = [Noise(float(sigma)) for sigma in least]
        self.noises = list(self.white_noises)
        self.loads = self._loads()

    @property
    def measured(self) -> Measured:
        """The run as it was measured."""
        return self.model.measured

    @property
    def sensors(self) -> Sensors:
        """Its sensors, with the order of their low-pass as it was found."""
        return Sensors(self.measured, self.order)

    def _loads(self) -> Array:
        """Curves on the trial's grid of which an unknown load is a sum [N.m], shape (n_points, n_loads): a constant, then
        cubic B-splines; each of the size of the load's standard deviation. None where a load was logged."""
        run, given = self.measured, self.model.parameters
        if "load_torque" in run.trial.inputs:
            return np.empty((len(run.trial.time), 0))
        sigma = usual_load(given) * value_of("gear.eta_opposing", given)
        time = run.trial.time - run.trial.start
        pieces = int(np.clip(np.ceil(time[-1] / KNOT), 2, MOST_KNOTS))
        inner = np.linspace(0.0, time[-1], pieces + 1)
        knots = np.r_[[inner[0]] * 3, inner, [inner[-1]] * 3]
        splines = BSpline.design_matrix(time, knots, 3).toarray()
        return np.column_stack([np.full(len(time), sigma), sigma * splines])

    @property
    def blocks(self) -> NDArray[np.intp]:
        """The block of BLOCK seconds in which each white residual lies, those of each channel apart, shape
        (n_residuals,)."""
        run = self.measured
        length = max(BLOCK, BLOCK_ROWS * float(np.median(np.diff(run.time))))
        block = ((run.time - run.time[0]) / length).astype(int)
        count = int(block[-1]) + 1
        return np.concatenate([k * count + block[run.weighed[:, k]] for k in range(run.weighed.shape[1])])

    def setting(self, parameters: dict[str, float], load: Array) -> Setting:
        """A flight's setting with the load's coefficients, shape (n_loads,)."""
        return Setting(parameters, self.loads @ load if load.any() else None)

    def white(self, rest: Array) -> Array:
        """Rest (n_rows, n_channels, ...) in the channels' units, made white with deviation one, in the rows that carry
        weight, channel after channel, shape (n_residuals, ...)."""
        rows, weights = [], self._weights()
        for k, own in enumerate(self.noises):
            weight = weights[:, k].reshape(-1, *[1] * (rest.ndim - 2))
            rows.append(own.white(rest[:, k] * weight)[self.measured.weighed[:, k]])
        return np.concatenate(rows)

    def _weights(self) -> Array:
        variances = np.array([own.variance for own in self.noises])
        return np.asarray(self.weight / np.sqrt(1.0 + self.scatter / variances))

    def learn(self, rest: Array) -> None:
        """Outliers and noise from what the model leaves over, shape (n_rows, n_channels)."""
        self.weight = self.kept.astype(float)
        floors = [CURRENT_FLOOR if "current" in name else NOISE_FLOOR for name in self.measured.channels]
        least = np.maximum(self.measured.quanta, floors * self.spans)
        for k in range(len(self.noises)):
            self.weight[noise.outliers(rest[:, k], self.kept[:, k], self.spans[k]), k] = 0.0
            used = self.weight[:, k] > 0.0
            self.noises[k] = noise.learnt(rest[:, k], used, self.spans[k], float(least[k]))


def usual_load(parameters: Mapping[str, float]) -> float:
    """LOAD_SHARE of what the current limit holds at the user's side [N.m] through a gear without losses; `parameters`: those
    set, by port name."""
    torque = 1.5 * value_of("motor.K_e", parameters) * value_of("controller.current_limit", parameters)
    return LOAD_SHARE * torque * value_of("gear.ratio", parameters)

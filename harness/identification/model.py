"""The model that is fitted to a measured run: an FMU that flies what was commanded, with faults."""

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ema_fmu_src import ports
from harness.fidelity import Fidelity
from harness.flight.twin import Twin
from harness.identification import coordinates
from harness.identification.measured import Measured
from harness.parameters import merged

Array = NDArray[np.float64]

RIPPLE = 0.01
"""Window [s] over which the difference of two fidelities is averaged: many periods of the inverter, few of a run."""
FLIGHTS, HAIR = 4, 1e-9
"""Flights of the other fidelity, and by how much their faults differ, in spans."""
LOWEST, HIGHEST = coordinates.scaled(coordinates.LOWEST), coordinates.scaled(coordinates.HIGHEST)
"""Bounds of the search in scaled coordinates."""
MOST_ECCENTRIC = 0.97
"""Of motor.p * fault.zeta, which has to stay below 1: more pole pairs leave less room than the search has."""


class Model:
    """A fidelity's FMU, from the folder `fmus`, that predicts a measured run; a context manager.

    `parameters`: those set for this actuator, by port name. `evaluations` counts the runs of the FMU. HarnessError as from
    Twin.
    """

    def __init__(self, fmus: Path, fidelity: Fidelity, measured: Measured, parameters: Mapping[str, float]) -> None:
        self.evaluations = 0
        self._measured = measured
        self._parameters = merged(fidelity, {**measured.initial, **parameters})
        self._pairs = parameters.get("motor.p", ports.VARIABLES[ports.INDEX["motor.p"]].start)
        self._outputs = [port for port in ports.OUTPUTS if port.name in measured.channels]
        self._columns = [[port.name for port in self._outputs].index(name) for name in measured.channels]
        self._last: tuple[Array, Array] | None = None  # coordinates and what was flown with them
        self._twin = Twin(fmus / fidelity.fmu)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._twin.close()

    def predict(self, z: Array, shifts: Array | None = None) -> Array:
        """The measured channels with the faults `z`, in the channels' units, shape (n_rows, n_channels).

        `z`: scaled coordinates, shape (n_coordinates,); `shifts` [s] of the channels, shape (n_channels,), 0 without.
        """
        flown = self._flown(z)
        return self._measured.observer.rows(flown, np.zeros(flown.shape[1]) if shifts is None else shifts)

    def apart(self, other: "Model", z: Array, shifts: Array) -> Array:
        """How far another fidelity is from this one with the faults `z`, as `predict` has it, in each of FLIGHTS flights of
        the other, shape (FLIGHTS, n_rows, n_channels).

        Smoothed over RIPPLE before rows are taken: in rows HF's ripple would be noise, of which a run shows its own. It is
        chaotic in rounding, so flights whose faults are a hair apart draw it anew: their mean hangs on no last digit, and
        what they differ by is what a run of one's own leaves to chance. The first has no hair: a model has no distance
        from itself there.
        """
        own = self._flown(z)
        flights = [other._flown(np.clip(z + HAIR * place, LOWEST, HIGHEST)) for place in range(FLIGHTS)]
        width = max(1, round(RIPPLE / self._measured.trial.step))
        smooth = [uniform_filter1d(flight - own, width, axis=0) for flight in flights]
        return np.array([self._measured.observer.rows(each, shifts) for each in smooth])

    def slopes(self, z: Array, shifts: Array) -> Array:
        """Derivative of each channel by its shift, in the channel's unit a second, shape (n_rows, n_channels)."""
        return self._measured.observer.slopes(self._flown(z), shifts)

    def aligned(self, z: Array) -> Array:
        """The shifts [s] at which each channel of the model is nearest to the measured one, shape (n_channels,)."""
        run = self._measured
        return run.observer.aligned(self._flown(z), run.values, run.weighed, run.shift_bounds)

    def _flown(self, z: Array) -> Array:
        """The channels on the trial's grid, shape (n_points, n_channels); the last flight is kept."""
        if self._last is None or not np.array_equal(self._last[0], z):
            self.evaluations += 1
            faults = coordinates.to_parameters(z)
            faults["fault.zeta"] = min(faults["fault.zeta"], MOST_ECCENTRIC / self._pairs)
            values, _ = self._twin.record(self._measured.trial, self._parameters | faults, self._outputs)
            self._last = z.copy(), np.ascontiguousarray(values[:, self._columns])
        return self._last[1]

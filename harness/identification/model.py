"""The model that is fitted to a measured run: an FMU that flies what was commanded, with faults."""

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.fidelity import Fidelity
from harness.flight.twin import Twin
from harness.identification import coordinates
from harness.identification.measured import Measured
from harness.parameters import merged

Array = NDArray[np.float64]

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
        trial = measured.trial
        places = (measured.time - trial.start) / trial.step
        whole = np.rint(places).astype(int)
        on_grid = np.allclose(places, whole, atol=1e-3) and whole[-1] < len(trial.time)
        self._rows = whole if on_grid else None  # None: the measured times lie between the communication points
        self._twin = Twin(fmus / fidelity.fmu)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._twin.close()

    def predict(self, z: Array) -> Array:
        """The measured channels with the faults `z`, in the channels' units, shape (n_rows, n_channels).

        `z`: scaled coordinates, shape (n_coordinates,).
        """
        self.evaluations += 1
        trial = self._measured.trial
        faults = coordinates.to_parameters(z)
        faults["fault.zeta"] = min(faults["fault.zeta"], MOST_ECCENTRIC / self._pairs)
        values, _ = self._twin.record(trial, self._parameters | faults, self._outputs)
        if self._rows is not None:
            return np.ascontiguousarray(values[self._rows][:, self._columns])
        return np.column_stack([np.interp(self._measured.time, trial.time, values[:, column]) for column in self._columns])

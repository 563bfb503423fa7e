"""The monitor model: an FMU that flies what was measured, with faults."""

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.fidelity import Fidelity
from harness.flight.twin import Twin
from harness.identification import faults
from harness.identification.measured import Measured

Array = NDArray[np.float64]


class Monitor:
    """A fidelity's FMU, flown along a measured run; a context manager. `evaluations` counts the runs."""

    def __init__(self, folder: Path, fidelity: Fidelity, measured: Measured, parameters: Mapping[str, float]) -> None:
        self.fidelity = fidelity
        self.evaluations = 0
        self._measured = measured
        self._parameters = {**measured.initial, **parameters, **fidelity.parameters}
        self._outputs = [port for port in ports.OUTPUTS if port.name in measured.channels]
        self._columns = [[port.name for port in self._outputs].index(name) for name in measured.channels]
        trial = measured.trial
        places = (measured.time - trial.start) / trial.step
        whole = np.rint(places).astype(int)
        self._rows = whole if np.allclose(places, whole, atol=1e-3) and whole[-1] < len(trial.time) else None
        self._twin = Twin(folder / fidelity.fmu)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._twin.close()

    def predict(self, z: Array) -> Array:
        """The measured channels as this model has them with the faults `z` (scaled), shape (n, n_channels)."""
        self.evaluations += 1
        trial = self._measured.trial
        values, _ = self._twin.record(trial, self._parameters | faults.to_parameters(z), self._outputs)
        if self._rows is not None:
            return np.ascontiguousarray(values[self._rows][:, self._columns])
        return np.column_stack([np.interp(self._measured.time, trial.time, values[:, column]) for column in self._columns])

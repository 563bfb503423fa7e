"""The flights of a measured run: an FMU that flies what was commanded, with other faults, parameters and loads each time."""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.fidelity import Fidelity
from harness.flight.twin import Twin
from harness.inference.measured import Measured
from harness.parameters import merged

Array = NDArray[np.float64]

KEPT = 4
"""Flights that are kept: those of the places from which a search goes on."""


@dataclass(frozen=True)
class Setting:
    """What a flight is set to beside the run's own parameters: `parameters` by port name, and a `load` [N.m] on the trial's
    grid, shape (n_points,), that is added to the trial's; None for none."""

    parameters: Mapping[str, float] = field(default_factory=dict)
    load: Array | None = None

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for settings that fly alike."""
        return (*sorted(self.parameters.items()), None if self.load is None else self.load.tobytes())


class Flights:
    """A fidelity's FMU, from the folder `fmus`, that flies a measured run on all cores; a context manager.

    `parameters`: those set for this actuator, by port name. `count`: the flights so far. HarnessError as from Twin.
    """

    def __init__(self, fmus: Path, fidelity: Fidelity, measured: Measured, parameters: Mapping[str, float]) -> None:
        self.count = 0
        self.fidelity, self.measured = fidelity, measured
        self.parameters = {**measured.initial, **parameters}
        self._outputs = [port for port in ports.OUTPUTS if port.name in measured.channels]
        self._columns = [[port.name for port in self._outputs].index(name) for name in measured.channels]
        self._kept: dict[tuple[object, ...], Array] = {}
        self._path = fmus / fidelity.fmu
        self._twins: SimpleQueue[Twin] = SimpleQueue()
        self._twins.put(Twin(self._path))
        self._open = 1
        self._threads = ThreadPoolExecutor(workers())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._threads.shutdown(cancel_futures=True)
        for _ in range(self._open):
            self._twins.get().close()

    def fly(self, setting: Setting) -> Array:
        """The channels on the trial's grid, shape (n_points, n_channels), in the channels' units."""
        return self.fly_all([setting])[0]

    def fly_all(self, settings: Sequence[Setting]) -> list[Array]:
        """The same of several settings, one flight a core at a time; the last few are kept."""
        keys = [setting.key for setting in settings]
        new = {key: setting for key, setting in zip(keys, settings, strict=True) if key not in self._kept}
        while self._open < min(len(new), workers()):
            self._twins.put(Twin(self._path))
            self._open += 1
        self.count += len(new)
        run = map if len(new) == 1 else self._threads.map
        flown = dict(zip(new, run(self._flown, new.values()), strict=True))
        found = [flown[key] if key in flown else self._kept[key] for key in keys]
        for key in keys[:1]:
            self._kept[key] = found[0]
        while len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        return found

    def _flown(self, setting: Setting) -> Array:
        trial = self.measured.trial
        if setting.load is not None:
            load = trial.inputs.get("load_torque", np.full(setting.load.shape, self.parameters.get("load_torque", 0.0)))
            trial = replace(trial, inputs={**trial.inputs, "load_torque": load + setting.load})
        given = merged(self.fidelity, {**self.parameters, **setting.parameters})
        twin = self._twins.get()
        try:
            values, _ = twin.record(trial, given, self._outputs)
        except HarnessError:
            if not setting.parameters and setting.load is None:
                raise
            return np.full((len(trial.time), len(self._columns)), np.nan)  # a place where the model cannot fly is no minimum
        finally:
            self._twins.put(twin)
        return np.ascontiguousarray(values[:, self._columns])


def workers() -> int:
    """Flights at a time: one a core, or one where the processes of a pool share the cores already."""
    return 1 if os.environ.get("OPENBLAS_NUM_THREADS") == "1" else os.cpu_count() or 1

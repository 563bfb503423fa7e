"""A twin: an open FMU with our ports, which flies trials."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.flight import fmufile, master
from harness.flight.component import Component
from harness.trials import Trial

HELD = ("load_torque", "supply_voltage")
"""Inputs that may stand among the parameters of a run: held where the trial gives none."""


class Interrupted(KeyboardInterrupt):
    """A run was stopped from the keyboard; `partial` holds what was computed until then, `done` the runs before it."""

    def __init__(self, partial: xr.Dataset) -> None:
        super().__init__()
        self.partial = partial
        self.done: dict[tuple[str, str], xr.Dataset] = {}


class Twin(Component):
    """An FMU with the ports of the twins; a context manager.

    HarnessError if the FMU cannot be opened, or if it refuses a value or a step (with the FMU's own message).
    """

    def __init__(self, path: Path) -> None:
        fmufile.require_ports(path, fmufile.describe(path))
        super().__init__(path)

    def run(
        self,
        trial: Trial,
        parameters: Mapping[str, float] | None = None,
        *,
        on_progress: Callable[[int], None] | None = None,
    ) -> xr.Dataset:
        """Fly `trial` with `parameters` (name -> value in the port's unit); every output over dimension time [s].

        The inputs load_torque and supply_voltage may stand among the parameters: held where the trial gives none.
        The dataset's variables carry units and long_name; its attributes the trial, the parameters, the FMU's hash,
        wall_s (of the communication loop) and simulated_s. The command is there too.
        """
        given = dict(parameters or {})
        outputs = sorted(ports.OUTPUTS, key=lambda port: port.kind == "Boolean")
        try:
            values, wall = self.record(trial, given, outputs, on_progress=on_progress)
        except master.Stopped as stop:
            raise Interrupted(self._dataset(trial, given, stop.outputs, 0.0, outputs)) from None
        return self._dataset(trial, given, values, wall, outputs)

    def record(
        self,
        trial: Trial,
        parameters: Mapping[str, float],
        outputs: Sequence[ports.Variable],
        *,
        on_progress: Callable[[int], None] | None = None,
        into: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.float64], float]:
        """As `run`, but only some outputs (Reals first, then Booleans), as they come from the master, and the wall time [s].

        The outputs have the shape (n_steps + 1, len(outputs)); they are written into `into`, if it is given. For many runs:
        it costs what the master costs.
        """
        inputs = _held(trial, parameters) | trial.inputs
        fixed = {name: value for name, value in parameters.items() if name not in HELD}
        reals = [port for port in outputs if port.kind == "Real"]
        slave = self.begin(fixed, {name: float(series[0]) for name, series in inputs.items()}, start=trial.start)
        try:
            return master.run(
                slave,
                start=trial.start,
                step=trial.step,
                stimuli=self._stimuli(trial, inputs),
                wanted=master.References(
                    real=self._references(reals), boolean=self._references([port for port in outputs if port.kind != "Real"])
                ),
                on_progress=on_progress,
                into=into,
            )
        except (FMICallException, master.StepFailed) as error:
            raise HarnessError(f"{self.path.name}, trial {trial.name}: {self.told() or error}") from None

    def _references(self, variables: Sequence[ports.Variable]) -> list[int]:
        return [self.variables[variable.name].valueReference for variable in variables]

    def _stimuli(self, trial: Trial, inputs: Mapping[str, Any]) -> master.Stimuli:
        """The table of inputs; those that the trial says are continuous ramp, if the FMU interpolates."""
        references = master.References(real=[self.variables[name].valueReference for name in inputs])
        interpolates = self.description.coSimulation.canInterpolateInputs
        ramps = [column for column, name in enumerate(inputs) if interpolates and name in trial.continuous]
        return master.Stimuli(references, np.column_stack(list(inputs.values())), ramps)

    def _dataset(
        self,
        trial: Trial,
        parameters: Mapping[str, float],
        values: NDArray[np.float64],
        wall: float,
        outputs: Sequence[ports.Variable],
    ) -> xr.Dataset:
        command = trial.inputs["command"][: len(values)]
        data: dict[str, Any] = {"command": ("time", command, {"units": "rad", "long_name": "Commanded position"})}
        for column, port in enumerate(outputs):
            series = values[:, column].astype(bool) if port.kind == "Boolean" else values[:, column]
            data[port.name] = ("time", series, {"units": port.unit, "long_name": port.description})
        times = trial.time[: len(values)]
        return xr.Dataset(
            data,
            coords={"time": ("time", times, {"units": "s"})},
            attrs={
                "trial": trial.name,
                "fmu": self.path.name,
                "fmu_sha256": self.fmu_hash,
                "parameters": dict(parameters),
                "wall_s": wall,
                "simulated_s": float(times[-1] - times[0]),
            },
        )


def _held(trial: Trial, parameters: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
    return {name: np.full(len(trial.time), parameters[name]) for name in HELD if name in parameters}

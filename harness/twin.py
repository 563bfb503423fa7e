"""A twin: an open FMU with our ports, which flies trials."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from fmpy.fmi1 import FMICallException

from ema_fmu_src import ports
from harness import archive, master
from harness.component import Component
from harness.errors import HarnessError
from harness.trials import Trial


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
        archive.require_ports(path, archive.describe(path))
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
        held = {name: given[name] for name in ("load_torque", "supply_voltage") if name in given}
        fixed = {name: value for name, value in given.items() if name not in held}
        inputs = {name: np.full(len(trial.time), value) for name, value in held.items()} | trial.inputs
        reals = [port for port in ports.OUTPUTS if port.kind == "Real"]
        booleans = [port for port in ports.OUTPUTS if port.kind == "Boolean"]
        slave = self.begin(fixed, {name: float(series[0]) for name, series in inputs.items()}, start=trial.start)
        try:
            values, wall = master.run(
                slave,
                start=trial.start,
                step=trial.step,
                stimuli=self._stimuli(trial, inputs),
                wanted=master.References(real=self._references(reals), boolean=self._references(booleans)),
                on_progress=on_progress,
            )
        except (FMICallException, master.StepFailed) as error:
            raise HarnessError(f"{self.path.name}, trial {trial.name}: {self.told() or error}") from None
        except master.Stopped as stop:
            raise Interrupted(self._dataset(trial, given, inputs, stop.outputs, 0.0, [*reals, *booleans])) from None
        return self._dataset(trial, given, inputs, values, wall, [*reals, *booleans])

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
        inputs: Mapping[str, Any],
        values: Any,
        wall: float,
        outputs: list[ports.Variable],
    ) -> xr.Dataset:
        command = inputs["command"][: len(values)]
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

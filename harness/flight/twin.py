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

CONSTANT_INPUTS = ("load_torque", "supply_voltage")
"""Inputs that may stand among the parameters of a run: constant where the trial gives none."""

COARSEST = 1e-6
"""Part of a communication step to which the times of a trial must be held."""


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
        on_progress: Callable[[int], object] | None = None,
    ) -> xr.Dataset:
        """Fly `trial` with `parameters` (name -> value in the port's unit); every output over dimension time [s].

        The inputs load_torque and supply_voltage may stand among the parameters: constant where the trial gives none.
        The dataset's variables carry units and long_name; the command is there too, and the other inputs where they are
        given. Its attributes are the trial, the parameters, the FMU's hash, wall_s (of the communication loop),
        simulated_s, and stopped. `on_progress(points)` is called now and then; if it answers True, the run stops there, and
        the dataset ends there, with stopped True.
        """
        given = dict(parameters or {})
        outputs = self.recorded()
        recording = self._fly(trial, given, outputs, on_progress=on_progress)
        return self.dataset(self.path.name, self.fmu_hash, trial, given, outputs, recording)

    def record(
        self,
        trial: Trial,
        parameters: Mapping[str, float],
        outputs: Sequence[ports.Variable],
        *,
        on_progress: Callable[[int], object] | None = None,
        into: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.float64], float]:
        """As `run`, but only `outputs` (Reals, then Integers, then Booleans) as they come from the master; wall time [s].

        The array has the shape (n_steps + 1, len(outputs)); it is `into`, if that is given. For many runs: it costs what the
        master costs. KeyboardInterrupt if `on_progress` stops it: who needs many runs can do nothing with a part of one.
        """
        recording = self._fly(trial, parameters, outputs, on_progress=on_progress, into=into)
        if recording.stopped:
            raise KeyboardInterrupt
        return recording.outputs, recording.wall

    def _fly(
        self,
        trial: Trial,
        parameters: Mapping[str, float],
        outputs: Sequence[ports.Variable],
        *,
        on_progress: Callable[[int], object] | None,
        into: NDArray[np.float64] | None = None,
    ) -> master.Recording:
        inputs = _constant_inputs(trial, parameters) | trial.inputs
        fixed = {name: value for name, value in parameters.items() if name not in CONSTANT_INPUTS}
        start, stop = self._span(trial)
        slave = self.begin(fixed, {name: float(series[0]) for name, series in inputs.items()}, start=start, stop=stop)
        try:
            recording = master.run(
                slave,
                start=start,
                step=trial.step,
                stimuli=self._stimuli(trial, inputs),
                wanted=self._value_references(outputs),
                on_progress=on_progress,
                into=into,
            )
        except (FMICallException, master.StepFailed) as error:
            raise HarnessError(f"{self.path.name}, trial {trial.name}: {self.take_messages() or error}") from None
        self.pass_on()
        return recording

    def _span(self, trial: Trial) -> tuple[float, float]:
        """First and last communication point [s] as the FMU is told: from 0 where the trial's own times are too coarse.

        From 1e6 s on, a step of 1e-4 s is no longer held to a millionth by times in double precision: at 1.7e9 s, of a
        calendar, steps come out up to 0.2 % too long or too short.
        """
        lasts = (len(trial.time) - 1) * trial.step
        if np.spacing(abs(trial.start) + lasts) <= COARSEST * trial.step:
            return trial.start, trial.start + lasts
        self.pass_on(
            f"times around {trial.start:.15g} s are held to {np.spacing(abs(trial.start)):.1g} s only: the FMU "
            f"counts its time from 0 s in trial {trial.name}"
        )
        return 0.0, lasts

    def _value_references(self, variables: Sequence[ports.Variable]) -> master.ValueReferences:
        real, integer, boolean = (
            [self.value_reference(variable.name, kind) for variable in variables if variable.kind == kind]
            for kind in ("Real", "Integer", "Boolean")
        )
        return master.ValueReferences(real, integer, boolean)

    def _stimuli(self, trial: Trial, inputs: Mapping[str, Any]) -> master.Stimuli:
        """The table of inputs; those that the trial says are continuous ramp, if the FMU interpolates."""
        columns = master.ValueReferences(real=[self.value_reference(name) for name in inputs])
        interpolates = self.description.coSimulation.canInterpolateInputs
        ramps = [column for column, name in enumerate(inputs) if interpolates and name in trial.continuous]
        return master.Stimuli(columns, np.column_stack(list(inputs.values())), ramps)

    @staticmethod
    def recorded() -> list[ports.Variable]:
        """The outputs that a run has, in the order of the columns that the master gives."""
        return sorted(ports.OUTPUTS, key=lambda port: port.kind == "Boolean")

    @staticmethod
    def dataset(
        fmu: str,
        fmu_hash: str,
        trial: Trial,
        parameters: Mapping[str, float],
        outputs: Sequence[ports.Variable],
        recording: master.Recording,
    ) -> xr.Dataset:
        """What `run` returns, of the FMU by name and SHA-256, from the columns `outputs` of a recording."""
        values = recording.outputs
        inputs = trial.inputs | {n: v for n, v in _constant_inputs(trial, parameters).items() if n not in trial.inputs}
        data: dict[str, Any] = {}
        for port in ports.INPUTS:
            if port.name in inputs:
                attributes = {"units": port.unit, "long_name": port.description}
                data[port.name] = ("time", inputs[port.name][: len(values)], attributes)
        columns = {port.name: column for column, port in enumerate(outputs)}
        for port in sorted(outputs, key=lambda port: ports.INDEX[port.name]):  # columns of files stay where they were
            column = columns[port.name]
            series = values[:, column].astype(bool) if port.kind == "Boolean" else values[:, column]
            data[port.name] = ("time", series, {"units": port.unit, "long_name": port.description})
        times = trial.time[: len(values)]
        return xr.Dataset(
            data,
            coords={"time": ("time", times, {"units": "s"})},
            attrs={
                "trial": trial.name,
                "fmu": fmu,
                "fmu_sha256": fmu_hash,
                "parameters": dict(parameters),
                "wall_s": recording.wall,
                "simulated_s": float(times[-1] - times[0]),
                "stopped": recording.stopped,
            },
        )


def _constant_inputs(trial: Trial, parameters: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
    return {name: np.full(len(trial.time), parameters[name]) for name in CONSTANT_INPUTS if name in parameters}

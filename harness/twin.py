"""An open FMU: one instance, reused by reset."""

import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import fmpy.fmi2
import numpy as np
import xarray as xr
from fmpy import supported_platforms
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

from ema_fmu_src import ports
from harness import archive, master
from harness.errors import HarnessError
from harness.trials import Trial


class Twin:
    """An FMU with the ports of the twins; a context manager.

    HarnessError if the FMU cannot be opened, or if it refuses a value or a step (with the FMU's own message).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.description = archive.describe(path)
        self.fmu_hash = archive.content_hash(path)
        self._variables = {variable.name: variable for variable in self.description.modelVariables}
        self._messages: list[str] = []
        self._folder = Path(tempfile.mkdtemp(prefix="ema_fmu_"))
        self._slave: Any = None
        self._begun = False
        try:
            archive.unpack(path, self._folder)
            if fmpy.platform not in supported_platforms(str(path)):
                raise HarnessError(f"{path}: holds no binary for this platform, {fmpy.platform}")
            self._slave = self._instantiate()
        except BaseException:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise

    def _instantiate(self) -> Any:
        try:
            slave = FMU2Slave(
                guid=self.description.guid,
                unzipDirectory=str(self._folder),
                modelIdentifier=self.description.coSimulation.modelIdentifier,
                instanceName=self.path.stem,
            )
        except Exception as error:  # noqa: BLE001 - FMPy lets through whatever the loader raises
            raise HarnessError(f"{self.path}: its library cannot be loaded: {error}") from None

        def collect(environment: Any, instance: bytes, status: int, category: bytes, message: bytes, *_: Any) -> None:
            if status > 0 and message:
                self._messages.append(message.decode(errors="replace"))

        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(collect)
        callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self._callbacks = callbacks  # the FMU keeps a pointer to them
        try:
            slave.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:  # noqa: BLE001 - FMPy raises plain Exception when the FMU returns no instance
            raise HarnessError(f"{self.path}: cannot be instantiated: {self._told() or error}") from None
        return slave

    def _told(self) -> str:
        """What the FMU has logged since the last call, as one line."""
        text = "; ".join(" ".join(message.split()) for message in dict.fromkeys(self._messages))
        self._messages.clear()
        return text

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and its unpacked files; once is enough, more does no harm."""
        if self._slave is not None:
            slave, self._slave = self._slave, None
            try:
                slave.freeInstance()
            finally:
                shutil.rmtree(self._folder, ignore_errors=True)

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
            raise HarnessError(f"{self.path.name}, trial {trial.name}: {self._told() or error}") from None
        return self._dataset(trial, given, inputs, values, wall, [*reals, *booleans])

    def read(self, name: str) -> float:
        """The value that the Real variable `name` has now."""
        return float(self._slave.getReal([self._variables[name].valueReference])[0])

    def _references(self, variables: Sequence[ports.Variable]) -> list[int]:
        return [self._variables[variable.name].valueReference for variable in variables]

    def _stimuli(self, trial: Trial, inputs: Mapping[str, Any]) -> master.Stimuli:
        """The table of inputs; those that the trial says are continuous ramp, if the FMU interpolates."""
        references = master.References(real=[self._variables[name].valueReference for name in inputs])
        interpolates = self.description.coSimulation.canInterpolateInputs
        ramps = [column for column, name in enumerate(inputs) if interpolates and name in trial.continuous]
        return master.Stimuli(references, np.column_stack(list(inputs.values())), ramps)

    def begin(self, parameters: Mapping[str, float], inputs: Mapping[str, float], *, start: float = 0.0) -> Any:
        """Start anew at the time `start` [s]: FMPy's slave, reset, set and out of initialization mode."""
        if self._slave is None:
            raise HarnessError(f"{self.path}: already closed")
        slave = self._slave
        self._messages.clear()
        if self._begun:
            slave.reset()
        self._begun = True
        try:
            slave.setupExperiment(startTime=start)
            for name, value in parameters.items():
                self._set(name, value)
            slave.enterInitializationMode()
            for name, value in inputs.items():
                self._set(name, value)
            slave.exitInitializationMode()
        except FMICallException as error:
            raise HarnessError(f"{self.path.name}: {self._told() or error}") from None
        if told := self._told():
            raise HarnessError(f"{self.path.name}: {told}")
        return slave

    def _set(self, name: str, value: float) -> None:
        variable = self._variables.get(name)
        if variable is None:
            raise HarnessError(f"{self.path}: has no variable '{name}'")
        reference = [variable.valueReference]
        if variable.type == "Boolean":
            self._slave.setBoolean(reference, [bool(value)])
        elif variable.type == "Integer":
            self._slave.setInteger(reference, [int(value)])
        else:
            self._slave.setReal(reference, [float(value)])

    def _dataset(
        self,
        trial: Trial,
        parameters: Mapping[str, float],
        inputs: Mapping[str, Any],
        values: Any,
        wall: float,
        outputs: list[ports.Variable],
    ) -> xr.Dataset:
        data: dict[str, Any] = {"command": ("time", inputs["command"], {"units": "rad", "long_name": "Commanded position"})}
        for column, port in enumerate(outputs):
            series = values[:, column].astype(bool) if port.kind == "Boolean" else values[:, column]
            data[port.name] = ("time", series, {"units": port.unit, "long_name": port.description})
        times = trial.time
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

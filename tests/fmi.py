"""An instance of an FMU through FMPy's ctypes layer, as an importer drives it."""

from pathlib import Path
from typing import Any

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)

from ema_fmu_src import ports

STEP = 1e-4  # s
OUTPUT_REALS = [ports.INDEX[variable.name] for variable in ports.OUTPUTS if variable.kind == "Real"]
OK, DISCARD, ERROR = 0, 2, 3


class Instance:
    """One instance, with all that it logs."""

    def __init__(self, path: Path, folder: Path) -> None:
        description = read_model_description(str(path))
        self.messages: list[tuple[int, str]] = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(str(path), unzipdir=str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="test",
        )
        self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)

    def _log(self, _environment: Any, _name: bytes, status: int, _category: bytes, message: bytes) -> None:
        self.messages.append((status, message.decode()))

    def start(self, *, start_time: float = 0.0, stop_time: float | None = None, command: float = 0.1) -> None:
        self.fmu.setupExperiment(startTime=start_time, stopTime=stop_time)
        self.fmu.enterInitializationMode()
        self.set("command", command)
        self.fmu.exitInitializationMode()

    def set(self, name: str, value: float) -> None:
        setter = {"Real": self.fmu.setReal, "Boolean": self.fmu.setBoolean}
        setter.get(ports.VARIABLES[ports.INDEX[name]].kind, self.fmu.setInteger)([ports.INDEX[name]], [value])

    def get(self, name: str) -> float:
        getter = {"Real": self.fmu.getReal, "Boolean": self.fmu.getBoolean}
        return getter.get(ports.VARIABLES[ports.INDEX[name]].kind, self.fmu.getInteger)([ports.INDEX[name]])[0]

    def step(self, time: float, size: float = STEP) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def run(self, first: int, last: int) -> list[list[float]]:
        """Outputs after each of the steps first..last-1."""
        rows = []
        for k in range(first, last):
            self.step(k * STEP)
            rows.append(self.fmu.getReal(OUTPUT_REALS))
        return rows

    def close(self) -> None:
        self.fmu.freeInstance()


def refused(status: int, call: Any, *arguments: Any) -> None:
    """Asserts that a call is answered with `status`."""
    with pytest.raises(FMICallException) as caught:
        call(*arguments)
    assert caught.value.status == status

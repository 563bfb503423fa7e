"""An open FMU of any make: one instance, reused by reset."""

import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import fmpy.fmi2
from fmpy import supported_platforms
from fmpy.fmi1 import FMICallException

from harness import scratch
from harness.errors import HarnessError
from harness.flight import fmufile
from harness.flight.calls import FMU2Checked


class Component:
    """An FMI 2.0 co-simulation FMU; a context manager.

    HarnessError if the FMU cannot be opened, or if it refuses a value (with the FMU's own message).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.description = fmufile.describe(path)
        self.fmu_hash = fmufile.content_hash(path)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self._messages: list[str] = []
        self._folder = scratch.make("fmu")
        self._slave: Any = None
        self._begun = False
        try:
            fmufile.unpack(path, self._folder)
            if fmpy.platform not in supported_platforms(str(self._folder)):
                raise HarnessError(f"{path}: holds no binary for this platform, {fmpy.platform}")
            self._slave = self._instantiate()
        except BaseException:
            scratch.remove(self._folder)
            raise

    def _instantiate(self) -> Any:
        try:
            place = os.getcwd()
            try:
                slave = FMU2Checked(
                    guid=self.description.guid,
                    unzipDirectory=str(self._folder),
                    modelIdentifier=self.description.coSimulation.modelIdentifier,
                    instanceName=self.path.stem,
                )
            finally:
                os.chdir(place)  # FMPy stays in the library's folder if it cannot be loaded
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
            raise HarnessError(f"{self.path}: cannot be instantiated: {self.take_messages() or error}") from None
        return slave

    def take_messages(self) -> str:
        """What the FMU has logged since the last call, as one line; the next call does not have it again."""
        text = "; ".join(" ".join(message.split()) for message in dict.fromkeys(self._messages))
        self._messages.clear()
        return text

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and its unpacked files; a second call does nothing."""
        if self._slave is not None:
            slave, self._slave = self._slave, None
            try:
                slave.freeInstance()
            finally:
                scratch.remove(self._folder)

    def value_reference(self, name: str, kind: str = "Real") -> int:
        """Value reference of the variable `name`; HarnessError if there is none, or if its type is not `kind`."""
        variable = self.variables.get(name)
        if variable is None or variable.type != kind:
            raise HarnessError(f"{self.path}: has no {kind} variable '{name}'")
        return int(variable.valueReference)

    def read(self, name: str) -> float:
        """The present value of the Real variable `name`."""
        return float(self._slave.getReal([self.value_reference(name)])[0])

    def begin(self, parameters: Mapping[str, float | str], inputs: Mapping[str, float], *, start: float = 0.0) -> Any:
        """Reset, set `parameters` and `inputs` (name -> value in its unit), initialize at the time `start` [s].

        The value of an Enumeration may also be the name of one of its items.

        Returns FMPy's slave, which has left initialization mode.
        """
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
            raise HarnessError(f"{self.path.name}: {self.take_messages() or error}") from None
        if messages := self.take_messages():
            raise HarnessError(f"{self.path.name}: {messages}")
        return slave

    def _set(self, name: str, value: float | str) -> None:
        variable = self.variables.get(name)
        if variable is None:
            raise HarnessError(f"{self.path}: has no variable '{name}'")
        references = [variable.valueReference]
        if isinstance(value, str):
            value = self._item(variable, value)
        if variable.type == "Boolean":
            self._slave.setBoolean(references, [bool(value)])
        elif variable.type in ("Integer", "Enumeration"):
            self._slave.setInteger(references, [int(value)])
        else:
            self._slave.setReal(references, [float(value)])

    def _item(self, variable: Any, name: str) -> float:
        """The value of the item `name` of an Enumeration; HarnessError if it has none of that name."""
        items = {item.name: item.value for item in variable.declaredType.items or ()} if variable.declaredType else {}
        if name not in items:
            raise HarnessError(f"{self.path}: {variable.name} = '{name}': {', '.join(items) or 'a number'} is needed")
        return float(items[name])

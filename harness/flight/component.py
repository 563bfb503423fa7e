"""An open FMU of any make: a new instance for each run."""

import logging
import math
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import fmpy
from fmpy import supported_platforms
from fmpy.fmi1 import FMICallException

from harness import scratch
from harness.errors import HarnessError
from harness.flight import fmufile
from harness.flight.calls import FMU2Checked
from harness.flight.messages import MOST, Messages
from harness.provenance import file_hash

FUNCTIONS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean", "String": "String"}
"""The kinds of variables, and the kind by whose FMI functions each is set and got (FMI 2.0, section 2.1.7)."""
Value = float | str
"""Of a variable: a number of whatever kind, a text for a String, or the name of an item of an Enumeration."""
remarks = logging.getLogger(__name__)
"""Takes what FMUs warn of; it goes to stderr unless the host of the library sends it elsewhere."""


class Component:
    """An FMI 2.0 co-simulation FMU; a context manager.

    HarnessError if the FMU cannot be opened, or if it refuses a value (with the FMU's own message). Warnings that it logs
    are passed on by `logging`, each once.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.description = fmufile.describe(path)
        self.fmu_hash = file_hash(path)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self._folder = scratch.make("fmu")
        self._messages = Messages(path.stem)
        self._told: set[str] = set()
        self._slave: Any = None
        self._begun = False
        try:
            fmufile.unpack(path, self._folder)
            if fmpy.platform not in supported_platforms(str(self._folder)):
                raise HarnessError(f"{path}: holds no binary for this platform, {fmpy.platform}")
            self._slave = self._load()
            self._instantiate()
        except BaseException:
            self.close()
            raise

    def _load(self) -> Any:
        try:
            place = os.getcwd()
            try:
                return FMU2Checked(
                    guid=self.description.guid,
                    unzipDirectory=str(self._folder),
                    modelIdentifier=self.description.coSimulation.modelIdentifier,
                    instanceName=self.path.stem,
                )
            finally:
                os.chdir(place)  # FMPy stays in the library's folder if it cannot be loaded
        except Exception as error:  # noqa: BLE001 - FMPy lets through whatever the loader raises
            raise HarnessError(f"{self.path}: its library cannot be loaded: {error}") from None

    def _instantiate(self) -> None:
        """A new instance, in the place of the one that is there."""
        self._free()
        try:
            self._slave.instantiate(callbacks=self._messages.callbacks(), loggingOn=True)
        except Exception as error:  # noqa: BLE001 - FMPy raises plain Exception when the FMU returns no instance
            raise HarnessError(f"{self.path}: cannot be instantiated: {self.take_messages() or error}") from None

    def _free(self) -> None:
        if getattr(self._slave, "component", None):
            instance, self._slave.component = self._slave.component, None
            self._slave.fmi2FreeInstance(instance)

    def take_messages(self) -> str:
        """What the FMU has logged since the last call, as one line; the next call does not have it again."""
        return self._messages.take()

    def pass_on(self, text: str = "") -> None:
        """Pass on `text`, else what the FMU has logged though all went well, if it is new."""
        text = text or self.take_messages()
        if text and text not in self._told and len(self._told) < MOST:
            self._told.add(text)
            remarks.warning("%s: %s", self.path.name, text)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and its unpacked files; a second call does nothing."""
        try:
            if self._slave is not None:
                self._free()
                self._slave.freeLibrary()
        finally:
            self._slave = None
            self._messages.close()
            scratch.remove(self._folder)

    def variable(self, name: str) -> Any:
        """FMPy's description of the variable `name`; HarnessError if there is none."""
        if name not in self.variables:
            raise HarnessError(f"{self.path}: has no variable '{name}'")
        return self.variables[name]

    def value_reference(self, name: str, kind: str = "Real") -> int:
        """Value reference of the variable `name`; HarnessError if there is none, or if its type is not `kind`."""
        variable = self.variables.get(name)
        if variable is None or variable.type != kind:
            raise HarnessError(f"{self.path}: has no {kind} variable '{name}'")
        return int(variable.valueReference)

    def read(self, name: str) -> float:
        """The present value of the Real variable `name`; HarnessError as from `value_reference` and `get`."""
        self.value_reference(name)
        return float(self.get(name))

    def get(self, name: str) -> Value:
        """The present value of the variable `name` of whatever kind; HarnessError if the FMU refuses it."""
        variable = self.variable(name)
        try:
            (value,) = getattr(self._slave, f"get{FUNCTIONS[variable.type]}")([variable.valueReference])
        except FMICallException as error:
            raise HarnessError(f"{self.path.name}: {name} cannot be read: {self.take_messages() or error}") from None
        return (value or b"").decode(errors="replace") if variable.type == "String" else value

    def set(self, name: str, value: Value) -> None:
        """Set the variable `name`; HarnessError if the value is not of its kind, or if the FMU refuses it."""
        variable = self.variable(name)
        fitting = self._fitting(variable, value)
        try:
            getattr(self._slave, f"set{FUNCTIONS[variable.type]}")([variable.valueReference], [fitting])
        except FMICallException as error:
            raise HarnessError(f"{self.path.name}: {self.take_messages() or f'{name} = {value} refused: {error}'}") from None

    def begin(
        self, parameters: Mapping[str, Value], inputs: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None
    ) -> Any:
        """A new instance with `parameters` and `inputs` (name -> value in its unit), initialized; times in s.

        Returns FMPy's slave, which has left initialization mode.
        """
        self.enter(parameters, start=start, stop=stop)
        for name, value in inputs.items():
            self.set(name, value)
        return self.leave()

    def enter(self, parameters: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> Any:
        """A new instance, `parameters` set, in initialization mode; FMPy's slave.

        Not the last run's instance reset: whether a reset takes back everything cannot be seen from outside.
        """
        if self._slave is None:
            raise HarnessError(f"{self.path}: already closed")
        self.take_messages()
        if self._begun:
            self._instantiate()
        self._begun = True
        try:
            self._slave.setupExperiment(startTime=start, stopTime=stop)
            for name, value in parameters.items():
                self.set(name, value)
            self._slave.enterInitializationMode()
        except FMICallException as error:
            raise self._refusal(error) from None
        return self._slave

    def leave(self) -> Any:
        """Leave initialization mode; FMPy's slave."""
        try:
            self._slave.exitInitializationMode()
        except FMICallException as error:
            raise self._refusal(error) from None
        self.pass_on()
        return self._slave

    def _refusal(self, error: FMICallException) -> HarnessError:
        return HarnessError(f"{self.path.name}: {self.take_messages() or error}")

    def _fitting(self, variable: Any, value: Value) -> Any:
        """`value` as FMPy's setter of the variable's kind takes it; HarnessError if it is none of that kind."""
        kind, wrong = variable.type, f"{self.path}: {variable.name} = {value!r}"
        if kind == "String":
            if not isinstance(value, str) or "\0" in value or any("\ud800" <= each <= "\udfff" for each in value):
                raise HarnessError(f"{wrong}: a text is needed, in Unicode and without the character 0")
            return value
        if isinstance(value, str):
            value = self._item(variable, value)
        if kind == "Real":
            return float(value)
        if not math.isfinite(value) or int(value) != value or abs(value) >= 2**31:
            raise HarnessError(f"{wrong}: a whole number is needed" if kind != "Boolean" else f"{wrong}: 0 or 1 is needed")
        if kind == "Boolean" and value not in (0, 1):
            raise HarnessError(f"{wrong}: 0 or 1 is needed")
        return int(value)

    def _item(self, variable: Any, name: str) -> float:
        """The value of the item `name` of an Enumeration; HarnessError if it has none of that name."""
        items = {item.name: item.value for item in variable.declaredType.items or ()} if variable.declaredType else {}
        if name not in items:
            raise HarnessError(f"{self.path}: {variable.name} = '{name}': {', '.join(items) or 'a number'} is needed")
        return float(items[name])

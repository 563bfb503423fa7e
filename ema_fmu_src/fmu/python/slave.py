"""The python runtime: a pythonfmu slave around a twin's kernels.

pythonfmu turns every Python exception into fmi2Fatal and drops the instance, which a host must then give up. So nothing
here raises for what a host can do wrong: a value that is refused is logged as an error, the old value stays, and the
next step is discarded (fmi2Discard); a step that is refused is logged and discarded. The instance works on afterwards.
The messages reach the host's logger if it has instantiated the FMU with loggingOn; pythonfmu holds them back otherwise.
"""

import json
import math
import sys
from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability
from pythonfmu._version import __version__ as pythonfmu_version
from pythonfmu.enums import Fmi2Status
from pythonfmu.variables import Boolean, Integer, Real

from ... import ports
from ...twins import CLOCK, STALE, TOLERANCE, TWINS
from .. import description
from ..variant import Variant
from . import checks

KINDS = {"Real": Real, "Integer": Integer, "Boolean": Boolean, "Enumeration": Integer}
"""pythonfmu knows no Enumeration, which FMI 2.0 gets and sets as an Integer; the model description is our own."""
CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": True,
    "canNotUseMemoryManagementFunctions": True,
    "canGetAndSetFMUstate": True,
    "canSerializeFMUstate": True,
}


def _yield_import_path(folder: str | None) -> None:
    """Move the FMU's folder, which pythonfmu puts first on sys.path, to its end: the host's own modules come first."""
    if folder in sys.path:
        sys.path[:] = [entry for entry in sys.path if entry != folder] + [folder]


def _is(kind: str, reference: int) -> bool:
    """Whether there is a variable with this value reference, of the class of pythonfmu's `kind`."""
    return 0 <= reference < len(ports.VARIABLES) and KINDS[ports.VARIABLES[reference].kind] is KINDS[kind]


class Slave(Fmi2Slave):
    """One instance of a twin; `model` is set by the class in the FMU ("HF", "ELF" or "LF")."""

    model: str
    sources: str
    """Content hash of the sources, set by the class in the FMU."""
    actuator: tuple[str, str, dict[str, float], dict[str, str], str] = ("", "", {}, {}, "")
    """The fields of the actuator's Variant, set by the class in the FMU."""
    log_categories = description.CATEGORIES

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        _yield_import_path(self.resources)
        self.modelName = f"EMA_{self.model}"
        self._twin = TWINS[self.model]
        self._variant = Variant(*self.actuator)
        starts = [self._variant.start(variable, self.model) for variable in ports.VARIABLES]
        self._v = np.array(starts, dtype=np.float64)
        self._x = np.zeros(self._twin.n_states, dtype=np.float64)
        self._mode = "instantiated"
        self._fresh = False  # outputs agree with what has been set, while initializing
        self._refused = ""  # why the next step is to be discarded
        self._failed = ""  # why no step is possible any more
        self._start = self._point = 0.0
        self._stop = math.inf
        self._tolerance = description.DEFAULT_TOLERANCE
        for variable in ports.VARIABLES:
            self.register_variable(
                KINDS[variable.kind](
                    variable.name,
                    causality=Fmi2Causality[variable.causality],
                    variability=Fmi2Variability[variable.variability],
                    getter=self._getter(variable.name),
                ),
                nested=False,
            )

    def _getter(self, name: str) -> Any:
        place = ports.INDEX[name]
        return lambda: self._v[place]

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The model description (FMI 2.0, section 2.2)."""
        return description.model_description(
            self.model,
            runtime=f"pythonfmu {pythonfmu_version}",
            source_hash=self.sources,
            capabilities=CAPABILITIES,
            variant=self._variant,
        )

    # --- values -----------------------------------------------------------------------------------------------------

    def _refuse(self, message: str) -> None:
        self.log(message, Fmi2Status.error, "logStatusError")
        self._refused = self._refused or message

    def _set(self, kind: str, references: Sequence[int], values: Sequence[float]) -> None:
        for reference, value in zip(references, values, strict=True):
            if not _is(kind, reference):
                self._refuse(f"value reference {reference} is no {kind} variable of {self.modelName}")
                continue
            variable = ports.VARIABLES[reference]
            problem = checks.value_problem(variable, float(value), self._mode)
            if problem:
                self._refuse(f"{variable.name} = {value} refused: {problem}; it stays {self._v[reference]}")
                continue
            self._v[reference] = value
            self._fresh = False
            if variable.causality == "parameter":
                self._x[STALE] = 1.0

    def _get(self, kind: str, references: Sequence[int]) -> list[float]:
        if self._mode == "initializing" and not self._fresh:
            self._initialize()
        values = []
        for reference in references:
            if not _is(kind, reference):
                self._refuse(f"value reference {reference} is no {kind} variable of {self.modelName}")
                values.append(0.0)
            else:
                values.append(self._v[reference])
        return values

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self._set("Real", vrs, values)

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set("Integer", vrs, values)

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set("Boolean", vrs, values)

    def get_real(self, vrs: list[int]) -> list[float]:
        return [float(value) for value in self._get("Real", vrs)]

    def get_integer(self, vrs: list[int]) -> list[int]:
        return [int(value) for value in self._get("Integer", vrs)]

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return [bool(value) for value in self._get("Boolean", vrs)]

    # --- life -------------------------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float | None = None, tolerance: float | None = None) -> None:
        """Start and stop time [s], relative tolerance; the twin's clock starts at zero with the start time."""
        if not math.isfinite(start_time):
            self._refuse(f"start time {start_time} s refused: a finite number is needed")
            return
        if stop_time is not None and not stop_time >= start_time:
            self._refuse(f"stop time {stop_time} s refused: it is before the start time {start_time} s")
            return
        if tolerance is not None and not 0.0 < tolerance < math.inf:
            self._refuse(f"tolerance {tolerance} refused: a number above 0 is needed")
            return
        self._start = self._point = float(start_time)
        self._stop = math.inf if stop_time is None else float(stop_time)
        self._tolerance = description.DEFAULT_TOLERANCE if tolerance is None else tolerance

    def enter_initialization_mode(self) -> None:
        self._mode = "initializing"

    def exit_initialization_mode(self) -> None:
        self._initialize()
        self._mode = "running"
        if self._failed:
            self.log(f"{self.modelName} cannot start: {self._failed}", Fmi2Status.error, "logStatusError")
        else:  # numba compiles on the first call: here, on copies, rather than in the host's first step
            self._twin.advance(self._v.copy(), self._x.copy(), 0.0)

    def _initialize(self) -> None:
        status = self._twin.initialize(self._v, self._x)
        self._x[TOLERANCE] = self._tolerance
        self._failed = status.message
        self._fresh = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Run from `current_time` over `step_size` [s]; False (fmi2Discard) with a logged reason if that cannot be."""
        problem = self._failed or self._refused or self._step_problem(current_time, step_size)
        self._refused = ""
        if not problem:
            end = current_time + step_size
            status = self._twin.advance(self._v, self._x, end - self._start)
            self._point = end
            self._failed = problem = status.message
        if problem:
            self.log(
                f"step from {current_time} s over {step_size} s discarded: {problem}",
                Fmi2Status.discard,
                "logStatusDiscard",
            )
        return not problem

    def _step_problem(self, time: float, step: float) -> str:
        """Why a step cannot be taken; empty if it can."""
        if self._mode != "running":
            return "the FMU has not been initialized"
        inner = float(self._x[CLOCK["step"]])
        return checks.step_problem(time, step, point=self._point, stop=self._stop, inner=inner)

    # --- state ------------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "twin": [self.model, self.sources],
            "v": self._v.tolist(),
            "x": self._x.tolist(),
            "clock": [self._start, self._point, self._stop, self._tolerance],
            "mode": [self._mode, self._refused, self._failed, self._fresh],
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if state.get("twin") != [self.model, self.sources]:
            self._refuse(f"the FMU state is of {state.get('twin')}, not of {[self.model, self.sources]}; nothing changed")
            return
        problem = checks.state_problem(self._twin, state)
        if problem:
            self._refuse(f"the FMU state is refused: {problem}; nothing changed")
            return
        self._v[:] = state["v"]
        self._x[:] = state["x"]
        self._start, self._point, self._stop, self._tolerance = state["clock"]
        self._mode, self._refused, self._failed, self._fresh = state["mode"]

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        """The state in `state`; an empty one, which `_set_fmu_state` refuses, if the bytes are none of ours."""
        try:
            decoded = json.loads(state.decode("utf-8"))
        except ValueError:
            return {}
        return decoded if isinstance(decoded, dict) else {}

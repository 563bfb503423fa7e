"""An actuator: its parameters, what moves at its output, and how its logs are to be read."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Output:
    """What moves at the user's side: a shaft, or, with a `lead` [m per turn of the user shaft], a rod.

    Inside, everything is in the ports' units. At the border (files, tables, plots) a rod's positions are in m and its
    load in N; what is on the motor's side stays.
    """

    lead: float | None = None

    def unit(self, port: str) -> str:
        """The unit of `port` outside."""
        if self.lead is None:
            return ports.VARIABLES[ports.INDEX[port]].unit
        own = ports.VARIABLES[ports.INDEX[port]].unit
        return {"position": "m", "command": "m", "load_torque": "N"}.get(port, own)

    def scale(self, port: str) -> float:
        """What a value of `port` inside is multiplied with to be one outside."""
        if self.lead is None:
            return 1.0
        travel = self.lead / (2.0 * math.pi)
        return {"position": travel, "command": travel, "load_torque": 1.0 / travel}.get(port, 1.0)

    def outside(self, port: str, values: Array) -> Array:
        """Values of `port`, any shape, in its unit outside."""
        return values * self.scale(port)

    def inside(self, port: str, values: Array) -> Array:
        """Values of `port` given in its unit outside, in the port's own."""
        return values / self.scale(port)


@dataclass(frozen=True)
class Actuator:
    """One actuator.

    `parameters`: port name -> value in the port's unit, for those that are stated or follow from a data sheet; the rest
    are the ports' defaults. The input supply_voltage may be among them: it holds where a trial or a log gives none.
    `tolerances`: port name -> half width of the interval that is stated, in the port's unit. `origins`: port name ->
    where the value comes from. `log`: what `[log]` says, as written. `limits`: short name of a fault -> value at which
    health is 0. `calibration`, `provenance`: tables as written.
    """

    name: str
    description: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    tolerances: Mapping[str, float] = field(default_factory=dict)
    origins: Mapping[str, str] = field(default_factory=dict)
    output: Output = field(default_factory=Output)
    log: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    calibration: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sha256(self) -> str:
        """Of the resolved parameters: every parameter's value, defaults too, and the output."""
        resolved = {port.name: float(self.parameters.get(port.name, port.start)) for port in ports.PARAMETERS}
        resolved["supply_voltage"] = float(self.parameters.get("supply_voltage", 48.0))
        return hashlib.sha256(json.dumps([resolved, self.output.lead], sort_keys=True).encode()).hexdigest()


DEFAULT = Actuator("default", "the actuator of the ports' defaults")

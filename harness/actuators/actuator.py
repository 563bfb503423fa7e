"""An actuator: its parameters, what moves at its output, and how its logs are to be read."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

ANGLES = ("command", "position", "mechanics.end_stop", "gear.backlash", "initial.position")
"""Ports [rad] on the user's side, which are lengths [m] of a rod."""
TORQUES = ("load_torque",)
"""Ports [N.m] on the user's side, which are forces [N] on a rod."""
ROD = {
    "command": "Commanded position of the rod",
    "position": "Position of the rod, after backlash",
    "mechanics.end_stop": "End stops at plus and minus this position of the rod",
    "gear.backlash": "Total play at the rod",
    "initial.position": "Position of the rod at the start, held within the play",
    "load_torque": "External force on the rod; positive opposes positive motion",
}
"""What these ports are at a rod."""


@dataclass(frozen=True)
class Output:
    """What moves at the user's side: a shaft, or, with a `lead` [m per turn of the user shaft], a rod.

    Inside, everything is in the ports' units. At the border (files, tables, plots) a rod's positions are in m and its
    load in N; what is on the motor's side stays.
    """

    lead: float | None = None

    def unit(self, port: str) -> str:
        """The unit of `port` outside."""
        own = ports.VARIABLES[ports.INDEX[port]].unit
        if self.lead is None:
            return own
        return "m" if port in ANGLES else "N" if port in TORQUES else own

    def meaning(self, port: str) -> str:
        """What `port` is, in words."""
        own = ports.VARIABLES[ports.INDEX[port]].description
        return own if self.lead is None else ROD.get(port, own)

    def scale(self, port: str) -> float:
        """What a value of `port` inside is multiplied with to be one outside."""
        if self.lead is None:
            return 1.0
        travel = self.lead / (2.0 * math.pi)
        return travel if port in ANGLES else 1.0 / travel if port in TORQUES else 1.0

    def outside(self, port: str, values: Array) -> Array:
        """Values of `port`, any shape, in its unit outside; the same array where nothing changes."""
        return values if self.scale(port) == 1.0 else values * self.scale(port)

    def inside(self, port: str, values: Array) -> Array:
        """Values of `port` given in its unit outside, in the port's own; the same array where nothing changes."""
        return values if self.scale(port) == 1.0 else values / self.scale(port)

    def shown(self, run: "xr.Dataset") -> "xr.Dataset":
        """A run, with variables named like ports, in the units outside; the same dataset where nothing changes."""
        changed = {
            str(name): run[name]
            .copy(data=self.outside(str(name), run[name].values))
            .assign_attrs(units=self.unit(str(name)))
            for name in run.data_vars
            if name in ports.INDEX and self.scale(str(name)) != 1.0
        }
        return run.assign(changed) if changed else run


@dataclass(frozen=True)
class Actuator:
    """One actuator.

    `parameters`: port name -> value in the port's unit, for those that are stated or follow from a data sheet; the rest
    are the ports' defaults. The input supply_voltage may be among them: it holds where a trial or a log gives none.
    `tolerances`: port name -> half width of the interval that is stated, in the port's unit; after a calibration that of
    the 95 % interval. `origins`: port name -> where the value comes from. `log`: what `[log]` says, as written. `limits`:
    short name of a fault -> value at which health is 0. `calibration`, `provenance`: tables as written. `warnings`: a line
    for each contradiction in what is stated.
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
    warnings: tuple[str, ...] = ()

    def value(self, port: str) -> float:
        """The value of a parameter, or of a constant input, in the port's unit: its own, or the port's default."""
        return float(self.parameters.get(port, ports.VARIABLES[ports.INDEX[port]].start))

    @property
    def sha256(self) -> str:
        """Of the resolved parameters: every parameter's value, defaults too, and the output."""
        resolved: dict[str, Any] = {port.name: self.value(port.name) for port in ports.PARAMETERS}
        for port in ports.PARAMETERS:
            if port.start_of and port.name not in self.parameters:
                resolved[port.name] = [port.start_for(model) for model in ports.MODELS]
        resolved["supply_voltage"] = self.value("supply_voltage")
        if "load_torque" in self.parameters:
            resolved["load_torque"] = self.value("load_torque")
        return hashlib.sha256(json.dumps([resolved, self.output.lead], sort_keys=True).encode()).hexdigest()

    @property
    def is_default(self) -> bool:
        """Whether it is the default actuator: no parameter stated, a rotary output."""
        return not self.parameters and self.output.lead is None

    @property
    def identity(self) -> dict[str, str]:
        """Name and hash, as results record them."""
        return {"name": self.name, "sha256": self.sha256}


DEFAULT = Actuator("default", "the actuator of the ports' defaults")

"""How a log's channels are shown: in units outside, a position on the user's side wherever it was measured."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Output

Array = NDArray[np.float64]

ON_THE_MOTOR = "the position was measured on the motor; it is shown on the user's side, through a rigid gear"


@dataclass(frozen=True)
class Shown:
    """A channel as it is shown: its `name`, its `unit`, and what a value in the port's unit is multiplied with."""

    name: str
    unit: str
    scale: float


def shown(port: str, others: Collection[str], output: Output, parameters: Mapping[str, float]) -> Shown:
    """How the channel `port` of a log with the channels `others` is shown; `parameters`: those set, by port name.

    A position that was measured on the motor is the user's over a rigid gear, unless that was measured too.
    """
    if port != "motor_position" or "position" in others:
        return Shown(port, output.unit(port), output.scale(port))
    return Shown("position", output.unit("position"), output.scale("position") / value_of("gear.ratio", parameters))


def value_of(port: str, parameters: Mapping[str, float]) -> float:
    """The parameter as it was set, or the port's default."""
    return float(parameters.get(port, ports.VARIABLES[ports.INDEX[port]].start))

"""What is known of an actuator's parameters before a run is looked at: values with their covariance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ema_fmu_src import ports
from harness.actuators.actuator import Actuator
from harness.actuators.calibrated import WIDTH, covariance_of
from harness.logs.shown import value_of

Array = NDArray[np.float64]

SHAKEN = 0.23
"""Relative deviation between the static friction of HF at hysteresis control and that of the averaged models, which do not
know the ripple that shakes the shaft loose earlier (ours, measured)."""
T_STATIC, MODULATION = "mechanics.T_static", "inverter.modulation"


@dataclass(frozen=True)
class Prior:
    """Parameters that are not known exactly: `names` of ports, their `values`, shape (n,), in the ports' units, and
    `covariance`, shape (n, n). A normal distribution; bounds are those of the ports. `averaged`: whether the model that is
    fitted averages over the switching, and is not the judge itself."""

    names: tuple[str, ...] = ()
    values: Array = field(default_factory=lambda: np.empty(0))
    covariance: Array = field(default_factory=lambda: np.empty((0, 0)))
    averaged: bool = True

    @property
    def sigmas(self) -> Array:
        """Standard deviations, shape (n,)."""
        return np.sqrt(np.diag(self.covariance))

    def without(self, names: Sequence[str]) -> "Prior":
        """The same without these, which are taken as exact."""
        kept = [place for place, name in enumerate(self.names) if name not in names]
        return Prior(tuple(self.names[place] for place in kept), self.values[kept], self.covariance[np.ix_(kept, kept)])


def prior_of(actuator: Actuator, parameters: Mapping[str, float], *, averaged: bool = True) -> Prior:
    """What an actuator's file says of its parameters: the covariance of its calibration, and the tolerances of the others.

    `parameters`: those set for this actuator, by port name; what is set to another value than the file's is exact.
    `averaged`: whether the model averages over the switching; then T_static is as uncertain as it makes it.
    """
    own = {
        name: width
        for name, width in actuator.tolerances.items()
        if width > 0.0 and value_of(name, parameters) == actuator.value(name) and _free(name)
    }
    shaken = SHAKEN * value_of(T_STATIC, parameters) if averaged and _ripples(parameters) else 0.0
    names = (*own, *([T_STATIC] if shaken and T_STATIC not in own else []))
    covariance = np.diag([(own.get(name, 0.0) / WIDTH) ** 2 for name in names]) if names else np.empty((0, 0))
    calibrated = covariance_of(actuator.calibration)
    known = [name for name in own if name in calibrated.names]
    if known:
        here, there = [names.index(name) for name in known], [calibrated.names.index(name) for name in known]
        covariance[np.ix_(here, here)] = calibrated.covariance[np.ix_(there, there)]
    if shaken and T_STATIC not in known:  # a calibration's has it already
        place = names.index(T_STATIC)
        covariance[place, place] += shaken**2
    return Prior(names, np.array([value_of(name, parameters) for name in names]), covariance, averaged)


def _ripples(parameters: Mapping[str, float]) -> bool:
    """Whether the current is controlled by hysteresis."""
    return value_of(MODULATION, parameters) == ports.VARIABLES[ports.INDEX[MODULATION]].items["hysteresis"]


def _free(name: str) -> bool:
    """Whether a port is one whose value can be off by a little."""
    return name in ports.INDEX and ports.VARIABLES[ports.INDEX[name]].kind == "Real"

"""The phase currents that are asked for: the commutation of I_ref with the shaft."""

from typing import NamedTuple

from ..jit import kernel
from ..phases import Abc


class Sensors(NamedTuple):
    """Gain and offset of each phase's current sensor."""

    gain: Abc
    offset: Abc


class Reference(NamedTuple):
    """I_ref*(cos, sin)(delta), delta the electrical error of the measured angle when it was latched."""

    cos: float
    sin: float


@kernel
def ideal(I_ref, s):
    """i_ref_j = -I_ref*sin(theta_j), commutated by an ideal resolver."""
    return Abc(-I_ref * s.a, -I_ref * s.b, -I_ref * s.c)


@kernel
def commutated(ref, s_j, c_j):
    """i_ref_j = -I_ref*sin(theta_j + delta)."""
    return -(ref.cos * s_j + ref.sin * c_j)


@kernel
def errors(ref, s, c, i, sensors):
    """i_ref_j - i_j as the current sensors see it."""
    gain, offset = sensors
    return Abc(
        commutated(ref, s.a, c.a) - gain.a * i.a - offset.a,
        commutated(ref, s.b, c.b) - gain.b * i.b - offset.b,
        commutated(ref, s.c, c.c) - gain.c * i.c - offset.c,
    )


@kernel
def measured(i, sensors):
    """The currents as the sensors show them."""
    gain, offset = sensors
    return Abc(gain.a * i.a + offset.a, gain.b * i.b + offset.b, gain.c * i.c + offset.c)


@kernel
def shown_as(target, sensors):
    """The currents, 0 in sum, that sensors show as `target` but for what all three have in common: what a control that knows
    no better makes of it, averaged over the switching (ours)."""
    gain, offset = sensors
    r = Abc((target.a - offset.a) / gain.a, (target.b - offset.b) / gain.b, (target.c - offset.c) / gain.c)
    y = Abc(1.0 / gain.a, 1.0 / gain.b, 1.0 / gain.c)
    common = (r.a + r.b + r.c) / (y.a + y.b + y.c)
    return Abc(r.a - common * y.a, r.b - common * y.b, r.c - common * y.c)

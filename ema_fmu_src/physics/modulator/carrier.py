"""Modulation at a carrier: from the voltages that are asked for to the legs' duties, and to the times at which they switch.

Regular sampling, twice a carrier period: within a half of it each leg switches once, where the carrier passes its duty. So
the edges are known beforehand.
"""

from typing import NamedTuple

from ..inverter import Leg
from ..jit import kernel
from ..phases import Abc
from ..trig import clamp

SINE_TRIANGLE, SPACE_VECTOR = 2.0, 3.0
"""`inverter.modulation`."""
NEVER = 1e30
"""A time [s] that does not come."""


class Given(NamedTuple):
    """Leg voltages about the mid-point, and whether they fall short of what was asked for."""

    v: Abc
    limited: bool


class Pulse(NamedTuple):
    """A leg's half carrier period: the side on which it begins (+1 upper, -1 lower), and the time to its edge."""

    side: float
    edge: float


@kernel
def modulate(u, top, space_vector):
    """What the legs can give of the voltages u, within +-top; with the space vector's injection, at last six steps."""
    high, low = max(u.a, u.b, u.c), min(u.a, u.b, u.c)
    if space_vector:
        shift = 0.5 * (high + low)
        u = Abc(u.a - shift, u.b - shift, u.c - shift)
        high, low = high - shift, low - shift
    if high <= top and low >= -top:
        return Given(u, False)
    return Given(Abc(clamp(u.a, -top, top), clamp(u.b, -top, top), clamp(u.c, -top, top)), True)


@kernel
def pulse(on, rising, T, least, keeps_off):
    """The half carrier period T of a leg whose upper switch is to be on for a time `on` of it.

    A pulse shorter than `least` [s] is dropped; where the utilisation keeps the legs off the rails (`keeps_off`), it is
    lengthened instead, for a leg that stays on its rail would give more than that.
    """
    if not least < on < T - least:
        on = (least if keeps_off else 0.0) if on < 0.5 * T else (T - least if keeps_off else T)
        if on <= 0.0 or on >= T:
            return Pulse(-1.0 if on <= 0.0 else 1.0, NEVER)
    return Pulse(1.0, on) if rising else Pulse(-1.0, T - on)


@kernel
def time_to_change(h, leg_j, edge_j, dead_time, gate_j, i_j, slope_j):
    """The earlier of `h` and the time at which the leg's next edge changes its voltage.

    While the current flows through the diode of the leg's present rail, an edge changes nothing before the dead time ends:
    a commutation then takes one step instead of two. A current that may die out in the dead time is looked at step by step.
    """
    at_edge = i_j + edge_j * slope_j
    kept = gate_j != 0.0 and leg_j.side * at_edge < -2.0 * dead_time * abs(slope_j)
    return min(h, edge_j + dead_time if kept else edge_j)


@kernel
def begun(leg_j, pulse_j, dead_time):
    """The leg at the beginning of its half carrier period."""
    return leg_j if leg_j.side == pulse_j.side else Leg(pulse_j.side, dead_time, 0.0)


@kernel
def _passed(leg_j, edge_j, h, dead_time):
    """The leg, aged by a step h, and the time to its next edge: an edge within the step has begun a dead time."""
    if edge_j > h:
        return leg_j, edge_j - h
    return Leg(-leg_j.side, dead_time - (h - edge_j), 0.0), NEVER


@kernel
def passed(legs, edge, h, dead_time):
    """The legs, aged by a step h, and the times to their next edges."""
    a, edge_a = _passed(legs.a, edge.a, h, dead_time)
    b, edge_b = _passed(legs.b, edge.b, h, dead_time)
    c, edge_c = _passed(legs.c, edge.c, h, dead_time)
    return Abc(a, b, c), Abc(edge_a, edge_b, edge_c)

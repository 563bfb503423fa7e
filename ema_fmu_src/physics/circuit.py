"""HF's circuit between two switchings: what switches, diodes and the star make of the legs, and the currents in it."""

from typing import NamedTuple

from . import inverter
from .jit import kernel
from .phases import Abc
from .windings import damping, inductor_voltages, per_sum, star_point


class Circuit(NamedTuple):
    """Whether the supply lets the legs switch, what they are tied to, 1/L_j of those that conduct and 1 over their sum, leg
    voltages, slopes of the currents."""

    is_live: bool
    gate: Abc
    rail: Abc
    g: Abc
    per_g: float
    v: Abc
    slope: Abc


@kernel
def connect(legs, open_side, star, i, e, V_dc):
    """The circuit as it is now."""
    is_live = inverter.live(V_dc)
    gate = Abc(
        inverter.gate(legs.a, open_side.a, is_live),
        inverter.gate(legs.b, open_side.b, is_live),
        inverter.gate(legs.c, open_side.c, is_live),
    )
    tied = Abc(inverter.rail(gate.a, i.a), inverter.rail(gate.b, i.b), inverter.rail(gate.c, i.c))
    rail, g, per_g = conduction(tied, star, i, e, V_dc)
    v = inverter.leg_voltages(rail, V_dc)
    d = inductor_voltages(v, star.R, i, e)
    v_n = star_point(d, g, per_g)
    slope = Abc(g.a * (d.a - v_n), g.b * (d.b - v_n), g.c * (d.c - v_n))
    return Circuit(is_live, gate, rail, g, per_g, v, slope)


@kernel
def conduction(rail, star, i, e, V_dc):
    """The rails once the diodes of open legs are looked at; 1/L_j of the legs that conduct, and 1 over their sum."""
    if rail.a != 0.0 and rail.b != 0.0 and rail.c != 0.0:
        return rail, star.g, star.per_g
    g = _conducting(rail, star.g)
    if g.a + g.b + g.c > 0.0:
        v_n = star_point(inductor_voltages(inverter.leg_voltages(rail, V_dc), star.R, i, e), g, per_sum(g))
    else:  # nothing ties the star: it floats until the largest difference of the back-EMFs reaches V_dc
        v_n = -0.5 * (max(e.a, e.b, e.c) + min(e.a, e.b, e.c))
    rail = Abc(
        rail.a if rail.a != 0.0 else inverter.forward_biased(v_n + e.a, V_dc),
        rail.b if rail.b != 0.0 else inverter.forward_biased(v_n + e.b, V_dc),
        rail.c if rail.c != 0.0 else inverter.forward_biased(v_n + e.c, V_dc),
    )
    g = _conducting(rail, star.g)
    return rail, g, per_sum(g)


@kernel
def _conducting(rail, g):
    """g_j of the legs that are tied to a rail."""
    return Abc(
        g.a if rail.a != 0.0 else 0.0,
        g.b if rail.b != 0.0 else 0.0,
        g.c if rail.c != 0.0 else 0.0,
    )


@kernel
def _dies(leg_j, open_side_j, is_live, i_j, i_new_j):
    """Whether a leg is off and its current has come to zero in the step."""
    if inverter.gate(leg_j, open_side_j, is_live) != 0.0:
        return False
    return i_j * i_new_j < 0.0 or (i_j != 0.0 and -1e-9 < i_new_j < 1e-9)


@kernel
def _share(i_j, rest, g_j, g_other):
    """i_j with its part of what was taken off another leg: all of it where the third leg conducts nothing."""
    if g_j == 0.0:
        return i_j
    return i_j + (0.5 * rest if g_other != 0.0 else rest)


@kernel
def stopped_at_zero(legs, open_side, is_live, i, i_new, g):
    """The currents after a step once those that have died in legs that are off are zero; the legs that conduct (g_j > 0)
    take up what is taken off. Where two have died, the star leaves the third no way."""
    a = _dies(legs.a, open_side.a, is_live, i.a, i_new.a)
    b = _dies(legs.b, open_side.b, is_live, i.b, i_new.b)
    c = _dies(legs.c, open_side.c, is_live, i.c, i_new.c)
    if (a and b) or (b and c) or (c and a):
        return Abc(0.0, 0.0, 0.0)
    if a:
        return Abc(0.0, _share(i_new.b, i_new.a, g.b, g.c), _share(i_new.c, i_new.a, g.c, g.b))
    if b:
        return Abc(_share(i_new.a, i_new.b, g.a, g.c), 0.0, _share(i_new.c, i_new.b, g.c, g.a))
    if c:
        return Abc(_share(i_new.a, i_new.c, g.a, g.b), _share(i_new.b, i_new.c, g.b, g.a), 0.0)
    return i_new


@kernel
def mean(i_j, i_middle_j, i_new_j):
    """Mean current over a step: the middle, taken along the first slope, misses the bend one way, the ends another."""
    return (i_j + i_middle_j + i_new_j) * (1.0 / 3.0)


@kernel
def mean_square(i_j, i_new_j):
    """Mean square of a current that is straight over a step."""
    return (i_j * i_j + i_j * i_new_j + i_new_j * i_new_j) * (1.0 / 3.0)


@kernel
def toward(star, i, slope, h):
    """The currents after a step h along their slopes, bent by the resistances."""
    R, g_j = star.R, star.g
    return Abc(
        i.a + h * slope.a * damping(h * R.a * g_j.a),
        i.b + h * slope.b * damping(h * R.b * g_j.b),
        i.c + h * slope.c * damping(h * R.c * g_j.c),
    )


@kernel
def damped(star, g, h):
    """g_j of a step h that is implicit in the resistances."""
    R, g_j = star.R, star.g
    return Abc(
        g.a * damping(h * R.a * g_j.a),
        g.b * damping(h * R.b * g_j.b),
        g.c * damping(h * R.c * g_j.c),
    )

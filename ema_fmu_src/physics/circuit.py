"""HF's circuit between two switchings: what switches, diodes and the star make of the legs, and the currents in it."""

from typing import NamedTuple

from . import inverter
from .jit import kernel
from .phases import Abc
from .windings import inductor_voltages, per_sum, star_point


class Circuit(NamedTuple):
    """What the legs are tied to, 1/L_j of those that conduct and 1 over their sum, leg voltages, slopes of the currents."""

    gate: Abc
    rail: Abc
    g: Abc
    per_g: float
    v: Abc
    slope: Abc


@kernel
def connect(legs, open_side, star, i, e, V_dc):
    """The circuit as it is now."""
    gate = Abc(inverter.gate(legs.a, open_side.a), inverter.gate(legs.b, open_side.b), inverter.gate(legs.c, open_side.c))
    tied = Abc(inverter.rail(gate.a, i.a), inverter.rail(gate.b, i.b), inverter.rail(gate.c, i.c))
    rail, g, per_g = conduction(tied, star, i, e, V_dc)
    v = inverter.leg_voltages(rail, V_dc)
    d = inductor_voltages(v, star.R, i, e)
    v_n = star_point(d, g, per_g)
    slope = Abc(g.a * (d.a - v_n), g.b * (d.b - v_n), g.c * (d.c - v_n))
    return Circuit(gate, rail, g, per_g, v, slope)


@kernel
def conduction(rail, star, i, e, V_dc):
    """The rails once the diodes of open legs are looked at; 1/L_j of the legs that conduct, and 1 over their sum."""
    if rail.a != 0.0 and rail.b != 0.0 and rail.c != 0.0:
        return rail, star.g, star.per_g
    g = _conducting(rail, star.g)
    v_n = star_point(inductor_voltages(inverter.leg_voltages(rail, V_dc), star.R, i, e), g, per_sum(g))
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
def stopped_at_zero(legs, open_side, i, i_new):
    """The new currents once those of legs that are off have stopped at zero; the star shares out what is taken off."""
    a, b, c = i_new
    cut_a = inverter.cut_off(legs.a, open_side.a, i.a, a)
    cut_b = inverter.cut_off(legs.b, open_side.b, i.b, b)
    cut_c = inverter.cut_off(legs.c, open_side.c, i.c, c)
    if cut_a != 0.0:
        a, b, c = 0.0, b + 0.5 * cut_a, c + 0.5 * cut_a
    if cut_b != 0.0:
        a, b, c = a + 0.5 * cut_b, 0.0, c + 0.5 * cut_b
    if cut_c != 0.0:
        a, b, c = a + 0.5 * cut_c, b + 0.5 * cut_c, 0.0
    return Abc(a, b, c)


@kernel
def mean(i_j, i_middle_j, i_new_j):
    """Mean current over a step: the middle, taken along the first slope, misses the bend one way, the ends another."""
    return (i_j + i_middle_j + i_new_j) * (1.0 / 3.0)


@kernel
def mean_square(i_j, i_new_j):
    """Mean square of a current that is straight over a step."""
    return (i_j * i_j + i_j * i_new_j + i_new_j * i_new_j) * (1.0 / 3.0)

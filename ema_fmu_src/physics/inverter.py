"""HF's inverter: three legs with dead time, diodes, and a switch that may stay open."""

from typing import NamedTuple

from .jit import kernel
from .phases import Abc
from .windings import inductor_voltages, per_sum, star_point

LEAST_SUPPLY = 1.0
"""V_dc that the inverter needs (ours): below it no switch conducts, only the diodes do, in every fidelity."""


class Leg(NamedTuple):
    """What a leg remembers: the commanded side (+1 upper switch, -1 lower), what is left of its dead time, and how fast its
    current error nears the band (0: not known)."""

    side: float
    dead_left: float
    closing: float


@kernel
def open_side(open_switch, number):
    """+1 (upper) or -1 (lower) if `open_switch` (1, 2: leg 0; 3, 4: leg 1; 5, 6: leg 2) is in leg `number`, else 0."""
    code = int(open_switch) - 2 * number
    if code == 1:
        return 1.0
    if code == 2:
        return -1.0
    return 0.0


@kernel
def live(V_dc):
    """Whether the supply is enough for the inverter to switch."""
    return V_dc >= LEAST_SUPPLY


@kernel
def gate(leg_j, open_side_j, is_live):
    """Which switch of a leg conducts: +1, -1, or 0 while both are off (dead time, the commanded switch open, no supply)."""
    if leg_j.dead_left > 0.0 or leg_j.side == open_side_j or not is_live:
        return 0.0
    return leg_j.side


@kernel
def rail(gate_j, i_j):
    """The rail that a leg is tied to: that of the switch, else that of the diode which the current's sign selects.

    A current out of the leg (i_j > 0) flows through the lower diode, one into it through the upper; 0: no current, open.
    """
    if gate_j != 0.0:
        return gate_j
    if i_j > 0.0:
        return -1.0
    if i_j < 0.0:
        return 1.0
    return 0.0


@kernel
def leg_voltages(rails, V_dc):
    """v_j = +-V_dc/2 about the mid-point."""
    return Abc(0.5 * V_dc * rails.a, 0.5 * V_dc * rails.b, 0.5 * V_dc * rails.c)


@kernel
def forward_biased(v_open, V_dc):
    """The rail whose diode starts to conduct when an open leg's terminal is at `v_open` about the mid-point, or 0."""
    if v_open > 0.5 * V_dc:
        return 1.0
    if v_open < -0.5 * V_dc:
        return -1.0
    return 0.0


@kernel
def conduction(rails, star, i, e, V_dc):
    """The rails once the diodes of open legs are looked at; 1/L_j of the legs that conduct, and 1 over their sum."""
    if rails.a != 0.0 and rails.b != 0.0 and rails.c != 0.0:
        return rails, star.g, star.per_g
    g = _conducting(rails, star.g)
    if g.a + g.b + g.c > 0.0:
        v_n = star_point(inductor_voltages(leg_voltages(rails, V_dc), star.R, i, e), g, per_sum(g))
    else:  # nothing ties the star: it floats until the largest difference of the back-EMFs reaches V_dc
        v_n = -0.5 * (max(e.a, e.b, e.c) + min(e.a, e.b, e.c))
    rails = Abc(
        rails.a if rails.a != 0.0 else forward_biased(v_n + e.a, V_dc),
        rails.b if rails.b != 0.0 else forward_biased(v_n + e.b, V_dc),
        rails.c if rails.c != 0.0 else forward_biased(v_n + e.c, V_dc),
    )
    g = _conducting(rails, star.g)
    return rails, g, per_sum(g)


@kernel
def _conducting(rails, g):
    return Abc(
        g.a if rails.a != 0.0 else 0.0,
        g.b if rails.b != 0.0 else 0.0,
        g.c if rails.c != 0.0 else 0.0,
    )


@kernel
def rectified(i):
    """Bus current while only the diodes conduct: each leg feeds back into the supply."""
    return -0.5 * (abs(i.a) + abs(i.b) + abs(i.c))


@kernel
def time_to_commutation(h, leg_j, gate_j, rail_j, i_j, slope_j):
    """The earlier of `h` and the time at which a leg that is off changes its voltage by itself, as the slope predicts it.

    The end of a dead time changes nothing where the diode has led to the new rail already.
    """
    if gate_j == 0.0:
        if 0.0 < leg_j.dead_left < h and rail_j != leg_j.side:
            h = leg_j.dead_left
        if i_j * slope_j < 0.0 and abs(slope_j) * h > abs(i_j):
            zero = abs(i_j / slope_j)
            if zero < leg_j.dead_left or leg_j.dead_left <= 0.0:
                h = zero
    return h


@kernel
def _dies(leg_j, open_side_j, is_live, i_j, i_new_j):
    """Whether a leg is off and its current has come to zero in the step."""
    if gate(leg_j, open_side_j, is_live) != 0.0:
        return False
    return i_j * i_new_j < 0.0 or (i_j != 0.0 and -1e-9 < i_new_j < 1e-9)


@kernel
def _share(i_j, rest, g_j, g_other):
    """i_j with its part of what was taken off another leg: all of it where the third leg conducts nothing."""
    if g_j == 0.0:
        return i_j
    return i_j + (0.5 * rest if g_other != 0.0 else rest)


@kernel
def cut_off(legs, open_side, is_live, i, i_new, g):
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

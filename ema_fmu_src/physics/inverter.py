"""HF's inverter: three legs with dead time, diodes, and a switch that may stay open."""

from typing import NamedTuple

from .jit import kernel
from .phases import Abc

LEAST_SUPPLY = 1.0
"""V_dc that the inverter needs (ours): below it no switch conducts, only the diodes do, in every fidelity."""


class Leg(NamedTuple):
    """What a leg remembers: the commanded side (+1 upper switch, -1 lower), what is left of its dead time, and how fast its
    current error nears the band (0: not known)."""

    side: float
    dead_left: float
    closing: float


@kernel
def aged(legs, h):
    """The legs after a step h in which none has switched."""
    return Abc(
        Leg(legs.a.side, legs.a.dead_left - h, legs.a.closing),
        Leg(legs.b.side, legs.b.dead_left - h, legs.b.closing),
        Leg(legs.c.side, legs.c.dead_left - h, legs.c.closing),
    )


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
def open_sides(open_switch):
    """`open_side` of the three legs."""
    return Abc(open_side(open_switch, 0), open_side(open_switch, 1), open_side(open_switch, 2))


@kernel
def without_switch(i, open_side):
    """The currents, averaged over the switching, that a switch which stays open leaves of i (ours): a leg without its upper
    switch gives none out, one without its lower takes none in; what it would carry the others lose in equal parts."""
    a = min(0.0, i.a) if open_side.a > 0.0 else max(0.0, i.a) if open_side.a < 0.0 else i.a
    b = min(0.0, i.b) if open_side.b > 0.0 else max(0.0, i.b) if open_side.b < 0.0 else i.b
    c = min(0.0, i.c) if open_side.c > 0.0 else max(0.0, i.c) if open_side.c < 0.0 else i.c
    if a != i.a:
        return Abc(a, b + 0.5 * (i.a - a), c + 0.5 * (i.a - a))
    if b != i.b:
        return Abc(a + 0.5 * (i.b - b), b, c + 0.5 * (i.b - b))
    if c != i.c:
        return Abc(a + 0.5 * (i.c - c), b + 0.5 * (i.c - c), c)
    return i


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
def leg_voltages(rail, V_dc):
    """v_j = +-V_dc/2 about the mid-point."""
    return Abc(0.5 * V_dc * rail.a, 0.5 * V_dc * rail.b, 0.5 * V_dc * rail.c)


@kernel
def forward_biased(v_open, V_dc):
    """The rail whose diode starts to conduct when an open leg's terminal is at `v_open` about the mid-point, or 0."""
    if v_open > 0.5 * V_dc:
        return 1.0
    if v_open < -0.5 * V_dc:
        return -1.0
    return 0.0


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

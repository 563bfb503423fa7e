"""The drive with a sampled current loop and a carrier, averaged over the switching (ours): a step of ELF+ of any length.

The healthy loop is exact in its own frame (`current_loop.over`). What it asks of a healthy machine meets the machine as it
is: unequal phases or another back-EMF see it as a source with the resistance `stiff`. Where the legs fall short, the
modulator's own law is taken at the mean currents of the step, by fixed-point passes.
"""

from typing import NamedTuple

from . import current_loop, inverter, voltage_limit
from .frame import Dq, to_frame, to_phases
from .jit import kernel
from .modulator import carrier, reference
from .phases import Abc
from .trig import clamp
from .voltage_limit import Driven
from .windings import Series, per_sum, star_point, step_impedance

PASSES = 3
"""Fixed-point passes of a step in saturation (ours); each shrinks the error by 0.5*bandwidth*h or less."""


class Frames(NamedTuple):
    """Sine and cosine of the electrical angle as the drive sees it, at a step's beginning, in its middle and at its end."""

    s_0: float
    c_0: float
    s: float
    c: float
    s_1: float
    c_1: float


class Legs(NamedTuple):
    """The inverter: the most that a leg gives about the mid-point, V_dc, dead time, whether a space vector is injected,
    and the legs' sides with a switch that stays open."""

    top: float
    V_dc: float
    dead_time: float
    injects: bool
    open_side: Abc


class Plant(NamedTuple):
    """The machine as it is: resistances and inductances, back-EMF in the middle of the step, its speeds, and whether it is
    not the one that the loop was designed for."""

    phases: Series
    e: Abc
    w: float
    w_e: float
    unlike: bool


class Aim(NamedTuple):
    """What the healthy loop does in a step: x and y of `current_loop` before it, and the measured currents after it."""

    current_error: Dq
    voltage_error: Dq
    i: Dq


@kernel
def _star(y, d):
    """Currents y_j*(d_j - v_n) that sum up to nothing."""
    v_n = star_point(d, y, per_sum(y))
    return Abc(y.a * (d.a - v_n), y.b * (d.b - v_n), y.c * (d.c - v_n))


@kernel
def _plus(i, other):
    return Abc(i.a + other.a, i.b + other.b, i.c + other.c)


@kernel
def _toward(i, i_new, share):
    return Abc(i.a + share * (i_new.a - i.a), i.b + share * (i_new.b - i.b), i.c + share * (i_new.c - i.c))


@kernel
def _needs(i, i_new, e, R, impedance):
    """Mean leg voltages that take the currents to i_new in the step."""
    return Abc(
        (i_new.a - i.a) * impedance.a + R.a * i.a + e.a,
        (i_new.b - i.b) * impedance.b + R.b * i.b + e.b,
        (i_new.c - i.c) * impedance.c + R.c * i.c + e.c,
    )


@kernel
def _after_dead_time(legs, loop, u_j, i_j):
    """Mean voltage of a leg: one that switches loses by its dead time against its current, within the ripple less."""
    if abs(u_j) >= 0.5 * legs.V_dc:
        return u_j
    f = 0.5 / loop.T
    most = legs.dead_time * f * legs.V_dc
    loss = clamp(24.0 * legs.dead_time * f * f * loop.L * i_j, -most, most)
    return clamp(u_j - loss, -0.5 * legs.V_dc, 0.5 * legs.V_dc)


@kernel
def _given(legs, loop, u, i):
    return Abc(
        _after_dead_time(legs, loop, u.a, i.a),
        _after_dead_time(legs, loop, u.b, i.b),
        _after_dead_time(legs, loop, u.c, i.c),
    )


@kernel
def aim(loop, passage, w, w_e, I_ref, xi, i):
    """What the healthy loop does in a step, exact in its own frame; `i`: the measured currents there."""
    left = (1.0 - loop.decoupling) * w_e * loop.L
    x = Dq(-i.d, I_ref - i.q)
    y = Dq(
        xi.d + left * i.q,
        xi.q - loop.R * I_ref - (1.0 - loop.emf_forward) * loop.K_e * w - left * i.d,
    )
    return Aim(x, y, Dq(-(passage.M_xx * x.d + passage.M_xy * y.d), I_ref - (passage.M_xx * x.q + passage.M_xy * y.q)))


@kernel
def carried_on(passage, aim, xi):
    """xi after a step in which the legs gave what was asked for."""
    return Dq(
        xi.d + passage.M_yx * aim.current_error.d + (passage.M_yy - 1.0) * aim.voltage_error.d,
        xi.q + passage.M_yx * aim.current_error.q + (passage.M_yy - 1.0) * aim.voltage_error.q,
    )


@kernel
def followed(loop, passage, w, w_e, xi, given, i):
    """xi after a step in which they fell short: it follows the voltages `given`, at the currents `i` of its middle."""
    fed = loop.decoupling * w_e * loop.L
    return Dq(
        xi.d + passage.follow * (given.d + fed * i.q - xi.d),
        xi.q + passage.follow * (given.q - fed * i.d - loop.emf_forward * loop.K_e * w - xi.q),
    )


@kernel
def step(loop, passage, legs, plant, sensors, frames, I_ref, xi, i, senses, h):
    """A step h of the drive from the currents i: what `voltage_limit.Driven` says of it, and xi after it."""
    R, L = plant.phases
    impedance = Abc(step_impedance(L.a / h, R.a), step_impedance(L.b / h, R.b), step_impedance(L.c / h, R.c))
    e, w = plant.e, plant.w
    f = frames
    seen = reference.measured(i, sensors) if senses else i
    i_dq = to_frame(seen, f.s_0, f.c_0)
    aimed = aim(loop, passage, plant.w, plant.w_e, I_ref, xi, i_dq)
    i_new = to_phases(aimed.i, f.s_1, f.c_1)
    if senses:
        i_new = reference.shown_as(i_new, sensors)
    u = _needs(i, i_new, e, R, impedance)
    deviation = Dq(0.0, 0.0)
    if plant.unlike:
        per = step_impedance(loop.L / h, loop.R)
        healthy = to_phases(Dq(0.0, loop.K_e * w), f.s, f.c)
        asked = _needs(i, i_new, healthy, Abc(loop.R, loop.R, loop.R), Abc(per, per, per))
        stiff = passage.stiff
        conductance = Abc(1.0 / (impedance.a + stiff), 1.0 / (impedance.b + stiff), 1.0 / (impedance.c + stiff))
        i_more = _star(conductance, Abc(asked.a - u.a, asked.b - u.b, asked.c - u.c))
        u = Abc(asked.a - stiff * i_more.a, asked.b - stiff * i_more.b, asked.c - stiff * i_more.c)
        deviation = to_frame(i_more, f.s, f.c)
        i_new = _plus(i_new, to_phases(deviation, f.s_1, f.c_1))  # decoupled, the deviation turns with the frame
    given = carrier.modulate(u, legs.top, legs.injects)
    if not given.limited:
        xi, more = carried_on(passage, aimed, xi), 0.5 * h * loop.K_i
        xi = Dq(xi.d - more * deviation.d, xi.q - more * deviation.q)
        i_new = inverter.without_switch(i_new, legs.open_side)
        return Driven(i_new, _toward(i, i_new, passage.share), u, False), xi
    admittance = Abc(1.0 / impedance.a, 1.0 / impedance.b, 1.0 / impedance.c)
    hold = Abc(e.a + R.a * i.a, e.b + R.b * i.b, e.c + R.c * i.c)
    at = max(0.0, 0.5 - 0.5 * loop.T / h)  # where in a step HF's samples lie, on the average
    j_dq, v, u = i_dq, given.v, given.v
    for _ in range(PASSES):
        middle = Dq(i_dq.d + at * (j_dq.d - i_dq.d), i_dq.q + at * (j_dq.q - i_dq.q))
        asked = to_phases(current_loop.voltages(loop, I_ref, xi, middle, w, plant.w_e), f.s, f.c)
        u = carrier.modulate(asked, legs.top, legs.injects).v
        v = _given(legs, loop, u, i)
        i_new = _plus(i, _star(admittance, Abc(v.a - hold.a, v.b - hold.b, v.c - hold.c)))
        j_dq = to_frame(reference.measured(i_new, sensors) if senses else i_new, f.s_1, f.c_1)
    middle = Dq(0.5 * (i_dq.d + j_dq.d), 0.5 * (i_dq.q + j_dq.q))
    xi = followed(loop, passage, plant.w, plant.w_e, xi, to_frame(u, f.s, f.c), middle)
    i_new = inverter.without_switch(i_new, legs.open_side)
    return Driven(i_new, _toward(i, i_new, passage.share), v, True), xi


@kernel
def independent(loop, passage, legs, plant, sensors, frames, I_ref, xi, i, senses, R, N, h):
    """Plain ELF's: the healthy loop's currents, each phase limited on its own (the paper, Eq. 1); returns as `step`."""
    f = frames
    i_dq = to_frame(reference.measured(i, sensors) if senses else i, f.s_0, f.c_0)
    aimed = aim(loop, passage, plant.w, plant.w_e, I_ref, xi, i_dq)
    i_ref = to_phases(aimed.i, f.s_1, f.c_1)
    if senses:
        i_ref = reference.shown_as(i_ref, sensors)
    i_ref = inverter.without_switch(i_ref, legs.open_side)
    driven = voltage_limit.independent(i, i_ref, plant.e, R, N, plant.phases, 2.0 * legs.top, h)
    if not driven.limited:
        return driven, carried_on(passage, aimed, xi)
    j_dq = to_frame(driven.i, f.s_1, f.c_1)
    middle = Dq(0.5 * (i_dq.d + j_dq.d), 0.5 * (i_dq.q + j_dq.q))
    return driven, followed(loop, passage, plant.w, plant.w_e, xi, to_frame(driven.v, f.s, f.c), middle)

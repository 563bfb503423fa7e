"""HF, the high fidelity: switching inverter, hysteresis current control, star-connected three-phase PMSM.

Controller: position P and speed PI, sampled every controller.period through a resolver of 2^bits counts a motor turn;
between the samples the commutation follows the shaft with the angle error latched there: i_ref_j = -I_ref*sin(theta_j).
Inverter: a leg whose current error reaches +-hysteresis commands its upper or lower switch; both switches are off for
the dead time, while a diode conducts (which, the current's sign decides); v_j = +-V_dc/2, R_on in series.
Windings: R_j = N_j*R, L_j = N_j^2*L, v_n = sum((v_j - R_j*i_j - e_j)/L_j)/sum(1/L_j),
L_j di_j/dt = v_j - v_n - R_j*i_j - e_j.
Back-EMF and torque (the paper, Eq. 2): e_j = k_j*w, T_m = sum(k_j*i_j).
Mechanics: J dw/dt = T_m - C*w - T_L - T_f, Borello friction, end stops, backlash.

Between switchings the equations are smooth and are stepped by the midpoint rule (second order; implicit in the resistances
where they bend the currents within a step). How far a step goes is a rule of its own: `events.step_to_event`
(solver.event_located) or `events.fixed_step`, always solver.step.

Covers: all faults. Does not cover: iron losses, magnetic saturation, thermal dynamics, forward voltage of the diodes.
"""

from typing import NamedTuple

from ..physics import events, inverter, monitor, sensor, stability, voltage_limit, windings
from ..physics.circuit import connect, damped, mean, mean_square, stopped_at_zero, toward
from ..physics.inverter import Leg
from ..physics.jit import kernel
from ..physics.modulator import hysteresis, reference
from ..physics.modulator.reference import Reference
from ..physics.phases import Abc, three_phases
from ..physics.trig import clamp, rotate, sincos
from . import actuator, host
from .actuator import derived, now, since
from .host import clock, inputs, partial, told
from .memory import Moving, State, places, port, whole
from .status import Status

OWN = (
    State("ref_cos", "A", "I_ref times the cosine of the latched error of the electrical angle"),
    State("ref_sin", "A", "I_ref times its sine"),
    *(State(f"side_{j}", "1", f"commanded side of leg {j}: +1 upper switch, -1 lower") for j in "abc"),
    *(State(f"dead_left_{j}", "s", f"what is left of the dead time of leg {j}") for j in "abc"),
    *(
        State(f"closing_{j}", "A/s", f"how fast the current error of leg {j} neared the band in the last step")
        for j in "abc"
    ),
)
"""What HF remembers of its motion beside what all fidelities do."""
STATES = whole(actuator.ONCE, (*actuator.MOVING, *OWN))
N_STATES = len(STATES)
MOVING = Moving(len(actuator.ONCE), len(actuator.MOVING) + len(OWN))
TICK = "controller.period"
"""The port that tells how long a tick of the clock is; empty: as long as a step."""
own = places("own", OWN, first=len(actuator.ONCE) + len(actuator.MOVING))

MOST_STEPS = 20000
"""Bound of event-located steps in 1e-4 s, beside those that the longest step asks for; a healthy run takes some 60."""
MARGIN = 4e-3
"""Event-located: a current error this close to the band, as a fraction of it, has reached it. The relative tolerance of an
experiment, if one is given, takes its place, within FINEST and COARSEST."""
FINEST, COARSEST = 1e-5, 0.05
RIPPLES = 10.0
"""Ripples of the band, as changes of the current at V_dc, in the time within which a limit of the voltage is looked for."""
STIFF = 0.05
"""h*R_j/L_j from which a step is implicit in the resistance; below it the explicit midpoint rule is as good and cheaper."""


class Machine(NamedTuple):
    """What stays as it is within a communication step."""

    p: float
    R: float
    tau: float
    N: Abc
    field: windings.Field
    phases: windings.Series
    star: windings.Star
    comparator: hysteresis.Comparator
    open_side: Abc
    offset: Abc


class Sums(NamedTuple):
    """Filtered equivalent current, supply charge, copper loss."""

    i_filtered: float
    charge: float
    loss: float


@kernel
def initialize(v, x):
    """Start at time 0; returns a Status."""
    longest = stability.for_currents(
        v[port.solver.step], v[port.motor.K_e], v[port.mechanics.J], v[port.motor.R], v[port.motor.L]
    )
    status = actuator.start(v, x, v[port.controller.period], longest, N_STATES)
    if status != Status.OK:
        return status
    x[own.ref_cos] = x[now.I_ref]
    x[own.side_a], x[own.side_b], x[own.side_c] = -1.0, -1.0, -1.0
    return actuator.publish(v, x, 0.0)


@kernel
def _machine(v, x):
    """The machine with its faults."""
    N, R, band = actuator.turns(v), x[derived.R], v[port.inverter.hysteresis]
    tolerance = clamp(x[told.tolerance], FINEST, COARSEST) if x[told.tolerance] > 0.0 else MARGIN
    margin = tolerance * band if v[port.solver.event_located] != 0.0 else 0.0
    switch = v[port.fault.open_switch]
    phases = windings.series(N, R, v[port.inverter.R_on], v[port.motor.L])
    return Machine(
        v[port.motor.p],
        R,
        v[port.monitor.tau],
        N,
        actuator.field(x),
        phases,
        windings.star(phases),
        hysteresis.Comparator(band, margin, v[port.inverter.dead_time]),
        Abc(inverter.open_side(switch, 0), inverter.open_side(switch, 1), inverter.open_side(switch, 2)),
        Abc(v[port.fault.current_offset_a], v[port.fault.current_offset_b], v[port.fault.current_offset_c]),
    )


@kernel
def _read(x):
    """What moves, from `x`: motion, currents, legs, sums."""
    legs = Abc(
        Leg(x[own.side_a], x[own.dead_left_a], x[own.closing_a]),
        Leg(x[own.side_b], x[own.dead_left_b], x[own.closing_b]),
        Leg(x[own.side_c], x[own.dead_left_c], x[own.closing_c]),
    )
    return actuator.motion(x), actuator.currents(x), legs, Sums(x[now.i_filtered], x[now.charge], x[now.loss])


@kernel
def _write(x, motion, i, legs, sums):
    """What moves, into `x`."""
    actuator.write_motion(x, motion)
    actuator.write_currents(x, i)
    x[own.side_a], x[own.dead_left_a], x[own.closing_a] = legs.a
    x[own.side_b], x[own.dead_left_b], x[own.closing_b] = legs.b
    x[own.side_c], x[own.dead_left_c], x[own.closing_c] = legs.c
    x[now.i_filtered], x[now.charge], x[now.loss] = sums


@kernel
def _sample(v, x, motion, t):
    """The controller's sample at time `t` [s], through the resolver: writes the reference, returns the motion with sine and
    cosine made anew."""
    p, G, bits, offset = v[port.motor.p], v[port.gear.ratio], v[port.sensor.resolver_bits], v[port.fault.resolver_offset]
    measured = sensor.resolver(motion.theta + offset, bits)
    position = sensor.resolver(motion.position * G + offset, bits) / G
    I_ref = actuator.control(v, x, t, position, motion.w)
    s, c = sincos(p * (measured - motion.theta))
    x[own.ref_cos], x[own.ref_sin] = I_ref * c, I_ref * s
    s, c = sincos(p * motion.theta)
    return actuator.Motion(motion.theta, motion.w, motion.position, s, c, motion.T_f, motion.stop)


@kernel
def _sum_up(m, sums, rail, i, i_mean, i_new, s, c, h):
    """The sums after a step h; s, c at its middle, i_mean the mean currents over it."""
    N = m.N
    loss = sums.loss + h * m.R * (
        N.a * mean_square(i.a, i_new.a) + N.b * mean_square(i.b, i_new.b) + N.c * mean_square(i.c, i_new.c)
    )
    q = monitor.quadrature_current(i_mean, s, c)
    i_filtered = monitor.low_pass(sums.i_filtered, q, monitor.smoothing(h, m.tau))
    charge = sums.charge + 0.5 * h * (rail.a * i_mean.a + rail.b * i_mean.b + rail.c * i_mean.c)
    return Sums(i_filtered, charge, loss)


@kernel
def _midpoint(v, x, m, motion, i, legs, sums, circuit, load, h):
    """A step h by the midpoint rule: the middle from the slopes at the beginning, the step from the slopes at the middle.

    Where the resistances bend the currents within the step (STIFF), it is implicit in them. What is summed up takes that
    bend into account: third order, at one step a commutation.
    """
    s, c = rotate(motion.s, motion.c, 0.5 * m.p * motion.w * h)
    sines, cosines = three_phases(s, c)
    k = windings.back_emf_coefficients(m.N, m.field, sines, cosines)
    slope, g = circuit.slope, circuit.g
    stiff = h * m.star.decay > STIFF
    if stiff:
        middle = toward(m.star, i, slope, 0.5 * h)
    else:
        middle = Abc(i.a + 0.5 * h * slope.a, i.b + 0.5 * h * slope.b, i.c + 0.5 * h * slope.c)
    w_mean, theta, w, position, T_f, stop = actuator.move(v, x, motion, windings.torque(k, middle), load, h)
    e = windings.back_emf(k, w_mean)
    if stiff:
        d, g = windings.inductor_voltages(circuit.v, m.star.R, i, e), damped(m.star, g, h)
        v_n = windings.star_point(d, g, windings.per_sum(g))
    else:
        d = windings.inductor_voltages(circuit.v, m.star.R, middle, e)
        v_n = windings.star_point(d, g, circuit.per_g)
    i_new = Abc(i.a + h * g.a * (d.a - v_n), i.b + h * g.b * (d.b - v_n), i.c + h * g.c * (d.c - v_n))
    legs = Abc(
        Leg(legs.a.side, legs.a.dead_left - h, legs.a.closing),
        Leg(legs.b.side, legs.b.dead_left - h, legs.b.closing),
        Leg(legs.c.side, legs.c.dead_left - h, legs.c.closing),
    )
    if circuit.gate.a * circuit.gate.b * circuit.gate.c == 0.0:
        i_new = stopped_at_zero(legs, m.open_side, circuit.is_live, i, i_new, g)
    if stiff:
        i_mean = windings.mean_currents(i, i_new, m.phases, h)
    else:
        i_mean = Abc(mean(i.a, middle.a, i_new.a), mean(i.b, middle.b, i_new.b), mean(i.c, middle.c, i_new.c))
    sums = _sum_up(m, sums, circuit.rail, i, i_mean, i_new, s, c, h)
    s, c = rotate(motion.s, motion.c, m.p * (theta - motion.theta))
    return actuator.Motion(theta, w, position, s, c, T_f, stop), i_new, legs, sums


@kernel
def _limited(m, ref, motion, i, V_dc, T_c):
    """Whether the inverter falls short of what the currents' references ask for.

    As in ELF+, from the voltages that would take the currents there within a controller period, or within the time that the
    ripple of the band needs. They differ by what the errors differ: an offset of a current sensor, which the star turns into
    an error that all phases have in common, limits nothing.
    """
    s, c = three_phases(motion.s, motion.c)
    error = reference.errors(ref, s, c, i, m.offset)
    e = windings.back_emf(windings.back_emf_coefficients(m.N, m.field, s, c), motion.w)
    wanted = Abc(i.a + error.a, i.b + error.b, i.c + error.c)
    L = m.phases.L
    per_h = min(1.0 / T_c, V_dc / (RIPPLES * m.comparator.band * max(L.a, L.b, L.c)))
    _, need, _ = voltage_limit.needs(i, wanted, e, m.phases, per_h)
    return voltage_limit.beyond(need, V_dc) or not inverter.live(V_dc)


@kernel
def _tick(x, limited):
    """End a controller period."""
    x[clock.tick] += 1.0
    x[now.limited] = 1.0 if limited else 0.0
    x[since.limited] += x[now.limited]


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a Status."""
    T_c = v[port.controller.period]
    status = actuator.begin(v, x, T_c, MOVING)
    if status != Status.OK:
        return status
    m = _machine(v, x)
    located, longest = v[port.solver.event_located] != 0.0, x[clock.step]
    most_steps = MOST_STEPS * max(1.0, T_c / 1e-4) + 2.0 * T_c / longest
    L = m.phases.L
    most_voltage = m.comparator.band * min(L.a, L.b, L.c) / longest
    close = host.CLOSE * longest
    motion, i, legs, sums = _read(x)
    elapsed = x[clock.offset]
    steps = 0
    while True:
        left = t - (x[clock.tick] * T_c + elapsed)
        if left <= close:
            break
        if x[clock.tick] == x[clock.next_sample]:
            motion = _sample(v, x, motion, x[clock.tick] * T_c)
            x[clock.next_sample] += 1.0
            steps = 0
        ref = Reference(x[own.ref_cos], x[own.ref_sin])
        V_dc = max(0.0, host.input_at(v, x, inputs.supply_voltage, t - left))
        s, c = three_phases(motion.s, motion.c)
        error = reference.errors(ref, s, c, i, m.offset)
        legs = hysteresis.look(m.comparator, legs, error)
        e = windings.back_emf(windings.back_emf_coefficients(m.N, m.field, s, c), motion.w)
        circuit = connect(legs, m.open_side, m.star, i, e, V_dc)
        step = stability.for_turn(longest, m.p * abs(motion.w))
        if step == 0.0:
            return Status.STIFF
        if located:
            legs, h = events.step_to_event(
                m.comparator, m.star, ref, m.p * motion.w, i, legs, error, circuit, s, c, min(step, T_c - elapsed)
            )
            steps += 1
            if steps > most_steps:
                return Status.STUCK
        elif V_dc > most_voltage:
            return Status.COARSE
        else:
            h = events.fixed_step(step, T_c - elapsed)
        partial_step = h > left + close
        if partial_step:
            _write(x, motion, i, legs, sums)
            x[clock.offset] = elapsed
            host.back_up(v, x, MOVING)
            h = left
        load = host.input_at(v, x, inputs.load_torque, t - left + 0.5 * h)
        motion, i, legs, sums = _midpoint(v, x, m, motion, i, legs, sums, circuit, load, h)
        if partial_step:
            break
        elapsed += h
        if elapsed >= T_c - close:
            elapsed = 0.0
            _tick(x, _limited(m, ref, motion, i, V_dc, T_c))
    _write(x, motion, i, legs, sums)
    if x[partial.pending] == 0.0:
        x[clock.offset] = elapsed
    return actuator.publish(v, x, t)

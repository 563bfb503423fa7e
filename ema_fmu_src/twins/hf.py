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
where they bend the currents within a step). How far a step goes is a
rule of its own: `_step_to_event` (solver.event_located) or `_fixed_step`, always solver.step.

Covers: all faults. Does not cover: iron losses, magnetic saturation, thermal dynamics, forward voltage of the diodes.
"""

from typing import NamedTuple

from ..physics import inverter, monitor, sensor, stability, voltage_limit, windings
from ..physics.inverter import Leg
from ..physics.jit import kernel
from ..physics.modulator import hysteresis, reference
from ..physics.modulator.reference import Reference
from ..physics.phases import Abc, three_phases
from ..physics.trig import clamp, rotate, sincos
from . import actuator, host
from .actuator import derived, now, since
from .host import clock, inputs, told, trial
from .memory import Moving, State, places, port, whole
from .status import Status

OWN = (
    State("ref_cos", "A", "I_ref times the cosine of the latched error of the electrical angle"),
    State("ref_sin", "A", "I_ref times its sine"),
    State("side_a", "1", "commanded side of leg a: +1 upper switch, -1 lower"),
    State("side_b", "1", "commanded side of leg b"),
    State("side_c", "1", "commanded side of leg c"),
    State("dead_left_a", "s", "what is left of the dead time of leg a"),
    State("dead_left_b", "s", "what is left of the dead time of leg b"),
    State("dead_left_c", "s", "what is left of the dead time of leg c"),
    State("closing_a", "A/s", "how fast the current error of leg a neared the band in the last step"),
    State("closing_b", "A/s", "how fast that of leg b did"),
    State("closing_c", "A/s", "how fast that of leg c did"),
)
"""What HF remembers of its motion beside what all fidelities do."""
STATES = whole(actuator.ONCE, (*actuator.MOVING, *OWN))
N_STATES = len(STATES)
MOVING = Moving(len(actuator.ONCE), len(actuator.MOVING) + len(OWN))
own = places("own", OWN, first=len(actuator.ONCE) + len(actuator.MOVING))

MOST_STEPS = 20000
"""Bound of event-located steps in one controller period, beside those that its longest step asks for; a healthy run takes
some 60."""
SHORTEST = 1e-9
"""Shortest step that is aimed at an event [s]: 0.1 mA of the current's slope."""
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
    star: windings.Star
    comparator: hysteresis.Comparator
    open_side: Abc
    offset: Abc
    L: Abc


class Circuit(NamedTuple):
    """The legs and the star between two switchings: whether the supply lets them switch, switches, rails, 1/L of what
    conducts, voltages, slopes of currents."""

    live: bool
    gate: Abc
    rail: Abc
    g: Abc
    per_g: float
    v: Abc
    slope: Abc


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
    return Machine(
        v[port.motor.p],
        R,
        v[port.monitor.tau],
        N,
        actuator.field(x),
        windings.star(N, R, v[port.inverter.R_on], v[port.motor.L]),
        hysteresis.Comparator(band, margin, v[port.inverter.dead_time]),
        Abc(inverter.open_side(switch, 0), inverter.open_side(switch, 1), inverter.open_side(switch, 2)),
        Abc(v[port.fault.current_offset_a], v[port.fault.current_offset_b], v[port.fault.current_offset_c]),
        windings.series(N, R, v[port.inverter.R_on], v[port.motor.L]).L,
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
    """The controller's sample at time `t` [s], through the resolver: writes the reference."""
    p, G, bits, offset = v[port.motor.p], v[port.gear.ratio], v[port.sensor.resolver_bits], v[port.fault.resolver_offset]
    measured = sensor.resolver(motion.theta + offset, bits)
    position = sensor.resolver(motion.position * G + offset, bits) / G
    I_ref = actuator.control(v, x, t, position, motion.w)
    s, c = sincos(p * (measured - motion.theta))
    x[own.ref_cos], x[own.ref_sin] = I_ref * c, I_ref * s


@kernel
def _look(comparator, legs, error):
    """The modulator's look at the legs."""
    return Abc(
        hysteresis.compare(comparator, legs.a, error.a),
        hysteresis.compare(comparator, legs.b, error.b),
        hysteresis.compare(comparator, legs.c, error.c),
    )


@kernel
def _circuit(m, motion, i, legs, s, c, V_dc):
    """The circuit that switches, diodes and the star make of the legs."""
    live, side = inverter.live(V_dc), m.open_side
    gate = Abc(inverter.gate(legs.a, side.a, live), inverter.gate(legs.b, side.b, live), inverter.gate(legs.c, side.c, live))
    e = windings.back_emf(windings.back_emf_coefficients(m.N, m.field, s, c), motion.w)
    tied = Abc(inverter.rail(gate.a, i.a), inverter.rail(gate.b, i.b), inverter.rail(gate.c, i.c))
    rail, g, per_g = inverter.conduction(tied, m.star, i, e, V_dc)
    v = inverter.leg_voltages(rail, V_dc)
    d = windings.inductor_voltages(v, m.star.R, i, e)
    v_n = windings.star_point(d, g, per_g)
    slope = Abc(g.a * (d.a - v_n), g.b * (d.b - v_n), g.c * (d.c - v_n))
    return Circuit(live, gate, rail, g, per_g, v, slope)


@kernel
def _event(h, comparator, leg_j, error_j, gate_j, rail_j, i_j, slope_j, decay_j):
    """The earlier of `h` and the next change of a leg's voltage."""
    h = hysteresis.time_to_band(h, comparator, leg_j, error_j, gate_j, i_j, slope_j, decay_j)
    return inverter.time_to_commutation(h, leg_j, gate_j, rail_j, i_j, slope_j)


@kernel
def _step_to_event(comparator, star, ref, w_e, i, legs, error, circuit, s, c, longest):
    """The legs with the speeds of their errors, and the event-located step: to the next event, at most `longest`."""
    slope, gate, rail = circuit.slope, circuit.gate, circuit.rail
    legs = Abc(
        hysteresis.approach(legs.a, ref, slope.a, w_e, s.a, c.a),
        hysteresis.approach(legs.b, ref, slope.b, w_e, s.b, c.b),
        hysteresis.approach(legs.c, ref, slope.c, w_e, s.c, c.c),
    )
    h = _event(longest, comparator, legs.a, error.a, gate.a, rail.a, i.a, slope.a, star.R.a * star.g.a)
    h = _event(h, comparator, legs.b, error.b, gate.b, rail.b, i.b, slope.b, star.R.b * star.g.b)
    h = _event(h, comparator, legs.c, error.c, gate.c, rail.c, i.c, slope.c, star.R.c * star.g.c)
    return legs, min(longest, max(h, SHORTEST))


@kernel
def _turn_limited(m, w, step):
    """`step`, or the shorter one in which theta_e turns by stability.TURN."""
    turn = m.p * abs(w)
    return step if turn * step <= stability.TURN else stability.TURN / turn


@kernel
def _fixed_step(step, to_tick):
    """The fixed rule: `step`, the last one before the controller's tick taking up what rounding has left."""
    return to_tick if to_tick < 1.5 * step else step


@kernel
def _mean(i_j, i_middle_j, i_new_j):
    """Mean current over a step: the middle, taken along the first slope, misses the bend one way, the ends another."""
    return (i_j + i_middle_j + i_new_j) * (1.0 / 3.0)


@kernel
def _square(i_j, i_new_j):
    """Mean square of a current that is straight over a step."""
    return (i_j * i_j + i_j * i_new_j + i_new_j * i_new_j) * (1.0 / 3.0)


@kernel
def _sum_up(m, sums, rail, i, mean, i_new, s, c, h):
    """The sums after a step h with theta_e = asin(s) at its middle, the currents' `mean` and their ends."""
    N = m.N
    loss = sums.loss + h * m.R * (N.a * _square(i.a, i_new.a) + N.b * _square(i.b, i_new.b) + N.c * _square(i.c, i_new.c))
    q = monitor.quadrature_current(mean, s, c)
    i_filtered = monitor.low_pass(sums.i_filtered, q, h / (m.tau + 0.5 * h))
    charge = sums.charge + 0.5 * h * (rail.a * mean.a + rail.b * mean.b + rail.c * mean.c)
    return Sums(i_filtered, charge, loss)


@kernel
def _toward(star, i, slope, h):
    """The currents after a step h along their slopes, bent by the resistances."""
    R, g_j = star.R, star.g
    return Abc(
        i.a + h * slope.a * windings.damping(h * R.a * g_j.a),
        i.b + h * slope.b * windings.damping(h * R.b * g_j.b),
        i.c + h * slope.c * windings.damping(h * R.c * g_j.c),
    )


@kernel
def _damped(star, g, h):
    """g_j of a step h that is implicit in the resistances."""
    R, g_j = star.R, star.g
    return Abc(
        g.a * windings.damping(h * R.a * g_j.a),
        g.b * windings.damping(h * R.b * g_j.b),
        g.c * windings.damping(h * R.c * g_j.c),
    )


@kernel
def _between(star, i, i_new, h):
    """Mean currents of such a step."""
    R, g_j = star.R, star.g
    return Abc(
        i.a + (i_new.a - i.a) * windings.mean_share(h * R.a * g_j.a, 1.0),
        i.b + (i_new.b - i.b) * windings.mean_share(h * R.b * g_j.b, 1.0),
        i.c + (i_new.c - i.c) * windings.mean_share(h * R.c * g_j.c, 1.0),
    )


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
        middle = _toward(m.star, i, slope, 0.5 * h)
    else:
        middle = Abc(i.a + 0.5 * h * slope.a, i.b + 0.5 * h * slope.b, i.c + 0.5 * h * slope.c)
    w_mean, theta, w, position, T_f, stop = actuator.move(v, x, motion, windings.torque(k, middle), load, h)
    e = windings.back_emf(k, w_mean)
    if stiff:
        d, g = windings.inductor_voltages(circuit.v, m.star.R, i, e), _damped(m.star, g, h)
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
        i_new = inverter.cut_off(legs, m.open_side, circuit.live, i, i_new, g)
    if stiff:
        mean = _between(m.star, i, i_new, h)
    else:
        mean = Abc(_mean(i.a, middle.a, i_new.a), _mean(i.b, middle.b, i_new.b), _mean(i.c, middle.c, i_new.c))
    sums = _sum_up(m, sums, circuit.rail, i, mean, i_new, s, c, h)
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
    per_h = min(1.0 / T_c, V_dc / (RIPPLES * m.comparator.band * max(m.L.a, m.L.b, m.L.c)))
    _, need, _ = voltage_limit.needs(i, wanted, e, windings.Series(m.star.R, m.L), per_h)
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
    most_steps = MOST_STEPS + 2.0 * T_c / longest
    close = host.CLOSE * longest
    motion, i, legs, sums = _read(x)
    elapsed = x[clock.offset]
    steps = 0
    while True:
        left = t - (x[clock.tick] * T_c + elapsed)
        if left <= close:
            break
        if x[clock.tick] == x[clock.next_sample]:
            _sample(v, x, motion, x[clock.tick] * T_c)
            s_e, c_e = sincos(m.p * motion.theta)
            motion = actuator.Motion(motion.theta, motion.w, motion.position, s_e, c_e, motion.T_f, motion.stop)
            x[clock.next_sample] += 1.0
            steps = 0
        ref = Reference(x[own.ref_cos], x[own.ref_sin])
        V_dc = max(0.0, host.input_at(v, x, inputs.supply_voltage, t - left))
        s, c = three_phases(motion.s, motion.c)
        error = reference.errors(ref, s, c, i, m.offset)
        legs = _look(m.comparator, legs, error)
        circuit = _circuit(m, motion, i, legs, s, c, V_dc)
        step = _turn_limited(m, motion.w, longest)
        if located:
            legs, h = _step_to_event(
                m.comparator, m.star, ref, m.p * motion.w, i, legs, error, circuit, s, c, min(step, T_c - elapsed)
            )
            steps += 1
            if steps > most_steps:
                return Status.STUCK
        else:
            h = _fixed_step(step, T_c - elapsed)
        on_trial = h > left + close
        if on_trial:
            _write(x, motion, i, legs, sums)
            x[clock.offset] = elapsed
            host.back_up(v, x, MOVING)
            h = left
        load = host.input_at(v, x, inputs.load_torque, t - left + 0.5 * h)
        motion, i, legs, sums = _midpoint(v, x, m, motion, i, legs, sums, circuit, load, h)
        if on_trial:
            break
        elapsed += h
        if elapsed >= T_c - close:
            elapsed = 0.0
            _tick(x, _limited(m, ref, motion, i, V_dc, T_c))
    _write(x, motion, i, legs, sums)
    if x[trial.pending] == 0.0:
        x[clock.offset] = elapsed
    return actuator.publish(v, x, t)

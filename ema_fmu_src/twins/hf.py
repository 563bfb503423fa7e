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

from ..physics import current_loop, events, inverter, stability, voltage_limit, windings
from ..physics.circuit import connect
from ..physics.frame import Dq, to_frame, to_phases
from ..physics.inverter import Leg
from ..physics.jit import kernel
from ..physics.modulator import carrier, hysteresis, reference
from ..physics.modulator.reference import Reference
from ..physics.phases import Abc, three_phases
from ..physics.trig import rotate
from . import actuator, drive, host, switched
from .host import clock, inputs, partial
from .layout import now, since
from .memory import port
from .status import Status
from .switched import MOVING, N_STATES, STATES, own

__all__ = ["MOVING", "N_STATES", "STATES", "TICK", "advance", "initialize"]

TICK = "controller.period"
"""The port that tells how long a tick of the clock is; empty: as long as a step."""
MOST_STEPS = 20000
"""Bound of event-located steps in 1e-4 s, beside those that the longest step asks for; a healthy run takes some 60."""
RIPPLES = 10.0
"""Ripples of the band, as changes of the current at V_dc, in the time within which a limit of the voltage is looked for."""


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
def _limited(m, ref, motion, i, V_dc, T_c):
    """Whether the inverter falls short of what the currents' references ask for.

    As in ELF+, from the voltages that would take the currents there within a controller period, or within the time that the
    ripple of the band needs. They differ by what the errors differ: an offset of a current sensor, which the star turns into
    an error that all phases have in common, limits nothing.
    """
    s, c = three_phases(motion.s, motion.c)
    error = reference.errors(ref, s, c, i, m.sensors)
    e = windings.back_emf(windings.back_emf_coefficients(m.N, m.field, s, c), motion.w)
    wanted = Abc(i.a + error.a, i.b + error.b, i.c + error.c)
    L = m.phases.L
    per_h = min(1.0 / T_c, V_dc / (RIPPLES * m.comparator.band * max(L.a, L.b, L.c)))
    _, need, _ = voltage_limit.needs(i, wanted, e, m.phases, per_h)
    return voltage_limit.beyond(need, V_dc) or not inverter.live(V_dc)


@kernel
def _tick(x):
    """End a controller period."""
    x[clock.tick] += 1.0


@kernel
def _mark(x, limited):
    """Whether the voltage limits, as it is found now."""
    x[now.limited] = 1.0 if limited else 0.0
    x[since.limited] += x[now.limited]


@kernel
def _flipped(leg_j, edge_j, dead_time):
    """The leg, and the time to its next edge, once the time `edge_j` to an edge has run out or has not."""
    if edge_j > 0.0:
        return leg_j, edge_j
    return Leg(-leg_j.side, dead_time, 0.0), carrier.NEVER


@kernel
def _after_edges(legs, edge, h, dead_time):
    """The legs after a step h, and the times to their next edges."""
    a, edge_a = _flipped(legs.a, edge.a - h, dead_time)
    b, edge_b = _flipped(legs.b, edge.b - h, dead_time)
    c, edge_c = _flipped(legs.c, edge.c - h, dead_time)
    return Abc(a, b, c), Abc(edge_a, edge_b, edge_c)


@kernel
def _begun(leg_j, pulse_j, dead_time):
    """The leg at the beginning of its pulse."""
    return leg_j if leg_j.side == pulse_j.side else Leg(pulse_j.side, dead_time, 0.0)


@kernel
def _peak(v, x, loop, sensors, motion, i, legs, V_dc):
    """A peak of the carrier: the current loop's sample, through its sensors. Writes xi and the limit, returns the legs and
    the times to their edges in the half period that begins."""
    p, T = v[port.motor.p], loop.T
    seen = drive.look(v, motion.theta, motion.position)
    s, c = rotate(motion.s, motion.c, p * (seen.motor_position - motion.theta))
    i_dq = to_frame(reference.measured(i, sensors), s, c)
    xi, I_ref = Dq(x[now.xi_d], x[now.xi_q]), x[now.I_ref]
    u = current_loop.voltages(loop, I_ref, xi, i_dq, motion.w, p * motion.w)
    s, c = rotate(s, c, 0.5 * p * motion.w * T)
    inverter_legs = drive.legs(v, V_dc)
    given = carrier.modulate(to_phases(u, s, c), inverter_legs.top, inverter_legs.injects)
    v_dq = to_frame(given.v, s, c) if given.limited else u
    x[now.xi_d], x[now.xi_q] = current_loop.integrated(loop, I_ref, xi, i_dq, u, v_dq)
    _mark(x, given.limited or not inverter.live(V_dc))
    rising = int(x[own.peak]) & 1 == 0
    least, keeps_off = v[port.inverter.minimum_pulse], v[port.inverter.utilisation] < 1.0
    a = carrier.pulse(given.v.a, V_dc, rising, T, least, keeps_off)
    b = carrier.pulse(given.v.b, V_dc, rising, T, least, keeps_off)
    c_pulse = carrier.pulse(given.v.c, V_dc, rising, T, least, keeps_off)
    dead_time = v[port.inverter.dead_time]
    x[own.peak] += 1.0
    legs = Abc(_begun(legs.a, a, dead_time), _begun(legs.b, b, dead_time), _begun(legs.c, c_pulse, dead_time))
    return legs, Abc(a.edge, b.edge, c_pulse.edge)


@kernel
def _carried(v, x, t):
    """Run to time `t` [s] at a carrier, of which the edges are known: no look at the currents, no search. Returns a Status."""
    T_c, longest = v[port.controller.period], x[clock.step]
    m, loop = switched.machine(v, x), drive.read_loop(x)
    dead_time = v[port.inverter.dead_time]
    most_steps = MOST_STEPS * max(1.0, T_c / 1e-4) + 2.0 * T_c / longest
    close = host.CLOSE * min(longest, loop.T)
    motion, i, legs, sums = switched.read(x)
    edge = Abc(x[own.edge_a], x[own.edge_b], x[own.edge_c])
    elapsed = x[clock.offset]
    steps = 0
    while True:
        since_start = x[clock.tick] * T_c + elapsed
        left = t - since_start
        if left <= close:
            break
        if x[clock.tick] == x[clock.next_sample]:
            motion = switched.sample(v, x, motion, i, x[clock.tick] * T_c)
            x[clock.next_sample] += 1.0
            steps = 0
        V_dc = max(0.0, host.input_at(v, x, inputs.supply_voltage, since_start))
        to_peak = x[own.peak] * loop.T - since_start
        if to_peak <= close:
            legs, edge = _peak(v, x, loop, m.sensors, motion, i, legs, V_dc)
            to_peak += loop.T
        s, c = three_phases(motion.s, motion.c)
        e = windings.back_emf(windings.back_emf_coefficients(m.N, m.field, s, c), motion.w)
        circuit = connect(legs, m.open_side, m.star, i, e, V_dc)
        step = stability.for_turn(longest, m.p * abs(motion.w))
        steps += 1
        if step == 0.0 or steps > most_steps:
            return Status.STIFF if step == 0.0 else Status.STUCK
        h = events.step_to_edge(legs, edge, i, circuit, min(step, T_c - elapsed, to_peak))
        partial_step = h > left + close
        if partial_step:
            switched.write(x, motion, i, legs, sums)
            x[own.edge_a], x[own.edge_b], x[own.edge_c] = edge
            x[clock.offset] = elapsed
            host.back_up(v, x, MOVING)
            h = left
        load = host.input_at(v, x, inputs.load_torque, since_start + 0.5 * h)
        motion, i, legs, sums = switched.midpoint(v, x, m, motion, i, legs, sums, circuit, load, h)
        legs, edge = _after_edges(legs, edge, h, dead_time)
        if partial_step:
            break
        elapsed += h
        if elapsed >= T_c - close:
            elapsed = 0.0
            _tick(x)
    switched.write(x, motion, i, legs, sums)
    x[own.edge_a], x[own.edge_b], x[own.edge_c] = edge
    if x[partial.pending] == 0.0:
        x[clock.offset] = elapsed
    return Status.OK


@kernel
def _by_hysteresis(v, x, t):
    """Run to time `t` [s] with the current's hysteresis. Returns a Status."""
    T_c, m = v[port.controller.period], switched.machine(v, x)
    located, longest = v[port.solver.event_located] != 0.0, x[clock.step]
    most_steps = MOST_STEPS * max(1.0, T_c / 1e-4) + 2.0 * T_c / longest
    L = m.phases.L
    most_voltage = m.comparator.band * min(L.a, L.b, L.c) / longest
    close = host.CLOSE * longest
    motion, i, legs, sums = switched.read(x)
    elapsed = x[clock.offset]
    steps = 0
    while True:
        left = t - (x[clock.tick] * T_c + elapsed)
        if left <= close:
            break
        if x[clock.tick] == x[clock.next_sample]:
            motion = switched.sample(v, x, motion, i, x[clock.tick] * T_c)
            x[clock.next_sample] += 1.0
            steps = 0
        ref = Reference(x[own.ref_cos], x[own.ref_sin])
        V_dc = max(0.0, host.input_at(v, x, inputs.supply_voltage, t - left))
        s, c = three_phases(motion.s, motion.c)
        error = reference.errors(ref, s, c, i, m.sensors)
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
            switched.write(x, motion, i, legs, sums)
            x[clock.offset] = elapsed
            host.back_up(v, x, MOVING)
            h = left
        load = host.input_at(v, x, inputs.load_torque, t - left + 0.5 * h)
        motion, i, legs, sums = switched.midpoint(v, x, m, motion, i, legs, sums, circuit, load, h)
        if partial_step:
            break
        elapsed += h
        if elapsed >= T_c - close:
            elapsed = 0.0
            _tick(x)
            _mark(x, _limited(m, ref, motion, i, V_dc, T_c))
    switched.write(x, motion, i, legs, sums)
    if x[partial.pending] == 0.0:
        x[clock.offset] = elapsed
    return Status.OK


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a Status."""
    status = actuator.begin(v, x, v[port.controller.period], MOVING)
    if status != Status.OK:
        return status
    status = _carried(v, x, t) if drive.is_oriented(v) else _by_hysteresis(v, x, t)
    return actuator.publish(v, x, t) if status == Status.OK else status

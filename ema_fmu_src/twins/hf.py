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

With controller.current_control = field_oriented the legs are switched at a carrier (twins/carried.py): a current loop in
the rotor's frame, sampled twice a carrier period, sine against triangle or space vectors.

Covers: all faults. Does not cover: iron losses, magnetic saturation, thermal dynamics, forward voltage of the diodes.
"""

from ..physics import events, inverter, stability, voltage_limit, windings
from ..physics.circuit import connect
from ..physics.jit import kernel
from ..physics.modulator import hysteresis, reference
from ..physics.modulator.reference import Reference
from ..physics.phases import Abc, three_phases
from . import actuator, carried, drive, host, switched
from .host import clock, inputs
from .layout import now
from .memory import port
from .status import Status
from .switched import MOST_STEPS, MOVING, N_STATES, STATES, own

__all__ = ["MOVING", "N_STATES", "STATES", "TICK", "advance", "initialize"]

TICK = "controller.period"
"""The port that tells how long a tick of the clock is; empty: as long as a step."""
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
            switched.set_aside(v, x, motion, i, legs, sums, elapsed)
            h = left
        load = host.input_at(v, x, inputs.load_torque, t - left + 0.5 * h)
        motion, i, legs, sums = switched.midpoint(v, x, m, motion, i, legs, sums, circuit, load, h)
        if partial_step:
            break
        elapsed += h
        if elapsed >= T_c - close:
            elapsed = 0.0
            switched.tick(x)
            switched.mark(x, _limited(m, ref, motion, i, V_dc, T_c))
    switched.leave(x, motion, i, legs, sums, elapsed)
    return Status.OK


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a Status."""
    status = actuator.begin(v, x, v[port.controller.period], MOVING)
    if status != Status.OK:
        return status
    status = carried.run(v, x, t) if drive.is_oriented(v) else _by_hysteresis(v, x, t)
    return actuator.publish(v, x, t) if status == Status.OK else status

"""ELF, the enhanced low fidelity: three phases, no switching.

Driver (the paper, Eq. 1): each phase takes its reference current, limited on its own by the supply and its back-EMF,
i_j = clamp(i_ref_j, (-V_dc - e_j)/(R*n_j), (V_dc - e_j)/(R*n_j)); no inductance.
With driver.coupled_saturation (ELF+, ours): the averaged inverter feeds the star through R and L; in saturation the legs
with the largest and the smallest need sit at the rails and the third follows as far as it can (physics/voltage_limit.py).
Back-EMF and torque (the paper, Eq. 2): e_j = k_j*w, T_m = sum(k_j*i_j), k at the middle of the step.
With controller.current_control = field_oriented ELF+ takes HF's sampled current loop and modulation, averaged over the
switching (physics/averaged.py); plain ELF takes the loop's currents, each phase limited on its own.
Controller: position P and speed PI, or PID, sampled every controller.period; sensors ideal but for their faults.
Mechanics: J dw/dt = T_m - C*w - T_L - T_f, Borello friction, end stops, backlash.

Covers: faults of friction, backlash, turns, eccentricity, gain, jam, magnet, resistance; of sensors and of a switch that
stays open, averaged over the switching; voltage saturation (ELF+).
Does not cover: the current ripple, quantised sensors; the dead time, but where a carrier saturates; saturation in plain ELF.
"""

from ..physics import averaged, inverter, monitor, stability, voltage_limit, windings
from ..physics.frame import Dq, to_frame
from ..physics.jit import kernel
from ..physics.modulator import reference
from ..physics.phases import three_phases
from ..physics.trig import rotate, sincos
from . import actuator, drive, host, layout
from .host import clock, inputs
from .layout import derived, now
from .memory import Moving, port, whole
from .status import Status

STATES = whole(layout.ONCE, layout.MOVING)
N_STATES = len(STATES)
MOVING = Moving(len(layout.ONCE), len(layout.MOVING))
TICK = ""
"""The port that tells how long a tick of the clock is; empty: as long as a step."""
LEAST_R = 0.5
"""Least fault.resistance: bounds of the step hold whatever the faults."""


@kernel
def initialize(v, x):
    """Start at time 0; returns a Status."""
    K_e, J, R = v[port.motor.K_e], v[port.mechanics.J], LEAST_R * v[port.motor.R]
    if v[port.driver.coupled_saturation] != 0.0:
        longest = stability.for_currents(v[port.solver.step], K_e, J, R, v[port.motor.L])
    else:
        longest = stability.for_driver(v[port.solver.step], K_e, J, R)
    status = actuator.start(v, x, v[port.controller.period], longest, N_STATES)
    return actuator.publish(v, x, 0.0) if status == Status.OK else status


@kernel
def _sample(v, x, t):
    """The controller's sample at time `t` [s]."""
    seen = drive.look_ideally(v, x[now.theta], x[now.position])
    drive.control(v, x, t, seen, x[now.w])
    s, c = drive.turned(v, x[now.s], x[now.c])
    drive.show(v, x, seen.motor_position, actuator.currents(x), s, c)


@kernel
def _asked(v, x, I_ref, s, c):
    """The phase currents that the ideal drive takes for those it is asked for: s, c of theta_e at the step's end."""
    if x[derived.astray] == 0.0:
        sines, _ = three_phases(s, c)
        return reference.ideal(I_ref, sines)
    s, c = drive.turned(v, s, c)
    sines, _ = three_phases(s, c)
    i_ref = reference.ideal(I_ref, sines)
    if x[derived.senses] != 0.0:
        i_ref = reference.shown_as(i_ref, drive.sensors(v))
    return inverter.without_switch(i_ref, inverter.open_sides(v[port.fault.open_switch]))


@kernel
def _ideally(v, x, i, i_ref, e, V_dc, h):
    """The ideal drive over a step h: plain ELF's, or ELF+'s."""
    R, N = x[derived.R], actuator.turns(v)
    phases = windings.series(N, R, v[port.inverter.R_on], v[port.motor.L])
    if v[port.driver.coupled_saturation] == 0.0:
        return voltage_limit.independent(i, i_ref, e, R, N, phases, V_dc, h)
    return voltage_limit.coupled(i, i_ref, e, phases, V_dc, h)


@kernel
def _seen(v, turn):
    """The electrical angle over a step as the drive sees it."""
    s_0, c_0 = drive.turned(v, turn.s_0, turn.c_0)
    s, c = drive.turned(v, turn.s, turn.c)
    s_1, c_1 = drive.turned(v, turn.s_1, turn.c_1)
    return averaged.Frames(s_0, c_0, s, c, s_1, c_1)


@kernel
def _orientedly(v, x, i, e, w, turn, V_dc, h):
    """The drive with a sampled current loop over a step h: plain ELF's, or ELF+'s. Writes xi."""
    if not inverter.live(V_dc):
        driven = _ideally(v, x, i, _asked(v, x, 0.0, turn.s_1, turn.c_1), e, V_dc, h)
        drive.idle(v, x, to_frame(driven.i_mean, turn.s, turn.c), w, h)
        return driven
    frames = _seen(v, turn)
    R, N = x[derived.R], actuator.turns(v)
    phases = windings.series(N, R, v[port.inverter.R_on], v[port.motor.L])
    loop, xi = drive.read_loop(x), Dq(x[now.xi_d], x[now.xi_q])
    passage = drive.passage(x, loop, h)
    plant = averaged.Plant(phases, e, w, v[port.motor.p] * w, x[derived.unlike] != 0.0)
    sensors, senses = drive.sensors(v), x[derived.senses] != 0.0
    if v[port.driver.coupled_saturation] != 0.0:
        driven, xi = averaged.step(
            loop, passage, drive.legs(v, V_dc), plant, sensors, frames, x[now.I_ref], xi, i, senses, h
        )
    else:
        driven, xi = averaged.independent(
            loop, passage, drive.legs(v, V_dc), plant, sensors, frames, x[now.I_ref], xi, i, senses, R, N, h
        )
    x[now.xi_d], x[now.xi_q] = xi
    return driven


@kernel
def _step(v, x, t, h):
    """One step h from time `t` [s] on."""
    motion, N, R = actuator.motion(x), actuator.turns(v), x[derived.R]
    V_dc = max(0.0, host.input_at(v, x, inputs.supply_voltage, t + 0.5 * h))
    p = v[port.motor.p]
    half = 0.5 * h * motion.w
    s, c = sincos(p * (motion.theta + half))
    s_end, c_end = rotate(s, c, p * half)
    sines, cosines = three_phases(s, c)
    k = windings.back_emf_coefficients(N, actuator.field(x), sines, cosines)
    live = inverter.live(V_dc)
    i = actuator.currents(x)
    load = host.input_at(v, x, inputs.load_torque, t + 0.5 * h)
    w_ahead = actuator.w_ahead(v, x, motion, windings.torque(k, i), load, h)
    e = windings.back_emf(k, w_ahead)
    if drive.is_oriented(v):
        driven = _orientedly(v, x, i, e, w_ahead, averaged.Frames(motion.s, motion.c, s, c, s_end, c_end), V_dc, h)
    else:
        driven = _ideally(v, x, i, _asked(v, x, x[now.I_ref] if live else 0.0, s_end, c_end), e, V_dc, h)

    i, v_legs = driven.i_mean, driven.v
    _, theta, w, position, T_f, stop = actuator.move(v, x, motion, windings.torque(k, i), load, h)
    s_end, c_end = rotate(s_end, c_end, p * (theta - motion.theta - 2.0 * half))
    means = actuator.Means(
        monitor.quadrature_current(i, s, c),
        (v_legs.a * i.a + v_legs.b * i.b + v_legs.c * i.c) / V_dc if live else inverter.rectified(i),
        R * (N.a * i.a * i.a + N.b * i.b * i.b + N.c * i.c * i.c),
    )
    moved = actuator.Motion(theta, w, position, s_end, c_end, T_f, stop)
    actuator.store(v, x, h, moved, driven.i, means, driven.limited or not live)


_run = host.stepper(_sample, actuator.shortened, _step, actuator.on_the_way, MOVING)


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a Status."""
    status = actuator.begin(v, x, x[clock.step], MOVING)
    if status != Status.OK:
        return status
    status = _run(v, x, t)
    return actuator.publish(v, x, t) if status == Status.OK else status

"""LF, the low fidelity: an equivalent single phase.

Shape functions (ours; the paper only says that LF defines some; healthy: f = 1):
f = (2/3)*sum N_j*sin^2(theta_j)*[1 + p*zeta*cos(theta_j - phi)], R_eq = (2/3)*R*sum N_j*sin^2(theta_j) + R_on.
Electrical: e = K_e*f*w, v = clamp(R_eq*I_ref + e + (L/tau)*(I_ref - i), +-sqrt((2*V_dc/pi)^2 - (p*w*L*i)^2)),
L di/dt = v - R_eq*i - e, T_m = 1.5*K_e*f*i; tau = 1e-4 s (ours), trapezoidal rule.
With controller.current_control = field_oriented i follows as in the q axis of the sampled current loop, v is limited by
inverter.utilisation times the six-step voltage.
Controller: I_ref = clamp(K_p*(w_ref - w), +-current_limit), at each step of LF's own: no integral, no period; or the PID
at the same steps, with the filter that its sampling is.
Mechanics: J dw/dt = T_m - C*w - T_L - T_f, Borello friction, end stops, backlash.

Covers: faults of friction, backlash, turns, eccentricity, gain, jam, magnet, resistance in the mean and in the leading
harmonic of the torque.
Does not cover: differences between the phase currents, the controller's integral and sampling, the current ripple, the
dead time, a switch that stays open, sensor errors.
"""

from ..physics import averaged, inverter, monitor, single_phase, stability
from ..physics.controller import cascade
from ..physics.frame import Dq
from ..physics.jit import kernel
from ..physics.phases import Abc, three_phases
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
MOST_GAIN = 10.0
"""Largest fault.gain: bounds of the step hold whatever the faults."""


@kernel
def _publish(v, x, t):
    """End a communication step at time `t` [s]; returns a Status.

    The cascade's integral is the one with which a twin that has one would go on from LF's current reference.
    """
    if v[port.controller.structure] != drive.PID:
        command = host.input_at(v, x, inputs.command, t)
        gains = drive.cascade_gains(v, x, 0.0, 0.0, x[clock.step])
        x[now.xi] = cascade.carrying_integral(gains, command, x[now.position], x[now.w], x[now.I_ref])
    return actuator.publish(v, x, t)


@kernel
def initialize(v, x):
    """Start at time 0; returns a Status."""
    K_e, J = v[port.motor.K_e], v[port.mechanics.J]
    longest = stability.for_currents(v[port.solver.step], K_e, J, 0.0, v[port.motor.L])
    lag = drive.lag(v) if drive.is_oriented(v) else single_phase.TAU
    if v[port.controller.structure] == drive.PID:
        K_d = v[port.controller.pid.K_d]
        longest = stability.for_loop(longest, 1.5 * K_e * K_d / J, lag)
        longest = stability.for_swing(longest, MOST_GAIN * 1.5 * K_e * v[port.controller.pid.K_p] / J)
    else:
        longest = stability.for_loop(longest, 1.5 * K_e * v[port.controller.K_p] / J, lag)
        longest = stability.for_loop(longest, MOST_GAIN * v[port.controller.K_pos], stability.SHORTEST)
    status = actuator.start(v, x, longest, longest, N_STATES)
    return _publish(v, x, 0.0) if status == Status.OK else status


@kernel
def _sample(v, x, t):
    """The control law, which has no sampling, at each step of LF's own."""
    drive.control_continuously(v, x, t, x[clock.step])
    drive.show(v, x, x[now.theta], actuator.currents(x), x[now.s], x[now.c])


@kernel
def _orientedly(v, x, i, e, w, R_eq, V_dc, h):
    """The drive with a sampled current loop over a step h, its q axis alone. Writes xi."""
    if not inverter.live(V_dc):
        driven = single_phase.current(
            i, single_phase.ideal_change(i, 0.0, h), e, R_eq, v[port.motor.L], V_dc, v[port.motor.p] * x[now.w], h
        )
        drive.idle(v, x, Dq(0.0, driven.i_mean), w, h)
        return driven
    loop, xi = drive.read_loop(x), Dq(0.0, x[now.xi_q])
    passage = drive.passage(x, loop, h)
    w_e = v[port.motor.p] * w
    aimed = averaged.aim(loop, passage, w, w_e, x[now.I_ref], xi, Dq(0.0, i))
    driven = single_phase.current(i, aimed.i.q - i, e, R_eq, v[port.motor.L], V_dc * v[port.inverter.utilisation], w_e, h)
    if driven.limited:
        xi = averaged.followed(loop, passage, w, w_e, xi, Dq(0.0, driven.v), Dq(0.0, driven.i_mean))
    else:
        xi = averaged.carried_on(passage, aimed, xi)
    x[now.xi_q] = xi.q
    return driven


@kernel
def _step(v, x, t, h):
    """One step h from time `t` [s] on."""
    motion, N, field = actuator.motion(x), actuator.turns(v), actuator.field(x)
    i = monitor.quadrature_current(actuator.currents(x), motion.s, motion.c)
    V_dc = max(0.0, host.input_at(v, x, inputs.supply_voltage, t + 0.5 * h))
    live = inverter.live(V_dc)

    p = v[port.motor.p]
    half = 0.5 * h * motion.w
    s, c = sincos(p * (motion.theta + half))
    sines, cosines = three_phases(s, c)
    K_f = field.K_e * single_phase.shape(N, field, sines, cosines)
    R_copper = single_phase.resistance(x[derived.R], N, sines)
    R_eq = R_copper + v[port.inverter.R_on]
    load = host.input_at(v, x, inputs.load_torque, t + 0.5 * h)
    w_ahead = actuator.w_ahead(v, x, motion, 1.5 * K_f * i, load, h)
    if drive.is_oriented(v):
        driven = _orientedly(v, x, i, K_f * w_ahead, w_ahead, R_eq, V_dc, h)
    else:
        change = single_phase.ideal_change(i, x[now.I_ref] if live else 0.0, h)
        driven = single_phase.current(i, change, K_f * w_ahead, R_eq, v[port.motor.L], V_dc, p * motion.w, h)
    mean = driven.i_mean
    _, theta, w, position, T_f, stop = actuator.move(v, x, motion, 1.5 * K_f * mean, load, h)
    s, c = rotate(s, c, p * (theta - motion.theta - half))
    sines, _ = three_phases(s, c)
    means = actuator.Means(
        mean,
        1.5 * driven.v * mean / V_dc if live else -single_phase.RECTIFIED * abs(mean),
        1.5 * R_copper * mean * mean,
    )
    moved = actuator.Motion(theta, w, position, s, c, T_f, stop)
    i_new = Abc(-driven.i * sines.a, -driven.i * sines.b, -driven.i * sines.c)
    actuator.store(v, x, h, moved, i_new, means, driven.limited or not live)


_run = host.stepper(_sample, actuator.shortened, _step, actuator.on_the_way, MOVING)


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a Status."""
    status = actuator.begin(v, x, x[clock.step], MOVING)
    if status != Status.OK:
        return status
    status = _run(v, x, t)
    return _publish(v, x, t) if status == Status.OK else status

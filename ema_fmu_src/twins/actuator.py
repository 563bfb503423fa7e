"""What every fidelity shares of the actuator: parameters with their faults, controller, mechanics, outputs."""

from typing import NamedTuple

from ..physics import mechanics, monitor, stability, windings
from ..physics.jit import kernel
from ..physics.phases import Abc, three_phases
from ..physics.trig import clamp, sincos
from . import drive, host
from .host import clock
from .layout import FIRST, MOVING, derived, law, now, since
from .memory import port
from .status import Status

COMMON = 2.0
"""`fault.eccentricity_law`: one cosine for all phases (1: shifted, each phase its own)."""


class Motion(NamedTuple):
    """Rotor and user shaft, sine and cosine of theta_e, dry friction in the last step, impulse of the end stops."""

    theta: float
    w: float
    position: float
    s: float
    c: float
    T_f: float
    stop: float


class Means(NamedTuple):
    """Means over a step: quadrature current q, supply current, copper loss."""

    q: float
    supply: float
    loss: float


@kernel
def derive(v, x):
    """Write what follows from the parameters; trigonometry only where there is an eccentricity. Returns a Status."""
    depth = v[port.motor.p] * v[port.fault.zeta]
    if depth >= 1.0:
        return Status.ECCENTRIC
    scale, jam = v[port.fault.friction], v[port.fault.jam]
    half_play = 0.5 * v[port.gear.backlash] * v[port.fault.backlash]
    s, c = 0.0, 1.0
    if depth != 0.0:
        s, c = sincos(v[port.fault.phi])
    x[derived.K_motor] = v[port.fault.gain] * v[port.controller.K_pos] * v[port.gear.ratio]
    x[derived.per_ratio] = 1.0 / v[port.gear.ratio]
    x[derived.T_static] = v[port.mechanics.T_static] * scale + jam
    x[derived.T_coulomb] = v[port.mechanics.T_coulomb] * scale + jam
    x[derived.loss_opposing] = 1.0 / v[port.gear.eta_opposing] - 1.0
    x[derived.loss_aiding] = 1.0 - v[port.gear.eta_aiding]
    x[derived.half_play] = half_play
    x[derived.theta_max] = (v[port.mechanics.end_stop] + half_play) * v[port.gear.ratio]
    s, c = depth * s, depth * c
    if v[port.fault.eccentricity_law] == COMMON:
        (x[derived.z_sin_a], x[derived.z_sin_b], x[derived.z_sin_c]), (
            x[derived.z_cos_a], x[derived.z_cos_b], x[derived.z_cos_c],
        ) = three_phases(s, c)  # fmt: skip
    else:
        x[derived.z_sin_a], x[derived.z_sin_b], x[derived.z_sin_c] = s, s, s
        x[derived.z_cos_a], x[derived.z_cos_b], x[derived.z_cos_c] = c, c, c
    x[derived.K_e] = v[port.motor.K_e] * v[port.fault.magnet]
    x[derived.R] = v[port.motor.R] * v[port.fault.resistance]
    x[derived.smoothing] = monitor.smoothing(x[clock.step], v[port.monitor.tau])
    return drive.derive(v, x)


@kernel
def start(v, x, period, longest, n_states):
    """Write the state at time 0 from the parameters in `v`; `period`, `longest` [s] as in `host.start`. Returns a Status."""
    if longest < stability.SHORTEST:
        return Status.STIFF
    host.start(v, x, period, longest, n_states)
    status = derive(v, x)
    if status != Status.OK:
        return status
    theta_max = x[derived.theta_max]
    theta = clamp(v[port.initial.motor_position], -theta_max, theta_max)
    x[now.theta] = theta
    x[now.w] = v[port.initial.motor_speed]
    x[now.position] = mechanics.user_shaft(
        v[port.initial.position], theta / v[port.gear.ratio], x[derived.half_play], 0.0, v[port.mechanics.end_stop]
    )
    x[now.s], x[now.c] = sincos(v[port.motor.p] * theta)
    x[now.i_a] = v[port.initial.phase_current_a]
    x[now.i_b] = v[port.initial.phase_current_b]
    x[now.i_c] = -v[port.initial.phase_current_a] - v[port.initial.phase_current_b]
    x[now.I_ref] = v[port.initial.reference_current]
    x[now.i_filtered] = v[port.initial.current_filtered]
    x[now.xi] = v[port.initial.integral]
    drive.start(v, x)
    return Status.OK


@kernel
def begin(v, x, tick_length, moving):
    """Begin a communication step; arguments as in `host.take_in`. Returns a Status."""
    x[since.limited] = 0.0
    if host.take_in(v, x, tick_length, moving):
        return derive(v, x)
    return Status.OK


@kernel
def motion(x):
    """The motion as it is now."""
    return Motion(x[now.theta], x[now.w], x[now.position], x[now.s], x[now.c], x[now.T_f], x[now.stop])


@kernel
def write_motion(x, motion):
    """Make `motion` that of now."""
    x[now.theta], x[now.w], x[now.position] = motion.theta, motion.w, motion.position
    x[now.s], x[now.c], x[now.T_f], x[now.stop] = motion.s, motion.c, motion.T_f, motion.stop


@kernel
def currents(x):
    """The phase currents as they are now."""
    return Abc(x[now.i_a], x[now.i_b], x[now.i_c])


@kernel
def write_currents(x, i):
    """Make `i` the phase currents of now."""
    x[now.i_a], x[now.i_b], x[now.i_c] = i


@kernel
def turns(v):
    """N_j of the phases."""
    return Abc(v[port.fault.N_a], v[port.fault.N_b], v[port.fault.N_c])


@kernel
def field(x):
    """The rotor's field with its faults."""
    return windings.Field(
        x[derived.K_e],
        Abc(x[derived.z_cos_a], x[derived.z_cos_b], x[derived.z_cos_c]),
        Abc(x[derived.z_sin_a], x[derived.z_sin_b], x[derived.z_sin_c]),
    )


@kernel
def load_on_rotor(v, x, motion, load_torque):
    """The torque T_L with which the load brakes the rotor."""
    half_play, end_stop = x[derived.half_play], v[port.mechanics.end_stop]
    return mechanics.carried(load_torque, motion.theta * x[derived.per_ratio], half_play, end_stop) * x[derived.per_ratio]


@kernel
def move(v, x, motion, T_m, load_torque, h):
    """Mechanics over a step h under the mean torque T_m: the mean speed, and theta, w, position, friction and the impulse of
    the end stops at its end."""
    friction = mechanics.Friction(
        x[derived.T_static],
        x[derived.T_coulomb],
        v[port.mechanics.T_asymmetry],
        x[derived.loss_opposing],
        x[derived.loss_aiding],
        v[port.mechanics.C],
    )
    J, C = v[port.mechanics.J], v[port.mechanics.C]
    w_new, T_f = mechanics.rotor(motion.w, T_m, load_on_rotor(v, x, motion, load_torque), friction, J, h)
    w_mean = mechanics.mean_speed(motion.w, w_new, C, J, h)
    theta, w = mechanics.end_stop(motion.theta + h * w_mean, w_new, x[derived.theta_max], motion.theta)
    if w != w_new:  # what the back-EMF sees is how far the rotor has come, not how it was pushed
        w_mean = (theta - motion.theta) / h
    position = mechanics.user_shaft(
        motion.position, theta * x[derived.per_ratio], x[derived.half_play], load_torque, v[port.mechanics.end_stop]
    )
    return w_mean, theta, w, position, T_f, motion.stop + J * (w_new - w)


@kernel
def w_ahead(v, x, motion, T_m, load_torque, h):
    """The speed in the middle of a step h, along the acceleration at its beginning.

    With the back-EMF there, the step neither feeds nor damps the swing between the rotor and the currents, whose phase
    advances by a = h*K_e*sqrt(1.5/(J*L)) a step. With that of the beginning it would grow by a^2/4 a step, which cost the
    balance of energy 0.1 % in SIN4, and the position 0.02 % of its range.
    """
    if motion.w == 0.0:
        return 0.0
    C = v[port.mechanics.C]
    T = T_m - load_on_rotor(v, x, motion, load_torque) - motion.T_f - C * motion.w
    return motion.w + 0.5 * h * T / max(v[port.mechanics.J], 0.5 * h * C)


@kernel
def shortened(v, x, h):
    """The whole part of the step h that may be taken at once; 0 if none can."""
    return stability.for_turn(h, v[port.motor.p] * abs(x[now.w]))


@kernel
def on_the_way(v, x, share):
    """Within a step, after `share` of it: what moves is between its values before and now, in proportion."""
    friction, I_ref, xi, limited = x[now.T_f], x[now.I_ref], x[now.xi], x[now.limited]
    for place in range(FIRST, FIRST + len(MOVING)):
        before = x[place + len(MOVING)]
        x[place] = before + share * (x[place] - before)
    x[now.T_f], x[now.I_ref], x[now.xi], x[now.limited] = friction, I_ref, xi, limited
    x[now.s], x[now.c] = sincos(v[port.motor.p] * x[now.theta])


@kernel
def store(v, x, h, motion, i, means, limited):
    """Write the end of a step h of ELF or LF, with the means over it."""
    smoothing = x[derived.smoothing] if h == x[clock.step] else monitor.smoothing(h, v[port.monitor.tau])
    x[now.i_filtered] = monitor.low_pass(x[now.i_filtered], means.q, smoothing)
    x[now.charge] += h * means.supply
    x[now.loss] += h * means.loss
    x[now.limited] = 1.0 if limited else 0.0
    x[since.limited] += x[now.limited]
    write_motion(x, motion)
    write_currents(x, i)


@kernel
def publish(v, x, t):
    """End a communication step at time `t` [s]: write the outputs. Returns a Status."""
    theta, w, s, c, i, i_filtered = x[now.theta], x[now.w], x[now.s], x[now.c], currents(x), x[now.i_filtered]
    charge, loss, stop = x[now.charge], x[now.loss], x[now.stop]
    elapsed = t - x[clock.point]
    sines, cosines = three_phases(s, c)
    k = windings.back_emf_coefficients(turns(v), field(x), sines, cosines)
    v[port.position] = x[now.position]
    v[port.motor_position] = theta
    v[port.motor_speed] = w
    v[port.reference_current] = x[now.I_ref]
    v[port.equivalent_current] = monitor.quadrature_current(i, s, c)
    v[port.equivalent_current_filtered] = i_filtered
    v[port.phase_current_a], v[port.phase_current_b], v[port.phase_current_c] = i
    v[port.back_emf_a], v[port.back_emf_b], v[port.back_emf_c] = windings.back_emf(k, w)
    v[port.motor_torque] = windings.torque(k, i)
    v[port.friction_torque] = x[now.T_f]
    if elapsed > 0.0:
        per_elapsed = 1.0 / elapsed
        v[port.supply_current] = (charge - x[since.charge]) * per_elapsed
        v[port.copper_loss] = (loss - x[since.loss]) * per_elapsed
        v[port.end_stop_torque] = (stop - x[since.stop]) * per_elapsed
    v[port.voltage_saturated] = 1.0 if x[since.limited] + x[now.limited] > 0.0 else 0.0
    v[port.voltage_saturated_real] = v[port.voltage_saturated]
    v[port.controller.integral] = x[now.xi]
    v[port.measured_motor_position] = x[law.motor_position]
    v[port.measured_current] = x[law.q]
    x[clock.point] = t
    x[since.charge] = charge
    x[since.loss] = loss
    x[since.stop] = stop
    total = theta + w + i.a + i.b + i.c + i_filtered + charge + loss
    return Status.OK if total - total == 0.0 else Status.NOT_FINITE

"""LF, the low fidelity: an equivalent single phase.

Shape functions (ours; the paper only says that LF defines some; healthy: f = 1):
f = (2/3)*sum N_j*sin^2(theta_j)*[1 + p*zeta*cos(theta_j - phi)], R_eq = (2/3)*R*sum N_j*sin^2(theta_j) + R_on.
Electrical: e = K_e*f*w, v = clamp(R_eq*I_ref + e + (L/tau)*(I_ref - i), +-V_dc/sqrt(3)), L di/dt = v - R_eq*i - e,
T_m = 1.5*K_e*f*i; tau = 1e-4 s (ours), trapezoidal rule.
Controller: I_ref = clamp(K_p*(w_ref - w), +-current_limit): no integral, no sampling.
Mechanics: J dw/dt = T_m - C*w - T_L - T_f, Borello friction, end stops, backlash.

Covers: faults of friction, backlash, turns, eccentricity, gain, jam, magnet, resistance in the mean and in the leading
harmonic of the torque.
Does not cover: differences between the phase currents, the controller's integral and sampling, the current ripple, the
dead time, a switch that stays open, sensor errors.
"""

import math

from ..physics import controller, equivalent, monitor
from ..physics.jit import kernel
from ..physics.trig import clamp, rotate, sincos, three_phases
from . import frame
from . import layout as at

N_STATES = at.N_STATES
PER_TAU = 1.0 / 1e-4
"""Of the current loop's time constant tau [1/s] (ours: the controller's default period)."""
INV_SQRT3 = 1.0 / math.sqrt(3.0)


@kernel
def initialize(v, x):
    """Start at time 0; returns a status of layout.STATUS."""
    return frame.start(v, x, v[at.STEP])


@kernel
def _step(v, x, to, t, h):
    """One step of length h [s] from the frame OWN at time `t` into the frame `to`."""
    o = at.OWN
    theta, w, position = x[o + at.THETA], x[o + at.W], x[o + at.POSITION]
    i = monitor.quadrature_current(x[o + at.I_A], x[o + at.I_B], x[o + at.I_C], x[o + at.SIN], x[o + at.COS])
    V_dc = max(0.0, frame.held_input(v, x, at.SUPPLY_VOLTAGE, t + 0.5 * h))
    command = frame.held_input(v, x, at.COMMAND, t)
    w_ref = controller.speed_reference(command, position, v[at.FAULT_GAIN] * v[at.K_POS], v[at.RATIO], v[at.SPEED_LIMIT])
    I_ref = controller.speed_p(w_ref, w, v[at.K_P], v[at.CURRENT_LIMIT])

    p = v[at.PAIRS]
    half = 0.5 * h * w
    s, c = sincos(p * (theta + half))
    s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s, c)
    N_a, N_b, N_c = v[at.FAULT_N_A], v[at.FAULT_N_B], v[at.FAULT_N_C]
    z_cos, z_sin = x[at.Z_COS], x[at.Z_SIN]
    f = (
        equivalent.shape(N_a, s_a, c_a, z_cos, z_sin)
        + equivalent.shape(N_b, s_b, c_b, z_cos, z_sin)
        + equivalent.shape(N_c, s_c, c_c, z_cos, z_sin)
    )
    R_copper = equivalent.resistance(x[at.R_HOT], N_a, N_b, N_c, s_a, s_b, s_c)
    R_eq = R_copper + v[at.R_ON]
    K_f = x[at.K_HOT] * f

    e = K_f * w
    L = v[at.L]
    target = i + (I_ref - i) * min(1.0, h * PER_TAU)
    need = R_eq * 0.5 * (i + target) + e + (L / h) * (target - i)
    voltage = clamp(need, -V_dc * INV_SQRT3, V_dc * INV_SQRT3)
    new = i + h * (voltage - e - R_eq * i) / (L + 0.5 * h * R_eq)
    mean = 0.5 * (i + new)

    load = frame.held_input(v, x, at.LOAD_TORQUE, t + 0.5 * h)
    theta, w, position, _, T_f = frame.move(v, x, theta, w, position, 1.5 * K_f * mean, load, h)
    s, c = rotate(s, c, p * (theta - x[o + at.THETA] - half))
    s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s, c)

    supply = 1.5 * voltage * mean / V_dc if V_dc > 0.0 else 0.0
    loss = 1.5 * R_copper * mean * mean
    i_a, i_b, i_c = -new * s_a, -new * s_b, -new * s_c
    frame.store(
        v, x, to, h, theta, w, position, s, c, i_a, i_b, i_c, I_ref, T_f, mean, supply, loss, voltage != need
    )  # fmt: skip


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a status of layout.STATUS."""
    grid = x[at.GRID]
    status = frame.take_in(v, x, grid)
    if status != at.OK:
        return status
    while True:
        now = x[at.TICK] * grid + x[at.OFFSET]
        left = t - now
        if left <= at.CLOSE * grid:
            x[at.PENDING] = 0.0
            break
        h = grid - x[at.OFFSET]
        if h > left + at.CLOSE * grid:
            _step(v, x, at.AT_POINT, now, left)
            x[at.PENDING] = 1.0
            break
        _step(v, x, at.OWN, now, h)
        x[at.TICK] += 1.0
        x[at.OFFSET] = 0.0
        x[at.LIMITED] += x[at.OWN + at.SATURATED]
    return frame.publish(v, x, t)

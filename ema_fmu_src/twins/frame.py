"""What the three twins share: start, the bookkeeping around a communication step, outputs, the mechanical half-step.

A twin moves on its own grid of steps, whatever steps the host takes. A communication point within a step is reached by
a step on trial: the frame OWN stays at the last point of the grid, the frame AT_POINT holds the twin at the
communication point, and the whole step is taken once the host is beyond it. So the results do not depend on how a run
is cut into communication steps, as long as inputs and parameters are constant. A change of the load, of the supply or
of a parameter is an event: the trial step is then kept, and the next step of the twin starts there.
"""

from ..physics import mechanics, monitor, windings
from ..physics.jit import kernel
from ..physics.trig import clamp, sincos, three_phases
from . import layout as at


@kernel
def derive(v, x):
    """Write what follows from the parameters into `x`; trigonometry only where there is an eccentricity."""
    scale, jam = v[at.FAULT_FRICTION], v[at.FAULT_JAM]
    half_play = 0.5 * v[at.BACKLASH] * v[at.FAULT_BACKLASH]
    depth = v[at.PAIRS] * v[at.FAULT_ZETA]
    s, c = 0.0, 1.0
    if depth != 0.0:
        s, c = sincos(v[at.FAULT_PHI])
    x[at.PER_RATIO] = 1.0 / v[at.RATIO]
    x[at.STATIC] = v[at.T_STATIC] * scale + jam
    x[at.COULOMB] = v[at.T_COULOMB] * scale + jam
    x[at.LOSS_OPPOSING] = 1.0 / v[at.ETA_OPPOSING] - 1.0
    x[at.LOSS_AIDING] = 1.0 - v[at.ETA_AIDING]
    x[at.HALF_PLAY] = half_play
    x[at.THETA_MAX] = (v[at.END_STOP] + half_play) * v[at.RATIO]
    x[at.Z_COS], x[at.Z_SIN] = depth * c, depth * s
    x[at.K_HOT] = v[at.K_E] * v[at.FAULT_MAGNET]
    x[at.R_HOT] = v[at.R] * v[at.FAULT_RESISTANCE]
    x[at.SMOOTHING] = x[at.GRID] / (v[at.TAU] + 0.5 * x[at.GRID])


@kernel
def start(v, x, period):
    """Write the twin's state at time 0 from the parameters in `v`; returns a status.

    The twin's own step is the largest that is no longer than solver.step and divides `period` [s].
    """
    for i in range(at.N_STATES):
        x[i] = 0.0
    if v[at.PAIRS] * v[at.FAULT_ZETA] >= 1.0:
        return at.ECCENTRIC
    x[at.PER_PERIOD] = float(int(period / v[at.STEP] + 0.999999))
    x[at.GRID] = period / x[at.PER_PERIOD]
    derive(v, x)
    half_play, theta_max = x[at.HALF_PLAY], x[at.THETA_MAX]
    theta = clamp(v[at.INITIAL], -theta_max, theta_max)
    x[at.OWN + at.THETA] = theta
    x[at.OWN + at.W] = v[at.INITIAL + 1]
    x[at.OWN + at.POSITION] = mechanics.play(v[at.INITIAL + 2], theta / v[at.RATIO], half_play)
    x[at.OWN + at.SIN], x[at.OWN + at.COS] = sincos(v[at.PAIRS] * theta)
    x[at.OWN + at.I_A] = v[at.INITIAL + 3]
    x[at.OWN + at.I_B] = v[at.INITIAL + 4]
    x[at.OWN + at.I_C] = -v[at.INITIAL + 3] - v[at.INITIAL + 4]
    x[at.OWN + at.I_REF] = v[at.INITIAL + 5]
    x[at.OWN + at.REF_COS] = v[at.INITIAL + 5]
    x[at.OWN + at.I_FILTERED] = v[at.INITIAL + 6]
    x[at.OWN + at.XI] = v[at.INITIAL + 7]
    x[at.OWN + at.U_A] = -1.0
    x[at.OWN + at.U_B] = -1.0
    x[at.OWN + at.U_C] = -1.0
    x[at.DUE] = 1.0
    x[at.HELD_LOAD] = v[at.LOAD_TORQUE]
    x[at.HELD_SUPPLY] = v[at.SUPPLY_VOLTAGE]
    publish(v, x, 0.0)
    return at.OK


@kernel
def keep(x, grid):
    """Move the twin's own frame to the communication point, which lies within a step of length `grid` [s]."""
    for i in range(at.FRAME_SIZE):
        x[at.OWN + i] = x[at.AT_POINT + i]
    x[at.OFFSET] = x[at.POINT] - x[at.TICK] * grid
    x[at.PENDING] = 0.0


@kernel
def take_in(v, x, grid):
    """Begin a communication step: notice what the host has changed; returns a status."""
    sloped = x[at.SLOPE] != 0.0 or x[at.SLOPE + 1] != 0.0 or x[at.SLOPE + 2] != 0.0
    stale = x[at.STALE] != 0.0
    changed = x[at.HELD_LOAD] != v[at.LOAD_TORQUE] or x[at.HELD_SUPPLY] != v[at.SUPPLY_VOLTAGE]
    if x[at.PENDING] != 0.0 and (stale or sloped or changed or x[at.RAMPED] != 0.0):
        keep(x, grid)
    x[at.HELD_LOAD] = v[at.LOAD_TORQUE]
    x[at.HELD_SUPPLY] = v[at.SUPPLY_VOLTAGE]
    x[at.RAMPED] = 1.0 if sloped else 0.0
    x[at.STALE] = 0.0
    x[at.LIMITED] = 0.0
    if stale:
        if v[at.PAIRS] * v[at.FAULT_ZETA] >= 1.0:
            return at.ECCENTRIC
        derive(v, x)
    return at.OK


@kernel
def held_input(v, x, which, t):
    """Input number `which` at time `t` [s]: its value at the last communication point and its slope since."""
    return v[which] + x[at.SLOPE + which] * (t - x[at.POINT])


@kernel
def move(v, x, theta, w, position, T_m, load_torque, h):
    """Mechanics over a step h [s] under the mean torque T_m: theta, w, position at its end, the mean speed, friction."""
    T_L = load_torque * x[at.PER_RATIO]
    w_new, T_f = mechanics.rotor(
        w, T_m, T_L, x[at.STATIC], x[at.COULOMB], x[at.LOSS_OPPOSING], x[at.LOSS_AIDING], v[at.C], v[at.J], h
    )
    w_mean = 0.5 * (w + w_new)
    theta_new, w_new = mechanics.end_stop(theta + h * w_mean, w_new, x[at.THETA_MAX])
    return theta_new, w_new, mechanics.play(position, theta_new * x[at.PER_RATIO], x[at.HALF_PLAY]), w_mean, T_f


@kernel
def store(
    v, x, to, h, theta, w, position, s, c, i_a, i_b, i_c, I_ref, T_f, q, supply, loss, saturated,
):  # fmt: skip
    """Write the end of a step of length h [s] from the frame OWN into the frame `to`.

    q, supply, loss: quadrature current [A], supply current [A] and copper loss [W], mean over the step.
    """
    o = at.OWN
    smoothing = x[at.SMOOTHING] if h == x[at.GRID] else h / (v[at.TAU] + 0.5 * h)
    x[to + at.I_FILTERED] = monitor.low_pass(x[o + at.I_FILTERED], q, smoothing)
    x[to + at.CHARGE] = x[o + at.CHARGE] + h * supply
    x[to + at.LOSS] = x[o + at.LOSS] + h * loss
    x[to + at.XI] = x[o + at.XI]
    x[to + at.THETA] = theta
    x[to + at.W] = w
    x[to + at.POSITION] = position
    x[to + at.SIN] = s
    x[to + at.COS] = c
    x[to + at.I_A] = i_a
    x[to + at.I_B] = i_b
    x[to + at.I_C] = i_c
    x[to + at.I_REF] = I_ref
    x[to + at.FRICTION] = T_f
    x[to + at.SATURATED] = 1.0 if saturated else 0.0


@kernel
def publish(v, x, t):
    """End a communication step at time `t` [s]: write the outputs; returns a status."""
    o = at.AT_POINT if x[at.PENDING] != 0.0 else at.OWN
    s, c, w = x[o + at.SIN], x[o + at.COS], x[o + at.W]
    i_a, i_b, i_c = x[o + at.I_A], x[o + at.I_B], x[o + at.I_C]
    s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s, c)
    z_cos, z_sin, K_e = x[at.Z_COS], x[at.Z_SIN], x[at.K_HOT]
    k_a = windings.back_emf_coefficient(v[at.FAULT_N_A], K_e, s_a, c_a, z_cos, z_sin)
    k_b = windings.back_emf_coefficient(v[at.FAULT_N_B], K_e, s_b, c_b, z_cos, z_sin)
    k_c = windings.back_emf_coefficient(v[at.FAULT_N_C], K_e, s_c, c_c, z_cos, z_sin)
    charge, loss = x[o + at.CHARGE], x[o + at.LOSS]
    elapsed = t - x[at.POINT]
    v[at.OUT] = x[o + at.POSITION]
    v[at.OUT + 1] = x[o + at.THETA]
    v[at.OUT + 2] = w
    v[at.OUT + 3] = x[o + at.I_REF]
    v[at.OUT + 4] = monitor.quadrature_current(i_a, i_b, i_c, s, c)
    v[at.OUT + 5] = x[o + at.I_FILTERED]
    v[at.OUT + 6] = i_a
    v[at.OUT + 7] = i_b
    v[at.OUT + 8] = i_c
    v[at.OUT + 9] = k_a * w
    v[at.OUT + 10] = k_b * w
    v[at.OUT + 11] = k_c * w
    v[at.OUT + 12] = windings.torque(k_a, k_b, k_c, i_a, i_b, i_c)
    v[at.OUT + 13] = x[o + at.FRICTION]
    if elapsed > 0.0:
        per_elapsed = 1.0 / elapsed
        v[at.OUT + 14] = (charge - x[at.POINT_CHARGE]) * per_elapsed
        v[at.OUT + 15] = (loss - x[at.POINT_LOSS]) * per_elapsed
    v[at.OUT + 16] = 1.0 if x[at.LIMITED] + x[o + at.SATURATED] > 0.0 else 0.0
    v[at.OUT + 17] = x[o + at.XI]
    x[at.POINT] = t
    x[at.POINT_CHARGE] = charge
    x[at.POINT_LOSS] = loss
    total = x[o + at.THETA] + w + i_a + i_b + i_c + x[o + at.I_FILTERED] + charge + loss
    return at.OK if total - total == 0.0 else at.NOT_FINITE

"""ELF, the enhanced low fidelity: three phases, no switching.

Driver (the paper, Eq. 1): each phase takes its reference current, limited on its own by the supply and its back-EMF,
i_j = clamp(i_ref_j, (-V_dc - e_j)/(R*n_j), (V_dc - e_j)/(R*n_j)); no inductance.
With driver.coupled_saturation (ELF+, ours): the averaged inverter feeds the star through R and L; in saturation the legs
with the largest and the smallest need sit at the rails and the third follows as far as it can (physics/driver.py).
Back-EMF and torque (the paper, Eq. 2): e_j = k_j*w, T_m = sum(k_j*i_j), k at the middle of the step.
Controller: position P and speed PI, sampled every controller.period; ideal resolver.
Mechanics: J dw/dt = T_m - C*w - T_L - T_f, Borello friction, end stops, backlash.

Covers: faults of friction, backlash, turns, eccentricity, gain, jam, magnet, resistance; voltage saturation (ELF+).
Does not cover: the current ripple, the dead time, a switch that stays open, sensor errors; saturation in plain ELF.
"""

from ..physics import controller, driver, monitor, windings
from ..physics.jit import kernel
from ..physics.trig import rotate, sincos, three_phases
from . import frame
from . import layout as at

N_STATES = at.N_STATES


@kernel
def initialize(v, x):
    """Start at time 0; returns a status of layout.STATUS."""
    return frame.start(v, x, v[at.PERIOD])


@kernel
def _sample(v, x, t):
    """The sampled controller at time `t` [s]."""
    o = at.OWN
    w_ref = controller.speed_reference(
        frame.held_input(v, x, at.COMMAND, t),
        x[o + at.POSITION],
        v[at.FAULT_GAIN] * v[at.K_POS],
        v[at.RATIO],
        v[at.SPEED_LIMIT],
    )
    x[o + at.I_REF], x[o + at.XI] = controller.speed_pi(
        w_ref, x[o + at.W], x[o + at.XI], v[at.K_P], v[at.K_I], v[at.PERIOD], v[at.CURRENT_LIMIT]
    )


@kernel
def _step(v, x, to, t, h):
    """One step of length h [s] from the frame OWN at time `t` into the frame `to`."""
    o = at.OWN
    theta, w, I_ref = x[o + at.THETA], x[o + at.W], x[o + at.I_REF]
    i_a, i_b, i_c = x[o + at.I_A], x[o + at.I_B], x[o + at.I_C]
    V_dc = max(0.0, frame.held_input(v, x, at.SUPPLY_VOLTAGE, t + 0.5 * h))
    p = v[at.PAIRS]
    half = 0.5 * h * w
    s, c = sincos(p * (theta + half))
    s_end, c_end = rotate(s, c, p * half)

    z_cos, z_sin, K_e = x[at.Z_COS], x[at.Z_SIN], x[at.K_HOT]
    N_a, N_b, N_c = v[at.FAULT_N_A], v[at.FAULT_N_B], v[at.FAULT_N_C]
    s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s, c)
    k_a = windings.back_emf_coefficient(N_a, K_e, s_a, c_a, z_cos, z_sin)
    k_b = windings.back_emf_coefficient(N_b, K_e, s_b, c_b, z_cos, z_sin)
    k_c = windings.back_emf_coefficient(N_c, K_e, s_c, c_c, z_cos, z_sin)
    r_a, r_b, r_c, c_a, c_b, c_c = three_phases(s_end, c_end)
    ref_a, ref_b, ref_c = -I_ref * r_a, -I_ref * r_b, -I_ref * r_c
    R = x[at.R_HOT]

    if v[at.COUPLED] != 0.0:
        L, R_on = v[at.L], v[at.R_ON]
        R_a, R_b, R_c = N_a * R + R_on, N_b * R + R_on, N_c * R + R_on
        d_a, d_b, d_c = k_a * w + R_a * i_a, k_b * w + R_b * i_b, k_c * w + R_c * i_c
        L_a, L_b, L_c = N_a * N_a * L, N_b * N_b * L, N_c * N_c * L
        per_h = 1.0 / h
        u_a = (ref_a - i_a) * (L_a * per_h + 0.5 * R_a) + d_a
        u_b = (ref_b - i_b) * (L_b * per_h + 0.5 * R_b) + d_b
        u_c = (ref_c - i_c) * (L_c * per_h + 0.5 * R_c) + d_c
        saturated = max(u_a, u_b, u_c) - min(u_a, u_b, u_c) > V_dc
        if saturated:
            g_a = driver.step_admittance(h, R_a, L_a)
            g_b = driver.step_admittance(h, R_b, L_b)
            g_c = driver.step_admittance(h, R_c, L_c)
            u_a, u_b, u_c = driver.saturated_legs(u_a, u_b, u_c, g_a, g_b, g_c, d_a, d_b, d_c, V_dc)
            per_g = windings.per_sum(g_a, g_b, g_c)
            v_n = windings.star_point(u_a - d_a, u_b - d_b, u_c - d_c, g_a, g_b, g_c, per_g)
            new_a = i_a + g_a * (u_a - v_n - d_a)
            new_b = i_b + g_b * (u_b - v_n - d_b)
            new_c = i_c + g_c * (u_c - v_n - d_c)
        else:
            new_a, new_b, new_c = ref_a, ref_b, ref_c
        m_a, m_b, m_c = 0.5 * (i_a + new_a), 0.5 * (i_b + new_b), 0.5 * (i_c + new_c)
    else:
        e_a, e_b, e_c = k_a * w, k_b * w, k_c * w
        new_a = driver.independent_phase(ref_a, e_a, R, N_a, V_dc)
        new_b = driver.independent_phase(ref_b, e_b, R, N_b, V_dc)
        new_c = driver.independent_phase(ref_c, e_c, R, N_c, V_dc)
        saturated = new_a != ref_a or new_b != ref_b or new_c != ref_c
        m_a, m_b, m_c = 0.5 * (i_a + new_a), 0.5 * (i_b + new_b), 0.5 * (i_c + new_c)
        u_a, u_b, u_c = e_a + N_a * R * m_a, e_b + N_b * R * m_b, e_c + N_c * R * m_c

    T_m = windings.torque(k_a, k_b, k_c, m_a, m_b, m_c)
    load = frame.held_input(v, x, at.LOAD_TORQUE, t + 0.5 * h)
    theta, w, position, _, T_f = frame.move(v, x, theta, w, x[o + at.POSITION], T_m, load, h)
    s_end, c_end = rotate(s_end, c_end, p * (theta - x[o + at.THETA] - 2.0 * half))

    supply = (u_a * m_a + u_b * m_b + u_c * m_c) / V_dc if V_dc > 0.0 else 0.0
    loss = R * (N_a * m_a * m_a + N_b * m_b * m_b + N_c * m_c * m_c)
    q = monitor.quadrature_current(m_a, m_b, m_c, s, c)
    frame.store(
        v, x, to, h, theta, w, position, s_end, c_end, new_a, new_b, new_c, I_ref, T_f, q, supply, loss, saturated
    )  # fmt: skip


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a status of layout.STATUS."""
    grid, per_period = x[at.GRID], int(x[at.PER_PERIOD])
    status = frame.take_in(v, x, grid)
    if status != at.OK:
        return status
    while True:
        now = x[at.TICK] * grid + x[at.OFFSET]
        left = t - now
        if left <= at.CLOSE * grid:
            x[at.PENDING] = 0.0
            break
        if x[at.DUE] != 0.0:
            _sample(v, x, now)
            x[at.DUE] = 0.0
        h = grid - x[at.OFFSET]
        if h > left + at.CLOSE * grid:
            _step(v, x, at.AT_POINT, now, left)
            x[at.PENDING] = 1.0
            break
        _step(v, x, at.OWN, now, h)
        x[at.TICK] += 1.0
        x[at.OFFSET] = 0.0
        x[at.LIMITED] += x[at.OWN + at.SATURATED]
        if per_period == 1 or int(x[at.TICK]) % per_period == 0:
            x[at.DUE] = 1.0
    return frame.publish(v, x, t)

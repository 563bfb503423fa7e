"""HF, the high fidelity: switching inverter, hysteresis current control, star-connected three-phase PMSM.

Controller: position P and speed PI, sampled every controller.period through a resolver of 2^bits counts a motor turn;
between the samples the commutation follows the shaft with the angle error latched there: i_ref_j = -I_ref*sin(theta_j).
Inverter: a leg whose current error reaches +-hysteresis commands its upper or lower switch; both switches are off for
the dead time, while a diode conducts (which, the current's sign decides); v_j = +-V_dc/2, R_on in series.
Windings: R_j = N_j*R, L_j = N_j^2*L, v_n = sum((v_j - R_j*i_j - e_j)/L_j)/sum(1/L_j),
L_j di_j/dt = v_j - v_n - R_j*i_j - e_j.
Back-EMF and torque (the paper, Eq. 2): e_j = k_j*w, T_m = sum(k_j*i_j).
Mechanics: J dw/dt = T_m - C*w - T_L - T_f, Borello friction, end stops, backlash.

Between switchings the equations are smooth and are stepped by the midpoint rule (second order). How far a step goes is a
rule of its own: `_step_to_event` (solver.event_located) or `_fixed_step`, always solver.step.

Covers: all faults. Does not cover: iron losses, magnetic saturation, thermal dynamics, forward voltage of the diodes.
"""

from ..physics import controller, inverter, monitor, sensor, windings
from ..physics.jit import kernel
from ..physics.trig import clamp, rotate, sincos, three_phases
from . import frame
from . import layout as at

N_STATES = at.N_STATES
MOST_STEPS = 20000
"""Bound of event-located steps in one controller period; a healthy run takes some 60."""
SHORTEST = 1e-9
"""Shortest step that is aimed at an event [s]: 0.1 mA of the current's slope."""
MARGIN = 4e-3
"""Event-located: a current error this close to the band, as a fraction of it, has reached it. The relative tolerance of an
experiment, if one is given, takes its place, within FINEST and COARSEST."""
FINEST, COARSEST = 1e-5, 0.05
LIMITED_AT = 2.2
"""Current error, in half bands, at the end of a controller period that counts as voltage-limited: the star lets errors
reach 2 without it."""


@kernel
def initialize(v, x):
    """Start at time 0; returns a status of layout.STATUS."""
    return frame.start(v, x, v[at.PERIOD])


@kernel
def _sample(v, x, t):
    """The controller's sample at time `t` [s], on the frame OWN."""
    o = at.OWN
    p, G, bits = v[at.PAIRS], v[at.RATIO], v[at.RESOLVER_BITS]
    theta = x[o + at.THETA]
    measured = sensor.resolver(theta + v[at.FAULT_RESOLVER], bits)
    position = sensor.resolver(x[o + at.POSITION] * G + v[at.FAULT_RESOLVER], bits) / G
    command = frame.held_input(v, x, at.COMMAND, t)
    w_ref = controller.speed_reference(command, position, v[at.FAULT_GAIN] * v[at.K_POS], G, v[at.SPEED_LIMIT])
    I_ref, x[o + at.XI] = controller.speed_pi(
        w_ref, x[o + at.W], x[o + at.XI], v[at.K_P], v[at.K_I], v[at.PERIOD], v[at.CURRENT_LIMIT]
    )
    s, c = sincos(p * (measured - theta))
    x[o + at.I_REF] = I_ref
    x[o + at.REF_COS] = I_ref * c
    x[o + at.REF_SIN] = I_ref * s
    x[o + at.SIN], x[o + at.COS] = sincos(p * theta)


@kernel
def _fixed_step(step, to_tick):
    """The fixed rule [s]: `step`, the last one before the controller's tick taking up what rounding has left."""
    return to_tick if to_tick < 1.5 * step else step


@kernel
def _settle(i_old, i_new, gate):
    """What is left [A] of the current of a leg that is off and whose current has crossed zero in the step: taken off."""
    if gate == 0.0 and i_old * i_new < 0.0:
        return i_new
    if gate == 0.0 and i_old != 0.0 and -1e-9 < i_new < 1e-9:
        return i_new
    return 0.0


@kernel
def _mean(i_old, i_middle, i_new):
    """Mean current [A] over a step: the middle, taken along the first slope, misses the bend one way, the ends another."""
    return (i_old + i_middle + i_new) * (1.0 / 3.0)


@kernel
def _square(i_old, i_new):
    """Mean square [A^2] of a current that is straight over a step."""
    return (i_old * i_old + i_old * i_new + i_new * i_new) * (1.0 / 3.0)


@kernel
def _store(
    x, o, theta, w, position, s, c, i_a, i_b, i_c, u_a, u_b, u_c, rest_a, rest_b, rest_c,
    closing_a, closing_b, closing_c, filtered, charge, loss, friction,
):  # fmt: skip
    """Write what `advance` holds in its variables into the frame at `o`."""
    x[o + at.THETA], x[o + at.W], x[o + at.POSITION] = theta, w, position
    x[o + at.SIN], x[o + at.COS] = s, c
    x[o + at.I_A], x[o + at.I_B], x[o + at.I_C] = i_a, i_b, i_c
    x[o + at.U_A], x[o + at.U_B], x[o + at.U_C] = u_a, u_b, u_c
    x[o + at.REST_A], x[o + at.REST_B], x[o + at.REST_C] = rest_a, rest_b, rest_c
    x[o + at.CLOSING_A], x[o + at.CLOSING_B], x[o + at.CLOSING_C] = closing_a, closing_b, closing_c
    x[o + at.I_FILTERED], x[o + at.CHARGE], x[o + at.LOSS] = filtered, charge, loss
    x[o + at.FRICTION] = friction


@kernel
def advance(v, x, t):
    """Run to time `t` [s] since the start; returns a status of layout.STATUS."""
    T_c = v[at.PERIOD]
    status = frame.take_in(v, x, T_c)
    if status != at.OK:
        return status

    p = v[at.PAIRS]
    N_a, N_b, N_c = v[at.FAULT_N_A], v[at.FAULT_N_B], v[at.FAULT_N_C]
    R = x[at.R_HOT]
    R_on = v[at.R_ON]
    R_a, R_b, R_c = N_a * R + R_on, N_b * R + R_on, N_c * R + R_on
    L = v[at.L]
    G_a, G_b, G_c = 1.0 / (N_a * N_a * L), 1.0 / (N_b * N_b * L), 1.0 / (N_c * N_c * L)
    z_cos, z_sin, K_e = x[at.Z_COS], x[at.Z_SIN], x[at.K_HOT]
    band, dead_time = v[at.HYSTERESIS], v[at.DEAD_TIME]
    off_a, off_b, off_c = v[at.FAULT_OFFSET_A], v[at.FAULT_OFFSET_B], v[at.FAULT_OFFSET_C]
    open_a = inverter.open_side(v[at.FAULT_OPEN_SWITCH], 0)
    open_b = inverter.open_side(v[at.FAULT_OPEN_SWITCH], 1)
    open_c = inverter.open_side(v[at.FAULT_OPEN_SWITCH], 2)
    per_G = windings.per_sum(G_a, G_b, G_c)
    tau = v[at.TAU]
    located = v[at.EVENT_LOCATED] != 0.0
    largest = x[at.GRID]
    tolerance = clamp(x[at.TOLERANCE], FINEST, COARSEST) if x[at.TOLERANCE] > 0.0 else MARGIN
    margin = tolerance * band if located else 0.0
    close = at.CLOSE * largest
    steps = 0

    o = at.OWN
    theta, w, position = x[o + at.THETA], x[o + at.W], x[o + at.POSITION]
    s, c = x[o + at.SIN], x[o + at.COS]
    i_a, i_b, i_c = x[o + at.I_A], x[o + at.I_B], x[o + at.I_C]
    u_a, u_b, u_c = x[o + at.U_A], x[o + at.U_B], x[o + at.U_C]
    rest_a, rest_b, rest_c = x[o + at.REST_A], x[o + at.REST_B], x[o + at.REST_C]
    closing_a, closing_b, closing_c = x[o + at.CLOSING_A], x[o + at.CLOSING_B], x[o + at.CLOSING_C]
    filtered, charge, loss = x[o + at.I_FILTERED], x[o + at.CHARGE], x[o + at.LOSS]
    friction = x[o + at.FRICTION]
    I_cos, I_sin = x[o + at.REF_COS], x[o + at.REF_SIN]
    elapsed = x[at.OFFSET]
    x[at.PENDING] = 0.0

    while True:
        s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s, c)
        left = t - (x[at.TICK] * T_c + elapsed)
        if left <= close:
            break
        if x[at.DUE] != 0.0:
            x[o + at.THETA], x[o + at.W], x[o + at.POSITION] = theta, w, position
            _sample(v, x, x[at.TICK] * T_c)
            s, c = x[o + at.SIN], x[o + at.COS]
            s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s, c)
            I_cos, I_sin = x[o + at.REF_COS], x[o + at.REF_SIN]
            x[at.DUE] = 0.0
            steps = 0

        # comparators, switches, rails
        error_a = controller.phase_reference(I_cos, I_sin, s_a, c_a) - i_a - off_a
        error_b = controller.phase_reference(I_cos, I_sin, s_b, c_b) - i_b - off_b
        error_c = controller.phase_reference(I_cos, I_sin, s_c, c_c) - i_c - off_c
        u_a, rest_a = inverter.hysteresis(u_a, rest_a, error_a, band, margin, dead_time, closing_a)
        u_b, rest_b = inverter.hysteresis(u_b, rest_b, error_b, band, margin, dead_time, closing_b)
        u_c, rest_c = inverter.hysteresis(u_c, rest_c, error_c, band, margin, dead_time, closing_c)
        gate_a = inverter.gate(u_a, rest_a, open_a)
        gate_b = inverter.gate(u_b, rest_b, open_b)
        gate_c = inverter.gate(u_c, rest_c, open_c)
        rail_a, rail_b, rail_c = inverter.rail(gate_a, i_a), inverter.rail(gate_b, i_b), inverter.rail(gate_c, i_c)

        V_dc = max(0.0, frame.held_input(v, x, at.SUPPLY_VOLTAGE, t - left))
        k_a = windings.back_emf_coefficient(N_a, K_e, s_a, c_a, z_cos, z_sin)
        k_b = windings.back_emf_coefficient(N_b, K_e, s_b, c_b, z_cos, z_sin)
        k_c = windings.back_emf_coefficient(N_c, K_e, s_c, c_c, z_cos, z_sin)
        e_a, e_b, e_c = k_a * w, k_b * w, k_c * w
        g_a, g_b, g_c, per_g = G_a, G_b, G_c, per_G
        if rail_a == 0.0 or rail_b == 0.0 or rail_c == 0.0:
            g_a = G_a if rail_a != 0.0 else 0.0
            g_b = G_b if rail_b != 0.0 else 0.0
            g_c = G_c if rail_c != 0.0 else 0.0
            v_n = windings.star_point(
                0.5 * V_dc * rail_a - R_a * i_a - e_a,
                0.5 * V_dc * rail_b - R_b * i_b - e_b,
                0.5 * V_dc * rail_c - R_c * i_c - e_c,
                g_a,
                g_b,
                g_c,
                windings.per_sum(g_a, g_b, g_c),
            )
            if rail_a == 0.0:
                rail_a = inverter.forward_biased(v_n + e_a, V_dc)
                g_a = G_a if rail_a != 0.0 else 0.0
            if rail_b == 0.0:
                rail_b = inverter.forward_biased(v_n + e_b, V_dc)
                g_b = G_b if rail_b != 0.0 else 0.0
            if rail_c == 0.0:
                rail_c = inverter.forward_biased(v_n + e_c, V_dc)
                g_c = G_c if rail_c != 0.0 else 0.0
            per_g = windings.per_sum(g_a, g_b, g_c)
        v_a, v_b, v_c = 0.5 * V_dc * rail_a, 0.5 * V_dc * rail_b, 0.5 * V_dc * rail_c
        d_a, d_b, d_c = v_a - R_a * i_a - e_a, v_b - R_b * i_b - e_b, v_c - R_c * i_c - e_c
        v_n = windings.star_point(d_a, d_b, d_c, g_a, g_b, g_c, per_g)
        f_a, f_b, f_c = g_a * (d_a - v_n), g_b * (d_b - v_n), g_c * (d_c - v_n)

        if located:
            turn = p * w
            closing_a = u_a * (f_a + turn * (I_cos * c_a - I_sin * s_a))
            closing_b = u_b * (f_b + turn * (I_cos * c_b - I_sin * s_b))
            closing_c = u_c * (f_c + turn * (I_cos * c_c - I_sin * s_c))
            most = min(largest, T_c - elapsed)
            h = inverter.time_to_event(
                most, u_a, error_a, closing_a, band, dead_time, rest_a, gate_a, rail_a, i_a, f_a, R_a * G_a
            )
            h = inverter.time_to_event(
                h, u_b, error_b, closing_b, band, dead_time, rest_b, gate_b, rail_b, i_b, f_b, R_b * G_b
            )
            h = inverter.time_to_event(
                h, u_c, error_c, closing_c, band, dead_time, rest_c, gate_c, rail_c, i_c, f_c, R_c * G_c
            )
            h = min(most, max(h, SHORTEST))
            steps += 1
            if steps > MOST_STEPS:
                return at.STUCK
        else:
            h = _fixed_step(largest, T_c - elapsed)
        on_trial = h > left + close
        if on_trial:
            _store(
                x, o, theta, w, position, s, c, i_a, i_b, i_c, u_a, u_b, u_c, rest_a, rest_b, rest_c,
                closing_a, closing_b, closing_c, filtered, charge, loss, friction,
            )  # fmt: skip
            x[at.OFFSET] = elapsed
            for i in range(at.FRAME_SIZE):
                x[at.AT_POINT + i] = x[at.OWN + i]
            x[at.PENDING] = 1.0
            o = at.AT_POINT
            h = left

        # midpoint rule: everything at the middle from the slopes at the beginning, the step from the slopes there
        s_m, c_m = rotate(s, c, 0.5 * p * w * h)
        s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s_m, c_m)
        k_a = windings.back_emf_coefficient(N_a, K_e, s_a, c_a, z_cos, z_sin)
        k_b = windings.back_emf_coefficient(N_b, K_e, s_b, c_b, z_cos, z_sin)
        k_c = windings.back_emf_coefficient(N_c, K_e, s_c, c_c, z_cos, z_sin)
        m_a, m_b, m_c = i_a + 0.5 * h * f_a, i_b + 0.5 * h * f_b, i_c + 0.5 * h * f_c
        T_m = windings.torque(k_a, k_b, k_c, m_a, m_b, m_c)
        load = frame.held_input(v, x, at.LOAD_TORQUE, t - left + 0.5 * h)
        theta_new, w_new, position, w_mean, friction = frame.move(v, x, theta, w, position, T_m, load, h)
        d_a, d_b, d_c = v_a - R_a * m_a - k_a * w_mean, v_b - R_b * m_b - k_b * w_mean, v_c - R_c * m_c - k_c * w_mean
        v_n = windings.star_point(d_a, d_b, d_c, g_a, g_b, g_c, per_g)
        new_a, new_b, new_c = i_a + h * g_a * (d_a - v_n), i_b + h * g_b * (d_b - v_n), i_c + h * g_c * (d_c - v_n)
        if gate_a * gate_b * gate_c == 0.0:
            cut_a = _settle(i_a, new_a, inverter.gate(u_a, rest_a - h, open_a))
            cut_b = _settle(i_b, new_b, inverter.gate(u_b, rest_b - h, open_b))
            cut_c = _settle(i_c, new_c, inverter.gate(u_c, rest_c - h, open_c))
            if cut_a != 0.0:
                new_a, new_b, new_c = 0.0, new_b + 0.5 * cut_a, new_c + 0.5 * cut_a
            if cut_b != 0.0:
                new_a, new_b, new_c = new_a + 0.5 * cut_b, 0.0, new_c + 0.5 * cut_b
            if cut_c != 0.0:
                new_a, new_b, new_c = new_a + 0.5 * cut_c, new_b + 0.5 * cut_c, 0.0

        # what is summed up takes the currents' bend within the step into account: third order, at one step a commutation
        loss += h * R * (N_a * _square(i_a, new_a) + N_b * _square(i_b, new_b) + N_c * _square(i_c, new_c))
        m_a, m_b, m_c = _mean(i_a, m_a, new_a), _mean(i_b, m_b, new_b), _mean(i_c, m_c, new_c)
        q = monitor.quadrature_current(m_a, m_b, m_c, s_m, c_m)
        filtered = monitor.low_pass(filtered, q, h / (tau + 0.5 * h))
        charge += 0.5 * h * (rail_a * m_a + rail_b * m_b + rail_c * m_c)
        s, c = rotate(s, c, p * (theta_new - theta))
        theta, w = theta_new, w_new
        i_a, i_b, i_c = new_a, new_b, new_c
        rest_a, rest_b, rest_c = rest_a - h, rest_b - h, rest_c - h
        if on_trial:
            break
        elapsed += h
        if elapsed >= T_c - close:
            elapsed = 0.0
            x[at.TICK] += 1.0
            x[at.DUE] = 1.0
            s_a, s_b, s_c, c_a, c_b, c_c = three_phases(s, c)
            error = max(
                abs(controller.phase_reference(I_cos, I_sin, s_a, c_a) - i_a - off_a),
                abs(controller.phase_reference(I_cos, I_sin, s_b, c_b) - i_b - off_b),
                abs(controller.phase_reference(I_cos, I_sin, s_c, c_c) - i_c - off_c),
            )
            x[o + at.SATURATED] = 1.0 if error > LIMITED_AT * band else 0.0
            x[at.LIMITED] += x[o + at.SATURATED]

    _store(
        x, o, theta, w, position, s, c, i_a, i_b, i_c, u_a, u_b, u_c, rest_a, rest_b, rest_c,
        closing_a, closing_b, closing_c, filtered, charge, loss, friction,
    )  # fmt: skip
    if x[at.PENDING] == 0.0:
        x[at.OFFSET] = elapsed
    return frame.publish(v, x, t)

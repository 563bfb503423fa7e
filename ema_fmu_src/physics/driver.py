"""The drivers without switching: ELF's independent phases (the paper, Eq. 1) and the coupled saturation of ELF+ (ours)."""

from .jit import kernel
from .trig import clamp


@kernel
def independent_phase(i_ref_j, e_j, R, N_j, V_dc):
    """i_j = clamp(i_ref_j, (-V_dc - e_j)/(R*n_j), (V_dc - e_j)/(R*n_j)) [A] (the paper, Eq. 1).

    Ours: n_j is the fraction of turns that are NOT shorted; the paper's "percentage in short" would give an infinite
    current in a healthy phase.
    """
    return clamp(i_ref_j, (-V_dc - e_j) / (R * N_j), (V_dc - e_j) / (R * N_j))


@kernel
def step_admittance(h, R_j, L_j):
    """a_j = (h/L_j)/(1 + h*R_j/(2*L_j)) [S]: change of current over a step h by the trapezoidal rule, per volt."""
    return h / (L_j + 0.5 * h * R_j)


@kernel
def _middle(need_m, a_m, c_m, a_h, c_h, a_l, c_l, V_dc):
    """Voltage of the leg between the two rails: what its reference needs, as far as the rails let it."""
    total = a_h + a_l + a_m
    A = a_h * (0.5 * V_dc - c_h) + a_l * (-0.5 * V_dc - c_l) - a_m * c_m
    return clamp((need_m + A / total) / (1.0 - a_m / total), -0.5 * V_dc, 0.5 * V_dc)


@kernel
def saturated_legs(need_a, need_b, need_c, a_a, a_b, a_c, c_a, c_b, c_c, V_dc):
    """Leg voltages u_a, u_b, u_c [V] about the mid-point in saturation (ours).

    The leg with the largest need sits at +V_dc/2, that with the smallest at -V_dc/2, and the third follows its
    reference as far as it can. need_j = (i_ref_j - i_j)/a_j + c_j, c_j = e_j + R_j*i_j.
    """
    high = 0.5 * V_dc
    low = -high
    if need_a >= need_b:
        if need_b >= need_c:
            return high, _middle(need_b, a_b, c_b, a_a, c_a, a_c, c_c, V_dc), low
        if need_a >= need_c:
            return high, low, _middle(need_c, a_c, c_c, a_a, c_a, a_b, c_b, V_dc)
        return _middle(need_a, a_a, c_a, a_c, c_c, a_b, c_b, V_dc), low, high
    if need_a >= need_c:
        return _middle(need_a, a_a, c_a, a_b, c_b, a_c, c_c, V_dc), high, low
    if need_b >= need_c:
        return low, high, _middle(need_c, a_c, c_c, a_b, c_b, a_a, c_a, V_dc)
    return low, _middle(need_b, a_b, c_b, a_c, c_c, a_a, c_a, V_dc), high

"""What the supply lets the currents be, without switching: ELF's independent phases (the paper, Eq. 1) and the coupled
saturation of ELF+ (ours)."""

from typing import NamedTuple

from .jit import kernel
from .phases import Abc
from .trig import clamp
from .windings import per_sum, star_point


class Driven(NamedTuple):
    """A step of the driver: currents at its end, mean currents, mean leg voltages, and whether some phase was limited."""

    i: Abc
    i_mean: Abc
    v: Abc
    limited: bool


@kernel
def _mean(i, i_new):
    return Abc(0.5 * (i.a + i_new.a), 0.5 * (i.b + i_new.b), 0.5 * (i.c + i_new.c))


@kernel
def independent_phase(i_ref_j, e_j, R, N_j, V_dc):
    """i_j = clamp(i_ref_j, (-V_dc - e_j)/(R*n_j), (V_dc - e_j)/(R*n_j)) (the paper, Eq. 1).

    Ours: n_j is the fraction of turns that are NOT shorted; the paper's "percentage in short" would give an infinite
    current in a healthy phase.
    """
    return clamp(i_ref_j, (-V_dc - e_j) / (R * N_j), (V_dc - e_j) / (R * N_j))


@kernel
def independent(i, i_ref, e, R, N, V_dc):
    """ELF's step: each phase limited on its own, no inductance."""
    i_new = Abc(
        independent_phase(i_ref.a, e.a, R, N.a, V_dc),
        independent_phase(i_ref.b, e.b, R, N.b, V_dc),
        independent_phase(i_ref.c, e.c, R, N.c, V_dc),
    )
    i_mean = _mean(i, i_new)
    v = Abc(e.a + N.a * R * i_mean.a, e.b + N.b * R * i_mean.b, e.c + N.c * R * i_mean.c)
    return Driven(i_new, i_mean, v, i_new.a != i_ref.a or i_new.b != i_ref.b or i_new.c != i_ref.c)


@kernel
def coupled(i, i_ref, e, R, L, V_dc, h):
    """ELF+'s step h: the references where the averaged inverter can reach them (the star point floats), else saturation.

    need_j = (i_ref_j - i_j)/y_j + hold_j, y_j = (h/L_j)/(1 + h*R_j/(2*L_j)), hold_j = e_j + R_j*i_j.
    """
    hold = Abc(e.a + R.a * i.a, e.b + R.b * i.b, e.c + R.c * i.c)
    per_h = 1.0 / h
    need = Abc(
        (i_ref.a - i.a) * (L.a * per_h + 0.5 * R.a) + hold.a,
        (i_ref.b - i.b) * (L.b * per_h + 0.5 * R.b) + hold.b,
        (i_ref.c - i.c) * (L.c * per_h + 0.5 * R.c) + hold.c,
    )
    limited = max(need.a, need.b, need.c) - min(need.a, need.b, need.c) > V_dc
    if not limited:
        return Driven(i_ref, _mean(i, i_ref), need, limited)
    y = Abc(step_admittance(h, R.a, L.a), step_admittance(h, R.b, L.b), step_admittance(h, R.c, L.c))
    v = saturated_legs(need, y, hold, V_dc)
    v_n = star_point(Abc(v.a - hold.a, v.b - hold.b, v.c - hold.c), y, per_sum(y))
    i_new = Abc(
        i.a + y.a * (v.a - v_n - hold.a),
        i.b + y.b * (v.b - v_n - hold.b),
        i.c + y.c * (v.c - v_n - hold.c),
    )
    return Driven(i_new, _mean(i, i_new), v, limited)


@kernel
def step_admittance(h, R_j, L_j):
    """y_j = (h/L_j)/(1 + h*R_j/(2*L_j)): change of current over a step h by the trapezoidal rule, per volt."""
    return h / (L_j + 0.5 * h * R_j)


@kernel
def _middle(need_m, y_m, hold_m, y_h, hold_h, y_l, hold_l, V_dc):
    """Voltage of the leg between the two rails: what its reference needs, as far as the rails let it."""
    total = y_h + y_l + y_m
    A = y_h * (0.5 * V_dc - hold_h) + y_l * (-0.5 * V_dc - hold_l) - y_m * hold_m
    return clamp((need_m + A / total) / (1.0 - y_m / total), -0.5 * V_dc, 0.5 * V_dc)


@kernel
def saturated_legs(need, y, hold, V_dc):
    """Leg voltages v_j about the mid-point in saturation (ours).

    The leg with the largest need sits at +V_dc/2, that with the smallest at -V_dc/2, and the third follows its
    reference as far as it can.
    """
    high = 0.5 * V_dc
    low = -high
    if need.a >= need.b:
        if need.b >= need.c:
            return Abc(high, _middle(need.b, y.b, hold.b, y.a, hold.a, y.c, hold.c, V_dc), low)
        if need.a >= need.c:
            return Abc(high, low, _middle(need.c, y.c, hold.c, y.a, hold.a, y.b, hold.b, V_dc))
        return Abc(_middle(need.a, y.a, hold.a, y.c, hold.c, y.b, hold.b, V_dc), low, high)
    if need.a >= need.c:
        return Abc(_middle(need.a, y.a, hold.a, y.b, hold.b, y.c, hold.c, V_dc), high, low)
    if need.b >= need.c:
        return Abc(low, high, _middle(need.c, y.c, hold.c, y.b, hold.b, y.a, hold.a, V_dc))
    return Abc(low, _middle(need.b, y.b, hold.b, y.c, hold.c, y.a, hold.a, V_dc), high)

"""What the supply lets the currents be, without switching: ELF's independent phases (the paper, Eq. 1) and the coupled
saturation of ELF+ (ours)."""

from typing import NamedTuple

from .jit import kernel
from .phases import Abc
from .trig import clamp
from .windings import mean_currents, per_sum, star_point, step_impedance


class Driven(NamedTuple):
    """A step of the driver: currents at its end, mean currents, mean leg voltages, and whether some phase was limited."""

    i: Abc
    i_mean: Abc
    v: Abc
    limited: bool


@kernel
def independent_phase(i_ref_j, e_j, R, N_j, V_dc):
    """i_j = clamp(i_ref_j, (-V_dc - e_j)/(R*n_j), (V_dc - e_j)/(R*n_j)) (the paper, Eq. 1).

    Ours: n_j is the fraction of turns that are NOT shorted; the paper's "percentage in short" would give an infinite
    current in a healthy phase.
    """
    return clamp(i_ref_j, (-V_dc - e_j) / (R * N_j), (V_dc - e_j) / (R * N_j))


@kernel
def needs(i, i_ref, e, phases, per_h):
    """What the currents ask of the legs over a step h = 1/per_h: the voltages hold_j = e_j + R_j*i_j that keep them as they
    are, need_j = (i_ref_j - i_j)/y_j + hold_j that take them to their references, and 1/y_j."""
    R, L = phases
    impedance = Abc(step_impedance(L.a * per_h, R.a), step_impedance(L.b * per_h, R.b), step_impedance(L.c * per_h, R.c))
    hold = Abc(e.a + R.a * i.a, e.b + R.b * i.b, e.c + R.c * i.c)
    need = Abc(
        (i_ref.a - i.a) * impedance.a + hold.a,
        (i_ref.b - i.b) * impedance.b + hold.b,
        (i_ref.c - i.c) * impedance.c + hold.c,
    )
    return hold, need, impedance


@kernel
def beyond(need, V_dc):
    """Whether the inverter cannot give the leg voltages `need`, wherever the star point floats: some phase is limited."""
    return max(need.a, need.b, need.c) - min(need.a, need.b, need.c) > V_dc


@kernel
def independent(i, i_ref, e, R, N, phases, V_dc, h):
    """ELF's step h: each phase limited on its own, no inductance. Whether a phase is limited is told by what the coupled
    windings would need, since ELF errs there long before its own limit acts."""
    i_new = Abc(
        independent_phase(i_ref.a, e.a, R, N.a, V_dc),
        independent_phase(i_ref.b, e.b, R, N.b, V_dc),
        independent_phase(i_ref.c, e.c, R, N.c, V_dc),
    )
    i_mean = Abc(0.5 * (i.a + i_new.a), 0.5 * (i.b + i_new.b), 0.5 * (i.c + i_new.c))
    v = Abc(e.a + N.a * R * i_mean.a, e.b + N.b * R * i_mean.b, e.c + N.c * R * i_mean.c)
    _, need, _ = needs(i, i_ref, e, phases, 1.0 / h)
    return Driven(i_new, i_mean, v, beyond(need, V_dc))


@kernel
def coupled(i, i_ref, e, phases, V_dc, h):
    """ELF+'s step h: the references where the averaged inverter can reach them (the star point floats), else saturation."""
    hold, need, z = needs(i, i_ref, e, phases, 1.0 / h)
    limited = beyond(need, V_dc)
    if not limited:
        return Driven(i_ref, mean_currents(i, i_ref, phases, h), need, limited)
    y = Abc(1.0 / z.a, 1.0 / z.b, 1.0 / z.c)
    v = saturated_legs(need, y, hold, V_dc)
    v_n = star_point(Abc(v.a - hold.a, v.b - hold.b, v.c - hold.c), y, per_sum(y))
    i_new = Abc(
        i.a + y.a * (v.a - v_n - hold.a),
        i.b + y.b * (v.b - v_n - hold.b),
        i.c + y.c * (v.c - v_n - hold.c),
    )
    return Driven(i_new, mean_currents(i, i_new, phases, h), v, limited)


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

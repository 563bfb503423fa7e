"""LF's equivalent single phase: its shape functions (ours; the paper only says that LF defines some) and its current."""

import math
from typing import NamedTuple

from .jit import kernel
from .trig import clamp
from .windings import mean_share, step_impedance

TAU = 1e-4
"""Time constant of the current loop [s] (ours: the controller's default period)."""
PER_TAU = 1.0 / TAU
SIX_STEP = 2.0 / math.pi
"""Amplitude of a phase voltage's fundamental over V_dc when the inverter switches but six times a period: the most that
hysteresis control reaches, and LF's ceiling."""
RECTIFIED = 3.0 / math.pi
"""Bus current of a three-phase diode bridge over the amplitude of its phase currents, mean over a period."""


class Driven(NamedTuple):
    """A step of the single phase: the current at its end and in the mean, the voltage, and whether that was limited."""

    i: float
    i_mean: float
    v: float
    limited: bool


@kernel
def _share(N_j, z_cos_j, z_sin_j, s_j, c_j):
    return (2.0 / 3.0) * N_j * s_j * s_j * (1.0 + z_cos_j * c_j + z_sin_j * s_j)


@kernel
def shape(N, field, s, c):
    """f = (2/3)*sum N_j*sin^2(theta_j)*[1 + p*zeta*cos(theta_j - phi_j)]; healthy: f = 1."""
    return (
        _share(N.a, field.z_cos.a, field.z_sin.a, s.a, c.a)
        + _share(N.b, field.z_cos.b, field.z_sin.b, s.b, c.b)
        + _share(N.c, field.z_cos.c, field.z_sin.c, s.c, c.c)
    )


@kernel
def resistance(R, N, s):
    """R_eq without R_on: (2/3)*R*sum N_j*sin^2(theta_j)."""
    return (2.0 / 3.0) * R * (N.a * s.a * s.a + N.b * s.b * s.b + N.c * s.c * s.c)


@kernel
def ideal_change(i, I_ref, h):
    """By how much an ideal drive changes the current in a step h: towards I_ref with the time constant tau."""
    return (I_ref - i) * min(1.0, h * PER_TAU)


@kernel
def current(i, change, e, R_eq, L, V_dc, w_e, h):
    """A step h of the equivalent current (ours): L di/dt = v - R_eq*i - e, by the rule of `windings.step_impedance`.

    v changes the current by `change`, as far as the six-step voltage 2*V_dc/pi reaches beside what the turning current needs
    across it, w_e*L*i.
    """
    share = mean_share(h * R_eq, L)
    need = R_eq * (i + share * change) + e + (L / h) * change
    across = w_e * L * i
    reach = math.sqrt(max(0.0, (V_dc * SIX_STEP) ** 2 - across * across))
    v = clamp(need, -reach, reach)
    change = (v - e - R_eq * i) / step_impedance(L / h, R_eq)
    return Driven(i + change, i + share * change, v, v != need)

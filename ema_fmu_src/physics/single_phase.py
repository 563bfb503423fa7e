"""LF's equivalent single phase: its shape functions (ours; the paper only says that LF defines some) and its current."""

import math

from .jit import kernel
from .trig import clamp

PER_TAU = 1.0 / 1e-4
"""Of the current loop's time constant tau [1/s] (ours: the controller's default period)."""
INV_SQRT3 = 1.0 / math.sqrt(3.0)


@kernel
def _share(N_j, field, s_j, c_j):
    return (2.0 / 3.0) * N_j * s_j * s_j * (1.0 + field.z_cos * c_j + field.z_sin * s_j)


@kernel
def shape(N, field, s, c):
    """f = (2/3)*sum N_j*sin^2(theta_j)*[1 + p*zeta*cos(theta_j - phi)]; healthy: f = 1."""
    return _share(N.a, field, s.a, c.a) + _share(N.b, field, s.b, c.b) + _share(N.c, field, s.c, c.c)


@kernel
def resistance(R, N, s):
    """R_eq without R_on: (2/3)*R*sum N_j*sin^2(theta_j)."""
    return (2.0 / 3.0) * R * (N.a * s.a * s.a + N.b * s.b * s.b + N.c * s.c * s.c)


@kernel
def current(i, I_ref, e, R_eq, L, V_dc, h):
    """The equivalent current after a step h, the voltage during it, and whether that was limited (ours).

    L di/dt = v - R_eq*i - e by the trapezoidal rule; v takes the current to I_ref with the time constant tau as far as
    +-V_dc/sqrt(3) reaches.
    """
    target = i + (I_ref - i) * min(1.0, h * PER_TAU)
    need = R_eq * 0.5 * (i + target) + e + (L / h) * (target - i)
    v = clamp(need, -V_dc * INV_SQRT3, V_dc * INV_SQRT3)
    return i + h * (v - e - R_eq * i) / (L + 0.5 * h * R_eq), v, v != need

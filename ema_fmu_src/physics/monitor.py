"""The equivalent single-phase current: Clarke and Park transforms, and the low-pass."""

import math

from .jit import kernel

INV_SQRT3 = 1.0 / math.sqrt(3.0)


@kernel
def quadrature_current(i, s, c):
    """-i_alpha*sin(theta_e) + i_beta*cos(theta_e), i_alpha = (2 i_a - i_b - i_c)/3, i_beta = (i_b - i_c)/sqrt(3)."""
    i_alpha = (2.0 * i.a - i.b - i.c) * (1.0 / 3.0)
    i_beta = (i.b - i.c) * INV_SQRT3
    return i_beta * c - i_alpha * s


@kernel
def smoothing(h, tau):
    """What a step h does to a low-pass of tau: h/(tau + h/2), the trapezoidal rule; 1, settled, where h > 2*tau."""
    return min(1.0, h / (tau + 0.5 * h))


@kernel
def low_pass(i_filtered, q, smoothing):
    """First-order low-pass after a step h with the mean q; `smoothing` is that of the step."""
    return i_filtered + (q - i_filtered) * smoothing

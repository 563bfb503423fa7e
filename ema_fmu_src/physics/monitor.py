"""The equivalent single-phase current: Clarke and Park transforms, and the low-pass."""

from .frame import to_frame
from .jit import kernel


@kernel
def quadrature_current(i, s, c):
    """-i_alpha*sin(theta_e) + i_beta*cos(theta_e), i_alpha = (2 i_a - i_b - i_c)/3, i_beta = (i_b - i_c)/sqrt(3)."""
    return to_frame(i, s, c).q


@kernel
def smoothing(h, tau):
    """What a step h does to a low-pass of tau: h/(tau + h/2), the trapezoidal rule; 1, settled, where h > 2*tau."""
    return min(1.0, h / (tau + 0.5 * h))


@kernel
def low_pass(i_filtered, q, smoothing):
    """First-order low-pass after a step h with the mean q; `smoothing` is that of the step."""
    return i_filtered + (q - i_filtered) * smoothing

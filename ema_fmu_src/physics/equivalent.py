"""LF's equivalent single phase: its shape functions (ours; the paper only says that LF defines some)."""

from .jit import kernel


@kernel
def shape(N_j, s_j, c_j, z_cos, z_sin):
    """One phase's share of f = (2/3)*sum N_j*sin^2(theta_j)*[1 + p*zeta*cos(theta_j - phi)] [1]; healthy: f = 1."""
    return (2.0 / 3.0) * N_j * s_j * s_j * (1.0 + z_cos * c_j + z_sin * s_j)


@kernel
def resistance(R, N_a, N_b, N_c, s_a, s_b, s_c):
    """R_eq = (2/3)*R*sum N_j*sin^2(theta_j) [Ohm]."""
    return (2.0 / 3.0) * R * (N_a * s_a * s_a + N_b * s_b * s_b + N_c * s_c * s_c)

"""Back-EMF with shorted turns and eccentricity (the paper, Eq. 2), and the star-connected windings."""

from .jit import kernel


@kernel
def back_emf_coefficient(N_j, K_e, s_j, c_j, z_cos, z_sin):
    """k_j = -N_j*K_e*sin(theta_j)*[1 + p*zeta*cos(theta_j - phi)] [V.s/rad] (the paper, Eq. 2).

    z_cos, z_sin = p*zeta*(cos, sin)(phi). That the cosine shifts with the phase is ours.
    """
    return -N_j * K_e * s_j * (1.0 + z_cos * c_j + z_sin * s_j)


@kernel
def star_point(d_a, d_b, d_c, g_a, g_b, g_c):
    """Voltage of the star point [V]: sum(g_j*d_j)/sum(g_j), d_j = v_j - R_j*i_j - e_j, g_j = 1/L_j; 0 if no leg conducts.

    Exact for unequal phases; a leg that does not conduct has g_j = 0.
    """
    total = g_a + g_b + g_c
    if total <= 0.0:
        return 0.0
    return (g_a * d_a + g_b * d_b + g_c * d_c) / total


@kernel
def torque(k_a, k_b, k_c, i_a, i_b, i_c):
    """T_m = sum(k_j*i_j) [N.m]."""
    return k_a * i_a + k_b * i_b + k_c * i_c

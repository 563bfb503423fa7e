"""Back-EMF with shorted turns and eccentricity (the paper, Eq. 2), and the star-connected windings."""

from .jit import kernel


@kernel
def back_emf_coefficient(N_j, K_e, s_j, c_j, z_cos, z_sin):
    """k_j = -N_j*K_e*sin(theta_j)*[1 + p*zeta*cos(theta_j - phi)] [V.s/rad] (the paper, Eq. 2).

    z_cos, z_sin = p*zeta*(cos, sin)(phi). That the cosine shifts with the phase is ours.
    """
    return -N_j * K_e * s_j * (1.0 + z_cos * c_j + z_sin * s_j)


@kernel
def star_point(d_a, d_b, d_c, g_a, g_b, g_c, per_g):
    """Voltage of the star point [V]: sum(g_j*d_j)/sum(g_j), d_j = v_j - R_j*i_j - e_j, g_j = 1/L_j.

    Exact for unequal phases; a leg that does not conduct has g_j = 0. per_g = 1/sum(g_j), as `per_sum` gives it.
    """
    return (g_a * d_a + g_b * d_b + g_c * d_c) * per_g


@kernel
def per_sum(g_a, g_b, g_c):
    """1/(g_a + g_b + g_c); 0 if no leg conducts."""
    total = g_a + g_b + g_c
    return 1.0 / total if total > 0.0 else 0.0


@kernel
def torque(k_a, k_b, k_c, i_a, i_b, i_c):
    """T_m = sum(k_j*i_j) [N.m]."""
    return k_a * i_a + k_b * i_b + k_c * i_c

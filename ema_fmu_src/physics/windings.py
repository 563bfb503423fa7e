"""Back-EMF with shorted turns and eccentricity (the paper, Eq. 2), and the star-connected windings."""

from typing import NamedTuple

from .jit import kernel
from .phases import Abc


class Field(NamedTuple):
    """The rotor as the windings see it: its magnets and its eccentricity, z_cos, z_sin = p*zeta*(cos, sin)(phi)."""

    K_e: float
    z_cos: float
    z_sin: float


class Star(NamedTuple):
    """The star-connected phases: R_j with a switch or a diode in series, g_j = 1/L_j, and 1/sum(g_j)."""

    R: Abc
    g: Abc
    per_g: float


@kernel
def star(N, R, R_on, L):
    """The star with R_j = N_j*R + R_on and L_j = N_j^2*L."""
    g = Abc(1.0 / (N.a * N.a * L), 1.0 / (N.b * N.b * L), 1.0 / (N.c * N.c * L))
    return Star(Abc(N.a * R + R_on, N.b * R + R_on, N.c * R + R_on), g, per_sum(g))


@kernel
def back_emf_coefficient(N_j, field, s_j, c_j):
    """k_j = -N_j*K_e*sin(theta_j)*[1 + p*zeta*cos(theta_j - phi)] (the paper, Eq. 2; that the cosine shifts is ours)."""
    return -N_j * field.K_e * s_j * (1.0 + field.z_cos * c_j + field.z_sin * s_j)


@kernel
def back_emf_coefficients(N, field, s, c):
    """k_j of the three phases."""
    return Abc(
        back_emf_coefficient(N.a, field, s.a, c.a),
        back_emf_coefficient(N.b, field, s.b, c.b),
        back_emf_coefficient(N.c, field, s.c, c.c),
    )


@kernel
def back_emf(k, w):
    """e_j = k_j*w (the paper, Eq. 2)."""
    return Abc(k.a * w, k.b * w, k.c * w)


@kernel
def torque(k, i):
    """T_m = sum(k_j*i_j)."""
    return k.a * i.a + k.b * i.b + k.c * i.c


@kernel
def inductor_voltages(v, R, i, e):
    """d_j = v_j - R_j*i_j - e_j: what is left for the inductances and the star point."""
    return Abc(v.a - R.a * i.a - e.a, v.b - R.b * i.b - e.b, v.c - R.c * i.c - e.c)


@kernel
def star_point(d, g, per_g):
    """v_n = sum(g_j*d_j)/sum(g_j), exact for unequal phases; g_j = 0 in a leg that does not conduct."""
    return (g.a * d.a + g.b * d.b + g.c * d.c) * per_g


@kernel
def per_sum(g):
    """1/sum(g_j); 0 if no leg conducts."""
    total = g.a + g.b + g.c
    return 1.0 / total if total > 0.0 else 0.0

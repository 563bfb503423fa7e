"""Back-EMF with shorted turns and eccentricity (the paper, Eq. 2), and the star-connected windings."""

from typing import NamedTuple

from .jit import kernel
from .phases import Abc


class Field(NamedTuple):
    """The rotor as the windings see it: its magnets and its eccentricity, z_cos_j, z_sin_j = p*zeta*(cos, sin)(phi_j).

    Eq. 2 is given for phase a. Its cosine either shifts with the phase, phi_j = phi (ours), or is common to the phases,
    cos(theta_e - phi) = cos(theta_j - phi_j) with phi_j = phi - 2*pi*j/3.
    """

    K_e: float
    z_cos: Abc
    z_sin: Abc


class Series(NamedTuple):
    """Resistance and inductance in each phase, that of a switch or a diode included."""

    R: Abc
    L: Abc


class Star(NamedTuple):
    """The star-connected phases: R_j with a switch or a diode in series, g_j = 1/L_j, 1/sum(g_j), and the fastest decay, the
    largest R_j*g_j."""

    R: Abc
    g: Abc
    per_g: float
    decay: float


@kernel
def series(N, R, R_on, L):
    """R_j = N_j*R + R_on and L_j = N_j^2*L."""
    return Series(Abc(N.a * R + R_on, N.b * R + R_on, N.c * R + R_on), Abc(N.a * N.a * L, N.b * N.b * L, N.c * N.c * L))


@kernel
def star(phases):
    """The phases connected in a star."""
    R, L = phases
    g = Abc(1.0 / L.a, 1.0 / L.b, 1.0 / L.c)
    return Star(R, g, per_sum(g), max(R.a * g.a, R.b * g.b, R.c * g.c))


@kernel
def damping(z_j):
    """Factor of the step of a current that decays by z_j = h*R_j/L_j in it: the trapezoidal rule's 1/(1 + z_j/2), and from
    z_j = 2 on, where that would overshoot, the 1/z_j that leads to the steady current (ours)."""
    return 1.0 / max(1.0 + 0.5 * z_j, z_j)


@kernel
def mean_share(hR_j, L_j):
    """Where between its ends the mean current of such a step lies: in the middle, and from z_j = 2 on at 1 - 1/z_j."""
    return 0.5 if hR_j <= 2.0 * L_j else 1.0 - L_j / hR_j


@kernel
def mean_currents(i, i_new, phases, h):
    """Mean currents of such a step h."""
    R, L = phases
    return Abc(
        i.a + (i_new.a - i.a) * mean_share(h * R.a, L.a),
        i.b + (i_new.b - i.b) * mean_share(h * R.b, L.b),
        i.c + (i_new.c - i.c) * mean_share(h * R.c, L.c),
    )


@kernel
def step_impedance(X_L, R_j):
    """1/y_j: voltage per change of current over such a step, X_L + R_j/2 by the trapezoidal rule, X_L = L_j/h; R_j where the
    current settles within the step."""
    return max(X_L + 0.5 * R_j, R_j)


@kernel
def back_emf_coefficient(N_j, K_e, z_cos_j, z_sin_j, s_j, c_j):
    """k_j = -N_j*K_e*sin(theta_j)*[1 + p*zeta*cos(theta_j - phi_j)] (the paper, Eq. 2)."""
    return -N_j * K_e * s_j * (1.0 + z_cos_j * c_j + z_sin_j * s_j)


@kernel
def back_emf_coefficients(N, field, s, c):
    """k_j of the three phases."""
    return Abc(
        back_emf_coefficient(N.a, field.K_e, field.z_cos.a, field.z_sin.a, s.a, c.a),
        back_emf_coefficient(N.b, field.K_e, field.z_cos.b, field.z_sin.b, s.b, c.b),
        back_emf_coefficient(N.c, field.K_e, field.z_cos.c, field.z_sin.c, s.c, c.c),
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
def bend(star, g, per_g, slope):
    """How fast the slopes of the currents decay, -d2i_j/dt2, at steady voltages: R_j*g_j*slope_j less the star's part."""
    R = star.R
    drop = Abc(R.a * slope.a, R.b * slope.b, R.c * slope.c)
    v_n = star_point(drop, g, per_g)
    return Abc(g.a * (drop.a - v_n), g.b * (drop.b - v_n), g.c * (drop.c - v_n))


@kernel
def per_sum(g):
    """1/sum(g_j); 0 if no leg conducts."""
    total = g.a + g.b + g.c
    return 1.0 / total if total > 0.0 else 0.0

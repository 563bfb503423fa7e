"""Position P and speed PI in cascade (the paper's structure; the clamps and the anti-windup rule are ours)."""

from .jit import kernel
from .trig import clamp


@kernel
def speed_reference(command, position, K_pos, G, speed_limit):
    """w_ref = clamp(K_pos*G*(command - position), +-speed_limit) [rad/s]; K_pos [1/s] includes fault.gain."""
    return clamp(K_pos * G * (command - position), -speed_limit, speed_limit)


@kernel
def speed_pi(w_ref, w, xi, K_p, K_i, T_c, current_limit):
    """Current reference and integral [A] of the sampled speed PI: u = K_p*e + xi, I_ref = clamp(u, +-limit).

    Conditional anti-windup: the integral moves only while the output is free or the error drives it back.
    """
    e = w_ref - w
    u = K_p * e + xi
    I_ref = clamp(u, -current_limit, current_limit)
    if u == I_ref or e * u < 0.0:
        xi += K_i * e * T_c
    return I_ref, xi


@kernel
def speed_p(w_ref, w, K_p, current_limit):
    """LF's simplified control logic: I_ref = clamp(K_p*(w_ref - w), +-limit) [A], no integral, no sampling."""
    return clamp(K_p * (w_ref - w), -current_limit, current_limit)


@kernel
def phase_reference(I_cos, I_sin, s_j, c_j):
    """i_ref_j = -I_ref*sin(theta_j + delta) [A], with I_cos, I_sin = I_ref*(cos, sin)(delta) and delta the electrical
    error of the measured angle."""
    return -(I_cos * s_j + I_sin * c_j)

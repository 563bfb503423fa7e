"""Position P and speed PI in cascade (the paper's structure; the clamps and the anti-windup rule are ours)."""

from typing import NamedTuple

from ..jit import kernel
from ..trig import clamp


class Gains(NamedTuple):
    """The cascade's parameters; K_motor = K_pos*G, the gain of the position loop as the motor sees it."""

    K_motor: float
    speed_limit: float
    K_p: float
    K_i: float
    T_c: float
    current_limit: float


@kernel
def speed_reference(gains, command, position):
    """w_ref = clamp(K_pos*G*(command - position), +-speed_limit)."""
    return clamp(gains.K_motor * (command - position), -gains.speed_limit, gains.speed_limit)


@kernel
def speed_pi(gains, w_ref, w, xi):
    """I_ref and xi after a sample: u = K_p*e_w + xi, e_w = w_ref - w, I_ref = clamp(u, +-current_limit).

    Conditional anti-windup: the integral moves only while the output is free or the error drives it back.
    """
    e_w = w_ref - w
    u = gains.K_p * e_w + xi
    I_ref = clamp(u, -gains.current_limit, gains.current_limit)
    if u == I_ref or e_w * u < 0.0:
        xi += gains.K_i * e_w * gains.T_c
    return I_ref, xi


@kernel
def sampled(gains, command, position, w, xi):
    """I_ref and xi after a sample of the whole cascade."""
    return speed_pi(gains, speed_reference(gains, command, position), w, xi)


@kernel
def continuous(gains, command, position, w):
    """LF's simplified control logic: I_ref = clamp(K_p*(w_ref - w), +-current_limit), no integral, no sampling."""
    w_ref = speed_reference(gains, command, position)
    return clamp(gains.K_p * (w_ref - w), -gains.current_limit, gains.current_limit)


@kernel
def carrying_integral(gains, command, position, w, I_ref):
    """The xi with which the next sample of the cascade goes on from I_ref without a jump: I_ref - K_p*(w_ref - w)."""
    return I_ref - gains.K_p * (speed_reference(gains, command, position) - w)

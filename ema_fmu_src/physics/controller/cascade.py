"""Position P and speed PI in cascade (the paper's structure; the clamps and the anti-windup rule are ours), with a filtered
derivative of the speed error and feed-forward where they are asked for (the paper's "detailed PID")."""

from typing import NamedTuple

from ..jit import kernel
from ..trig import clamp
from . import derivative


class Gains(NamedTuple):
    """The cascade's parameters; K_motor = K_pos*G, the gain of the position loop as the motor sees it."""

    K_motor: float
    speed_limit: float
    K_p: float
    K_i: float
    K_d: float
    T_d: float
    T_c: float
    current_limit: float


@kernel
def speed_reference(gains, command, position):
    """w_ref = clamp(K_pos*G*(command - position), +-speed_limit)."""
    return clamp(gains.K_motor * (command - position), -gains.speed_limit, gains.speed_limit)


@kernel
def sampled(gains, ahead, command, position, w, memory):
    """I_ref and the memory after a sample: u = K_p*e_w + xi + K_d*D(e_w) + ahead [A], e_w = w_ref - w,
    I_ref = clamp(u, +-current_limit).

    Conditional anti-windup: the integral moves only while the output is free or the error drives it back.
    """
    e_w = speed_reference(gains, command, position) - w
    xi, D = memory.xi, 0.0
    u = gains.K_p * e_w + xi
    if gains.K_d != 0.0:
        if memory.samples >= 1.0:
            D = derivative.backward(memory.D, gains.K_d, gains.T_d, e_w - memory.e_d, gains.T_c)
        u += D
    u += ahead
    I_ref = clamp(u, -gains.current_limit, gains.current_limit)
    if u == I_ref or e_w * u < 0.0:
        xi += gains.K_i * e_w * gains.T_c
    return I_ref, derivative.Memory(xi, D, e_w, 1.0)


@kernel
def carrying_integral(gains, command, position, w, I_ref):
    """The xi with which the next sample of the cascade goes on from I_ref without a jump: I_ref - K_p*(w_ref - w)."""
    return I_ref - gains.K_p * (speed_reference(gains, command, position) - w)

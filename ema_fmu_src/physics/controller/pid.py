"""PID on the motor's position, straight to the current reference (ours; as drives that one can buy have it).

Without limits it is the cascade of `cascade` with K_p = K_pos*K_p' + K_i', K_i = K_i'*K_pos, K_d = K_p', b = K_pos*K_p'/K_p,
c = 0, T_f -> 0, where the primes are the cascade's and the gear has no play. With a limit active they are different laws.
"""

from typing import NamedTuple

from ..jit import kernel
from ..trig import clamp
from . import derivative


class Gains(NamedTuple):
    """The PID's parameters; `scale` is the fault of its gain."""

    scale: float
    K_p: float
    K_i: float
    K_d: float
    T_f: float
    b_weight: float
    c_weight: float
    T_c: float
    current_limit: float


@kernel
def sampled(gains, ahead, r, y, w, memory):
    """I_ref and the memory after a sample, r = G*command, y the measured motor position:
    u = scale*K_p*(b*r - y) + xi + K_d*s/(1 + T_f*s)*(c*r - y) + ahead [A], I_ref = clamp(u, +-current_limit).

    The derivative begins at that of a steady speed w, with which the command moves. Conditional anti-windup: the integral
    moves by scale*K_i*(r - y)*T_c only while the output is free or the position error drives it back.
    """
    e, e_d = r - y, gains.c_weight * r - y
    if memory.samples >= 1.0:
        D = derivative.backward(memory.D, gains.K_d, gains.T_f, e_d - memory.e_d, gains.T_c)
    else:
        D = -(1.0 - gains.c_weight) * gains.K_d * w
    u = gains.scale * gains.K_p * (gains.b_weight * r - y) + memory.xi + D + ahead
    I_ref = clamp(u, -gains.current_limit, gains.current_limit)
    xi = memory.xi
    if u == I_ref or e * u < 0.0:
        xi += gains.scale * gains.K_i * e * gains.T_c
    return I_ref, derivative.Memory(xi, D, e_d, 1.0)


@kernel
def continuous(gains, ahead, r, y, w, h, memory):
    """LF's, at each step h [s] of its own: as `sampled`, with the filter that the sampling in effect is, T_f + T_c/2, for a
    period. (-K_d*w + c*K_d*dr/dt without a filter would be 6 % off where a held command steps and T_f is long.)"""
    filtered = max(0.0, gains.T_f + 0.5 * (gains.T_c - h))
    own = Gains(
        gains.scale, gains.K_p, gains.K_i, gains.K_d, filtered, gains.b_weight, gains.c_weight, h, gains.current_limit
    )
    return sampled(own, ahead, r, y, w, memory)

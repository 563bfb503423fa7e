"""What the control laws share: what they remember from sample to sample, filtered derivatives, feed-forward (ours)."""

from typing import NamedTuple

from ..jit import kernel


class Memory(NamedTuple):
    """What a law remembers: its integral part, its derivative part, what that is the derivative of, the commanded motor
    position at the last sample and its last change, and how many samples there have been (2 and more count as 2)."""

    xi: float
    D: float
    e_d: float
    r: float
    dr: float
    samples: float


class Forward(NamedTuple):
    """Gains of the feed-forward of the commanded motor speed and acceleration."""

    speed: float
    acceleration: float


@kernel
def backward(D, K_d, T_f, change, T):
    """K_d*s/(1 + T_f*s) after a sample in which its input has changed by `change`: backward difference, in effect a filter
    of T_f + T/2 (the trapezoidal rule would ring for T_f < T/2)."""
    return (T_f * D + K_d * change) / (T_f + T)


@kernel
def ahead(forward, memory, r, T):
    """Feed-forward of r = G*command by its first and second backward difference; 0 until there are samples enough."""
    dr = r - memory.r
    u = 0.0
    if memory.samples >= 1.0:
        u = forward.speed * dr / T
    if memory.samples >= 2.0:
        u += forward.acceleration * (dr - memory.dr) / (T * T)
    return u


@kernel
def after(memory, xi, D, e_d, r):
    """The memory after a sample."""
    dr = r - memory.r if memory.samples >= 1.0 else 0.0
    return Memory(xi, D, e_d, r, dr, min(2.0, memory.samples + 1.0))

"""What the control laws share: what they remember from sample to sample, filtered derivatives, feed-forward (ours)."""

from typing import NamedTuple

from ..jit import kernel


class Memory(NamedTuple):
    """What a law remembers: its integral part, its derivative part, what that is the derivative of, and whether there has
    been a sample (`samples` > 0)."""

    xi: float
    D: float
    e_d: float
    samples: float


class Commanded(NamedTuple):
    """The commanded motor position at the last look, its change then, and how many looks there have been, at most 2."""

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
def ahead(forward, last, r, w, T):
    """Feed-forward of r = G*command by its first and second backward difference over T [s], and the look for the next time.

    At the first look the command is taken to move with the motor, at w; the second difference waits for three looks.
    """
    dr = r - last.r if last.samples >= 1.0 else w * T
    u = forward.speed * dr / T
    if last.samples >= 2.0:
        u += forward.acceleration * (dr - last.dr) / (T * T)
    return u, Commanded(r, dr, min(2.0, last.samples + 1.0))

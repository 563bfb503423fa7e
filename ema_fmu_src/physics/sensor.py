"""Resolver or encoder: a quantised angle (ours). The converter's own tracking loop gives the speed, taken as ideal."""

import math

from .jit import kernel

TURN = 2.0 * math.pi


@kernel
def resolver(angle, bits, counts):
    """`angle` [rad] rounded to the nearest of `counts` a turn or, where these are 0, of 2^bits; bits = 0 is ideal."""
    if counts > 0.0:
        count = TURN / counts
    elif bits < 0.5:
        return angle
    else:
        count = TURN / (1 << int(bits))
    steps = angle / count
    if not -1e15 < steps < 1e15:
        return angle
    return int(steps + (0.5 if steps >= 0.0 else -0.5)) * count

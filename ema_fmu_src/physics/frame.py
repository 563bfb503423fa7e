"""The rotor's frame: the transforms of Clarke and Park, both ways. The d axis lies along the magnets, q ahead of it."""

import math
from typing import NamedTuple

from .jit import kernel
from .phases import HALF_SQRT3, Abc

INV_SQRT3 = 1.0 / math.sqrt(3.0)


class Dq(NamedTuple):
    """One quantity in the rotor's frame."""

    d: float
    q: float


@kernel
def to_frame(i, s, c):
    """d and q of three phases, at the angle of which sine and cosine are given; what they have in common drops out."""
    alpha = (2.0 * i.a - i.b - i.c) * (1.0 / 3.0)
    beta = (i.b - i.c) * INV_SQRT3
    return Dq(alpha * c + beta * s, beta * c - alpha * s)


@kernel
def to_phases(dq, s, c):
    """The phases of a vector in the rotor's frame; their sum is 0."""
    alpha, beta = dq.d * c - dq.q * s, dq.d * s + dq.q * c
    return Abc(alpha, -0.5 * alpha + HALF_SQRT3 * beta, -0.5 * alpha - HALF_SQRT3 * beta)

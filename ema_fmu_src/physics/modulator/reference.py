"""The phase currents that are asked for: the commutation of I_ref with the shaft."""

from typing import NamedTuple

from ..jit import kernel
from ..phases import Abc


class Reference(NamedTuple):
    """I_ref*(cos, sin)(delta), delta the electrical error of the measured angle when it was latched."""

    cos: float
    sin: float


@kernel
def ideal(I_ref, s):
    """i_ref_j = -I_ref*sin(theta_j), commutated by an ideal resolver."""
    return Abc(-I_ref * s.a, -I_ref * s.b, -I_ref * s.c)


@kernel
def commutated(ref, s_j, c_j):
    """i_ref_j = -I_ref*sin(theta_j + delta)."""
    return -(ref.cos * s_j + ref.sin * c_j)


@kernel
def errors(ref, s, c, i, offset):
    """i_ref_j - i_j as the current sensors see it: `offset` is what they add."""
    return Abc(
        commutated(ref, s.a, c.a) - i.a - offset.a,
        commutated(ref, s.b, c.b) - i.b - offset.b,
        commutated(ref, s.c, c.c) - i.c - offset.c,
    )

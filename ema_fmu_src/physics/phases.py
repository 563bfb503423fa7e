"""A quantity of the three phases, and the angles at which they see the rotor."""

import math
from typing import Any, NamedTuple

from .jit import kernel

HALF_SQRT3 = math.sqrt(3.0) / 2.0


class Abc(NamedTuple):
    """One quantity in the phases a, b, c: a number each, or a record of several."""

    a: Any
    b: Any
    c: Any


@kernel
def three_phases(s, c):
    """Sines and cosines of theta_j = theta_e - 2*pi*j/3, j = a, b, c, from those of theta_e."""
    return (
        Abc(s, -0.5 * s - HALF_SQRT3 * c, -0.5 * s + HALF_SQRT3 * c),
        Abc(c, -0.5 * c + HALF_SQRT3 * s, -0.5 * c - HALF_SQRT3 * s),
    )

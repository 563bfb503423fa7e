"""Sine and cosine of our own, so that every platform gives the same bits (a C library's differ in the last place)."""

import math

from .jit import kernel

TWO_OVER_PI = 2.0 / math.pi
PIO2_HIGH = 1.57079632673412561417e00
"""The first 33 bits of pi/2, so that a small integer times it is exact (Cody and Waite)."""
PIO2_LOW = 6.07710050650619224932e-11
NAN = math.nan


@kernel
def sincos(angle):
    """Sine and cosine of `angle` [rad], to 1e-15 for |angle| < 1e6; NaN beyond 1e9 and for NaN.

    Minimax polynomials on [-pi/4, pi/4] with fdlibm's coefficients (k_sin.c, k_cos.c) after reduction by pi/2.
    """
    if not -1e9 < angle < 1e9:
        return NAN, NAN
    quarter = int(angle * TWO_OVER_PI + (0.5 if angle >= 0.0 else -0.5))
    r = (angle - quarter * PIO2_HIGH) - quarter * PIO2_LOW
    z = r * r
    s = r + r * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
            )
        )
    )
    c = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666666019037e-02
            + z
            * (
                -1.38888888888741095749e-03
                + z
                * (
                    2.48015872894767294178e-05
                    + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
                )
            )
        )
    )
    quadrant = quarter & 3
    if quadrant == 0:
        return s, c
    if quadrant == 1:
        return c, -s
    if quadrant == 2:
        return -s, -c
    return -c, s


@kernel
def rotate(s, c, angle):
    """Sine and cosine of an angle advanced by the small `angle` [rad], from its sine `s` and cosine `c`.

    Taylor polynomials, error below 1e-11 for |angle| <= 0.05; beyond that the polynomial of `sincos`. A third of the cost
    of `sincos` in HF's step.
    """
    if -0.05 <= angle <= 0.05:
        z = angle * angle
        sd = angle * (1.0 - z * (1.0 / 6.0) * (1.0 - z * 0.05))
        cd = 1.0 - 0.5 * z * (1.0 - z * (1.0 / 12.0))
    else:
        sd, cd = sincos(angle)
    return s * cd + c * sd, c * cd - s * sd


@kernel
def clamp(value, low, high):
    """`value` held within [low, high]; NaN passes through."""
    if value < low:
        return low
    if value > high:
        return high
    return value

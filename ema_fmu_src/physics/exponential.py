"""Exponential and complex logarithm of our own, so that every platform gives the same bits (a C library's differ)."""

import math

from .jit import kernel

HALVINGS = 6
"""How often a logarithm takes the root of its argument before the series: within 3 % of 1 for what lies in 1/7 to 7."""


@kernel
def root(x):
    """Square root; 0 below 0, for a compiler that knows so much makes an instruction of it and not a call."""
    return math.sqrt(max(0.0, x))


@kernel
def exp(x):
    """e^x to 1e-14 for x <= 0, the decays that are asked for; 0 below -700."""
    if x < -700.0:
        return 0.0
    squarings = 0
    while x < -0.125:
        x *= 0.5
        squarings += 1
    e = 1.0 + x * (
        1.0
        + x
        * (
            1.0 / 2.0
            + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0 + x * (1.0 / 5040.0 + x / 40320.0)))))
        )
    )
    for _ in range(squarings):
        e *= e
    return e


@kernel
def log(re, im):
    """Principal logarithm, its real and imaginary part, of re + j*im, im >= 0, within 1e-3 to 1e3 of 0, to 1e-13."""
    for _ in range(HALVINGS):
        size = root(re * re + im * im)
        if re >= 0.0:
            re = root(0.5 * (size + re))
            im *= 0.5 / re
        else:
            re, im = im, root(0.5 * (size - re))
            re *= 0.5 / im
    # 2*artanh(q), q = (z - 1)/(z + 1)
    below = (re + 1.0) * (re + 1.0) + im * im
    q_re, q_im = (re * re + im * im - 1.0) / below, 2.0 * im / below
    s_re, s_im = q_re * q_re - q_im * q_im, 2.0 * q_re * q_im
    sum_re, sum_im = 0.0, 0.0
    for n in range(13, 0, -2):
        sum_re, sum_im = s_re * sum_re - s_im * sum_im + 1.0 / n, s_re * sum_im + s_im * sum_re
    scale = 2.0 * 2.0**HALVINGS
    return scale * (q_re * sum_re - q_im * sum_im), scale * (q_re * sum_im + q_im * sum_re)

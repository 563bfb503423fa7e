"""The drive's sampled current loop in the rotor's frame, and what it does over any time in closed form (ours).

Windings there: v = R*i + L*di/dt + j*w_e*L*i + j*K_e*w, i = i_d + j*i_q. The loop, sampled every T, twice a carrier period:
u = K*(r - i) + xi + j*decoupling*w_e*L*i + j*emf_forward*K_e*w, r = j*I_ref, and xi grows by K_i*T*(r - i). Gains by
bandwidth cancel the windings' pole and leave exp(-bandwidth*T) a sample. Where the inverter falls short, xi follows what it
gave, by K_i*T/K of the difference (back-calculation: an integral that is held can lock where the back-EMF is not fed
forward, when a drive is started at speed).

Over a step h of the averaged twins, x = r - i and y = xi - R*r - D, D a steady disturbance, become M*(x, y), M the power
h/T of one sample's matrix: what HF's samples would do, whatever the step.
"""

from typing import NamedTuple

from .exponential import exp, log, root
from .frame import Dq
from .jit import kernel
from .trig import sincos

APART = 1e-5
"""Eigenvalues that are nearer to each other than this are taken apart by it: their power is then a difference."""
LEAST = 1e-3
"""Least size of an eigenvalue, which has settled within a sample."""


class Loop(NamedTuple):
    """The loop's gains K [V/A], K_i [V/(A.s)], its period T [s], the machine that it was designed for, and what it feeds
    forward."""

    K: float
    K_i: float
    T: float
    R: float
    L: float
    K_e: float
    decoupling: float
    emf_forward: float


class Response(NamedTuple):
    """How the loop settles: the eigenvalues of a sample, exp((-decay_1 +- j*turning)*T) or exp(-decay_1*T) and
    exp(-decay_2*T) [1/s, rad/s], and M of a sample."""

    decay_1: float
    decay_2: float
    turning: float
    M_xx: float
    M_xy: float
    M_yx: float


class Passage(NamedTuple):
    """A step: M, the resistance `stiff` [V/A] by which it opposes a current that it did not expect, where between
    its ends the mean current lies, and how much of the difference from the inverter's voltage xi takes up."""

    M_xx: float
    M_xy: float
    M_yx: float
    M_yy: float
    stiff: float
    share: float
    follow: float


@kernel
def gains(R, L, T, bandwidth, K_p, K_i):
    """K and K_i of the loop: the stated ones where K_p > 0, else those of which the pole is exp(-bandwidth*T) exactly."""
    if K_p > 0.0:
        return K_p, K_i
    K = R * (1.0 - exp(-bandwidth * T))
    return K / (1.0 - exp(-R * T / L)), K / T


@kernel
def response(loop):
    """How the loop settles; a decay that is not positive is that of a loop which does not."""
    K, K_i, T, R, L = loop.K, loop.K_i, loop.T, loop.R, loop.L
    A = exp(-R * T / L)
    M_xx, M_xy, M_yx = A - (1.0 - A) * K / R, (A - 1.0) / R, K_i * T
    half, product = 0.5 * (M_xx + 1.0), M_xx - M_xy * M_yx
    below = half * half - product
    if below < 0.0:
        size, angle = log(half, root(-below))
        return Response(-size / T, -size / T, angle / T, M_xx, M_xy, M_yx)
    apart = root(below)
    if half - apart < 0.0:  # rings from sample to sample: no power of it is real
        return Response(-1.0, -1.0, 0.0, M_xx, M_xy, M_yx)
    fast, _ = log(max(LEAST, half - apart), 0.0)
    slow, _ = log(max(LEAST, half + apart), 0.0)
    if slow - fast < APART * abs(fast):
        fast = slow * (1.0 + APART)
    return Response(-fast / T, -slow / T, 0.0, M_xx, M_xy, M_yx)


@kernel
def _power(of, T, h):
    """c_1 and c_0 with M = c_1*M_T + c_0."""
    if of.turning != 0.0:
        s_1, _ = sincos(of.turning * T)
        s_n, _ = sincos(of.turning * h)
        s_less, _ = sincos(of.turning * (h - T))
        size = exp(-of.decay_1 * h)
        return size / exp(-of.decay_1 * T) * s_n / s_1, -size * s_less / s_1
    fast, slow = exp(-of.decay_1 * T), exp(-of.decay_2 * T)
    fast_h, slow_h = exp(-of.decay_1 * h), exp(-of.decay_2 * h)
    per = 1.0 / (fast - slow)
    return (fast_h - slow_h) * per, (fast * slow_h - slow * fast_h) * per


@kernel
def over(loop, of, h):
    """What the loop does over a step h."""
    c_1, c_0 = _power(of, loop.T, h)
    M_xy = c_1 * of.M_xy
    settling = of.decay_1 * h
    share = 0.5 + settling / 12.0 if settling < 1e-3 else 1.0 / (1.0 - exp(-settling)) - 1.0 / settling
    return Passage(
        c_1 * of.M_xx + c_0,
        M_xy,
        c_1 * of.M_yx,
        c_1 + c_0,
        -1.0 / M_xy - loop.L / h - 0.5 * loop.R,
        share,
        1.0 - exp(-loop.K_i * h / loop.K),
    )


@kernel
def voltages(loop, I_ref, xi, i, w, w_e):
    """u [V] that the loop asks for, at the currents `i` and the mechanical speed w [rad/s]."""
    x = loop.decoupling * w_e * loop.L
    return Dq(
        xi.d - loop.K * i.d - x * i.q,
        xi.q + loop.K * (I_ref - i.q) + x * i.d + loop.emf_forward * loop.K_e * w,
    )


@kernel
def integrated(loop, I_ref, xi, i, u, given):
    """xi after a sample, in which the inverter gave the voltages `given` where u were asked for."""
    back = loop.K_i * loop.T / loop.K
    return Dq(
        xi.d - loop.K_i * loop.T * i.d + back * (given.d - u.d),
        xi.q + loop.K_i * loop.T * (I_ref - i.q) + back * (given.q - u.q),
    )

"""How long a step of the twins' own may be (ours): within these bounds the numbers move as the physics does.

A step is explicit in what couples the rotor with the currents (back-EMF, torque) and, in LF, with its control law. Each
bound is a number that rises with the step; from some 0.3 (currents), 4 (driver) and 2 (loops) on a run grows without end,
and it is right to a few percent within half an order of magnitude below. It is shortened at the start, from the parameters.
"""

from .jit import kernel

SHORTEST = 1e-9
"""Step [s] below which nothing is resolved."""
CURRENTS, DRIVER, LOOP = 0.002, 1.0, 0.2
"""Largest numbers that are stepped."""
TURN = 0.2
"""Largest turn of theta_e in a step [rad]: at its ends sine and torque are then 0.2 % off those of its middle."""


@kernel
def for_currents(h, K_e, J, R, L):
    """`h` [s], halved until 1.5*K_e^2*h^2/(J*(L + h*R/2)) is small: rotor and currents through R and L."""
    while h >= SHORTEST and 1.5 * K_e * K_e * h * h > CURRENTS * J * (L + 0.5 * h * R):
        h *= 0.5
    return h


@kernel
def for_driver(h, K_e, J, R):
    """`h` [s], no longer than what keeps 3*K_e^2*h/(J*R) small: plain ELF's currents follow the back-EMF at once."""
    return min(h, DRIVER * J * R / (3.0 * K_e * K_e))


@kernel
def for_turn(h, turning):
    """The whole part of `h` [s] in which theta_e turns by no more than TURN at `turning` [rad/s]; 0 if that is too short."""
    if turning * h > TURN:
        h = h / (int(turning * h / TURN) + 1) if turning * SHORTEST <= TURN else 0.0
    return h


@kernel
def for_swing(h, stiffness):
    """`h` [s], halved until stiffness*h^2 is small: a rotor held by a proportional position loop, `stiffness` [1/s2]."""
    while h >= SHORTEST and stiffness * h * h > LOOP * LOOP:
        h *= 0.5
    return h


@kernel
def for_loop(h, gain, lag):
    """`h` [s], halved until gain*h*min(1, h/lag) is small: a loop of `gain` [1/s] closed over a lag [s]."""
    while h >= SHORTEST and gain * h * min(1.0, h / lag) > LOOP:
        h *= 0.5
    return h

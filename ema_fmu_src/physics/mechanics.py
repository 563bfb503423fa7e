"""Rotor and gear on the motor side: Borello's dry friction, load-dependent friction, end stops, backlash."""

from typing import NamedTuple

from .jit import kernel
from .trig import clamp


class Friction(NamedTuple):
    """What brakes the rotor: limits of the dry friction and what positive motion has more of it than negative, losses of the
    loaded gear, viscous coefficient.

    loss_opposing = 1/eta_opposing - 1, loss_aiding = 1 - eta_aiding.
    """

    T_static: float
    T_coulomb: float
    T_asymmetry: float
    loss_opposing: float
    loss_aiding: float
    C: float


@kernel
def load_friction(T_L, direction, friction):
    """Friction of the loaded gear, added to both dry-friction limits: loss_opposing*|T_L| when the load opposes the motion,
    loss_aiding*|T_L| when it aids it. `direction` is that of the motion or, at rest, of the torque that would start it.
    """
    if T_L * direction > 0.0:
        return friction.loss_opposing * abs(T_L)
    return friction.loss_aiding * abs(T_L)


@kernel
def rotor(w, T_m, T_L, friction, J, h):
    """w after a step h, and the dry friction T_f during it: J dw/dt = T_m - C*w - T_L - T_f.

    Friction after Borello: at rest it balances the net torque up to the static limit; beyond it, or moving, the Coulomb
    value opposes, both with their asymmetry (ours; where it is larger than they are, none is left); a speed that would
    change sign in the step stops at zero. Viscous friction by the trapezoidal rule; where it brakes within the step
    (h*C/J > 2), the speed takes its settled value.
    """
    net = T_m - T_L
    direction = w if w != 0.0 else net
    extra = load_friction(T_L, direction, friction)
    asymmetry = friction.T_asymmetry if direction > 0.0 else -friction.T_asymmetry
    T_f = max(0.0, friction.T_coulomb + asymmetry) + extra
    if w == 0.0 and abs(net) <= max(0.0, max(friction.T_static, friction.T_coulomb) + asymmetry) + extra:
        return 0.0, net
    if direction < 0.0:
        T_f = -T_f
    w_new = w + h * (net - T_f - friction.C * w) / max(J + 0.5 * h * friction.C, h * friction.C)
    if (w > 0.0 and w_new < 0.0) or (w < 0.0 and w_new > 0.0):  # their product may underflow
        return 0.0, T_f
    return w_new, T_f


@kernel
def mean_speed(w, w_new, C, J, h):
    """The mean speed over a step h of `rotor`."""
    if h * C > 2.0 * J:
        return w_new + (w - w_new) * J / (h * C)
    return 0.5 * (w + w_new)


@kernel
def end_stop(theta, w, theta_max, before):
    """theta and w behind inelastic stops at +-theta_max; a rotor that was beyond them, at `before`, gets no further."""
    if theta >= max(theta_max, before) and w >= 0.0:
        return max(theta_max, before), 0.0
    if theta <= min(-theta_max, before) and w <= 0.0:
        return min(-theta_max, before), 0.0
    return theta, w


@kernel
def carried(load, x, half_play, end_stop):
    """The part of the load that the gear carries at x = theta/G: none while it rests against the end stop."""
    rests = (load < 0.0 and x + half_play >= end_stop) or (load > 0.0 and x - half_play <= -end_stop)
    return 0.0 if rests else load


@kernel
def user_shaft(position, x, half_play, load, end_stop):
    """Position of the user shaft behind the backlash, within its end stops; x = theta/G is that of the gear.

    A load seats the shaft against the flank that carries it, at once: the user side has no mass of its own (ours, quasi-
    static). So a loaded gap is never open, a load that reverses takes the shaft across it, and what the load loses on that
    way is lost in the impact. Without a load the shaft stays where friction leaves it, within +-half_play (play operator).
    """
    if load > 0.0:
        position = x - half_play
    elif load < 0.0:
        position = x + half_play
    else:
        position = play(position, x, half_play)
    return clamp(position, -end_stop, end_stop)


@kernel
def play(position, x, half_play):
    """Play operator: the user shaft stays within +-half_play of the gear's x = theta/G."""
    if position > x + half_play:
        return x + half_play
    if position < x - half_play:
        return x - half_play
    return position

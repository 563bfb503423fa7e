"""Rotor and gear on the motor side: Borello's dry friction, load-dependent friction, end stops, backlash."""

from .jit import kernel


@kernel
def load_friction(T_L, direction, loss_opposing, loss_aiding):
    """Friction of the loaded gear [N.m], motor side, added to both dry-friction limits.

    loss_opposing*|T_L|, 1/eta_opposing - 1, when the load opposes the motion; loss_aiding*|T_L|, 1 - eta_aiding, when it
    aids it. `direction` is that of the motion or, at rest, of the torque that would start it.
    """
    if T_L * direction > 0.0:
        return loss_opposing * abs(T_L)
    return loss_aiding * abs(T_L)


@kernel
def rotor(w, T_m, T_L, T_static, T_coulomb, loss_opposing, loss_aiding, C, J, h):
    """Speed [rad/s] after a step h and the dry-friction torque [N.m] during it: J dw/dt = T_m - C*w - T_L - T_f.

    Friction after Borello: at rest it balances the net torque up to the static limit; beyond it, or moving, the Coulomb
    value opposes; a speed that would change sign in the step stops at zero. Viscous friction by the trapezoidal rule.
    """
    net = T_m - T_L
    direction = w if w != 0.0 else net
    extra = load_friction(T_L, direction, loss_opposing, loss_aiding)
    T_f = T_coulomb + extra
    if w == 0.0 and abs(net) <= max(T_static, T_coulomb) + extra:
        return 0.0, net
    if direction < 0.0:
        T_f = -T_f
    w_new = w + h * (net - T_f - C * w) / (J + 0.5 * h * C)
    if w * w_new < 0.0:
        return 0.0, T_f
    return w_new, T_f


@kernel
def end_stop(theta, w, theta_max):
    """Angle [rad] and speed [rad/s] of the rotor behind inelastic stops at +-theta_max."""
    if theta >= theta_max and w >= 0.0:
        return theta_max, 0.0
    if theta <= -theta_max and w <= 0.0:
        return -theta_max, 0.0
    return theta, w


@kernel
def play(position, x, half):
    """Play (backlash) operator: the user shaft stays within +-half of the gear's x = theta/G [rad]."""
    if position > x + half:
        return x + half
    if position < x - half:
        return x - half
    return position

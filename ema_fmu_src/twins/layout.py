"""Where what all fidelities remember lies in `x`: what follows from the parameters, what a control law keeps, what moves."""

from ..physics import current_loop
from . import host
from .memory import State, places

DERIVED = (
    State("K_e", "V.s/rad", "motor.K_e with its fault"),
    State("R", "Ohm", "motor.R with its fault"),
    State("z_cos_a", "1", "p*zeta*cos(phi_a)"),
    State("z_cos_b", "1", "p*zeta*cos(phi_b)"),
    State("z_cos_c", "1", "p*zeta*cos(phi_c)"),
    State("z_sin_a", "1", "p*zeta*sin(phi_a)"),
    State("z_sin_b", "1", "p*zeta*sin(phi_b)"),
    State("z_sin_c", "1", "p*zeta*sin(phi_c)"),
    State("T_static", "N.m", "limit of the dry friction at rest, with its faults"),
    State("T_coulomb", "N.m", "dry friction of the moving rotor, with its faults"),
    State("loss_opposing", "1", "1/eta_opposing - 1"),
    State("loss_aiding", "1", "1 - eta_aiding"),
    State("K_motor", "1/s", "K_pos*G with its fault"),
    State("per_ratio", "1", "1/G"),
    State("half_play", "rad", "half of the backlash, with its fault"),
    State("theta_max", "rad", "the rotor's end stop"),
    State("smoothing", "1", "of the filtered current over a whole step"),
    State("senses", "1", "1: a current sensor has a fault"),
    State("plain", "1", "1: the cascade without derivative or feed-forward"),
    State("astray", "1", "1: a sensor or a switch has a fault: the currents are not those that are asked for"),
    State("unlike", "1", "1: the machine is not the one that the current loop was designed for"),
    *(State(f"loop_{name}", "", "the current loop") for name in current_loop.Loop._fields),
    *(State(f"response_{name}", "", "how it settles") for name in current_loop.Response._fields),
    *(State(f"passage_{name}", "", "what it does over a whole step") for name in current_loop.Passage._fields),
)
"""What follows from the parameters, taken at the start and after each change: it saves ELF and LF 5 % of their time."""
LAW = (
    State("D", "A", "derivative part of the control law"),
    State("e_d", "rad", "what it is the derivative of, at the last sample; cascade: rad/s"),
    State("r", "rad", "commanded motor position at the last sample"),
    State("dr", "rad", "its change then"),
    State("samples", "1", "samples so far, at most 2; LF: its looks at the command"),
    State("begun", "1", "1: there has been a sample"),
    State("ahead", "A", "LF: feed-forward at the last look at the command"),
    State("looked", "s", "LF: when that was"),
    State("motor_position", "rad", "measured motor position at the last sample"),
    State("q", "A", "measured quadrature current at the last sample"),
)
"""What the control law remembers from sample to sample beside its integral."""
SINCE = (
    State("charge", "C", "supply charge at the last communication point"),
    State("loss", "J", "copper loss at the last communication point"),
    State("stop", "N.m.s", "impulse of the end stops at the last communication point"),
    State("limited", "1", "above 0: voltage-limited at some time since the last communication point"),
)
MOVING = (
    State("theta", "rad", "rotor angle, mechanical"),
    State("w", "rad/s", "rotor speed, mechanical"),
    State("position", "rad", "user shaft angle"),
    State("s", "1", "sin(theta_e)"),
    State("c", "1", "cos(theta_e)"),
    State("T_f", "N.m", "dry friction in the last step"),
    State("stop", "N.m.s", "impulse of the end stops since the start"),
    State("i_a", "A", "current of phase a"),
    State("i_b", "A", "current of phase b"),
    State("i_c", "A", "current of phase c"),
    State("I_ref", "A", "current reference"),
    State("xi", "A", "integral part of the controller; LF's cascade: what another twin's would have to be"),
    State("xi_d", "V", "integral part of the current loop, d axis"),
    State("xi_q", "V", "integral part of the current loop, q axis"),
    State("i_filtered", "A", "filtered equivalent current"),
    State("charge", "C", "supply charge since the start"),
    State("loss", "J", "copper loss since the start"),
    State("limited", "1", "1: voltage-limited in the last step; HF: at the last tick"),
)
ONCE = (*host.STATES, *DERIVED, *LAW, *SINCE)
derived = places("derived", DERIVED, first=len(host.STATES))
law = places("law", LAW, first=len(host.STATES) + len(DERIVED))
since = places("since", SINCE, first=len(host.STATES) + len(DERIVED) + len(LAW))
FIRST = len(ONCE)
now = places("now", MOVING, first=FIRST)

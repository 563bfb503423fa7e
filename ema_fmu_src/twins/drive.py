"""The drive of every fidelity: the control law, what its sensors show, and its current loop."""

from typing import NamedTuple

from ..physics import averaged, current_loop, inverter, sensor
from ..physics.averaged import Legs
from ..physics.controller import cascade, derivative, pid
from ..physics.current_loop import Loop, Passage, Response
from ..physics.frame import Dq, to_frame
from ..physics.jit import kernel
from ..physics.modulator import carrier, reference
from ..physics.phases import Abc
from ..physics.trig import sincos
from . import host
from .host import clock, inputs
from .layout import derived, law, now
from .memory import port
from .status import Status

PID, FIELD_ORIENTED, HYSTERESIS = 2.0, 2.0, 1.0
"""`controller.structure` (1: cascade), `controller.current_control` (1: ideal), `inverter.modulation` (other: a carrier)."""
SLOWEST = -1e-6
"""Decay [1/s] of a current loop below which it grows."""


class Seen(NamedTuple):
    """What the drive's sensors show: the rotor's angle by which it commutates, the motor's position, the user shaft's."""

    angle: float
    motor_position: float
    position: float


@kernel
def is_oriented(v):
    """Whether the current loop is the sampled one, and not ideal."""
    return v[port.controller.current_control] == FIELD_ORIENTED


@kernel
def _loop(v):
    """The current loop, for the machine as it was designed for: without its faults."""
    R, T = v[port.motor.R] + v[port.inverter.R_on], 0.5 / v[port.inverter.carrier_frequency]
    K, K_i = current_loop.gains(
        R,
        v[port.motor.L],
        T,
        v[port.controller.current.bandwidth],
        v[port.controller.current.K_p],
        v[port.controller.current.K_i],
    )
    return Loop(
        K, K_i, T, R, v[port.motor.L], v[port.motor.K_e],
        v[port.controller.current.decoupling], v[port.controller.current.emf_forward],
    )  # fmt: skip


@kernel
def derive(v, x):
    """Write what follows from the drive's parameters. Returns a Status."""
    ideal, hysteresis = not is_oriented(v), v[port.inverter.modulation] == HYSTERESIS
    if ideal != hysteresis:
        return Status.PAIR
    gain, offset = sensors(v)
    unequal = gain.a != 1.0 or gain.b != 1.0 or gain.c != 1.0
    shifted = offset.a != 0.0 or offset.b != 0.0 or offset.c != 0.0
    x[derived.senses] = 1.0 if unequal or shifted else 0.0
    elsewhere = v[port.fault.resolver_offset] != 0.0 or v[port.fault.open_switch] != 0.0
    forward = v[port.controller.feedforward_speed] != 0.0 or v[port.controller.feedforward_acceleration] != 0.0
    plain = v[port.controller.structure] != PID and v[port.controller.K_d] == 0.0 and not forward
    x[derived.plain] = 1.0 if plain else 0.0
    if plain:  # what a law has remembered is of no use to one that is chosen later
        x[law.begun] = 0.0
    x[derived.astray] = 1.0 if unequal or shifted or elsewhere else 0.0
    if ideal:
        return Status.OK
    loop = _loop(v)
    if v[port.inverter.dead_time] >= loop.T or v[port.inverter.minimum_pulse] >= 0.5 * loop.T:
        return Status.PULSE
    response = current_loop.response(loop)
    if response.decay_1 < 0.0 or response.decay_2 < SLOWEST:
        return Status.LOOP
    write_loop(x, loop, response, current_loop.over(loop, response, x[clock.step]))
    shorted = v[port.fault.N_a] != 1.0 or v[port.fault.N_b] != 1.0 or v[port.fault.N_c] != 1.0
    changed = v[port.fault.magnet] != 1.0 or v[port.fault.resistance] != 1.0
    moved = v[port.fault.zeta] != 0.0 or v[port.fault.resolver_offset] != 0.0
    x[derived.unlike] = 1.0 if shorted or changed or moved else 0.0
    return Status.OK


@kernel
def start(v, x):
    """The drive at time 0: its current loop has settled, and its sensors show what is."""
    if is_oriented(v):
        loop, i = read_loop(x), to_frame(Abc(x[now.i_a], x[now.i_b], x[now.i_c]), x[now.s], x[now.c])
        left = (1.0 - loop.decoupling) * v[port.motor.p] * x[now.w] * loop.L
        x[now.xi_d] = loop.R * i.d - left * i.q
        x[now.xi_q] = loop.R * i.q + left * i.d + (1.0 - loop.emf_forward) * loop.K_e * x[now.w]
    show(v, x, x[now.theta], Abc(x[now.i_a], x[now.i_b], x[now.i_c]), x[now.s], x[now.c])


@kernel
def write_loop(x, loop, response, passage):
    """Keep the current loop."""
    x[derived.loop_K], x[derived.loop_K_i], x[derived.loop_T], x[derived.loop_R] = loop.K, loop.K_i, loop.T, loop.R
    x[derived.loop_L], x[derived.loop_K_e] = loop.L, loop.K_e
    x[derived.loop_decoupling], x[derived.loop_emf_forward] = loop.decoupling, loop.emf_forward
    x[derived.response_decay_1], x[derived.response_decay_2] = response.decay_1, response.decay_2
    x[derived.response_turning] = response.turning
    x[derived.response_M_xx], x[derived.response_M_xy], x[derived.response_M_yx] = (
        response.M_xx,
        response.M_xy,
        response.M_yx,
    )
    x[derived.passage_M_xx], x[derived.passage_M_xy] = passage.M_xx, passage.M_xy
    x[derived.passage_M_yx], x[derived.passage_M_yy] = passage.M_yx, passage.M_yy
    x[derived.passage_stiff], x[derived.passage_share] = passage.stiff, passage.share
    x[derived.passage_follow] = passage.follow


@kernel
def read_loop(x):
    """The current loop."""
    return Loop(
        x[derived.loop_K], x[derived.loop_K_i], x[derived.loop_T], x[derived.loop_R], x[derived.loop_L], x[derived.loop_K_e],
        x[derived.loop_decoupling], x[derived.loop_emf_forward],
    )  # fmt: skip


@kernel
def passage(x, loop, h):
    """What the current loop does over a step h; over a whole step it is known."""
    if h == x[clock.step]:
        return Passage(
            x[derived.passage_M_xx], x[derived.passage_M_xy], x[derived.passage_M_yx], x[derived.passage_M_yy],
            x[derived.passage_stiff], x[derived.passage_share], x[derived.passage_follow],
        )  # fmt: skip
    response = Response(
        x[derived.response_decay_1], x[derived.response_decay_2], x[derived.response_turning],
        x[derived.response_M_xx], x[derived.response_M_xy], x[derived.response_M_yx],
    )  # fmt: skip
    return current_loop.over(loop, response, h)


@kernel
def idle(v, x, i, w, h):
    """The current loop over a step h in which the supply is too low to switch: xi follows no voltage, at the currents i."""
    loop = read_loop(x)
    xi = averaged.followed(loop, passage(x, loop, h), w, v[port.motor.p] * w, Dq(x[now.xi_d], x[now.xi_q]), Dq(0.0, 0.0), i)
    x[now.xi_d], x[now.xi_q] = xi


@kernel
def lag(v):
    """The current loop's lag [s], by its bandwidth or, of stated gains, L/K_p."""
    K_p = v[port.controller.current.K_p]
    return v[port.motor.L] / K_p if K_p > 0.0 else 1.0 / v[port.controller.current.bandwidth]


@kernel
def sensors(v):
    """The current sensors with their faults."""
    return reference.Sensors(
        Abc(v[port.fault.current_gain_a], v[port.fault.current_gain_b], v[port.fault.current_gain_c]),
        Abc(v[port.fault.current_offset_a], v[port.fault.current_offset_b], v[port.fault.current_offset_c]),
    )


@kernel
def top(v, V_dc):
    """The most that a leg gives at a carrier, about the mid-point."""
    return 0.5 * V_dc * v[port.inverter.utilisation]


@kernel
def injects(v):
    """Whether the modulation is that of space vectors."""
    return v[port.inverter.modulation] == carrier.SPACE_VECTOR


@kernel
def legs(v, V_dc):
    """The inverter at a carrier, averaged."""
    return Legs(
        top(v, V_dc),
        V_dc,
        v[port.inverter.dead_time],
        injects(v),
        inverter.open_sides(v[port.fault.open_switch]),
    )


@kernel
def look(v, theta, position):
    """What HF's sensors show. A drive that counts, in steps too wide to commutate by, goes on between them with its speed:
    as that, the angle is ideal (ours)."""
    bits, counts, offset = v[port.sensor.resolver_bits], v[port.sensor.counts], v[port.fault.resolver_offset]
    G = v[port.gear.ratio]
    motor_position = sensor.resolver(theta + offset, bits, counts)
    angle = motor_position if counts == 0.0 else theta + offset
    return Seen(angle, motor_position, sensor.resolver(position * G + offset, bits, counts) / G)


@kernel
def look_ideally(v, theta, position):
    """The positions as ideal sensors show them, but for the fault of the resolver."""
    offset = v[port.fault.resolver_offset]
    if offset == 0.0:
        return Seen(theta, theta, position)
    return Seen(theta + offset, theta + offset, position + offset / v[port.gear.ratio])


@kernel
def turned(v, s, c):
    """Sine and cosine of theta_e as a resolver shows it that is ideal but for its fault."""
    offset = v[port.fault.resolver_offset]
    if offset == 0.0:
        return s, c
    s_off, c_off = sincos(v[port.motor.p] * offset)
    return s * c_off + c * s_off, c * c_off - s * s_off


@kernel
def show(v, x, motor_position, i, s, c):
    """Keep what the controller has measured: the motor's position and, at the angle of it (sine s, cosine c), the quadrature
    current."""
    x[law.motor_position] = motor_position
    if x[derived.senses] != 0.0:
        i = reference.measured(i, sensors(v))
    x[law.q] = to_frame(i, s, c).q


@kernel
def _memory(x):
    """What the control law remembers."""
    return derivative.Memory(x[now.xi], x[law.D], x[law.e_d], x[law.begun])


@kernel
def _remember(x, memory):
    x[now.xi], x[law.D], x[law.e_d], x[law.begun] = memory


@kernel
def _ahead(v, x, r, w, T):
    """Feed-forward, by the command's change over T [s]."""
    forward = derivative.Forward(v[port.controller.feedforward_speed], v[port.controller.feedforward_acceleration])
    if forward.speed == 0.0 and forward.acceleration == 0.0:
        return 0.0
    last = derivative.Commanded(x[law.r], x[law.dr], x[law.samples])
    u, last = derivative.ahead(forward, last, r, w, T)
    x[law.r], x[law.dr], x[law.samples] = last
    return u


@kernel
def cascade_gains(v, x, K_i, T_d, T_c):
    """The cascade's gains with their fault; `K_i`, and `T_d` and `T_c` [s], as the twin takes them."""
    return cascade.Gains(
        x[derived.K_motor],
        v[port.controller.speed_limit],
        v[port.controller.K_p],
        K_i,
        v[port.controller.K_d],
        T_d,
        T_c,
        v[port.controller.current_limit],
    )


@kernel
def _pid_gains(v):
    return pid.Gains(
        v[port.fault.gain],
        v[port.controller.pid.K_p],
        v[port.controller.pid.K_i],
        v[port.controller.pid.K_d],
        v[port.controller.pid.T_f],
        v[port.controller.pid.b],
        v[port.controller.pid.c],
        v[port.controller.period],
        v[port.controller.current_limit],
    )


@kernel
def _plainly(v, x, K_i, T_c, command, position, w, xi):
    """The cascade with neither derivative nor feed-forward, which needs no memory but xi: writes and returns I_ref. It saves
    LF 4 % of its instructions."""
    gains = cascade.Gains(
        x[derived.K_motor], v[port.controller.speed_limit], v[port.controller.K_p], K_i, 0.0, 0.0, T_c,
        v[port.controller.current_limit],
    )  # fmt: skip
    I_ref, memory = cascade.sampled(gains, 0.0, command, position, w, derivative.Memory(xi, 0.0, 0.0, 0.0))
    x[now.I_ref], x[now.xi] = I_ref, memory.xi
    return I_ref


@kernel
def control(v, x, t, seen, w):
    """The controller's sample at time `t` [s], by the control law: writes and returns I_ref, and what it remembers."""
    command, T_c = host.input_at(v, x, inputs.command, t), v[port.controller.period]
    if x[derived.plain] != 0.0:
        return _plainly(v, x, v[port.controller.K_i], T_c, command, seen.position, w, x[now.xi])
    r = v[port.gear.ratio] * command
    ahead = _ahead(v, x, r, w, T_c)
    if v[port.controller.structure] == PID:
        I_ref, memory = pid.sampled(_pid_gains(v), ahead, r, seen.motor_position, w, _memory(x))
    else:
        gains = cascade_gains(v, x, v[port.controller.K_i], v[port.controller.T_d], T_c)
        I_ref, memory = cascade.sampled(gains, ahead, command, seen.position, w, _memory(x))
    _remember(x, memory)
    x[now.I_ref] = I_ref
    return I_ref


@kernel
def control_continuously(v, x, t, h):
    """LF's: the control law at time `t` [s] at a step h of its own, with the filters that its sampling in effect is; the
    cascade has no integral. The command's change is looked at once a controller period: all that of a command that is held
    in steps would else fall into one step of LF's, and be limited."""
    command = host.input_at(v, x, inputs.command, t)
    if x[derived.plain] != 0.0:
        _plainly(v, x, 0.0, h, command, x[now.position], x[now.w], 0.0)
        return
    T_c, r = v[port.controller.period], v[port.gear.ratio] * command
    since_look = t - x[law.looked] if x[law.samples] > 0.0 else T_c
    if since_look >= T_c * (1.0 - 1e-6):
        x[law.ahead], x[law.looked] = _ahead(v, x, r, x[now.w], since_look), t
    if v[port.controller.structure] == PID:
        I_ref, memory = pid.continuous(_pid_gains(v), x[law.ahead], r, x[now.theta], x[now.w], h, _memory(x))
    else:
        gains = cascade_gains(v, x, 0.0, max(0.0, v[port.controller.T_d] + 0.5 * (T_c - h)), h)
        without = derivative.Memory(0.0, x[law.D], x[law.e_d], x[law.begun])
        I_ref, memory = cascade.sampled(gains, x[law.ahead], command, x[now.position], x[now.w], without)
    _remember(x, memory)
    x[now.I_ref] = I_ref

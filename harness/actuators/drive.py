"""The drive that an actuator's parameters choose: what they use of the ports, its current loop, and the PID as a cascade."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

from ema_fmu_src import ports
from harness.actuators.actuator import Actuator

CASCADE_ONLY = ("K_pos", "speed_limit", "K_p", "K_i", "K_d", "T_d")
"""Ports `controller.*` of the cascade alone."""
CARRIER_ONLY = ("inverter.carrier_frequency", "inverter.minimum_pulse", "inverter.utilisation")
GAINS = ("controller.current.K_p", "controller.current.K_i")
HYSTERESIS_ONLY = ("inverter.hysteresis",)


def chosen(parameters: Mapping[str, float], port: str) -> str:
    """The item of an Enumeration, such as "pid" of controller.structure."""
    variable = ports.VARIABLES[ports.INDEX[port]]
    return variable.text(float(parameters.get(port, variable.start)))


def is_pid(parameters: Mapping[str, float]) -> bool:
    """Whether the control law is the PID."""
    return chosen(parameters, "controller.structure") == "pid"


def is_oriented(parameters: Mapping[str, float]) -> bool:
    """Whether the current loop is the sampled one, at a carrier."""
    return chosen(parameters, "controller.current_control") == "field_oriented"


def idle(parameters: Mapping[str, float]) -> set[str]:
    """The ports that only another drive than the chosen one would use."""
    cascade = {f"controller.{name}" for name in CASCADE_ONLY}
    pid = {port.name for port in ports.PARAMETERS if port.name.startswith("controller.pid.")}
    loop = {port.name for port in ports.PARAMETERS if port.name.startswith("controller.current.")}
    if is_oriented(parameters):
        stated = parameters.get(GAINS[0], 0.0) > 0.0
        of_currents = {*HYSTERESIS_ONLY, *(("controller.current.bandwidth",) if stated else GAINS)}
    else:
        of_currents = loop | set(CARRIER_ONLY)
    return (cascade if is_pid(parameters) else pid) | of_currents


@dataclass(frozen=True)
class Loop:
    """The sampled current loop: gains `K` [V/A] and `K_i` [V/(A.s)], sampling period `T` [s], and its two poles [1/s], of
    which the samples' eigenvalues are exp(pole*T).

    `stated`: the gains are those of the ports, and do not follow from the bandwidth. `settles`: both poles decay, and
    neither rings from sample to sample; a loop that does not is refused by every fidelity.
    """

    K: float
    K_i: float
    T: float
    poles: tuple[complex, complex]
    stated: bool
    settles: bool


def current_loop(actuator: Actuator) -> Loop:
    """The loop of a field-oriented drive, at the machine that it was designed for: R with the switches', no faults.

    A sample changes x = r - i and y = xi - R*r to (A - (1 - A)*K/R)*x + (A - 1)/R*y and K_i*T*x + y, A = exp(-R*T/L).
    """
    R, L = actuator.value("motor.R") + actuator.value("inverter.R_on"), actuator.value("motor.L")
    T = 0.5 / actuator.value("inverter.carrier_frequency")
    A = math.exp(-R * T / L)
    K, K_i = actuator.value("controller.current.K_p"), actuator.value("controller.current.K_i")
    stated = K > 0.0
    if not stated:
        K = R * -math.expm1(-actuator.value("controller.current.bandwidth") * T) / (1.0 - A)
        K_i = K * (1.0 - A) / T
    M_xx, M_xy, M_yx = A - (1.0 - A) * K / R, (A - 1.0) / R, K_i * T
    half = 0.5 * (M_xx + 1.0)
    apart = cmath.sqrt(half * half - (M_xx - M_xy * M_yx))
    z = (half + apart, half - apart)
    positive = all(each.imag != 0.0 or each.real > 0.0 for each in z)
    poles = (_pole(z[0], T), _pole(z[1], T))
    return Loop(K, K_i, T, poles, stated, positive and all(pole.real <= 1e-6 for pole in poles))


def _pole(z: complex, T: float) -> complex:
    """ln(z)/T [1/s]; of 0, which has settled within a sample, minus infinity."""
    return cmath.log(z) / T if z else complex(-math.inf)


@dataclass(frozen=True)
class Cascade:
    """The cascade that a PID is while no limit is active: K_pos [1/s], K_p [A.s/rad], K_i [A/rad]; the PID's b for it."""

    K_pos: float
    K_p: float
    K_i: float
    b: float


def as_cascade(actuator: Actuator) -> Cascade | None:
    """The cascade of the PID with K_P = K_pos*K_p + K_i, K_I = K_i*K_pos, K_D = K_p; of the two the stiffer in position.

    None where there is none: without a derivative, or with K_P^2 < 4*K_D*K_I.
    """
    K_P, K_I, K_D = (actuator.value(f"controller.pid.{name}") for name in ("K_p", "K_i", "K_d"))
    under = K_P * K_P - 4.0 * K_D * K_I
    if K_D == 0.0 or K_P == 0.0 or under < 0.0:
        return None
    K_pos = (K_P + math.sqrt(under)) / (2.0 * K_D)
    return Cascade(K_pos, K_D, K_I / K_pos, K_pos * K_D / K_P)


def lines(actuator: Actuator) -> list[str]:
    """What the drive is, in words: a line for the law, one for the current loop."""
    law = _pid(actuator) if is_pid(actuator.parameters) else "cascade, P on position and PI on speed"
    period = f"every {1e3 * actuator.value('controller.period'):.4g} ms"
    return [f"control law, {period}: {law}", f"current control: {_currents(actuator)}"]


def _pid(actuator: Actuator) -> str:
    found = as_cascade(actuator)
    if found is not None:
        gains = f"K_pos {found.K_pos:.4g} 1/s, K_p {found.K_p:.4g} A.s/rad, K_i {found.K_i:.4g} A/rad"
        like = f"while no limit is active as a cascade with {gains}, where b is {found.b:.4g}, c 0 and T_f 0"
    elif actuator.value("controller.pid.K_d") == 0.0 or actuator.value("controller.pid.K_p") == 0.0:
        like = "as no cascade, without a proportional or a derivative part"
    else:
        like = "as no cascade, because K_P^2 < 4*K_D*K_I"
    return f"PID on the motor's position; {like}"


def _currents(actuator: Actuator) -> str:
    if not is_oriented(actuator.parameters):
        return "ideal, each phase within its hysteresis band"
    loop, bandwidth = current_loop(actuator), actuator.value("controller.current.bandwidth") / (2.0 * math.pi)
    gains = "with stated gains" if loop.stated else f"with a bandwidth of {bandwidth:.4g} Hz"
    carrier = 1e-3 * actuator.value("inverter.carrier_frequency")
    settled = "it settles" if loop.settles else "it does NOT settle, and no fidelity flies it"
    modulation = chosen(actuator.parameters, "inverter.modulation")
    at = f"sampled at {1e-3 / loop.T:.4g} kHz, {modulation} at a carrier of {carrier:.4g} kHz"
    return f"field oriented {gains}, {at}; {settled}"

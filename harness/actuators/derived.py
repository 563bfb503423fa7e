"""What follows from an actuator's parameters: speeds, torques and time constants, each with its formula."""

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from harness.actuators.actuator import Actuator
from harness.actuators.drive import chosen, current_loop, is_oriented, is_pid

SIX_STEPS = 2.0 / math.pi
"""Fundamental of six steps over the supply voltage."""
_SINE = (1.0 / math.sqrt(3.0), "V/sqrt(3)")
NO_LOAD = "K_e*w_0 = sqrt((2*V/pi)^2 - (p*w_0*L*I)^2) - R*I, I = (T_coulomb + C*w_0)/K_t, as LF; HF: "
MORE, LESS = "up to 8 % more", "up to 10 % less"
"""Of HF with hysteresis, and at a carrier: as measured with the actuators of the library."""


@dataclass(frozen=True)
class Derived:
    """A quantity: its `value` in `unit`, and the `formula` in the ports' symbols."""

    name: str
    value: float
    unit: str
    formula: str


def derived(actuator: Actuator) -> list[Derived]:
    """The quantities that describe the actuator as a whole, healthy, at its supply voltage; R is with the switches'.

    Voltages are amplitudes of a phase: V/sqrt(3) is the largest that is sinusoidal (V/2 with sine_triangle), 2*V/pi the
    fundamental of six steps; V is what the modulation reaches of the supply.
    """
    share, told = (0.5, "V/2") if chosen(actuator.parameters, "inverter.modulation") == "sine_triangle" else _SINE
    K_e, R = actuator.value("motor.K_e"), actuator.value("motor.R") + actuator.value("inverter.R_on")
    T_c = actuator.value("mechanics.T_coulomb")
    V, G = usable_voltage(actuator), actuator.value("gear.ratio")
    K_t = 1.5 * K_e
    w_0 = _no_load_speed(actuator)
    T_v = K_t * V * share / R
    T_i = min(T_v, K_t * actuator.value("controller.current_limit"))
    found = [
        Derived("torque constant", K_t, "N.m/A", "K_t = 1.5*K_e"),
        Derived("saturation speed", V * share / K_e, "rad/s", f"{told}/K_e: the back-EMF alone takes all"),
        Derived("no-load speed", w_0, "rad/s", NO_LOAD + (LESS if is_oriented(actuator.parameters) else MORE)),
        Derived("no-load current", no_load_current(actuator), "A", "(T_coulomb + C*w_0)/K_t"),
        Derived("stall torque", T_v, "N.m", f"K_t*{told}/R, whatever the current"),
        Derived("stall torque at the current limit", T_i, "N.m", "K_t*current_limit, at most the stall torque"),
        Derived("electrical time constant", actuator.value("motor.L") / R, "s", "L/R"),
        Derived("mechanical time constant", actuator.value("mechanics.J") * R / (K_t * K_e), "s", "J*R/(K_t*K_e)"),
    ]
    K_d = "pid.K_d" if is_pid(actuator.parameters) else "K_p"
    if (
        gain := K_t
        * actuator.value(f"controller.{K_d}")
        * actuator.value("controller.period")
        / actuator.value("mechanics.J")
    ):
        found.append(Derived("gain of the sampled speed loop", gain, "1", f"K_t*{K_d}*period/J; 2 and more is unstable"))
    return [
        *found,
        *_loop(actuator),
        *_at_the_output(actuator, w_0 / G, G * actuator.value("gear.eta_opposing") * max(0.0, T_i - T_c)),
    ]


def usable_voltage(actuator: Actuator) -> float:
    """What the modulation reaches of the supply voltage [V]."""
    V = actuator.value("supply_voltage")
    return V * actuator.value("inverter.utilisation") if is_oriented(actuator.parameters) else V


def _loop(actuator: Actuator) -> list[Derived]:
    """Gains and poles of a field-oriented current loop; none of another."""
    if not is_oriented(actuator.parameters):
        return []
    loop = current_loop(actuator)
    stated, poles = "as stated", "ln(z)/T, z an eigenvalue of a sample"
    found = [
        Derived(
            "gain of the current loop",
            loop.K,
            "V/A",
            stated if loop.stated else "R*(1 - E)/(1 - A), E = exp(-bandwidth*T), A = exp(-R*T/L)",
        ),
        Derived(
            "integral gain of the current loop",
            loop.K_i,
            "V/(A.s)",
            stated if loop.stated else "R*(1 - E)/T, T = 1/(2*carrier_frequency)",
        ),
        Derived("first pole of the current loop", loop.poles[0].real, "1/s", poles),
        Derived("second pole of the current loop", loop.poles[1].real, "1/s", poles),
    ]
    if turning := abs(loop.poles[0].imag):
        found.append(Derived("frequency of these poles", turning, "rad/s", "their imaginary part"))
    return found


def no_load_current(actuator: Actuator) -> float:
    """The current [A] that friction needs at the no-load speed."""
    C, T_c = actuator.value("mechanics.C"), actuator.value("mechanics.T_coulomb")
    return (T_c + C * _no_load_speed(actuator)) / (1.5 * actuator.value("motor.K_e"))


def _no_load_speed(actuator: Actuator) -> float:
    """Where six steps' fundamental holds the friction's current: w_0 [rad/s] of NO_LOAD, 0 if friction alone holds it."""
    K_e, R = actuator.value("motor.K_e"), actuator.value("motor.R") + actuator.value("inverter.R_on")
    C, T_c = actuator.value("mechanics.C"), actuator.value("mechanics.T_coulomb")
    pL, K_t, V_1 = (
        actuator.value("motor.p") * actuator.value("motor.L"),
        1.5 * K_e,
        SIX_STEPS * usable_voltage(actuator),
    )

    def left(w: float) -> float:
        current = (T_c + C * w) / K_t
        return math.sqrt(max(0.0, V_1**2 - (pL * w * current) ** 2)) - R * current - K_e * w

    return float(brentq(left, 0.0, V_1 / K_e, xtol=1e-9)) if left(0.0) > 0.0 else 0.0


def _at_the_output(actuator: Actuator, speed: float, torque: float) -> list[Derived]:
    """Speed [rad/s] and torque [N.m] of the user shaft, as those of the rod where there is one."""
    output = actuator.output
    load = "G*eta_opposing*(stall torque at the current limit - T_coulomb)"
    travel, force = output.scale("position"), output.scale("load_torque")
    if output.lead is None:
        return [
            Derived("no-load speed at the output", speed, "rad/s", "w_0/G"),
            Derived("stall torque at the output", torque, "N.m", load),
        ]
    return [
        Derived("no-load speed at the output", speed * travel, "m/s", "w_0/G*lead/(2*pi)"),
        Derived("stall force at the output", torque * force, "N", f"{load}*2*pi/lead"),
        Derived("motor angle a travel", actuator.value("gear.ratio") / travel, "rad/m", "G*2*pi/lead"),
    ]

"""What is allowed in an actuator, but hardly meant: a line for each."""

from collections.abc import Mapping

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.actuators.drive import idle, is_oriented, is_pid

SHORTEST, LONGEST = 1e-4, 0.5
"""Leads [m a turn] between which screws lie."""
ROTARY = ("gear.ratio", "mechanics.end_stop")
"""Parameters whose defaults are those of a rotary actuator: with a lead they give another machine."""
KINDS = ("controller", "gear", "inverter")
"""Kinds of parameters that belong to each actuator, and whose defaults say nothing of another."""
LOOP = ("motor.K_e", "controller.period", "mechanics.J")
"""What the gain of the sampled speed loop is made of, beside the law's own: what a step of the speed changes of itself in a
period. A derivative of the position, filtered or not, bears as much as a proportional part of the speed."""


def doubts(parameters: Mapping[str, float], output: Output) -> list[str]:
    """The lines for the `parameters` that are known, by port in its unit, and what moves at the output."""
    lines = []
    T_static, T_coulomb = (_value(parameters, name) for name in ("mechanics.T_static", "mechanics.T_coulomb"))
    if T_static < T_coulomb:
        lines.append(
            f"mechanics.T_static {T_static:g} N.m is less than mechanics.T_coulomb {T_coulomb:g} N.m: is it left out?"
        )
    K_e, period, J = (_value(parameters, name) for name in LOOP)
    law = "pid.K_d" if is_pid(parameters) else "K_p"
    if (gain := 1.5 * K_e * _value(parameters, f"controller.{law}") * period / J) >= 2.0:
        lines.append(
            f"K_t*{law}*period/J = {gain:.3g}: the sampled speed loop is unstable from 2 on; is controller.{law} too high?"
        )
    lines += _of_the_law(parameters, 1.5 * K_e / J)
    band, current = _value(parameters, "inverter.hysteresis"), T_coulomb / (1.5 * K_e)
    if 0.0 < current < band and not is_oriented(parameters):
        lines.append(
            f"inverter.hysteresis {band:g} A is more than the {current:.3g} A that friction needs (T_coulomb/K_t): in slow "
            "runs HF's ripple hides what is to be measured; state a narrower one"
        )
    if output.lead is None:
        return lines
    if not SHORTEST <= output.lead <= LONGEST:
        lines.append(f"lead {output.lead:g} m a turn: screws have {SHORTEST:g} to {LONGEST:g} m; is its unit left out?")
    return lines + [_rotary(name, parameters, output) for name in ROTARY if name not in parameters]


def _of_the_law(parameters: Mapping[str, float], per_inertia: float) -> list[str]:
    """Lines on the control law; `per_inertia`: K_t/J [rad/(A.s2)]."""
    lines = []
    if is_pid(parameters):
        K_P, K_D = _value(parameters, "controller.pid.K_p"), _value(parameters, "controller.pid.K_d")
        if K_D > 0.0 and K_P / K_D > per_inertia * K_D:
            lines.append(
                f"controller.pid: K_p/K_d = {K_P / K_D:.3g} 1/s is more than K_t*K_d/J = {per_inertia * K_D:.3g} 1/s: the "
                "position swings; is K_p in A/rad?"
            )
        weights = [name for name in ("controller.pid.b", "controller.pid.c") if name not in parameters]
        if weights and "controller.pid.K_p" in parameters:
            lines.append(f"{' and '.join(weights)} not stated: the default cascade's are taken; 1 is a PID on the error")
    if (forward := abs(_value(parameters, "controller.feedforward_acceleration") * per_inertia)) > 10.0:
        lines.append(
            f"controller.feedforward_acceleration is {forward:.3g} times J/K_t, which accelerates the rotor as commanded"
        )
    without_use = sorted(name for name in idle(parameters) if name in parameters and _value(parameters, name) > 0.0)
    if without_use:
        lines.append(f"stated, but not used by this drive: {', '.join(without_use)}")
    return lines


def unstated(parameters: Mapping[str, float]) -> dict[str, list[str]]:
    """What nobody stated of the kinds that are each actuator's own: kind -> its ports, which keep the default actuator's.

    Ports that the drive does not use are not among them.
    """
    unused = idle(parameters)
    names = [port.name for port in ports.PARAMETERS if port.name not in parameters and port.name not in unused]
    found = {kind: [name for name in names if name.startswith(f"{kind}.")] for kind in KINDS}
    return {kind: listed for kind, listed in found.items() if listed}


def unstated_end_stop(parameters: Mapping[str, float], output: Output) -> list[str]:
    """A line if a rod's end stops are not stated: a rotary actuator's most likely end its runs early."""
    if output.lead is None or "mechanics.end_stop" in parameters:
        return []
    return [_rotary("mechanics.end_stop", parameters, output)]


def _rotary(name: str, parameters: Mapping[str, float], output: Output) -> str:
    """What the rotary default means for a rod."""
    default, travel = _value(parameters, name), output.scale("position")
    if name == "gear.ratio":
        meant = f"with the lead {default / travel:.4g} rad of the motor a metre; state it, or travel_constant under [sheet]"
    else:
        meant = f"{1e3 * default * travel:.3g} mm of travel; state it as a length"
    return f"{name} is not stated: the rotary default of {default:g} is kept, {meant}"


def _value(parameters: Mapping[str, float], name: str) -> float:
    return float(parameters.get(name, ports.VARIABLES[ports.INDEX[name]].start))

"""Parameters that a user sets: checked against the ports, and merged with those of a fidelity."""

import math
from collections.abc import Mapping

from ema_fmu_src import ports
from ema_fmu_src.fidelities import Fidelity
from harness.errors import HarnessError, unknown
from harness.units import quantity, split

PORTS = "'ema ports' lists all"
HERTZ = ("Hz", 0.5 / math.pi)
"""The unit that a bandwidth [rad/s] may also be in, and what a value in it is divided by."""
PAIR = ("controller.current_control", "inverter.modulation")
"""Ports of which the defaults go together, and any other item of the one with any other of the other."""


def merged(fidelity: Fidelity, given: Mapping[str, float] | None = None) -> dict[str, float]:
    """What the FMU of `fidelity` is set to: `given` (port name -> value in the port's unit), and the fidelity's own.

    The fidelity's own parameters win: with other values it would be another fidelity.
    """
    return {**(given or {}), **fidelity.parameters}


def parse_settings(settings: list[str]) -> dict[str, float]:
    """Parameters from texts NAME=VALUE, checked against the ports.

    The inputs load_torque and supply_voltage are accepted too: they hold that value where the trial gives none.
    A value may have a unit: `controller.speed_limit=6000 rpm`. An Enumeration takes its value or the name of an item.
    HarnessError for an unknown name, a text that is not a number, a unit that measures something else, or a value out of
    range.
    """
    values: dict[str, float] = {}
    for setting in settings:
        name, equals, text = (part.strip() for part in setting.partition("="))
        where = f"--set {setting}"
        if not equals:
            raise HarnessError(f"{where}: NAME=VALUE is needed, such as fault.N_a=0.9")
        variable = settable(name, where)
        values[name] = _parsed(variable, text, where)
        check_value(variable, values[name], where)
    check_together(values)
    return values


def check_together(values: Mapping[str, float], where: str = "") -> None:
    """HarnessError, beginning with `where`, if parameters that are in range one by one exclude each other."""
    pairs = values.get("motor.p", ports.VARIABLES[ports.INDEX["motor.p"]].start)
    zeta = values.get("fault.zeta", 0.0)
    if pairs * zeta >= 1.0:
        before = f"{where}: " if where else ""
        raise HarnessError(f"{before}motor.p * fault.zeta = {pairs * zeta:g} is out of range, less than 1 is needed")


def check_drive(values: Mapping[str, float], where: str) -> None:
    """HarnessError, beginning with `where`, if current control and modulation do not go together; `values` are all that are
    set, and the others at the ports' defaults."""
    both = [ports.VARIABLES[ports.INDEX[name]] for name in PAIR]
    chosen = [values.get(port.name, port.start) for port in both]
    if (chosen[0] == both[0].start) != (chosen[1] == both[1].start):
        one, other = (f"{port.name} = {port.text(value)}" for port, value in zip(both, chosen, strict=True))
        raise HarnessError(
            f"{where}: {one} does not go with {other}; ideal goes with hysteresis, field_oriented with sine_triangle or "
            "space_vector"
        )


def _parsed(variable: ports.Variable, text: str, where: str) -> float:
    """The value of `variable` that `text` means; HarnessError, beginning with `where`, if it means none."""
    words: Mapping[str, float] = {"true": 1.0, "false": 0.0} if variable.kind == "Boolean" else variable.items
    try:
        if text.lower() in words or variable.kind == "Boolean":
            return float(words[text.lower()])
        if variable.items:
            return float(text)
    except (KeyError, ValueError):
        wanted = "true or false" if variable.kind == "Boolean" else " or ".join(["a number", *words])
        raise HarnessError(f"{where}: '{text}' is not {wanted}") from None
    try:
        return float(text)
    except ValueError:
        check_unit(variable, text, where)
        return quantity(text, variable.unit, where, also_in(variable))


def also_in(variable: ports.Variable) -> tuple[str, float] | None:
    """The other unit that a value of `variable` may be in, and what a value in it is divided by; None if there is none."""
    return HERTZ if variable.unit == "rad/s" and variable.name.endswith("bandwidth") else None


def check_unit(variable: ports.Variable, text: str, where: str) -> None:
    """HarnessError, beginning with `where`, if `text` gives what is no fraction, such as pole pairs, in % or the like."""
    if variable.unit == "1" and (variable.kind == "Integer" or (variable.minimum or 0.0) >= 1.0):
        unit = split(text, "", where)[1]
        if unit not in ("", "-", "1"):
            raise HarnessError(f"{where}: '{text}': {variable.name} is a plain number, not one in {unit}")


def settable(name: str, where: str) -> ports.Variable:
    """The parameter `name`, or the input load_torque or supply_voltage.

    HarnessError, beginning with `where`, if there is none or if it cannot be set.
    """
    known = {v.name: v for v in (*ports.PARAMETERS, *(i for i in ports.INPUTS if i.name != "command"))}
    if name not in known:
        if name in ports.INDEX:
            raise HarnessError(f"{where}: {name} is not a parameter; trials give the command, FMUs the outputs")
        raise HarnessError(f"{where}: {unknown('parameter', name, known, listed=PORTS)}")
    return known[name]


def check_value(variable: ports.Variable, value: float, where: str) -> None:
    """HarnessError, beginning with `where`, if the port does not accept the value."""
    if variable.kind in ("Integer", "Enumeration") and not float(value).is_integer():
        raise HarnessError(f"{where}: {variable.name} is a whole number, {value:g} is not")
    low = -float("inf") if variable.minimum is None else variable.minimum
    high = float("inf") if variable.maximum is None else variable.maximum
    if not (low <= value <= high and abs(value) != float("inf")):
        unit = "" if variable.unit == "1" else f" {variable.unit}"
        raise HarnessError(f"{where}: {variable.name} = {value:g} is out of range, {low:g} to {high:g}{unit}")

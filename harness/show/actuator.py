"""An actuator resolved: every parameter with its origin, and what follows, as tables and for JSON."""

from collections.abc import Mapping
from typing import Any

from ema_fmu_src import ports
from harness.actuators import drive
from harness.actuators.actuator import Actuator
from harness.actuators.derived import derived
from harness.actuators.doubts import unstated

PARAMETER_HEADS = ("Parameter", "Value", "Unit", "+-95 %", "Origin")
DERIVED_HEADS = ("Quantity", "Value", "Unit", "Formula")
LEFT_OUT = ("fault.", "initial.")
FLIGHT_HEADS = ("Fidelity", "Flies")


def resolved(actuator: Actuator) -> list[ports.Variable]:
    """What an actuator has a value for: supply_voltage, load_torque if it is stated, and every parameter."""
    inputs = [port for port in ports.INPUTS if port.name == "supply_voltage" or port.name in actuator.parameters]
    return [*inputs, *ports.PARAMETERS]


def parameter_rows(actuator: Actuator) -> list[tuple[str, ...]]:
    """A row of texts for each of `resolved`, under PARAMETER_HEADS; a linear actuator's lengths also in m.

    Faults and the state at the start have one only where they are stated.
    """
    rows: list[tuple[str, ...]] = []
    for port in resolved(actuator):
        if port.name.startswith(LEFT_OUT) and port.name not in actuator.parameters:
            continue
        value, width = actuator.value(port.name), actuator.tolerances.get(port.name)
        unit, outside = port.unit, actuator.output.unit(port.name)
        if outside != unit:
            unit = f"{unit} ({value * actuator.output.scale(port.name):.6g} {outside})"
        shown = port.text(value) if port.items or port.kind == "Boolean" else f"{value:.6g}"
        if port.name not in actuator.parameters:
            shown += "".join(f", {model} {start:g}" for model, start in port.start_of.items())
        rows.append((port.name, shown, unit, "" if width is None else f"{width:.3g}", _origin(actuator, port.name)))
    return rows


def _origin(actuator: Actuator, port: str) -> str:
    return actuator.origins.get(port, "default")


def unstated_lines(actuator: Actuator) -> list[str]:
    """A line for each kind of parameter of which something is left at the default actuator's values; none for itself."""
    if actuator.is_default:
        return []
    return [
        f"not stated, the default actuator's: {kind}: "
        + ", ".join(f"{name.partition('.')[2]} {_with_unit(actuator, name)}" for name in names)
        for kind, names in unstated(actuator.parameters).items()
    ]


def _with_unit(actuator: Actuator, name: str) -> str:
    """The value of a parameter in its unit outside."""
    unit, port = actuator.output.unit(name), ports.VARIABLES[ports.INDEX[name]]
    if port.items:
        return port.text(actuator.value(name))
    return f"{actuator.value(name) * actuator.output.scale(name):.4g}{'' if unit == '1' else f' {unit}'}"


def derived_rows(actuator: Actuator) -> list[tuple[str, ...]]:
    """A row of texts for each derived quantity, under DERIVED_HEADS."""
    return [(item.name, f"{item.value:.5g}", item.unit, item.formula) for item in derived(actuator)]


def drive_as_dict(actuator: Actuator) -> dict[str, object]:
    """What the drive is, for JSON: the Enumerations' items, the current loop if it is a sampled one, the PID's cascade if it
    has one."""
    given = actuator.parameters
    loop = drive.current_loop(actuator) if drive.is_oriented(given) else None
    cascade = drive.as_cascade(actuator) if drive.is_pid(given) else None
    return {
        "structure": drive.chosen(given, "controller.structure"),
        "current_control": drive.chosen(given, "controller.current_control"),
        "modulation": drive.chosen(given, "inverter.modulation"),
        "cascade": None if cascade is None else vars(cascade),
        "current_loop": None
        if loop is None
        else {
            "K": loop.K,
            "K_i": loop.K_i,
            "T": loop.T,
            "poles": [[pole.real, pole.imag] for pole in loop.poles],
            "settles": loop.settles,
        },
    }


def flight_rows(refusals: Mapping[str, str]) -> list[tuple[str, ...]]:
    """A row of texts for each fidelity, under FLIGHT_HEADS."""
    return [(name, reason or "yes") for name, reason in refusals.items()]


def as_dict(actuator: Actuator, refusals: Mapping[str, str] | None) -> dict[str, object]:
    """For JSON; `refusals` as from `harness.flight.tryout`, None if the FMUs were not tried."""
    return {
        **actuator.identity,
        "description": actuator.description,
        "output": {"lead": actuator.output.lead},
        "parameters": {
            port.name: {
                "value": actuator.value(port.name),
                "unit": port.unit,
                "tolerance": actuator.tolerances.get(port.name),
                "origin": _origin(actuator, port.name),
            }
            for port in resolved(actuator)
        },
        "derived": {
            item.name: {"value": item.value, "unit": item.unit, "formula": item.formula} for item in derived(actuator)
        },
        "drive": drive_as_dict(actuator),
        "flies": None if refusals is None else {name: not reason for name, reason in refusals.items()},
        "refusals": None if refusals is None else {name: reason for name, reason in refusals.items() if reason},
        "warnings": list(actuator.warnings),
        "unstated": []
        if actuator.is_default
        else [name for names in unstated(actuator.parameters).values() for name in names],
        "log": dict(actuator.log),
        "limits": dict(actuator.limits),
        "calibration": plain(actuator.calibration),
        "provenance": plain(actuator.provenance),
    }


def plain(value: Any) -> Any:
    """A value out of TOML as JSON has it: dates as texts."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value if isinstance(value, str | int | float | bool) else str(value)

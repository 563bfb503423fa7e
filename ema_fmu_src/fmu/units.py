"""The units of the ports, as FMI 2.0 (section 2.2.2) and SSP 1.0 declare them."""

import math
from xml.etree.ElementTree import Element, SubElement

UNITS: dict[str, tuple[str, dict[str, int]]] = {
    "rad": ("Angle", {"rad": 1}),
    "rad/s": ("AngularVelocity", {"rad": 1, "s": -1}),
    "s": ("Time", {"s": 1}),
    "1/s": ("PositionGain", {"s": -1}),
    "1": ("Ratio", {}),
    "A": ("Current", {"A": 1}),
    "A/rad": ("IntegralGain", {"A": 1, "rad": -1}),
    "A.s/rad": ("SpeedGain", {"A": 1, "s": 1, "rad": -1}),
    "V": ("Voltage", {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "V.s/rad": ("BackEmfCoefficient", {"kg": 1, "m": 2, "s": -2, "A": -1, "rad": -1}),
    "W": ("Power", {"kg": 1, "m": 2, "s": -3}),
    "Ohm": ("Resistance", {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "H": ("Inductance", {"kg": 1, "m": 2, "s": -2, "A": -2}),
    "N.m": ("Torque", {"kg": 1, "m": 2, "s": -2}),
    "N.m.s/rad": ("RotationalDamping", {"kg": 1, "m": 2, "s": -1, "rad": -1}),
    "kg.m2": ("MomentOfInertia", {"kg": 1, "m": 2}),
    "Hz": ("Frequency", {"s": -1}),
    "1/turn": ("CountsPerTurn", {"rad": -1}),
    "A.s2/rad": ("AccelerationGain", {"A": 1, "s": 2, "rad": -1}),
    "A/(rad.s)": ("PositionIntegralGain", {"A": 1, "rad": -1, "s": -1}),
    "V/A": ("CurrentGain", {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "V/(A.s)": ("CurrentIntegralGain", {"kg": 1, "m": 2, "s": -4, "A": -2}),
}
"""Quantity, which is the name of the type too, and exponents of the SI base units, for each unit of a port."""

FACTORS = {"1/turn": 1.0 / (2.0 * math.pi)}
"""Unit -> how much of its SI base units it is, where that is not 1."""

DISPLAY_UNITS: dict[str, dict[str, float]] = {
    "rad": {"deg": 57.29577951308232},
    "rad/s": {"rpm": 9.549296585513721},
    "A": {"mA": 1e3},
}
"""Units in which people read a unit, and their factors."""
DISPLAYED = {"rad": "deg", "rad/s": "rpm"}
"""Display unit of all variables of a unit that do not name another one."""


def declare(parent: Element, name: str, *, prefix: str = "") -> Element:
    """Append the declaration of the unit `name` to `parent`; `prefix` is that of the XML namespace, with its colon."""
    unit = SubElement(parent, f"{prefix}Unit", name=name)
    _, exponents = UNITS[name]
    base = {base: str(exponent) for base, exponent in exponents.items()}
    if name in FACTORS:
        base["factor"] = repr(FACTORS[name])
    SubElement(unit, f"{prefix}BaseUnit", base)
    return unit

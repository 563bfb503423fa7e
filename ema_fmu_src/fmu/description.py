"""The model description, made from `ports`: what pythonfmu's own leaves out or gets wrong is completed here."""

import uuid
from xml.etree.ElementTree import Element, SubElement, tostring

from .. import __version__, ports

UNITS: dict[str, dict[str, int]] = {
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "s": {"s": 1},
    "1/s": {"s": -1},
    "1": {},
    "A": {"A": 1},
    "A/rad": {"A": 1, "rad": -1},
    "A.s/rad": {"A": 1, "s": 1, "rad": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "V.s/rad": {"kg": 1, "m": 2, "s": -2, "A": -1, "rad": -1},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "kg.m2": {"kg": 1, "m": 2},
}
"""Exponents of the SI base units of each unit that the ports use."""

DISPLAY_UNITS = {"rad": ("deg", 57.29577951308232), "rad/s": ("rpm", 9.549296585513721)}
"""Display unit and its factor for the units that people read in others."""

START_TIME, STOP_TIME, STEP_SIZE, TOLERANCE = "0.0", "2.5", "0.0001", "0.0001"
GENERATED = "2026-01-01T00:00:00Z"
"""Fixed, so that the same source gives the same FMU byte for byte."""
CATEGORIES = {
    "logStatusWarning": "What the FMU noticed and went on with",
    "logStatusDiscard": "Why a step was refused",
    "logStatusError": "Why a value or a call was refused",
    "logStatusFatal": "Why the FMU cannot go on",
    "logAll": "All messages",
}


def _number(value: float) -> str:
    """Shortest text that reads back to the same float64."""
    return repr(float(value))


def _units() -> Element:
    definitions = Element("UnitDefinitions")
    for name, exponents in UNITS.items():
        unit = SubElement(definitions, "Unit", name=name)
        SubElement(unit, "BaseUnit", {base: str(exponent) for base, exponent in exponents.items()})
        if name in DISPLAY_UNITS:
            display, factor = DISPLAY_UNITS[name]
            SubElement(unit, "DisplayUnit", name=display, factor=_number(factor))
    return definitions


def _scalar_variable(variable: ports.Variable, reference: int, model: str) -> Element:
    calculated = variable.causality in ("output", "local")
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description_for(model),
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality != "input":
        attributes["initial"] = "calculated" if calculated else "exact"
    element = Element("ScalarVariable", attributes)
    kind = SubElement(element, variable.kind)
    start = variable.start_for(model)
    if variable.kind == "Real":
        kind.set("unit", variable.unit)
        if variable.unit in DISPLAY_UNITS:
            kind.set("displayUnit", DISPLAY_UNITS[variable.unit][0])
    if variable.kind != "Boolean":
        text = _number if variable.kind == "Real" else (lambda value: str(int(value)))
        if variable.minimum is not None:
            kind.set("min", text(variable.minimum))
        if variable.maximum is not None:
            kind.set("max", text(variable.maximum))
        if not calculated:
            kind.set("start", text(start))
    elif not calculated:
        kind.set("start", "true" if start else "false")
    return element


def complete(root: Element, model: str, source_hash: str) -> Element:
    """Complete pythonfmu's description `root` of the twin `model`, in place; returns it.

    Adds units, limits, initial and unknowns, replaces the variables by those of `ports`, fixes date and GUID by content.
    """
    root.set("generationTool", f"EMA twins {__version__} ({root.get('generationTool')})")
    root.set("generationDateAndTime", GENERATED)
    root.set("version", __version__)
    root.set("variableNamingConvention", "structured")
    co_simulation = root.find("CoSimulation")
    assert co_simulation is not None
    co_simulation.attrib.update(
        needsExecutionTool="false",
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    for child in list(root):
        if child is not co_simulation:
            root.remove(child)
    root.append(_units())
    categories = SubElement(root, "LogCategories")
    for name, description in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    SubElement(
        root, "DefaultExperiment", startTime=START_TIME, stopTime=STOP_TIME, stepSize=STEP_SIZE, tolerance=TOLERANCE
    )
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(ports.VARIABLES):
        variables.append(_scalar_variable(variable, reference, model))
    structure = SubElement(root, "ModelStructure")
    outputs = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    for reference, variable in enumerate(ports.VARIABLES):
        if variable.causality == "output":
            SubElement(outputs, "Unknown", index=str(reference + 1))
            SubElement(unknowns, "Unknown", index=str(reference + 1))
    root.set("guid", "")
    identity = tostring(root).decode() + source_hash
    root.set("guid", "{" + str(uuid.uuid5(uuid.NAMESPACE_URL, identity)) + "}")
    return root

"""The model description, made from `ports` alone, so that every runtime of a twin carries the same one."""

import uuid
from xml.etree.ElementTree import Element, SubElement, tostring

from .. import __version__, ports
from ..twins import TWINS

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

START_TIME, STOP_TIME, STEP_SIZE = "0.0", "2.5", "0.0001"
GENERATED = "2026-01-01T00:00:00Z"
"""Fixed, so that the same source gives the same FMU byte for byte."""
CATEGORIES = {
    "logStatusWarning": "What the FMU noticed and went on with",
    "logStatusDiscard": "Why a step was refused",
    "logStatusError": "Why a value or a call was refused",
    "logStatusFatal": "Why the FMU cannot go on",
    "logAll": "All messages",
}

FLAGS = (
    "needsExecutionTool",
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "canBeInstantiatedOnlyOncePerProcess",
    "canNotUseMemoryManagementFunctions",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
)
"""Flags of the CoSimulation element (FMI 2.0, section 4.3.1)."""


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
    """One ScalarVariable (FMI 2.0, section 2.2.7); inputs have no `initial`, as the standard asks."""
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


def model_description(model: str, *, runtime: str, source_hash: str, capabilities: dict[str, bool]) -> Element:
    """The fmiModelDescription of the twin `model` ("HF", "ELF" or "LF"; FMI 2.0, section 2.2).

    `runtime` names what runs the kernels, for generationTool. `capabilities` are flags of the CoSimulation element;
    those that are not named are false. The GUID follows from the description and from `source_hash`, the content of
    the sources: the same content has the same GUID.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=f"EMA_{model}",
        guid="",
        description=TWINS[model].title,
        version=__version__,
        generationTool=f"EMA twins {__version__} ({runtime})",
        generationDateAndTime=GENERATED,
        variableNamingConvention="structured",
    )
    flags = dict.fromkeys(FLAGS, False) | capabilities
    SubElement(
        root,
        "CoSimulation",
        {"modelIdentifier": f"EMA_{model}"} | {name: "true" if flag else "false" for name, flag in flags.items()},
    )
    root.append(_units())
    categories = SubElement(root, "LogCategories")
    for name, description in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    SubElement(root, "DefaultExperiment", startTime=START_TIME, stopTime=STOP_TIME, stepSize=STEP_SIZE)
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(ports.VARIABLES):
        variables.append(_scalar_variable(variable, reference, model))
    structure = SubElement(root, "ModelStructure")
    for name in ("Outputs", "InitialUnknowns"):
        unknowns = SubElement(structure, name)
        for variable in ports.OUTPUTS:
            SubElement(unknowns, "Unknown", index=str(ports.INDEX[variable.name] + 1))
    identity = tostring(root).decode() + source_hash
    root.set("guid", "{" + str(uuid.uuid5(uuid.NAMESPACE_URL, identity)) + "}")
    return root

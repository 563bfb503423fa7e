"""The model description, made from `ports` alone, so that both runtimes of a twin carry the same one."""

import uuid
from xml.etree.ElementTree import Element, SubElement, tostring

from .. import __author__, __copyright__, __license__, __version__, ports
from ..twins import TWINS, switched
from .markup import literal
from .units import DISPLAY_UNITS, DISPLAYED, UNITS, declare
from .variant import DEFAULT, Variant

START_TIME, STOP_TIME, STEP_SIZE = "0.0", "2.5", "0.0001"
DEFAULT_TOLERANCE = switched.MARGIN
"""Relative tolerance of an experiment that gives none (FMI 2.0, section 2.2.5)."""
EXPERIMENT = {"startTime": START_TIME, "stopTime": STOP_TIME, "stepSize": STEP_SIZE, "tolerance": f"{DEFAULT_TOLERANCE!r}"}
"""Attributes of the default experiment."""
GENERATED = "2026-01-01T00:00:00Z"
"""Fixed, so that the same sources give the same FMU byte for byte."""
CATEGORIES = {
    "logStatusWarning": "Something is unusual; the FMU continues",
    "logStatusDiscard": "A value was refused (python runtime: a step), and why",
    "logStatusError": "A step or a call was refused, and why",
    "logStatusFatal": "The FMU cannot continue, and why",
    "logAll": "All messages",
}

_ANGLE = ("initial.motor_position", "mechanics.end_stop", "gear.ratio", "gear.backlash", "fault.backlash")
_FIELD = (*_ANGLE, "motor.p", "motor.K_e", "fault.magnet", "fault.zeta", "fault.phi")
_CURRENTS = ("initial.phase_current_a", "initial.phase_current_b")
_SENSORS = tuple(f"fault.current_{error}_{phase}" for error in ("gain", "offset") for phase in "abc")
INITIAL_DEPENDENCIES: dict[str, tuple[str, ...]] = {
    "position": (*_ANGLE, "initial.position"),
    "motor_position": _ANGLE,
    "motor_speed": ("initial.motor_speed",),
    "reference_current": ("initial.reference_current",),
    "equivalent_current": (*_ANGLE, "motor.p", *_CURRENTS),
    "equivalent_current_filtered": ("initial.current_filtered",),
    "phase_current_a": ("initial.phase_current_a",),
    "phase_current_b": ("initial.phase_current_b",),
    "phase_current_c": _CURRENTS,
    "back_emf_a": (*_FIELD, "initial.motor_speed", "fault.N_a"),
    "back_emf_b": (*_FIELD, "fault.eccentricity_law", "initial.motor_speed", "fault.N_b"),
    "back_emf_c": (*_FIELD, "fault.eccentricity_law", "initial.motor_speed", "fault.N_c"),
    "motor_torque": (*_FIELD, "fault.eccentricity_law", *_CURRENTS, "fault.N_a", "fault.N_b", "fault.N_c"),
    "measured_motor_position": _ANGLE,
    "measured_current": (*_ANGLE, "motor.p", *_CURRENTS, *_SENSORS),
}
"""Parameters that the initial value of an output depends on; the other outputs start at zero."""

FLAGS = (
    "needsExecutionTool",
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "canBeInstantiatedOnlyOncePerProcess",
    "canNotUseMemoryManagementFunctions",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
)
"""Capability flags of the CoSimulation element (FMI 2.0, section 4.3.1)."""


def _units() -> Element:
    definitions = Element("UnitDefinitions")
    for name in UNITS:
        unit = declare(definitions, name)
        for display, factor in DISPLAY_UNITS.get(name, {}).items():
            SubElement(unit, "DisplayUnit", name=display, factor=literal("Real", factor))
    return definitions


def type_name(variable: ports.Variable) -> str:
    """Name of the type of an Enumeration or a Real: fault.open_switch is an OpenSwitch, a motor.R a Resistance."""
    if variable.kind == "Enumeration":
        return variable.name.rpartition(".")[2].replace("_", " ").title().replace(" ", "")
    return UNITS[variable.unit][0]


def _types() -> Element:
    """A type for each unit, and one for each Enumeration (FMI 2.0, section 2.2.3)."""
    definitions = Element("TypeDefinitions")
    for unit, (quantity, _) in UNITS.items():
        real = SubElement(SubElement(definitions, "SimpleType", name=quantity), "Real", quantity=quantity, unit=unit)
        if unit in DISPLAYED:
            real.set("displayUnit", DISPLAYED[unit])
    for variable in ports.VARIABLES:
        if variable.kind == "Enumeration":
            items = SubElement(SubElement(definitions, "SimpleType", name=type_name(variable)), "Enumeration")
            for item, value in variable.items.items():
                SubElement(items, "Item", name=item, value=str(value))
    return definitions


def _scalar_variable(variable: ports.Variable, reference: int, model: str, variant: Variant) -> Element:
    """One ScalarVariable (FMI 2.0, section 2.2.7); inputs have no attribute `initial`, as the standard requires."""
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
    if variable.kind in ("Real", "Enumeration"):
        kind.set("declaredType", type_name(variable))
    if variable.kind == "Real":
        kind.set("unit", variable.unit)
        display = variable.display or DISPLAYED.get(variable.unit)
        if display:
            kind.set("displayUnit", display)
    numbers = {} if variable.kind == "Boolean" else {"min": variable.minimum, "max": variable.maximum}
    numbers |= {"nominal": variable.nominal, "start": None if calculated else variant.start(variable, model)}
    for attribute, value in numbers.items():
        if value is not None:
            kind.set(attribute, literal(variable.kind, value))
    return element


def _structure() -> Element:
    """The ModelStructure (FMI 2.0, section 2.2.8): an output depends on the state, not on an input at the same point."""
    structure = Element("ModelStructure")
    outputs = SubElement(structure, "Outputs")
    for variable in ports.OUTPUTS:
        SubElement(outputs, "Unknown", index=str(ports.INDEX[variable.name] + 1), dependencies="")
    initial = SubElement(structure, "InitialUnknowns")
    for variable in ports.OUTPUTS:
        knowns = sorted(ports.INDEX[name] + 1 for name in INITIAL_DEPENDENCIES.get(variable.name, ()))
        attributes = {"index": str(ports.INDEX[variable.name] + 1), "dependencies": " ".join(map(str, knowns))}
        SubElement(initial, "Unknown", attributes)
    return structure


def model_description(
    model: str, *, runtime: str, source_hash: str, capabilities: dict[str, bool], variant: Variant = DEFAULT
) -> Element:
    """The fmiModelDescription of the twin `model` ("HF", "ELF" or "LF"; FMI 2.0, section 2.2).

    `runtime` goes into generationTool. `capabilities` are flags of the CoSimulation element; those that are not given are
    false. `variant`: the actuator whose start values it has. The GUID is derived from the description and from
    `source_hash`, the hash of the sources: the same content has the same GUID.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=variant.model_name(model),
        guid="",
        description=variant.title(TWINS[model].title),
        author=__author__,
        version=__version__,
        copyright=__copyright__,
        license=f"{__license__}, see documentation/licenses/license.txt",
        generationTool=f"EMA twins {__version__} ({runtime})",
        generationDateAndTime=GENERATED,
        variableNamingConvention="structured",
    )
    flags = dict.fromkeys(FLAGS, False) | capabilities
    SubElement(
        root,
        "CoSimulation",
        {"modelIdentifier": f"EMA_{model}"} | {name: literal("Boolean", flag) for name, flag in flags.items()},
    )
    root.append(_units())
    root.append(_types())
    categories = SubElement(root, "LogCategories")
    for name, description in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    SubElement(root, "DefaultExperiment", EXPERIMENT)
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(ports.VARIABLES):
        variables.append(_scalar_variable(variable, reference, model, variant))
    root.append(_structure())
    identity = tostring(root).decode() + source_hash
    root.set("guid", "{" + str(uuid.uuid5(uuid.NAMESPACE_URL, identity)) + "}")
    return root

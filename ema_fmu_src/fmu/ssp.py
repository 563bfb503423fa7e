"""ema.ssp: the actuator as a system (SSP 1.0, and by its schemas 2.0), with parameter sets for the healthy actuator and for
faults.

The system has one component, `actuator`, with the FMU resources/EMA.fmu. To change the fidelity, replace that file: all
fidelities have the same ports. SystemStructure.ssd binds the parameter set `healthy`; each of the other sets has a system
structure of its own, NAME.ssd, as SSP provides for variants. For an actuator that is not the default one, every set holds
its start values too, and an annotation tells its name and what else is known of it. The system itself has no connectors,
because some importers (ecos) do not support them: a host uses those of the actuator.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from .. import __version__, ports
from . import archive, description, markup, units
from .variant import DEFAULT, Variant

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
COMPONENT = "actuator"
ANNOTATION = "ema-twins.actuator"
"""Type of the annotation in a parameter set, whose element `actuator` has the name and `Variant.about` as attributes."""

SET_NAME = "initialValues"
"""Name of every parameter set: libcosim and ecos apply the set of this name at the start."""

PARAMETER_SETS: dict[str, dict[str, float]] = {
    "healthy": {variable.name: variable.start for variable in ports.FAULTS if variable.kind != "Enumeration"},
    "worn": {"fault.friction": 2.0, "fault.backlash": 50.0},
    "shorted": {"fault.N_a": 0.8},
    "eccentric": {"fault.zeta": 0.1, "fault.phi": 0.5},
    "broken": {"fault.open_switch": 1},
    "ELF+": {"driver.coupled_saturation": 1.0},
}
"""Parameter sets in the package, by name, each in a file resources/NAME.ssv; values in the ports' units. The set that is
bound has no Enumeration, because libcosim and ecos read none (and start healthy without)."""


def parameter_set(name: str, values: Mapping[str, float], variant: Variant = DEFAULT) -> bytes:
    """A parameter set (SSV) of `values`, parameter -> value in the port's unit; `name` is its description.

    Those of the actuator `variant` are there too; the healthy one is described by the actuator's name.
    """
    values = {**variant.starts, **values}
    if variant.name:
        name = variant.name if name == "healthy" else f"{variant.name}, {name}"
    root = Element(
        "ssv:ParameterSet", {"xmlns:ssv": SSV, "xmlns:ssc": SSC, "version": "1.0", "name": SET_NAME, "description": name}
    )
    parameters = SubElement(root, "ssv:Parameters")
    variables = [ports.VARIABLES[ports.INDEX[parameter]] for parameter in values]
    for variable in variables:
        _typed(SubElement(parameters, "ssv:Parameter", name=variable.name), "ssv", variable, values[variable.name])
    _declare_enumerations(root, "ssv", variables)
    _declare_units(root, "ssv", variables)
    if variant.name:
        annotation = SubElement(SubElement(root, "ssv:Annotations"), "ssc:Annotation", type=ANNOTATION)
        SubElement(annotation, "actuator", {"name": variant.name, **variant.about})
    return markup.document(root)


def _typed(parent: Element, prefix: str, variable: ports.Variable, value: float | None = None) -> None:
    """The type of `variable`, and its `value`: that of an Enumeration is the name of an item."""
    element = SubElement(parent, f"{prefix}:{variable.kind}")
    if value is not None:
        element.set("value", variable.text(value) if variable.items else markup.literal(variable.kind, value))
    if variable.kind == "Real":
        element.set("unit", variable.unit)
    if variable.kind == "Enumeration":
        element.set("name", description.type_name(variable))


def _declare_enumerations(root: Element, prefix: str, variables: Iterable[ports.Variable]) -> None:
    """Declare the types of those `variables` that are Enumerations, if any is: SSP allows no empty list."""
    chosen = [variable for variable in variables if variable.kind == "Enumeration"]
    if chosen:
        declared = SubElement(root, f"{prefix}:Enumerations")
        for variable in chosen:
            items = SubElement(declared, "ssc:Enumeration", name=description.type_name(variable))
            for item, value in variable.items.items():
                SubElement(items, "ssc:Item", name=item, value=str(value))


def _declare_units(root: Element, prefix: str, variables: Iterable[ports.Variable]) -> None:
    """Declare the units of `variables`, if any has one: SSP allows no empty list."""
    used = dict.fromkeys(variable.unit for variable in variables if variable.unit)
    if used:
        declared = SubElement(root, f"{prefix}:Units")
        for name in used:
            units.declare(declared, name, prefix="ssc:")


def structure(parameters: str) -> bytes:
    """The system structure (SSD): one component with the set `parameters` of PARAMETER_SETS bound to it.

    Its name is another one for each set: importers (OMSimulator) tell the variants in a package by their names, and take
    only letters, digits and underscores.
    """
    root = Element(
        "ssd:SystemStructureDescription",
        {"xmlns:ssd": SSD, "xmlns:ssc": SSC, "xmlns:ssv": SSV, "version": "1.0"}
        | {"name": f"EMA_{parameters.replace('+', '_plus')}"}
        | {"generationTool": f"EMA twins {__version__}", "generationDateAndTime": description.GENERATED},
    )
    system = SubElement(root, "ssd:System", name="EMA", description="Electromechanical flight-control actuator")
    shared = (*ports.INPUTS, *ports.OUTPUTS)
    elements = SubElement(system, "ssd:Elements")
    kind = {"type": "application/x-fmu-sharedlibrary", "source": "resources/EMA.fmu", "implementation": "CoSimulation"}
    component = SubElement(elements, "ssd:Component", {"name": COMPONENT} | kind)
    connectors = SubElement(component, "ssd:Connectors")
    for variable in shared:
        _typed(SubElement(connectors, "ssd:Connector", name=variable.name, kind=variable.causality), "ssc", variable)
    SubElement(
        SubElement(component, "ssd:ParameterBindings"),
        "ssd:ParameterBinding",
        {"type": "application/x-ssp-parameter-set", "source": f"resources/{parameters}.ssv"},
    )
    _declare_units(root, "ssd", shared)
    start, stop = description.START_TIME, description.STOP_TIME
    SubElement(root, "ssd:DefaultExperiment", startTime=start, stopTime=stop)
    return markup.document(root)


def write(path: Path, fmu: Path, variant: Variant = DEFAULT) -> None:
    """Write the package `path` with the FMU file `fmu` as its component, completely or not at all.

    Its sets are those of the actuator `variant`.
    """
    members = {"resources/EMA.fmu": fmu.read_bytes()}
    for name, values in PARAMETER_SETS.items():
        members["SystemStructure.ssd" if name == "healthy" else f"{name}.ssd"] = structure(name)
        members[f"resources/{name}.ssv"] = parameter_set(name, values, variant)
    archive.write(path, members)

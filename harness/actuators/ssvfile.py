"""An actuator from a parameter set of SSP (.ssv, SSP 1.0 and 2.0), such as those in ema.ssp."""

from pathlib import Path
from xml.etree import ElementTree

from harness.actuators.actuator import Actuator, Output
from harness.actuators.doubts import doubts
from harness.actuators.values import Stated, checked_name, stated_for, stated_lead
from harness.errors import HarnessError
from harness.parameters import check_drive, check_together, settable

SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
ANNOTATION = "ema-twins.actuator"
"""Type of the annotation that ema_fmu_src/fmu/ssp.py writes; importing that would compile the twins."""
LEAD = "output_lead"
"""Attribute [m] in the annotation of a set that was written for a linear actuator."""
INITIAL = "initialValues"
"""Name of every set in ema.ssp, whose own name is then its description."""


def read_ssv(path: Path) -> Actuator:
    """The actuator whose parameters are the set in the file at `path`; what the set does not have keeps its default.

    HarnessError, with the file and the parameter, for anything that cannot be used.
    """
    root = _root(path)
    values: dict[str, Stated] = {}
    for parameter in root.iterfind(f"{SSV}Parameters/{SSV}Parameter"):
        name = parameter.get("name", "")
        where = f"{path}, {name}"
        variable = settable(name, where)
        if name in values:
            raise HarnessError(f"{where}: it is there twice")
        values[name] = stated_for(variable, _written(parameter, where), Output(), where)
    if not values:
        raise HarnessError(f"{path}: no parameters; an ssv:ParameterSet with ssv:Parameter in it is needed")
    parameters = {name: found.value for name, found in values.items()}
    check_together(parameters, str(path))
    check_drive(parameters, str(path))
    name = root.get("name", "")
    name = (root.get("description") if name in ("", INITIAL) else name) or path.stem
    name = checked_name(name, f"{path}, name")
    output = Output(_lead(root, path))
    origins = dict.fromkeys(parameters, "stated")
    return Actuator(name, "", parameters, origins=origins, output=output, warnings=tuple(doubts(parameters, output)))


def _root(path: Path) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror}") from None
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # an unknown or unfit encoding, too
        raise HarnessError(f"{path}: is not XML: {error}") from None
    if root.tag != f"{SSV}ParameterSet":
        raise HarnessError(f"{path}: is no SSP parameter set; its root has to be ssv:ParameterSet, not {root.tag}")
    return root


def _written(parameter: ElementTree.Element, where: str) -> object:
    """The value of an ssv:Parameter: a text, with the unit of a Real behind it."""
    kinds = [child for child in parameter if child.tag.startswith(SSV) and child.get("value") is not None]
    if len(kinds) != 1:
        raise HarnessError(f"{where}: one value is needed: ssv:Real, ssv:Integer, ssv:Boolean or ssv:Enumeration")
    text, kind = kinds[0].get("value", ""), kinds[0].tag.removeprefix(SSV)
    if kind == "Boolean":
        return {"1": "true", "0": "false"}.get(text, text)
    return f"{text} {kinds[0].get('unit', '')}".strip() if kind == "Real" else text


def _lead(root: ElementTree.Element, path: Path) -> float | None:
    """The lead [m] that our own annotation tells, None if there is none."""
    told = root.find(f"{SSV}Annotations/{SSC}Annotation[@type='{ANNOTATION}']/actuator[@{LEAD}]")
    if told is None:
        return None
    return stated_lead(told.get(LEAD), f"{path}, {LEAD}")

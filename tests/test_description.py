"""The model description, in both runtimes."""

import math
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from ema_fmu_src import __author__, __copyright__, __license__, __version__, ports

STEP = 1e-4  # s
ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("model", ports.MODELS)
def test_validates(built: dict[str, Path], model: str) -> None:
    assert validate_fmu(str(built[model])) == []


@pytest.mark.parametrize("model", ports.MODELS)
def test_description_is_that_of_the_ports(built: dict[str, Path], model: str) -> None:
    description = read_model_description(str(built[model]))
    assert description.modelName == description.coSimulation.modelIdentifier == f"EMA_{model}"
    assert description.version == __version__
    assert description.generationTool.startswith(f"EMA twins {__version__} (")
    assert description.generationDateAndTime.endswith("Z")
    assert not description.coSimulation.needsExecutionTool
    assert description.coSimulation.canHandleVariableCommunicationStepSize
    assert description.coSimulation.canGetAndSetFMUstate and description.coSimulation.canSerializeFMUstate
    assert (description.author, description.copyright) == (__author__, __copyright__)
    assert description.license == f"{__license__}, see documentation/licenses/license.txt"
    experiment = description.defaultExperiment
    assert (float(experiment.startTime), float(experiment.stopTime), float(experiment.stepSize)) == (0.0, 2.5, STEP)
    assert float(experiment.tolerance) == 4e-3
    assert len(description.modelVariables) == len(ports.VARIABLES)
    for place, (found, declared) in enumerate(zip(description.modelVariables, ports.VARIABLES, strict=True)):
        assert (found.name, found.valueReference, found.type) == (declared.name, place, declared.kind)
        assert (found.causality, found.variability) == (declared.causality, declared.variability)
        assert found.description == declared.description_for(model)
        if declared.kind == "Real":
            assert found.unit == declared.unit
            assert found.nominal == (None if declared.nominal is None else repr(float(declared.nominal)))
        if declared.kind == "Enumeration":
            assert {item.name: int(item.value) for item in found.declaredType.items} == declared.items
        for bound, told in ((declared.minimum, found.min), (declared.maximum, found.max)):
            assert declared.kind == "Boolean" or (told is None if bound is None else float(told) == bound)
        if declared.causality in ("output", "local"):
            assert (found.initial, found.start) == ("calculated", None)
        elif declared.kind == "Boolean":
            assert found.start == ("true" if declared.start else "false")
        else:
            assert float(found.start) == declared.start_for(model)
    names = [variable.name for variable in ports.OUTPUTS]
    assert [unknown.variable.name for unknown in description.outputs] == names
    assert [unknown.variable.name for unknown in description.initialUnknowns] == names


def test_same_interface_in_all_three(built: dict[str, Path]) -> None:
    interfaces = [
        [
            (v.name, v.valueReference, v.type, v.unit, v.displayUnit, v.causality, v.variability, v.min, v.max)
            for v in read_model_description(str(path)).modelVariables
        ]
        for path in built.values()
    ]
    assert interfaces[0] == interfaces[1] == interfaces[2]
    assert len({read_model_description(str(path)).guid for path in built.values()}) == 3


@pytest.mark.parametrize(
    "name, factor, shown",
    [
        ("deg", 180 / math.pi, {"command", "position", "fault.phi", "fault.resolver_offset", "mechanics.end_stop"}),
        ("rpm", 30 / math.pi, {"motor_speed", "initial.motor_speed", "controller.speed_limit"}),
        ("mA", 1e3, {"inverter.hysteresis", *(f"fault.current_offset_{phase}" for phase in "abc")}),
    ],
)
def test_display_units(built: dict[str, Path], name: str, factor: float, shown: set[str]) -> None:
    description = read_model_description(str(built["HF"]))
    displays = {display.name: display.factor for unit in description.unitDefinitions for display in unit.displayUnits}
    assert float(displays[name]) == pytest.approx(factor, rel=1e-15)
    assert shown <= {variable.name for variable in description.modelVariables if variable.displayUnit == name}


def test_inputs_have_bounds(built: dict[str, Path]) -> None:
    found = {variable.name: variable for variable in read_model_description(str(built["ELF"])).modelVariables}
    for name, most in (("command", 1e3), ("load_torque", 1e6)):
        assert (float(found[name].min), float(found[name].max)) == (-most, most)


def test_an_enumeration_keeps_its_place_and_its_values(built: dict[str, Path]) -> None:
    """fault.open_switch was an Integer up to version 0.2."""
    (switch,) = (v for v in read_model_description(str(built["HF"])).modelVariables if v.name == "fault.open_switch")
    assert (switch.type, switch.valueReference, switch.start) == ("Enumeration", 67, "0")
    assert [item.name for item in switch.declaredType.items] == [
        "none", "a_upper", "a_lower", "b_upper", "b_lower", "c_upper", "c_lower"
    ]  # fmt: skip


def test_what_is_linked_in_has_its_license(built: dict[str, Path], runtime: str) -> None:
    for path in built.values():
        with zipfile.ZipFile(path) as archive:
            texts = {name: archive.read(name).decode() for name in archive.namelist() if "/licenses/" in name}
        own = texts.pop("documentation/licenses/license.txt")
        assert own.startswith((ROOT / "LICENSE").read_text())
        assert set(texts) == ({"documentation/licenses/pythonfmu.txt"} if runtime == "python" else set())
        for name, text in texts.items():
            assert name.rpartition("/")[2] in own and "Copyright" in text

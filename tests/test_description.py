"""The model description, in both runtimes."""

import math
from pathlib import Path

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from ema_fmu_src import __version__, ports

STEP = 1e-4  # s


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
    experiment = description.defaultExperiment
    assert (float(experiment.startTime), float(experiment.stopTime), float(experiment.stepSize)) == (0.0, 2.5, STEP)
    assert len(description.modelVariables) == len(ports.VARIABLES)
    for place, (found, declared) in enumerate(zip(description.modelVariables, ports.VARIABLES, strict=True)):
        assert (found.name, found.valueReference, found.type) == (declared.name, place, declared.kind)
        assert (found.causality, found.variability) == (declared.causality, declared.variability)
        assert found.description == declared.description_for(model)
        if declared.kind == "Real":
            assert found.unit == declared.unit
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


@pytest.mark.parametrize("name, factor", [("deg", 180 / math.pi), ("rpm", 30 / math.pi)])
def test_display_units(built: dict[str, Path], name: str, factor: float) -> None:
    units = read_model_description(str(built["HF"])).unitDefinitions
    displays = {display.name: display.factor for unit in units for display in unit.displayUnits}
    assert float(displays[name]) == pytest.approx(factor, rel=1e-15)

"""The FMUs as an importer sees them: description, life cycle, state, what they refuse, how they are packed."""

import math
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from fmpy.validation import validate_fmu

from ema_fmu_src import __version__, ports
from ema_fmu_src.fmu import source
from ema_fmu_src.fmu.build import build, built_from, is_current

STEP = 1e-4  # s
OUTPUT_REALS = [ports.INDEX[variable.name] for variable in ports.OUTPUTS if variable.kind == "Real"]
DISCARD, ERROR = 2, 3


class Instance:
    """An instance of an FMU through FMPy's ctypes layer, with all that it logs."""

    def __init__(self, path: Path, folder: Path) -> None:
        description = read_model_description(str(path))
        self.messages: list[tuple[int, str]] = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(str(path), unzipdir=str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="test",
        )
        self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)

    def _log(self, _environment: Any, _name: bytes, status: int, _category: bytes, message: bytes) -> None:
        self.messages.append((status, message.decode()))

    def start(self, *, start_time: float = 0.0, stop_time: float | None = None, command: float = 0.1) -> None:
        self.fmu.setupExperiment(startTime=start_time, stopTime=stop_time)
        self.fmu.enterInitializationMode()
        self.set("command", command)
        self.fmu.exitInitializationMode()

    def set(self, name: str, value: float) -> None:
        setter = {"Real": self.fmu.setReal, "Integer": self.fmu.setInteger, "Boolean": self.fmu.setBoolean}
        setter[ports.VARIABLES[ports.INDEX[name]].kind]([ports.INDEX[name]], [value])

    def get(self, name: str) -> float:
        getter = {"Real": self.fmu.getReal, "Integer": self.fmu.getInteger, "Boolean": self.fmu.getBoolean}
        return getter[ports.VARIABLES[ports.INDEX[name]].kind]([ports.INDEX[name]])[0]

    def step(self, time: float, size: float = STEP) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def run(self, first: int, last: int) -> list[list[float]]:
        """Outputs after each of the steps first..last-1."""
        rows = []
        for k in range(first, last):
            self.step(k * STEP)
            rows.append(self.fmu.getReal(OUTPUT_REALS))
        return rows

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture
def open_fmu(fmus: dict[str, Path], tmp_path: Path) -> Iterator[Callable[..., Instance]]:
    """Opens instances of a model (or of an FMU elsewhere) and closes them after the test."""
    opened: list[Instance] = []

    def open_one(model: str | Path) -> Instance:
        path = fmus[model] if isinstance(model, str) else model
        opened.append(Instance(path, tmp_path / f"instance{len(opened)}"))
        return opened[-1]

    yield open_one
    for instance in opened:
        instance.close()


@pytest.fixture(params=ports.MODELS)
def instance(request: pytest.FixtureRequest, open_fmu: Callable[..., Instance]) -> Instance:
    return open_fmu(request.param)


# --- description ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ports.MODELS)
def test_validates(fmus: dict[str, Path], model: str) -> None:
    assert validate_fmu(str(fmus[model])) == []


@pytest.mark.parametrize("model", ports.MODELS)
def test_description_is_that_of_the_ports(fmus: dict[str, Path], model: str) -> None:
    description = read_model_description(str(fmus[model]))
    assert description.modelName == description.coSimulation.modelIdentifier == f"EMA_{model}"
    assert description.version == __version__
    assert description.generationTool == f"EMA twins {__version__} (pythonfmu 0.7.0)"
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


def test_same_interface_in_all_three(fmus: dict[str, Path]) -> None:
    interfaces = [
        [
            (v.name, v.valueReference, v.type, v.unit, v.displayUnit, v.causality, v.variability, v.min, v.max)
            for v in read_model_description(str(path)).modelVariables
        ]
        for path in fmus.values()
    ]
    assert interfaces[0] == interfaces[1] == interfaces[2]
    assert len({read_model_description(str(path)).guid for path in fmus.values()}) == 3


@pytest.mark.parametrize("name, factor", [("deg", 180 / math.pi), ("rpm", 30 / math.pi)])
def test_display_units(fmus: dict[str, Path], name: str, factor: float) -> None:
    units = read_model_description(str(fmus["HF"])).unitDefinitions
    displays = {display.name: display.factor for unit in units for display in unit.displayUnits}
    assert float(displays[name]) == pytest.approx(factor, rel=1e-15)


# --- life cycle -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ports.MODELS)
def test_fmpy_simulates(fmus: dict[str, Path], model: str) -> None:
    result = simulate_fmu(
        str(fmus[model]), stop_time=0.05, output_interval=STEP, start_values={"command": 0.1, "fault.N_a": 0.9}
    )
    assert result["time"][-1] == pytest.approx(0.05)
    assert np.all(np.isfinite(result["position"]))
    assert 0.01 < result["position"][-1] < 0.1


def test_sets_and_gets_every_type(instance: Instance) -> None:
    for name, value in (("motor.R", 1.25), ("sensor.resolver_bits", 12), ("solver.event_located", False)):
        instance.set(name, value)
        assert instance.get(name) == value
    assert instance.messages == []


def test_reset_repeats_the_run(instance: Instance) -> None:
    instance.start()
    first = instance.run(0, 50)
    instance.set("fault.friction", 3.0)
    instance.run(50, 60)
    instance.fmu.reset()
    assert instance.get("fault.friction") == 1.0
    instance.start()
    assert instance.run(0, 50) == first


def test_clock_starts_with_the_start_time(open_fmu: Callable[..., Instance]) -> None:
    early, late = open_fmu("ELF"), open_fmu("ELF")
    early.start()
    late.start(start_time=8.0)
    early.run(0, 20)
    for k in range(20):
        late.step(8.0 + k * STEP)
    assert late.get("position") == pytest.approx(early.get("position"), rel=1e-9)


def test_tunable_parameter_acts_in_mid_run(instance: Instance) -> None:
    instance.start()
    instance.run(0, 50)
    state = instance.fmu.getFMUstate()
    healthy = instance.run(50, 80)
    instance.fmu.setFMUstate(state)
    instance.set("fault.magnet", 0.5)
    assert instance.run(50, 80) != healthy


@pytest.mark.parametrize("serialized", [False, True])
def test_state_continues_identically(instance: Instance, serialized: bool) -> None:
    """0.00713 s is a multiple of neither the controller's period nor the solver's step."""
    instance.start()
    instance.run(0, 71)
    instance.step(0.0071, 3e-5)
    state = instance.fmu.getFMUstate()
    if serialized:
        data = instance.fmu.serializeFMUstate(state)
        instance.fmu.freeFMUstate(state)
        state = instance.fmu.deSerializeFMUstate(data)

    def go_on() -> list[list[float]]:
        rows = []
        for k in range(30):
            instance.step(0.00713 + k * STEP)
            rows.append(instance.fmu.getReal(OUTPUT_REALS))
        return rows

    first = go_on()
    instance.set("command", -0.2)
    instance.step(0.00713 + 30 * STEP)
    instance.fmu.setFMUstate(state)
    assert go_on() == first
    instance.fmu.freeFMUstate(state)


def test_many_instances_in_one_process(fmus: dict[str, Path], tmp_path: Path) -> None:
    for _ in range(40):
        Instance(fmus["LF"], tmp_path).fmu.freeInstance()


# --- refusals -------------------------------------------------------------------------------------------------------


def refused(call: Callable[..., None], *arguments: float) -> None:
    """Asserts that a step is answered with fmi2Discard."""
    with pytest.raises(FMICallException) as caught:
        call(*arguments)
    assert caught.value.status == DISCARD


@pytest.mark.parametrize(
    "name, value, told",
    [
        ("command", math.nan, ("command = nan", "0.1")),
        ("load_torque", math.inf, ("load_torque = inf", "0.0")),
        ("fault.friction", math.nan, ("fault.friction = nan", "1.0")),
        ("supply_voltage", -1.0, ("supply_voltage = -1.0", "minimum 0.0")),
        ("fault.N_a", 1.5, ("fault.N_a = 1.5", "maximum 1.0")),
        ("fault.open_switch", 7, ("fault.open_switch = 7", "maximum 6")),
        ("motor.R", 2.0, ("motor.R = 2.0", "fixed", "1.0")),
        ("motor.p", 3, ("motor.p = 3", "fixed", "2")),
        ("driver.coupled_saturation", True, ("driver.coupled_saturation = True", "fixed", "0.0")),
        ("position", 0.3, ("position = 0.3", "output")),
    ],
)
def test_refused_value_stays_out(instance: Instance, name: str, value: float, told: tuple[str, ...]) -> None:
    instance.start()
    instance.run(0, 5)
    before = instance.get(name)
    instance.set(name, value)
    assert instance.get(name) == before
    status, message = instance.messages[0]
    assert status == ERROR
    assert all(word in message for word in told), message
    refused(instance.step, 5 * STEP)
    assert instance.messages[-1][0] == DISCARD
    assert all(word in instance.messages[-1][1] for word in told)
    instance.run(5, 10)
    assert len(instance.messages) == 2


@pytest.mark.parametrize(
    "time, size, told",
    [
        (5 * STEP, 0.0, ("0.0 s", "more than 0 s")),
        (5 * STEP, -STEP, ("-0.0001 s", "more than 0 s")),
        (5 * STEP, math.nan, ("nan", "finite")),
        (5 * STEP, math.inf, ("inf", "finite")),
        (math.nan, STEP, ("nan", "finite")),
        (0.75, STEP, ("0.75 s", "0.0005 s")),
        (4 * STEP, STEP, ("0.0004 s", "0.0005 s")),
        (5 * STEP, 1e-25, ("too short", "0.0005 s")),
        (5 * STEP, 0.2, ("0.2005 s", "0.01 s")),
    ],
)
def test_refused_step(instance: Instance, time: float, size: float, told: tuple[str, ...]) -> None:
    instance.start(stop_time=0.01)
    instance.run(0, 5)
    refused(instance.step, time, size)
    status, message = instance.messages[0]
    assert status == DISCARD
    assert all(word in message for word in told), message
    instance.run(5, 100)
    assert len(instance.messages) == 1


def test_refused_value_before_the_start(instance: Instance) -> None:
    instance.set("mechanics.J", 0.0)
    assert instance.messages[0][0] == ERROR
    assert "mechanics.J = 0.0" in instance.messages[0][1] and "1e-08" in instance.messages[0][1]
    instance.start()
    refused(instance.step, 0.0)


def test_step_before_initialization(instance: Instance) -> None:
    refused(instance.step, 0.0)
    assert "not been initialized" in instance.messages[0][1]
    instance.start()
    instance.run(0, 5)


def test_status_of_the_kernel_is_told(instance: Instance) -> None:
    """Eccentricity at which the rotor touches the stator: motor.p * zeta >= 1."""
    instance.set("motor.p", 2)
    instance.set("fault.zeta", 0.6)
    instance.start()
    assert instance.messages[0][0] == ERROR
    assert "motor.p * fault.zeta" in instance.messages[0][1]
    refused(instance.step, 0.0)
    assert "motor.p * fault.zeta" in instance.messages[-1][1]
    instance.fmu.reset()
    instance.start()
    instance.run(0, 5)


def test_tunable_parameter_is_checked_in_mid_run(instance: Instance) -> None:
    """The kernel checks motor.p * zeta only when it is told that a parameter has changed."""
    instance.start()
    instance.run(0, 5)
    state = instance.fmu.getFMUstate()
    instance.set("fault.zeta", 0.6)
    refused(instance.step, 5 * STEP)
    assert "motor.p * fault.zeta" in instance.messages[-1][1]
    instance.fmu.setFMUstate(state)
    instance.run(5, 10)


def test_unknown_reference(instance: Instance) -> None:
    instance.start()
    instance.fmu.setReal([len(ports.VARIABLES)], [1.0])
    assert f"value reference {len(ports.VARIABLES)} is no Real" in instance.messages[0][1]
    refused(instance.step, 0.0)
    instance.run(0, 5)


def test_state_of_another_twin(open_fmu: Callable[..., Instance]) -> None:
    lf, elf = open_fmu("LF"), open_fmu("ELF")
    lf.start()
    elf.start()
    data = lf.fmu.serializeFMUstate(lf.fmu.getFMUstate())
    elf.fmu.setFMUstate(elf.fmu.deSerializeFMUstate(data))
    assert "'LF'" in elf.messages[0][1] and "'ELF'" in elf.messages[0][1]
    refused(elf.step, 0.0)
    elf.run(0, 5)


# --- packing --------------------------------------------------------------------------------------------------------


def test_same_bytes_again(fmus: dict[str, Path], tmp_path: Path) -> None:
    for model, path in zip(ports.MODELS, build(out=tmp_path), strict=True):
        assert path.read_bytes() == fmus[model].read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["EMA_ELF.fmu", "EMA_HF.fmu", "EMA_LF.fmu"]


def test_holds_its_sources(fmus: dict[str, Path]) -> None:
    digest = source.content_hash()
    with zipfile.ZipFile(fmus["HF"]) as archive:
        names = set(archive.namelist())
    bundled = {f"resources/ema_fmu_src_{digest[:8]}/{path.relative_to(source.PACKAGE)}" for path in source.files()}
    assert bundled <= names
    assert not any("__pycache__" in name for name in names)
    assert built_from(fmus["HF"]) == digest
    assert is_current(fmus["HF"])


def test_unknown_model(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"XF.*HF, ELF, LF"):
        build(["XF"], out=tmp_path)
    assert not list(tmp_path.iterdir())


def test_failed_build_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ema_fmu_src.fmu.build.validate_fmu", lambda _: ["made up"])
    (tmp_path / "EMA_LF.fmu").write_bytes(b"old")
    with pytest.raises(RuntimeError, match="made up"):
        build(["LF"], out=tmp_path)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("EMA_LF.fmu", b"old")]


@pytest.fixture(scope="module")
def other_lf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """EMA_LF.fmu built from a copy of the sources in which motor.R starts at 2 Ohm."""
    folder = tmp_path_factory.mktemp("other")
    copy = folder / "ema_fmu_src"
    shutil.copytree(source.PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    text = (copy / "ports.py").read_text()
    assert text.count('"motor.R", "Ohm", 1.0') == 1
    (copy / "ports.py").write_text(text.replace('"motor.R", "Ohm", 1.0', '"motor.R", "Ohm", 2.0'))
    script = "from pathlib import Path; from ema_fmu_src.fmu.build import build; build(['LF'], out=Path('.'))"
    environment = os.environ | {"PYTHONPATH": str(folder)}
    subprocess.run([sys.executable, "-c", script], check=True, cwd=folder, env=environment)
    return folder / "EMA_LF.fmu"


def test_bundle_is_used_when_the_sources_differ(open_fmu: Callable[..., Instance], other_lf: Path) -> None:
    ours, others = open_fmu("LF"), open_fmu(other_lf)
    assert (ours.get("motor.R"), others.get("motor.R")) == (1.0, 2.0)
    for one in (ours, others):
        one.start()
        one.run(0, 5)
    assert f"ema_fmu_src_{built_from(other_lf)[:8]}.twins.lf" in sys.modules
    assert f"ema_fmu_src_{source.content_hash()[:8]}" not in sys.modules


def test_runs_without_the_package_and_without_numba(other_lf: Path, tmp_path: Path) -> None:
    """In a Python that can import neither ema_fmu_src nor numba."""
    script = (
        "import sys\n"
        "sys.modules['ema_fmu_src'] = sys.modules['numba'] = None\n"
        "from fmpy import simulate_fmu\n"
        "result = simulate_fmu(sys.argv[1], stop_time=0.01, start_values={'command': 0.1}, output_interval=1e-3)\n"
        "assert result['position'][-1] > 0.0\n"
    )
    subprocess.run([sys.executable, "-c", script, str(other_lf)], check=True, cwd=tmp_path)

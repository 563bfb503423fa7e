"""The FMUs and the SSP in importers that others wrote: fmutool, libcosimpy (libcosim, FMI Library), ecospy (ecos).

Truth: FMPy's results for the same inputs, to the last bit. FMPy hands the tolerance of the default experiment on to the FMU,
libcosim and ecos give none.
"""

import ctypes.util
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

from ema_fmu_src import ports
from ema_fmu_src.fmu import ssp
from ema_fmu_src.fmu.build import SSP

STEPS, STEP = 200, 1e-4
COMMAND, LOAD = 0.1, 2.0
"""Held from the first communication step on [rad], [N.m]."""
FIDELITIES: dict[str, tuple[str, dict[str, float]]] = {
    "HF": ("HF", {}),
    "ELF": ("ELF", {}),
    "ELF+": ("ELF", {"driver.coupled_saturation": 1.0}),
    "LF": ("LF", {}),
}
FAULTS = {"fault.friction": 2.0, "fault.N_a": 0.8}
REALS = [variable.name for variable in ports.OUTPUTS if variable.kind == "Real"]
SETS = pytest.mark.parametrize("name", ["healthy", "worn", "shorted", "eccentric"])
EACH = pytest.mark.parametrize("fidelity", FIDELITIES)
needs_tbb = pytest.mark.skipif(
    ctypes.util.find_library("tbb") is None, reason="ecospy needs the system library libtbb12, which is not installed"
)


def fmpys(fmu: Path, parameters: Mapping[str, float]) -> list[float]:
    """Every Real output after STEPS steps, by FMPy."""
    start = {"command": COMMAND, "load_torque": LOAD} | dict(parameters)
    run = simulate_fmu(str(fmu), stop_time=STEPS * STEP, output_interval=STEP, start_values=start, output=REALS)
    assert len(run) == STEPS + 1
    return [float(run[name][-1]) for name in REALS]


def libcosims(source: Path, parameters: Mapping[str, float]) -> list[float]:
    """The same by libcosim, of a single FMU or of a folder with an unpacked SSP."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.WARNING)
    nanoseconds = round(STEP * 1e9)
    if source.suffix == ".fmu":
        execution = CosimExecution.from_step_size(step_size=nanoseconds)
        execution.add_local_slave(CosimLocalSlave(fmu_path=str(source), instance_name=ssp.COMPONENT))
    else:
        execution = CosimExecution.from_ssp_file(str(source), step_size=nanoseconds)
    slave = execution.slave_index_from_instance_name(ssp.COMPONENT)
    setters = {
        "Real": execution.real_initial_value,
        "Integer": lambda s, r, v: execution.integer_initial_value(s, r, int(v)),
        "Enumeration": lambda s, r, v: execution.integer_initial_value(s, r, int(v)),
        "Boolean": lambda s, r, v: execution.boolean_initial_value(s, r, bool(v)),
    }
    for name, value in ({"command": COMMAND, "load_torque": LOAD} | dict(parameters)).items():
        assert setters[ports.VARIABLES[ports.INDEX[name]].kind](slave, ports.INDEX[name], value)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    assert execution.step(STEPS)
    return [float(value) for value in observer.last_real_values(slave, [ports.INDEX[name] for name in REALS])]


def ecoss(source: Path, parameters: Mapping[str, float], *, parameter_set: str | None = None) -> list[float]:
    """The same by ecos, of a single FMU or of an SSP package."""
    from ecospy import EcosSimulation, EcosSimulationStructure
    from ecospy.lib import EcosLib

    EcosLib.set_log_level("warn")
    name = ssp.COMPONENT
    if source.suffix == ".ssp":
        simulation = EcosSimulation(step_size=STEP, ssp_path=str(source))
    else:
        structure = EcosSimulationStructure()
        structure.add_model(name, str(source))
        typed = {f"{name}::{key}": _typed(key, value) for key, value in parameters.items()}
        if typed:
            structure.add_parameter_set("given", typed)
            parameter_set = "given"
        simulation = EcosSimulation(step_size=STEP, structure=structure)
    simulation.init(parameter_set=parameter_set)
    simulation.set_real(f"{name}::command", COMMAND)
    simulation.set_real(f"{name}::load_torque", LOAD)
    simulation.step(STEPS)
    found = [float(simulation.get_real(f"{name}::{output}")) for output in REALS]
    simulation.terminate()
    simulation.free()
    return found


def _typed(name: str, value: float) -> float | int | bool:
    kinds: dict[str, Callable[[float], float | int | bool]] = {
        "Real": float,
        "Integer": int,
        "Boolean": bool,
        "Enumeration": int,
    }
    return kinds[ports.VARIABLES[ports.INDEX[name]].kind](value)


@pytest.fixture
def unpacked(fmus: dict[str, Path], tmp_path: Path) -> Path:
    """Folder with the unpacked SSP, whose one FMU file a test may replace."""
    subprocess.run([sys.executable, "-m", "zipfile", "-e", str(fmus["HF"].parent / SSP), str(tmp_path)], check=True)
    return tmp_path


@pytest.mark.parametrize("model", ports.MODELS)
def test_fmutool_finds_nothing(fmus: dict[str, Path], model: str) -> None:
    tool = Path(sys.executable).with_name("fmutool")
    done = subprocess.run([tool, "-input", fmus[model], "-check"], capture_output=True, text=True, check=True)
    told = done.stdout + done.stderr
    assert "seems to be compliant" in told and "No semantic error" in told
    assert "WARN" not in told and "ERROR" not in told


@EACH
def test_libcosim_runs_an_fmu(fmus: dict[str, Path], fidelity: str) -> None:
    model, parameters = FIDELITIES[fidelity]
    assert libcosims(fmus[model], parameters | FAULTS) == fmpys(fmus[model], parameters | FAULTS)


def test_libcosim_stops_at_a_value_out_of_range(fmus: dict[str, Path]) -> None:
    """It takes fmi2Discard for what it is, a bad value (FMI 2.0.5, section 2.1.3)."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(step_size=round(STEP * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmus["LF"]), instance_name=ssp.COMPONENT))
    override = CosimManipulator.create_override()
    assert execution.add_manipulator(override) and execution.step(5)
    assert override.slave_real_values(slave, [ports.INDEX["load_torque"]], [5.0]) and execution.step(5)
    assert override.slave_real_values(slave, [ports.INDEX["load_torque"]], [2e6]) and not execution.step(5)


@needs_tbb
def test_ecos_goes_on_with_the_value_before_one_out_of_range(fmus: dict[str, Path]) -> None:
    """It looks at no status of a value that it sets."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    structure.add_model(ssp.COMPONENT, str(fmus["LF"]))
    simulation = EcosSimulation(step_size=STEP, structure=structure)
    simulation.init()
    name = f"{ssp.COMPONENT}::load_torque"
    for value, kept in ((5.0, 5.0), (2e6, 5.0), (-3.0, -3.0)):
        simulation.set_real(name, value)
        simulation.step(1)
        assert simulation.get_real(name) == kept
    simulation.terminate()
    simulation.free()


@EACH
def test_libcosim_runs_the_package_with_one_file_swapped(fmus: dict[str, Path], unpacked: Path, fidelity: str) -> None:
    model, parameters = FIDELITIES[fidelity]
    bound(unpacked, fmus[model], "healthy")
    assert libcosims(unpacked, parameters) == fmpys(fmus[model], parameters)


@SETS
def test_libcosim_applies_the_parameter_sets_of_the_package(fmus: dict[str, Path], unpacked: Path, name: str) -> None:
    bound(unpacked, fmus["LF"], name)
    assert libcosims(unpacked, {}) == fmpys(fmus["LF"], ssp.PARAMETER_SETS[name])


@needs_tbb
@EACH
def test_ecos_runs_an_fmu(fmus: dict[str, Path], fidelity: str) -> None:
    """ecos sets inputs only after the initialization: so does nothing here depend on them at t = 0."""
    model, parameters = FIDELITIES[fidelity]
    assert ecoss(fmus[model], parameters | FAULTS) == fmpys(fmus[model], parameters | FAULTS)


@needs_tbb
@SETS
def test_ecos_applies_the_parameter_sets_of_the_package(
    fmus: dict[str, Path], unpacked: Path, tmp_path: Path, name: str
) -> None:
    package = packed(bound(unpacked, fmus["LF"], name), tmp_path / "own.ssp")
    expected = fmpys(fmus["LF"], ssp.PARAMETER_SETS[name])
    assert ecoss(package, {}, parameter_set="initialValues") == expected
    assert name == "healthy" or not np.array_equal(expected, fmpys(fmus["LF"], {}))


@needs_tbb
@EACH
def test_ecos_runs_the_package_with_one_file_swapped(
    fmus: dict[str, Path], unpacked: Path, tmp_path: Path, fidelity: str
) -> None:
    model, parameters = FIDELITIES[fidelity]
    bound(unpacked, fmus[model], "ELF+" if fidelity == "ELF+" else "healthy")
    package = packed(unpacked, tmp_path / "own.ssp")
    assert ecoss(package, {}, parameter_set="initialValues") == fmpys(fmus[model], parameters)


def bound(unpacked: Path, fmu: Path, parameters: str) -> Path:
    """The unpacked SSP with another FMU and another of its parameter sets bound."""
    (unpacked / "resources" / "EMA.fmu").write_bytes(fmu.read_bytes())
    if parameters != "healthy":
        (unpacked / f"{parameters}.ssd").replace(unpacked / "SystemStructure.ssd")
    return unpacked


def packed(unpacked: Path, package: Path) -> Path:
    """The unpacked SSP as a package again."""
    members = ["SystemStructure.ssd", "resources"]
    subprocess.run([sys.executable, "-m", "zipfile", "-c", str(package), *members], check=True, cwd=unpacked)
    return package

"""The python runtime's own ways: what it refuses is discarded with the next step, and which sources it runs."""

import json
import math
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmi import DISCARD, ERROR, STEP, Instance, refused
from rebuild import rebuilt

from ema_fmu_src import ports
from ema_fmu_src.fmu import source
from ema_fmu_src.fmu.build import built_from, is_current
from ema_fmu_src.twins import CLOCK


@pytest.fixture(params=["python"])
def runtime(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_many_instances_in_one_process(python_fmus: dict[str, Path], tmp_path: Path) -> None:
    """Each in a folder of its own: to extract over a library that is still loaded would crash any host."""
    for n in range(40):
        Instance(python_fmus["LF"], tmp_path / str(n)).fmu.freeInstance()


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
    refused(DISCARD, instance.step, 5 * STEP)
    assert instance.messages[-1][0] == DISCARD
    assert all(word in instance.messages[-1][1] for word in told)
    instance.run(5, 10)
    assert len(instance.messages) == 2


def test_refused_value_before_the_start(instance: Instance) -> None:
    instance.set("mechanics.J", 0.0)
    assert instance.messages[0][0] == ERROR
    assert "mechanics.J = 0.0" in instance.messages[0][1] and "1e-08" in instance.messages[0][1]
    instance.start()
    refused(DISCARD, instance.step, 0.0)


def test_step_before_initialization(instance: Instance) -> None:
    refused(DISCARD, instance.step, 0.0)
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
    refused(DISCARD, instance.step, 0.0)
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
    refused(DISCARD, instance.step, 5 * STEP)
    assert "motor.p * fault.zeta" in instance.messages[-1][1]
    instance.fmu.setFMUstate(state)
    instance.run(5, 10)


def test_unknown_reference(instance: Instance) -> None:
    instance.start()
    instance.fmu.setReal([len(ports.VARIABLES)], [1.0])
    assert f"value reference {len(ports.VARIABLES)} is no Real" in instance.messages[0][1]
    refused(DISCARD, instance.step, 0.0)
    instance.run(0, 5)


def test_state_of_another_twin(open_fmu: Callable[..., Instance]) -> None:
    lf, elf = open_fmu("LF"), open_fmu("ELF")
    lf.start()
    elf.start()
    data = lf.fmu.serializeFMUstate(lf.fmu.getFMUstate())
    elf.fmu.setFMUstate(elf.fmu.deSerializeFMUstate(data))
    assert "'LF'" in elf.messages[0][1] and "'ELF'" in elf.messages[0][1]
    refused(DISCARD, elf.step, 0.0)
    elf.run(0, 5)


FORGED: dict[str, tuple[str, Callable[[dict[str, Any]], object]]] = {
    "no step": ("clock", lambda state: place(state["x"], "step", 0.0)),
    "a step that is none": ("finite", lambda state: place(state["x"], "step", math.nan)),
    "no tick": ("finite", lambda state: place(state["x"], "tick", math.nan)),
    "a tick elsewhere": ("clock", lambda state: place(state["x"], "tick", 1e12)),
    "no steps in a period": ("clock", lambda state: place(state["x"], "per_sample", 0.0)),
    "a part of a tick before it": ("clock", lambda state: place(state["x"], "offset", -1.0)),
    "a sample that is none": ("clock", lambda state: place(state["x"], "next_sample", 0.5)),
    "a flag that is none": ("clock", lambda state: place(state["x"], "pending", 0.5)),
    "a point elsewhere": ("clock", lambda state: state["clock"].__setitem__(1, 1e6)),
    "no start": ("times", lambda state: state["clock"].__setitem__(0, None)),
    "a stop before the start": ("times", lambda state: state["clock"].__setitem__(2, -1.0)),
    "no tolerance": ("tolerance", lambda state: state["clock"].__setitem__(3, 0.0)),
    "a parameter out of its range": ("solver.step is out", lambda state: state["v"].__setitem__(SOLVER_STEP, 1e-300)),
    "half a pole pair": ("motor.p is out", lambda state: state["v"].__setitem__(ports.INDEX["motor.p"], 2.5)),
    "an output that is none": ("finite", lambda state: state["v"].__setitem__(ports.INDEX["position"], math.inf)),
    "words for numbers": ("other variables", lambda state: state["v"].__setitem__(0, "one")),
    "a number too large": ("other variables", lambda state: state["x"].__setitem__(0, 10**400)),
    "too few numbers": ("other variables", lambda state: state["x"].pop()),
    "no mode": ("no mode", lambda state: state.pop("mode")),
    "another mode": ("no mode", lambda state: state["mode"].__setitem__(0, "flying")),
    "another status": ("no status", lambda state: state["mode"].__setitem__(2, ["why"])),
}
SOLVER_STEP = ports.INDEX["solver.step"]


def place(x: list[float], name: str, value: float) -> None:
    x[CLOCK[name]] = value


@pytest.mark.parametrize("forgery", FORGED)
def test_forged_states_are_refused(instance: Instance, forgery: str) -> None:
    told, forge = FORGED[forgery]
    instance.start()
    instance.run(0, 7)
    data = instance.fmu.serializeFMUstate(instance.fmu.getFMUstate())
    state = json.loads(data)
    forge(state)
    instance.fmu.setFMUstate(instance.fmu.deSerializeFMUstate(json.dumps(state).encode()))
    assert "FMU state is refused" in instance.messages[-1][1] and told in instance.messages[-1][1]
    refused(DISCARD, instance.step, 7 * STEP)
    instance.fmu.setFMUstate(instance.fmu.deSerializeFMUstate(data))
    instance.run(7, 10)


def test_holds_its_sources(python_fmus: dict[str, Path]) -> None:
    digest = source.content_hash()
    with zipfile.ZipFile(python_fmus["HF"]) as archive:
        names = set(archive.namelist())
    bundled = {f"resources/ema_fmu_src_{digest[:8]}/{path.relative_to(source.PACKAGE)}" for path in source.runtime_files()}
    assert bundled <= names
    assert not any("__pycache__" in name for name in names)
    assert built_from(python_fmus["HF"])["source"] == digest
    assert is_current(python_fmus["HF"])


@pytest.fixture(scope="module")
def other_lf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """EMA_LF.fmu built from a copy of the sources in which motor.R starts at 2 Ohm."""
    folder = tmp_path_factory.mktemp("other")
    old, new = '"motor.R", "Ohm", 1.0', '"motor.R", "Ohm", 2.0'
    return rebuilt("LF", folder, tmp_path_factory.mktemp("sources"), old=old, new=new, runtime="python")


def test_bundle_is_used_when_the_sources_differ(open_fmu: Callable[..., Instance], other_lf: Path) -> None:
    ours, others = open_fmu("LF"), open_fmu(other_lf)
    for one in (ours, others):
        one.start()
    assert (ours.get("motor.R"), others.get("motor.R")) == (1.0, 2.0)
    for one in (ours, others):
        one.run(0, 5)
    assert f"ema_fmu_src_{built_from(other_lf)['source'][:8]}.twins.lf" in sys.modules
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

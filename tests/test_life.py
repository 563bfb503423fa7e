"""The life of an instance, in both runtimes: values, reset, clock, state, refused steps, how runs are cut."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmi import DISCARD, ERROR, OUTPUT_REALS, STEP, Instance, refused
from fmpy import read_model_description, simulate_fmu

from ema_fmu_src import ports


@pytest.mark.parametrize("model", ports.MODELS)
def test_fmpy_simulates(built: dict[str, Path], model: str) -> None:
    result = simulate_fmu(
        str(built[model]), stop_time=0.05, output_interval=STEP, start_values={"command": 0.1, "fault.N_a": 0.9}
    )
    assert result["time"][-1] == pytest.approx(0.05)
    assert np.all(np.isfinite(result["position"]))
    assert 0.01 < result["position"][-1] < 0.1


def test_sets_and_gets_every_type(instance: Instance) -> None:
    values = {"motor.R": 1.25, "sensor.resolver_bits": 12, "solver.event_located": False}
    for name, value in values.items():
        instance.set(name, value)
    instance.start()
    for name, value in values.items():
        assert instance.get(name) == value
    assert instance.messages == []


def test_reset_repeats_the_run(instance: Instance) -> None:
    instance.start()
    first = instance.run(0, 50)
    instance.set("fault.friction", 3.0)
    instance.run(50, 60)
    instance.fmu.reset()
    instance.start()
    assert instance.get("fault.friction") == 1.0
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


@pytest.mark.parametrize(
    "time, size, told",
    [
        (5 * STEP, 0.0, ("more than 0 s",)),
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
def test_refused_step(runtime: str, instance: Instance, time: float, size: float, told: tuple[str, ...]) -> None:
    """FMI 2.0.5 asks for fmi2Error (sections 2.1.6, 4.2.2), pythonfmu can only discard; the right step can be taken next."""
    answer = ERROR if runtime == "native" else DISCARD
    instance.start(stop_time=0.01)
    instance.run(0, 5)
    refused(answer, instance.step, time, size)
    status, message = instance.messages[0]
    assert status == answer
    assert all(word in message for word in told), message
    instance.run(5, 100)
    assert len(instance.messages) == 1


@pytest.mark.parametrize("size", [1e300, 1e9])
def test_a_step_that_would_not_end_is_refused(runtime: str, instance: Instance, size: float) -> None:
    instance.start()
    refused(ERROR if runtime == "native" else DISCARD, instance.step, 0.0, size)
    assert "steps of" in instance.messages[0][1] and "1e+09 are the most" in instance.messages[0][1]
    instance.run(0, 5)


def test_no_tolerance_is_that_of_the_default_experiment(built: dict[str, Path], open_fmu: Callable[..., Instance]) -> None:
    """HF finds its switchings with it; a tighter one finds others."""
    for model in ports.MODELS:
        default = float(read_model_description(str(built[model])).defaultExperiment.tolerance)
        assert default == 4e-3
        rows = {}
        for tolerance in (None, default, 1e-4):
            instance = open_fmu(model)
            instance.fmu.setupExperiment(tolerance=tolerance, startTime=0.0)
            instance.fmu.enterInitializationMode()
            instance.set("command", 0.1)
            instance.fmu.exitInitializationMode()
            rows[tolerance] = instance.run(0, 100)
        assert rows[None] == rows[default]
        assert (rows[1e-4] == rows[default]) == (model != "HF")
        assert rows[1e-4][-1][0] == pytest.approx(rows[default][-1][0], rel=1e-3)

"""The native runtime's own ways: what it refuses and how, call by call; ramps; tolerance; status queries; logging."""

import ctypes
import math
from collections.abc import Callable

import numpy as np
import pytest
from flight import Flight
from fmi import ERROR, STEP, Instance, refused

from ema_fmu_src import ports
from ema_fmu_src.twins import SLOPES

POSITION = ports.INDEX["position"]


@pytest.fixture(params=["native"])
def runtime(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.parametrize(
    "name, value, told",
    [
        ("command", math.nan, ("command = nan", "stays 0.1")),
        ("load_torque", math.inf, ("load_torque = inf", "stays 0")),
        ("fault.friction", math.nan, ("fault.friction = nan", "stays 1")),
        ("supply_voltage", -1.0, ("supply_voltage = -1 ", "minimum 0")),
        ("fault.N_a", 1.5, ("fault.N_a = 1.5", "maximum 1")),
        ("fault.open_switch", 7, ("fault.open_switch = 7", "maximum 6")),
        ("motor.R", 2.0, ("motor.R = 2 ", "fixed", "stays 1")),
        ("motor.p", 3, ("motor.p = 3", "fixed", "stays 2")),
        ("driver.coupled_saturation", True, ("driver.coupled_saturation = 1", "fixed", "stays 0")),
        ("position", 0.3, ("position = 0.3", "only the FMU")),
    ],
)
def test_refused_value_changes_nothing(instance: Instance, name: str, value: float, told: tuple[str, ...]) -> None:
    instance.start()
    instance.run(0, 5)
    before = instance.get(name)
    refused(ERROR, instance.set, name, value)
    assert instance.get(name) == before
    ((status, message),) = instance.messages
    assert status == ERROR and all(word in message for word in told), message
    instance.run(5, 10)


def test_a_call_sets_all_its_values_or_none(instance: Instance) -> None:
    instance.start()
    references = [ports.INDEX["fault.friction"], ports.INDEX["fault.N_a"]]
    refused(ERROR, instance.fmu.setReal, references, [2.0, 7.0])
    assert instance.get("fault.friction") == 1.0


CALLS: dict[str, Callable[[Instance], object]] = {
    "setupExperiment": lambda i: i.fmu.setupExperiment(startTime=0.0),
    "enterInitializationMode": lambda i: i.fmu.enterInitializationMode(),
    "exitInitializationMode": lambda i: i.fmu.exitInitializationMode(),
    "doStep": lambda i: i.step(0.0),
    "get": lambda i: i.get("position"),
    "set": lambda i: i.set("command", 0.2),
    "terminate": lambda i: i.fmu.terminate(),
    "status": lambda i: i.fmu.getRealStatus(2),
    "getFMUstate": lambda i: i.fmu.freeFMUstate(i.fmu.getFMUstate()),
    "reset": lambda i: i.fmu.reset(),
}
ALLOWED = {
    "instantiated": {"setupExperiment", "enterInitializationMode", "set", "getFMUstate", "reset"},
    "initializing": {"exitInitializationMode", "get", "set", "getFMUstate", "reset"},
    "initialized": {"doStep", "get", "set", "terminate", "status", "getFMUstate", "reset"},
    "terminated": {"get", "status", "getFMUstate", "reset"},
}
"""The calling sequence of FMI 2.0.4, section 4.2.4, table of co-simulation."""


@pytest.mark.parametrize("mode", ALLOWED)
@pytest.mark.parametrize("call", CALLS)
def test_calls_are_refused_in_the_wrong_state(open_fmu: Callable[..., Instance], mode: str, call: str) -> None:
    instance = open_fmu("LF")
    if mode == "initializing":
        instance.fmu.setupExperiment(startTime=0.0)
        instance.fmu.enterInitializationMode()
    elif mode != "instantiated":
        instance.start()
        if mode == "terminated":
            instance.fmu.terminate()
    if call in ALLOWED[mode]:
        CALLS[call](instance)
        assert not instance.messages
    else:
        refused(ERROR, CALLS[call], instance)
        assert "not allowed while the instance is" in instance.messages[0][1]
    instance.fmu.reset()
    instance.start()
    instance.run(0, 3)


def test_a_failed_twin_says_why_and_can_be_reset(instance: Instance) -> None:
    """Eccentricity at which the rotor touches the stator: motor.p * zeta >= 1."""
    instance.set("fault.zeta", 0.6)
    instance.fmu.setupExperiment(startTime=0.0)
    instance.fmu.enterInitializationMode()
    refused(ERROR, instance.fmu.exitInitializationMode)
    assert "motor.p * fault.zeta" in instance.messages[0][1]
    refused(ERROR, instance.step, 0.0)
    assert "failed" in instance.messages[-1][1]
    instance.fmu.reset()
    instance.start()
    instance.run(0, 5)


def test_a_twin_that_fails_in_mid_run_goes_on_from_a_state(instance: Instance) -> None:
    instance.start()
    instance.run(0, 5)
    state = instance.fmu.getFMUstate()
    instance.set("fault.zeta", 0.6)
    refused(ERROR, instance.step, 5 * STEP)
    assert "motor.p * fault.zeta" in instance.messages[0][1]
    assert math.isfinite(instance.get("position"))
    instance.fmu.setFMUstate(state)
    instance.run(5, 10)


def test_unknown_references_and_wrong_types(instance: Instance) -> None:
    instance.start()
    for call, reference in ((instance.fmu.setReal, len(ports.VARIABLES)), (instance.fmu.setInteger, 0)):
        refused(ERROR, call, [reference], [1])
        assert f"value reference {reference} is no" in instance.messages[-1][1]
    refused(ERROR, instance.fmu.getBoolean, [POSITION])
    refused(ERROR, instance.fmu.getString, [POSITION])
    instance.run(0, 5)


@pytest.mark.parametrize("model", ports.MODELS)
def test_ramps_are_the_kernels_ramps(open_fmu: Callable[..., Instance], model: str) -> None:
    """Against the kernel flown with the same slopes; and a ramp in ten communication steps against one in a hundred, which
    follow the same command."""
    slope = 2.0
    fine, coarse, held = open_fmu(model), open_fmu(model), open_fmu(model)
    flight = Flight(model)
    for one in (fine, coarse, held):
        one.start(command=0.0)
    for k in range(100):
        fine.set("command", slope * k * STEP)
        fine.fmu.setRealInputDerivatives([0], [1], [slope])
        fine.step(k * STEP)
        flight.v[ports.INDEX["command"]] = slope * k * STEP
        flight.x[SLOPES["command"]] = slope
        flight.to(k * STEP + STEP)
        assert fine.get("position") == flight["position"]
    for k in range(10):
        for one in (coarse, held):
            one.set("command", slope * k * 10 * STEP)
        coarse.fmu.setRealInputDerivatives([0], [1], [slope])
        for one in (coarse, held):
            one.step(k * 10 * STEP, 10 * STEP)
    assert coarse.get("position") == pytest.approx(fine.get("position"), rel=1e-6)
    assert abs(held.get("position") - fine.get("position")) > 1e-3 * fine.get("position")


def test_a_ramp_holds_for_one_step(open_fmu: Callable[..., Instance]) -> None:
    ramped, plain = open_fmu("LF"), open_fmu("LF")
    for one in (ramped, plain):
        one.start(command=0.0)
    state = ramped.fmu.getFMUstate()
    ramped.fmu.setRealInputDerivatives([0], [1], [5.0])
    ramped.fmu.setFMUstate(state)  # the state holds the slopes too: none
    assert ramped.run(0, 20) == plain.run(0, 20)
    for order, value in ((2, 1.0), (1, math.nan)):
        refused(ERROR, ramped.fmu.setRealInputDerivatives, [0], [order], [value])
    refused(ERROR, ramped.fmu.setRealInputDerivatives, [POSITION], [1], [1.0])


def test_status_queries(instance: Instance) -> None:
    do_step, pending, last, terminated = range(4)
    instance.start()
    instance.run(0, 7)
    assert instance.fmu.getStatus(do_step) == 0
    assert instance.fmu.getRealStatus(last) == pytest.approx(7 * STEP)
    assert not instance.fmu.getBooleanStatus(terminated)
    with pytest.raises(Exception, match=r"status 2"):
        instance.fmu.getStringStatus(pending)


@pytest.mark.parametrize(
    "stop, tolerance, told", [(-1.0, None, "stop time -1 s"), (None, 0.0, "tolerance 0 "), (None, math.nan, "nan")]
)
def test_refused_experiments(instance: Instance, stop: float | None, tolerance: float | None, told: str) -> None:
    with pytest.raises(Exception, match="status 3"):
        instance.fmu.setupExperiment(tolerance=tolerance, startTime=0.0, stopTime=stop)
    assert told in instance.messages[0][1]


def test_categories_choose_what_is_logged(open_fmu: Callable[..., Instance]) -> None:
    instance = open_fmu("LF")
    instance.start()
    instance.fmu.setDebugLogging(True, ["logStatusDiscard"])
    refused(ERROR, instance.set, "command", math.nan)
    assert instance.messages == []
    with pytest.raises(Exception, match="status 2"):
        instance.step(5.0)
    assert len(instance.messages) == 1
    instance.fmu.setDebugLogging(False, [])
    with pytest.raises(Exception, match="status 2"):
        instance.step(5.0)
    assert len(instance.messages) == 1
    instance.fmu.setDebugLogging(True, ["logAll"])
    refused(ERROR, instance.fmu.setDebugLogging, True, ["noise"])
    assert "no category noise" in instance.messages[-1][1]


@pytest.mark.parametrize(
    "change, told",
    [
        ({"guid": b"{other}"}, "GUID {other} is not this FMU's"),
        ({"kind": 0}, "only co-simulation"),
        ({"name": b""}, "name is needed"),
    ],
)
def test_refused_instantiation(open_fmu: Callable[..., Instance], change: dict[str, object], told: str) -> None:
    instance = open_fmu("LF")
    given = {"name": b"other", "kind": 1, "guid": instance.fmu.guid.encode()} | change
    fmu = instance.fmu
    made = fmu.fmi2Instantiate(given["name"], given["kind"], given["guid"], b"", ctypes.byref(instance.callbacks), 0, 1)
    assert not made
    assert told in instance.messages[-1][1]


def test_two_interleaved_instances_are_strangers(open_fmu: Callable[..., Instance]) -> None:
    one, other, alone = open_fmu("HF"), open_fmu("HF"), open_fmu("HF")
    one.start(command=0.1)
    other.start(command=-0.3)
    alone.start(command=0.1)
    rows = []
    for k in range(50):
        rows += one.run(k, k + 1)
        other.run(k, k + 1)
    assert rows == alone.run(0, 50)
    assert not np.array_equal(rows[-1], other.run(50, 51)[0])


def test_the_tolerance_is_that_of_hfs_events(open_fmu: Callable[..., Instance]) -> None:
    """The default is 4e-3 of the band: given as the tolerance, the same bits; a tighter one finds other switchings."""
    rows = {}
    for tolerance in (None, 4e-3, 1e-4):
        instance = open_fmu("HF")
        instance.fmu.setupExperiment(tolerance=tolerance, startTime=0.0)
        instance.fmu.enterInitializationMode()
        instance.set("command", 0.1)
        instance.fmu.exitInitializationMode()
        rows[tolerance] = instance.run(0, 100)
    assert rows[None] == rows[4e-3] != rows[1e-4]
    assert rows[1e-4][-1][0] == pytest.approx(rows[None][-1][0], rel=1e-3)

"""The native runtime's own ways: what it refuses and how, call by call; ramps; tolerance; status queries; logging."""

import ctypes
import math
from collections.abc import Callable

import numpy as np
import pytest
from flight import Flight
from fmi import DISCARD, ERROR, STEP, Instance, refused

from ema_fmu_src import ports
from ema_fmu_src.twins import SLOPES

POSITION = ports.INDEX["position"]


@pytest.fixture(params=["native"])
def runtime(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.parametrize(
    "name, value, status, told",
    [
        ("command", math.nan, DISCARD, ("command = nan", "stays 0.1")),
        ("command", 1001.0, DISCARD, ("command = 1001 ", "maximum 1000", "stays 0.1")),
        ("load_torque", math.inf, DISCARD, ("load_torque = inf", "stays 0")),
        ("load_torque", -1.1e6, DISCARD, ("load_torque = -1100000 ", "minimum -1000000", "stays 0")),
        ("fault.friction", math.nan, DISCARD, ("fault.friction = nan", "stays 1")),
        ("supply_voltage", -1.0, DISCARD, ("supply_voltage = -1 ", "minimum 0")),
        ("fault.N_a", 1.5, DISCARD, ("fault.N_a = 1.5", "maximum 1")),
        ("fault.open_switch", 7, DISCARD, ("fault.open_switch = 7", "maximum 6")),
        ("motor.R", 2.0, ERROR, ("motor.R = 2 ", "fixed", "stays 1")),
        ("motor.p", 3, ERROR, ("motor.p = 3", "fixed", "stays 2")),
        ("driver.coupled_saturation", True, ERROR, ("driver.coupled_saturation = 1", "fixed", "stays 0")),
        ("position", 0.3, ERROR, ("position = 0.3", "only the FMU")),
    ],
)
def test_refused_value_changes_nothing(
    instance: Instance, name: str, value: float, status: int, told: tuple[str, ...]
) -> None:
    """A value that is out of its range is discarded (FMI 2.0.5, section 2.1.3); one that may not be set is an error."""
    instance.start()
    instance.run(0, 5)
    before = instance.get(name)
    refused(status, instance.set, name, value)
    assert instance.get(name) == before
    ((logged, message),) = instance.messages
    assert logged == status and all(word in message for word in told), message
    instance.run(5, 10)


def test_the_worst_of_several_refusals_is_told(instance: Instance) -> None:
    instance.start()
    references = [ports.INDEX["fault.friction"], ports.INDEX["motor.R"], ports.INDEX["fault.N_a"]]
    refused(ERROR, instance.fmu.setReal, references, [math.nan, 2.0, 7.0])
    assert [status for status, _ in instance.messages] == [DISCARD, ERROR, DISCARD]


def test_a_call_sets_all_its_values_or_none(instance: Instance) -> None:
    instance.start()
    references = [ports.INDEX["fault.friction"], ports.INDEX["fault.N_a"]]
    refused(DISCARD, instance.fmu.setReal, references, [2.0, 7.0])
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
"""The calling sequence of FMI 2.0.5, section 4.2.4, table of co-simulation."""


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


@pytest.mark.parametrize(
    "name, value, slope", [("supply_voltage", 48.0, -1e3), ("command", 999.0, 20.0), ("load_torque", 0.0, 1e300)]
)
def test_a_ramp_that_leaves_the_range_is_refused(instance: Instance, name: str, value: float, slope: float) -> None:
    instance.start()
    instance.set(name, value)
    instance.fmu.setRealInputDerivatives([ports.INDEX[name]], [1], [slope])
    refused(ERROR, instance.step, 0.0, 0.1)
    assert f"{name} would ramp out of its range" in instance.messages[-1][1]
    instance.fmu.setRealInputDerivatives([ports.INDEX[name]], [1], [0.0])
    instance.step(0.0, 0.001)


@pytest.mark.parametrize("model", ports.MODELS)
def test_outputs_in_any_order_and_number(open_fmu: Callable[..., Instance], model: str) -> None:
    """Those that follow one another are copied together: each must still be the one that was asked for."""
    instance = open_fmu(model)
    instance.start(command=0.2)
    instance.run(0, 50)
    reals = [reference for reference, port in enumerate(ports.VARIABLES) if port.kind == "Real"]
    alone = {reference: instance.fmu.getReal([reference])[0] for reference in reals}
    assert len(set(alone.values())) > 30
    for asked in (reals, reals[::-1], reals[::2], reals[3:9] + reals[3:9], reals[5:22] * 2 + reals[:1] + reals[-3:]):
        assert list(instance.fmu.getReal(asked)) == [alone[reference] for reference in asked]
    integer = ports.INDEX["motor.p"]
    for wrong in ([*range(reals[0], integer + 1)], [*reals, integer], [reals[-1], len(ports.VARIABLES)]):
        refused(ERROR, instance.fmu.getReal, wrong)


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
    refused(ERROR, instance.step, 5.0)
    assert instance.messages == []
    refused(DISCARD, instance.set, "command", math.nan)
    assert len(instance.messages) == 1
    instance.fmu.setDebugLogging(False, [])
    refused(DISCARD, instance.set, "command", math.nan)
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

"""Coupled FMUs: an EMA against a spring-damper load, which is an FMU that pythonfmu made."""

import math
from pathlib import Path

import numpy as np
import pytest
import spring
from flight import Flight
from spring import STIFFNESS, TAU

from harness.errors import HarnessError
from harness.flight.couple import Connection, System, fly

INNER = 2e-6  # s


@pytest.fixture(scope="module")
def load(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return spring.build(tmp_path_factory.mktemp("load"))


def system(fmus: dict[str, Path], load: Path) -> System:
    return System(
        components={"ema": fmus["LF"], "load": load},
        connections=[Connection("ema.position", "load.position"), Connection("load.torque", "ema.load_torque")],
        parameters={"ema.solver.step": INNER},
    )


@pytest.fixture(scope="module")
def monolithic() -> np.ndarray:
    """Position and torque at the end of 20 ms: both models in one loop, with steps as small as the twin's own."""
    flight = Flight("LF", {"solver.step": INNER, "command": 0.1})
    torque = 0.0
    share = 1.0 - math.exp(-INNER / TAU)
    for k in range(round(0.02 / INNER)):
        flight.v[1] = torque
        flight.to((k + 1) * INNER)
        torque += (STIFFNESS * flight["position"] - torque) * share
    return np.array([flight["position"], torque])


@pytest.mark.parametrize("order", ["jacobi", "gauss-seidel"])
def test_it_converges_to_the_monolithic_solution_at_first_order(fmus, load, monolithic, order) -> None:
    errors = []
    for step in (8e-4, 4e-4, 2e-4):
        run = fly(
            system(fmus, load),
            stop=0.02,
            step=step,
            inputs={"ema.command": np.full(round(0.02 / step), 0.1)},
            record=["ema.position", "load.torque"],
            order=order,
        )
        found = np.array([run["ema.position"][-1], run["load.torque"][-1]])
        errors.append(np.abs(found - monolithic) / np.abs(monolithic))
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(errors[-1] < 0.02)
    assert np.all(ratios > 1.7), ratios
    if order == "jacobi":  # staggered steps, as Gauss-Seidel makes them, are of second order in the position
        assert np.all(ratios < 2.3), ratios


def test_a_factor_scales_and_the_load_acts(fmus, load) -> None:
    free = System({"ema": fmus["LF"], "load": load}, [Connection("ema.position", "load.position", 0.0)])
    for chosen, torque in ((free, 0.0), (system(fmus, load), None)):
        run = fly(chosen, stop=0.02, step=1e-3, inputs={"ema.command": np.full(20, 0.1)}, record=["load.torque"])
        assert (float(run["load.torque"][-1]) == 0.0) == (torque == 0.0)


def test_an_enumeration_is_set_by_value_or_by_name(fmus) -> None:
    """A switch that stays open is seen in the currents; by either way, alike."""

    def currents(**parameters: float | str) -> list[float]:
        told = {f"ema.fault.{name}": value for name, value in parameters.items()}
        run = fly(
            System({"ema": fmus["HF"]}, [], told),
            stop=0.02,
            step=1e-3,
            inputs={"ema.command": np.full(20, 0.1)},
            record=["ema.phase_current_a"],
        )
        return run["ema.phase_current_a"].values.tolist()

    assert currents(open_switch="a_upper") == currents(open_switch=1) == currents(open_switch=1.0) != currents()
    for name, value, told in (
        ("open_switch", "upper", "none, a_upper, .* is needed"),
        ("N_a", "none", "a number is needed"),
    ):
        with pytest.raises(HarnessError, match=told):
            currents(**{name: value})


@pytest.mark.parametrize(
    "change, told",
    [
        ({"record": ["ema.angle"]}, "unknown variable of ema 'angle'"),
        ({"record": ["position"]}, "COMPONENT.VARIABLE is needed"),
        ({"record": ["motor.position"]}, "with a component of ema, load"),
        ({"order": "newton"}, "jacobi or gauss-seidel"),
        ({"inputs": {"ema.command": np.zeros(3)}}, "3 values are given, 20 are needed"),
        ({"inputs": {"ema.supply_voltage": np.full(20, -1.0)}}, "supply_voltage = -1 refused"),
    ],
)
def test_mistakes_are_named(fmus, load, change, told) -> None:
    with pytest.raises(HarnessError, match=told):
        fly(system(fmus, load), **{"stop": 0.02, "step": 1e-3, **change})

"""Runs whose current is mostly ripple: HF is the plant, on a linear actuator of the library."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness.actuators.read import read_actuator
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.identification.diagnosis import Diagnosis, identify
from harness.identification.unexplained import unexplained
from harness.inference.coordinates import from_values, to_parameters
from harness.inference.left import Left
from harness.inference.measured import CURRENT, measured_from_log
from harness.logs.log import Log
from harness.trials import STEP, Trial, grid

SOLD = read_actuator("maxon-linear-a")
MACHINE = {
    name: value for name, value in SOLD.parameters.items() if not name.startswith(("controller.", "inverter.", "sensor."))
}
CASCADE = {
    "controller.K_pos": 40.0, "controller.speed_limit": 628.0, "controller.K_p": 0.08, "controller.K_i": 2.5,
    "controller.current_limit": 22.0, "controller.period": 4e-4, "inverter.hysteresis": 0.5, "inverter.R_on": 0.0,
    "inverter.dead_time": 0.0,
}  # fmt: skip
LINEAR = replace(SOLD, parameters={**MACHINE, **CASCADE})
"""The machine with hysteresis control in place of its own drive."""
TRUTH = {"friction": 1.5, "N_a": 0.85}


@pytest.fixture(scope="module")
def plant(fmus: dict[str, Path]) -> Log:
    """Strokes of 5 mm to and fro in 1.4 s, which need 0.4 A between their steps: less than half the band of 0.5 A."""
    points = grid(0.0, 14001, STEP)
    held = np.array([0.0, 5e-3, -5e-3, 5e-3])[np.searchsorted([0.1, 0.5, 1.0], points, side="right")]
    command = LINEAR.output.inside("command", held)
    supply = np.full(points.size, LINEAR.value("supply_voltage"))
    with Twin(fmus["HF"]) as twin:
        trial = Trial("strokes", 0.0, STEP, {"command": command, "supply_voltage": supply}, "held")
        run = twin.run(trial, {**LINEAR.parameters, **to_parameters(from_values(TRUTH))})
    rows = slice(None, None, 10)
    channels = {name: run[name].values[rows] for name in ("position", "motor_speed", CURRENT)}
    inputs = {"command": command[rows], "supply_voltage": supply[rows]}
    return Log("strokes", Path("strokes.csv"), run.time.values[rows], inputs, channels, output=LINEAR.output)


def diagnose(log: Log, fmus: dict[str, Path], **other: float) -> Diagnosis:
    given = {**LINEAR.parameters, **other}
    run = measured_from_log(log, given)
    return identify(run, fmus=fmus["HF"].parent, fidelity=FIDELITIES["ELF+"], parameters=given)


@pytest.fixture(scope="module")
def found(plant: Log, fmus: dict[str, Path]) -> Diagnosis:
    return diagnose(plant, fmus)


def test_what_the_ripple_hides_is_neither_identified_nor_alarmed(found):
    assert not found.complaints and any("inverter.hysteresis" in line for line in found.remarks)
    assert {item.fault for item in found.estimates if item.alarm} == {"friction"}
    assert all(found.estimate(name).identifiable is False for name in ("N_a", "N_b", "N_c", "zeta"))


def test_the_intervals_of_a_rippled_run_hold_the_truth(found):
    for name in ("friction", "N_a", "N_b", "N_c", "zeta", "gain"):
        item = found.estimate(name)
        truth = TRUTH.get(name, 0.0 if name == "zeta" else 1.0)
        margin = 0.02 * truth  # what the ripple does to friction is more than any interval says
        assert item.full[0] - margin <= truth <= item.full[1] + margin or (name == "zeta" and not item.identifiable)


def test_a_fault_without_effect_is_said_to_have_none(found):
    item = found.estimate("backlash")
    assert not item.effect and "gear.backlash is 0" in item.reason and item.low == item.high == 1.0
    assert "backlash" not in found.verdict and found.as_dict()["faults"]["backlash"]["effect"] is False


def test_what_ripple_leaves_unexplained_is_called_that(found):
    """Of a current; a position has no ripple, nor has a current whose band is narrow beside it."""
    run = found.measured
    much = np.full(len(run.channels), 0.01)
    rest, still = replace(found.curves, left=Left(much, much)), [0.0] * len(run.channels)
    position, *_, current = unexplained(rest, run, 0.003, LINEAR.parameters, still)
    assert "ripple of the current" in current and "slower" not in current and "ripple" not in position
    quiet = unexplained(rest, run, 0.003, {**LINEAR.parameters, "inverter.hysteresis": 0.05}, still)
    assert not any("ripple" in line for line in quiet)

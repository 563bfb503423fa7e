"""Communication steps shorter than a twin's own: what is published between its steps."""

import math

import numpy as np
import pytest
from flight import Flight


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@pytest.mark.parametrize("step", [1e-5, 3e-5])
def test_a_loss_is_never_negative(fidelity: str, step: float) -> None:
    """R*i^2 is none at any time, so no mean of it is, however the command jumps between the twin's own steps."""
    flown = Flight(fidelity).fly(lambda t: 0.3 * (int(t / 0.00333) % 2), n=2000, step=step)
    assert np.min(flown["copper_loss"]) >= -1e-9


@pytest.mark.parametrize("fidelity", ["ELF", "ELF+", "LF"])
def test_means_add_up_however_a_run_is_cut(fidelity: str) -> None:
    """Loss, supply charge and impulse of the stops over 20 ms: the same from means over 1e-4 s and over 7e-6 s."""
    sums = []
    for step, n in ((1e-4, 210), (7e-6, 3000)):
        flown = Flight(fidelity, {"command": 0.3, "load_torque": 5.0}).fly(lambda t: 0.3, n=n, step=step)
        sums.append([float(np.sum(flown[name])) * step for name in ("copper_loss", "supply_current", "end_stop_torque")])
    assert sums[0] == pytest.approx(sums[1], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("fidelity", ["ELF", "ELF+", "LF"])
@pytest.mark.parametrize("step", [3e-5, 1e-5, 2e-6])
def test_saturation_does_not_depend_on_the_cut(fidelity: str, step: float) -> None:
    """With constant inputs the last time at which it is told is the same, to a step of the twin's own."""
    last = []
    for each in (1e-4, step):
        flown = Flight(fidelity).fly(lambda t: 0.002, n=round(4e-3 / each), step=each)
        told = flown["time"][flown["voltage_saturated"] > 0.0]
        last.append(told[-1] if len(told) else 0.0)
    assert last[1] == pytest.approx(last[0], abs=1.01e-4)


def test_lf_does_not_react_before_its_command() -> None:
    """LF holds the command of its own step's beginning; the current rises no faster than the voltage takes it."""
    flight = Flight("LF")
    flight.fly(lambda t: 0.0 if t < 0.10005 - 1e-9 else 0.3, n=10006, step=1e-5)
    fastest = 2.0 * 48.0 / math.pi / flight["motor.L"]
    assert abs(flight["equivalent_current"]) <= fastest * 1e-5


@pytest.mark.parametrize("fidelity", ["ELF", "ELF+", "LF"])
def test_between_two_steps_everything_is_between_them(fidelity: str) -> None:
    """At a communication point within a step: in proportion between the values at its ends, by definition."""
    names = ("motor_speed", "phase_current_a", "motor_position", "equivalent_current_filtered")
    ends = [Flight(fidelity, {"command": 0.1}).fly(lambda t: 0.1, n=n) for n in (40, 41)]
    flight = Flight(fidelity, {"command": 0.1})
    flight.fly(lambda t: 0.1, n=40)
    flight.to(40.25e-4)
    for name in names:
        assert flight[name] == pytest.approx(0.75 * ends[0][name][-1] + 0.25 * ends[1][name][-1], rel=1e-9), name

"""First law: what the supply gives is lost in resistances and friction, stored, or done to the load."""

import numpy as np
import pytest
from flight import Flight

from ema_fmu_src import ports
from harness.trials import BUILT_IN, trial

R, R_ON, L, J, C, G, V_DC = (
    ports.VARIABLES[ports.INDEX[name]].start
    for name in ("motor.R", "inverter.R_on", "motor.L", "mechanics.J", "mechanics.C", "gear.ratio", "supply_voltage")
)


def balance(flight: Flight, flown: dict[str, np.ndarray], load: np.ndarray, step: float) -> tuple[float, float]:
    """What the supply gave, and what became of it [J]."""
    w = np.concatenate([[0.0], flown["motor_speed"]])
    w_mean = 0.5 * (w[1:] + w[:-1])
    supply = V_DC * np.sum(flown["supply_current"]) * step
    resistances = np.sum(flown["copper_loss"]) * step * (1.0 + R_ON / R)
    friction = np.sum(np.abs(flown["friction_torque"] * w_mean)) * step
    viscous = np.sum(C * w_mean**2) * step
    done = np.sum(load / G * w_mean) * step
    stored = 0.5 * J * w[-1] ** 2 + 0.5 * L * sum(flown[f"phase_current_{j}"][-1] ** 2 for j in "abc")
    assert flight["motor_speed"] == w[-1]
    return float(supply), float(resistances + friction + viscous + done + stored)


@pytest.mark.parametrize("name", BUILT_IN)
@pytest.mark.parametrize("fidelity, share", [("HF", 2e-3), ("ELF+", 5e-3)])
def test_energy_is_conserved_in_every_trial(fidelity: str, share: float, name: str) -> None:
    """Supply = copper + R_on and diodes + friction + viscous + mechanical output + stored: HF to 0.2 %, ELF+ to 0.5 %.

    Each leg conducts through R_on, by a switch or a diode. The trials do not touch the end stops.
    """
    flown_trial = trial(name)
    load = flown_trial.inputs.get("load_torque", np.zeros(len(flown_trial.time)))[:-1]
    command = flown_trial.inputs["command"]
    flight = Flight(fidelity)
    step = flown_trial.step
    flown = flight.fly(lambda t: command[round(t / step)], n=len(load), load=lambda t: load[round(t / step)])
    supply, found = balance(flight, flown, load, step)
    assert supply > 0.5
    assert found == pytest.approx(supply, rel=share)

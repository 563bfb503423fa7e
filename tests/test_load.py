"""Backlash under load, end stops and a supply that breaks down: by hand, and alike in every fidelity."""

import math

import numpy as np
import pytest
from flight import Flight

from ema_fmu_src import ports
from harness.trials import trial

FIDELITIES = ("HF", "ELF", "ELF+", "LF")
START = {variable.name: variable.start for variable in ports.VARIABLES}


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_load_that_reverses_takes_the_shaft_across_the_gap(fidelity: str) -> None:
    """At rest under +6 N.m the shaft lies on the flank that carries the load; under -6 N.m on the other, a play away."""
    play = 0.01
    flight = Flight(fidelity, {"gear.backlash": play, "mechanics.T_static": 10.0, "load_torque": 6.0})
    held = flight.fly(lambda t: 0.0, n=10)["position"]
    assert held == pytest.approx(-0.5 * play)
    flight.set({"load_torque": -6.0})
    assert flight.to(11 * 1e-4)["position"] == pytest.approx(0.5 * play)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_an_unloaded_shaft_stays_where_the_play_leaves_it(fidelity: str) -> None:
    """The play operator: after a move up by x and back by less than the play, the shaft has not moved back."""
    play = 0.01
    coasting = {
        "gear.backlash": play,
        "initial.motor_speed": 300.0,
        "mechanics.T_static": 0.0,
        "mechanics.T_coulomb": 0.0,
        "controller.current_limit": 0.0,
    }
    flight = Flight(fidelity, coasting)
    up = flight.fly(lambda t: 0.0, n=100)
    x = up["motor_position"] / START["gear.ratio"]
    assert up["position"][-1] == pytest.approx(x[-1] - 0.5 * play)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_the_end_stop_carries_what_the_motor_pushes(fidelity: str) -> None:
    """At rest at the stop: T_stop = T_m - T_f, the mean over the step that `end_stop_torque` gives."""
    flight = Flight(fidelity, {"mechanics.end_stop": 0.05})
    flown = flight.fly(lambda t: 0.2, n=3000)
    assert flown["motor_speed"][-1] == 0.0
    limit = 1.5 * START["motor.K_e"] * START["controller.current_limit"]
    expected = limit - START["mechanics.T_coulomb"]
    assert np.mean(flown["end_stop_torque"][-200:]) == pytest.approx(expected, rel=0.02)
    free = Flight(fidelity).fly(lambda t: 0.01, n=500)
    assert not free["end_stop_torque"].any()


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_a_rotor_pushed_into_its_stop_induces_nothing(fidelity: str) -> None:
    """Off, at the stop under a load, a current that is left decays with L/(R + R_on) alone: the light rotor is still."""
    pushed = {"mechanics.J": 1e-7, "mechanics.end_stop": 0.01, "initial.motor_position": -2.01, "initial.position": -0.01,
              "load_torque": 1000.0, "supply_voltage": 0.0, "initial.phase_current_a": 1.0, "initial.phase_current_b": -0.5,
              "motor.L": 0.05}  # fmt: skip
    flown = Flight(fidelity, pushed).fly(lambda t: 0.0, n=100)
    assert not flown["motor_speed"].any()
    tau = pushed["motor.L"] / (START["motor.R"] + START["inverter.R_on"])
    q = np.abs(flown["equivalent_current"])
    assert q[-1] == pytest.approx(q[0] * math.exp(-(flown["time"][-1] - flown["time"][0]) / tau), rel=1e-3)


SHORTED = {"mechanics.J": 10.0, "initial.motor_speed": 400.0, "supply_voltage": 0.0, "mechanics.end_stop": 1e3,
           "controller.current_limit": 10.0}  # fmt: skip


@pytest.mark.parametrize("fidelity, share", [("HF", 0.005), ("ELF+", 0.01)])
def test_without_supply_the_diodes_short_the_turning_motor(fidelity: str, share: float) -> None:
    """V_dc = 0: phasors of a shorted PMSM, |i| = K_e*w/sqrt((R + R_on)^2 + (p*w*L)^2), whatever the controller asks for."""
    w = SHORTED["initial.motor_speed"]
    flown = Flight(fidelity, SHORTED).fly(lambda t: 1.0, n=800)
    R, X = START["motor.R"] + START["inverter.R_on"], START["motor.p"] * w * START["motor.L"]
    peak = max(float(np.max(np.abs(flown[f"phase_current_{j}"][-400:]))) for j in "abc")
    assert peak == pytest.approx(START["motor.K_e"] * w / math.hypot(R, X), rel=share)


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("volts", [0.0, 5e-324, 1e-3, 0.999])
def test_below_what_the_inverter_needs_it_is_off(fidelity: str, volts: float) -> None:
    """A motor at rest stays there: no current, no torque, nothing from the supply; and it is said that the voltage lacks."""
    flown = Flight(fidelity, {"supply_voltage": volts}).fly(lambda t: 0.3, n=50)
    for name in ("motor_speed", "motor_torque", "supply_current", "copper_loss", "equivalent_current"):
        assert not flown[name].any(), name
    assert flown["voltage_saturated"].all() and flown["voltage_saturated_real"].all()


@pytest.mark.parametrize("fidelity", ["ELF+", "LF"])
def test_fidelities_agree_through_a_brown_out(fidelity: str) -> None:
    """48 V, then 10 mV from 0.3 to 0.6 s of a fast sine, then 48 V again: speed against HF's."""
    flown = {}
    for name in ("HF", fidelity):
        flight = Flight(name)
        flown[name] = flight.fly(
            lambda t: 0.3 * math.sin(4.0 * math.pi * t), n=8000, supply=lambda t: 0.01 if 0.3 <= t < 0.6 else 48.0
        )
    reference, found = (flown[name]["motor_speed"] for name in ("HF", fidelity))
    error = math.sqrt(float(np.mean((found - reference) ** 2))) / float(np.ptp(reference))
    assert error < {"ELF+": 0.005, "LF": 0.05}[fidelity]


def energy(
    flight: Flight, flown: dict[str, np.ndarray], supply: np.ndarray, load: np.ndarray, step: float
) -> tuple[float, float]:
    """What is missing in the balance, and what was turned over [J]; L and R_on are those of a healthy actuator."""
    w = np.r_[0.0, flown["motor_speed"]]
    w_mean = 0.5 * (w[1:] + w[:-1])
    given = float(np.sum(supply * flown["supply_current"])) * step
    copper = float(np.sum(flown["copper_loss"])) * step * (1.0 + START["inverter.R_on"] / START["motor.R"])
    friction = float(np.sum(np.abs(flown["friction_torque"] * w_mean))) * step
    viscous = float(np.sum(START["mechanics.C"] * w_mean**2)) * step
    stops = float(np.sum(flown["end_stop_torque"] * w_mean)) * step
    done = float(np.sum(load / START["gear.ratio"] * w_mean)) * step
    squares = sum(flown[f"phase_current_{j}"][-1] ** 2 for j in "abc")
    stored = 0.5 * START["mechanics.J"] * w[-1] ** 2 + 0.5 * START["motor.L"] * float(squares)
    turned = float(np.sum(np.abs(supply * flown["supply_current"]))) * step + copper + abs(done)
    return given - (copper + friction + viscous + stops + done + stored), turned


CASES = {
    "end stops": ({}, lambda t: 1.0 if t % 1.0 < 0.5 else -1.0, None, None),
    "reversing load": ({"gear.backlash": 0.01}, lambda t: 0.05, lambda t: 6.0 if t % 0.25 < 0.125 else -6.0, None),
    "brown-out": ({}, lambda t: 0.3 * math.sin(4.0 * math.pi * t), None, lambda t: 0.01 if 0.3 <= t < 0.6 else 48.0),
    "dip to 12 V": ({}, lambda t: 0.3 * math.sin(4.0 * math.pi * t), None, lambda t: 12.0 if 0.3 <= t < 0.6 else 48.0),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_energy_is_conserved(fidelity: str, name: str) -> None:
    """Supply = copper + R_on + friction + viscous + stops + load + stored, within 1 % of what is turned over.

    Plain ELF has no inductance.
    """
    parameters, command, load, supply = CASES[name]
    n, step = 8000, 1e-4
    flight = Flight(fidelity, parameters)
    flown = flight.fly(command, n=n, step=step, load=load, supply=supply)
    times = np.arange(n) * step
    volts = np.array([supply(t) for t in times]) if supply else np.full(n, START["supply_voltage"])
    torque = np.array([load(t) for t in times]) if load else np.zeros(n)
    missing, turned = energy(flight, flown, volts, torque, step)
    assert turned > 1.0
    assert abs(missing) < 0.01 * turned


def test_load_step_seats_the_shaft_and_the_motor_carries_the_load() -> None:
    """LOAD-STEP ends with I_ref = T_L/(1.5*K_e) within the friction, and the shaft on the flank below the gear."""
    flown_trial = trial("LOAD-STEP")
    load = flown_trial.inputs["load_torque"]
    step = flown_trial.step
    flown = Flight("ELF+").fly(lambda t: 0.05, n=len(load) - 1, load=lambda t: float(load[round(t / step)]))
    gear = flown["motor_position"] / START["gear.ratio"]
    assert flown["position"][-1] == pytest.approx(gear[-1] - 0.5 * START["gear.backlash"], abs=1e-12)
    T_L, K = 6.0 / START["gear.ratio"], 1.5 * START["motor.K_e"]
    friction = START["mechanics.T_static"] + (1.0 / START["gear.eta_opposing"] - 1.0) * T_L
    assert abs(flown["equivalent_current_filtered"][-1] - T_L / K) <= friction / K

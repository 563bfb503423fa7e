"""Corners of the declared ranges by name: stiff windings, long dead times, fast rotors, `voltage_saturated`."""

import math

import numpy as np
import pytest
from flight import Flight

from ema_fmu_src import ports
from ema_fmu_src.twins import Status

START = {variable.name: variable.start for variable in ports.VARIABLES}
SIN = 0.1, 2.0 * math.pi
FAST = 0.3, 4.0 * math.pi
SIN4 = 0.5, 10.0 * math.pi


def sine(shape: tuple[float, float]):  # type: ignore[no-untyped-def]
    amplitude, omega = shape
    return lambda t: amplitude * math.sin(omega * t)


def nrmse(found: np.ndarray, expected: np.ndarray) -> float:
    return math.sqrt(float(np.mean((found - expected) ** 2))) / float(np.ptp(expected))


@pytest.mark.parametrize("L", [0.7e-3, 0.35e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("dead_time", [5e-7, 3e-6, 1e-5, 1e-4])
def test_hf_steps_through_dead_times_at_any_inductance(L: float, dead_time: float) -> None:
    """An open leg takes none of what is cut off a dying current, so that no leg chatters; the star keeps sum(i) = 0."""
    flown = Flight("HF", {"motor.L": L, "inverter.dead_time": dead_time}).fly(sine(SIN), n=300)
    total = sum(flown[f"phase_current_{j}"] for j in "abc")
    assert np.max(np.abs(total)) < 1e-6


@pytest.mark.parametrize("hysteresis", [0.25, 0.05, 0.01])
@pytest.mark.parametrize("dead_time", [0.0, 5e-7, 2e-6, 3e-6])
def test_hf_steps_through_dead_times_at_any_band(hysteresis: float, dead_time: float) -> None:
    """What the shaft does depends on neither: against the default drive, after 0.1 s of SIN."""
    flown = Flight("HF", {"inverter.hysteresis": hysteresis, "inverter.dead_time": dead_time}).fly(sine(SIN), n=1000)
    assert flown["position"][-1] == pytest.approx(Flight("HF").fly(sine(SIN), n=1000)["position"][-1], rel=2e-3)


@pytest.mark.parametrize("R", [300.0, 1000.0])
@pytest.mark.parametrize("L", [1e-6, 2e-5, 0.7e-3, 1e-2])
@pytest.mark.parametrize("step", [2e-5, 1e-6])
def test_stiff_windings_settle_at_ohms_law(R: float, L: float, step: float) -> None:
    """A locked rotor at theta = 0, legs a and c low, b high: i_b = (2/3)*V_dc/(R + R_on), and half of it back in a and c.

    The currents are too small for a comparator of a to turn. h*R/L is 0.03 to 20,000.
    """
    lock = {"mechanics.T_static": 100.0, "motor.R": R, "motor.L": L, "solver.step": step}
    flown = Flight("HF", lock).fly(lambda t: 0.5, n=20)
    expected = (2.0 / 3.0) * START["supply_voltage"] / (R + START["inverter.R_on"])
    assert flown["phase_current_b"][-1] == pytest.approx(expected, rel=1e-6)
    assert flown["phase_current_a"][-1] == pytest.approx(-0.5 * expected, rel=1e-6)
    assert np.max(np.abs(flown["phase_current_b"])) <= expected * (1.0 + 1e-9)


@pytest.mark.parametrize("parameters", [{"motor.R": 10.0, "motor.L": 2e-5}, {"motor.R": 30.0, "motor.L": 1e-4}])
def test_hf_with_stiff_windings_agrees_with_small_fixed_steps(parameters: dict[str, float]) -> None:
    """Two methods: from event to event, implicit in R, and 1e-7 s fixed, where h*R/L is 0.05 or less."""
    located = Flight("HF", parameters).fly(sine(SIN), n=1000)
    fixed = Flight("HF", {**parameters, "solver.event_located": 0.0, "solver.step": 1e-7}).fly(sine(SIN), n=1000)
    assert nrmse(located["position"], fixed["position"]) < 1e-3
    assert nrmse(located["equivalent_current_filtered"], fixed["equivalent_current_filtered"]) < 0.02


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@pytest.mark.parametrize("K_e", [0.5, 1.0, 2.0, 10.0])
def test_a_strong_motor_does_not_outrun_the_steps(fidelity: str, K_e: float) -> None:
    """The step is chosen from K_e^2*h^2/(J*L) and the like: against one of 1e-6 s."""
    coarse, fine = (Flight(fidelity, {"motor.K_e": K_e, "solver.step": step}) for step in (1e-4, 1e-6))
    found, expected = (flight.fly(sine(SIN), n=1500) for flight in (coarse, fine))
    assert nrmse(found["position"], expected["position"]) < 0.01


@pytest.mark.parametrize("J", [1e-8, 1e-7, 1e-6])
def test_a_light_rotor_does_not_outrun_lfs_control_law(J: float) -> None:
    """LF's law is continuous: its loop over a light rotor is no limit cycle of the step."""
    coarse, fine = (Flight("LF", {"mechanics.J": J, "solver.step": step}) for step in (1e-4, 1e-7))
    found, expected = (flight.fly(sine(SIN), n=500) for flight in (coarse, fine))
    assert nrmse(found["position"], expected["position"]) < 0.05
    assert np.max(np.abs(found["equivalent_current"])) < 0.3 * START["controller.current_limit"]


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
def test_a_fast_rotor_turns_little_in_a_step(fidelity: str) -> None:
    """50 pole pairs at 400 rad/s turn theta_e by 2 rad in 1e-4 s; against steps of 1e-6 s."""
    fast = {"motor.p": 50.0, "motor.L": 1e-5, "initial.motor_speed": 400.0, "fault.N_a": 0.8}
    coarse, fine = (Flight(fidelity, {**fast, "solver.step": step}) for step in (1e-4, 1e-6))
    found, expected = (flight.fly(lambda t: 0.5, n=200) for flight in (coarse, fine))
    assert nrmse(found["motor_speed"], expected["motor_speed"]) < 0.02


def test_what_no_step_can_follow_is_refused() -> None:
    stiff = {"motor.K_e": 10.0, "mechanics.J": 1e-8, "motor.R": 1e-3}
    assert Flight.tried("ELF", stiff) == Status.STIFF
    assert "mechanics.J" in Status.STIFF.message


def test_the_smallest_step_is_taken() -> None:
    """solver.step = 1e-9 asks for 100,000 steps a controller period."""
    flown = Flight("HF", {"solver.step": 1e-9}).fly(lambda t: 0.01, n=2)
    assert np.isfinite(flown["motor_speed"]).all()


SATURATED = {
    "SIN": (SIN, {"HF": 0.0, "ELF": 0.0, "ELF+": 0.0, "LF": 0.0}),
    "0.3 rad at 2 Hz": (FAST, {"HF": 0.587, "ELF": 0.434, "ELF+": 0.582, "LF": 0.566}),
    "SIN4": (SIN4, {"HF": 0.293, "ELF": 0.241, "ELF+": 0.292, "LF": 0.259}),
}


@pytest.mark.parametrize("name", SATURATED)
def test_saturation_is_told_alike(name: str) -> None:
    """Part of the steps in which the voltage limits; one criterion for all, the voltages that the currents would need."""
    shape, expected = SATURATED[name]
    for fidelity, share in expected.items():
        flown = Flight(fidelity).fly(sine(shape), n=25000)
        assert np.mean(flown["voltage_saturated"]) == pytest.approx(share, abs=0.01), fidelity


def test_elf_warns_before_it_errs() -> None:
    """Before plain ELF's position in SIN4 is 1 % of the range off HF's, voltage_saturated has been up."""
    reference, found = (Flight(fidelity).fly(sine(SIN4), n=3000) for fidelity in ("HF", "ELF"))
    off = np.abs(found["position"] - reference["position"]) > 0.01 * np.ptp(reference["position"])
    assert np.argmax(found["voltage_saturated"] > 0.0) < np.argmax(off)


@pytest.mark.parametrize(
    "parameters",
    [
        {"fault.current_offset_a": 1.0},
        {"fault.current_offset_a": 0.5},
        {"inverter.hysteresis": 0.02, "inverter.dead_time": 3e-6},
    ],
)
def test_an_offset_and_a_dead_time_are_no_saturation(parameters: dict[str, float]) -> None:
    assert not Flight("HF", parameters).fly(sine(SIN), n=5000)["voltage_saturated"].any()


@pytest.mark.parametrize("shape, limits", [(FAST, (0.007, 0.02)), (SIN4, (0.006, 0.01))], ids=["0.3 rad at 2 Hz", "SIN4"])
def test_lf_reaches_the_six_step_voltage(shape: tuple[float, float], limits: tuple[float, float]) -> None:
    """2*V_dc/pi, as hysteresis control does when it saturates, not the V_dc/sqrt(3) of a sinusoid."""
    reference, found = (Flight(fidelity).fly(sine(shape), n=12000) for fidelity in ("HF", "LF"))
    errors = [nrmse(found[name], reference[name]) for name in ("position", "motor_speed")]
    assert errors[0] < limits[0] and errors[1] < limits[1]


def torque_factor(law: float, depth: float) -> np.ndarray:
    """Torque over that of a healthy motor at sinusoidal currents, over a turn of theta_e; from the back-EMFs at 1 rad/s."""
    p, K_e = START["motor.p"], START["motor.K_e"]
    angles = np.arange(48) * 2.0 * np.pi / 48
    factors = []
    for theta_e in angles:
        flight = Flight("ELF", {"initial.motor_position": theta_e / p, "initial.motor_speed": 1.0,
                                "fault.zeta": depth / p, "fault.eccentricity_law": law})  # fmt: skip
        currents = [-math.sin(theta_e - 2.0 * math.pi * j / 3.0) for j in range(3)]
        k = [flight[f"back_emf_{j}"] for j in "abc"]
        factors.append(sum(a * b for a, b in zip(k, currents, strict=True)) / (1.5 * K_e))
    return np.array(factors)


@pytest.mark.parametrize("law, harmonic, amplitude", [(1.0, 3, 0.10), (2.0, 1, 0.20)])
def test_the_two_readings_of_eq_2(law: float, harmonic: int, amplitude: float) -> None:
    """The paper, Eq. 2, at p*zeta = 0.2.

    Shifted cosine: (2/3)*sum sin^2(theta_j)*p*zeta*cos(theta_j) leaves a third harmonic of p*zeta/2. Common cosine:
    sum sin^2(theta_j) = 3/2 leaves p*zeta*cos(theta_e) itself.
    """
    spectrum = np.abs(np.fft.rfft(torque_factor(law, 0.2))) / 24.0
    assert spectrum[harmonic] == pytest.approx(amplitude, abs=1e-9)
    others = [spectrum[k] for k in range(1, 12) if k != harmonic]
    assert max(others) < 1e-9


RUNAWAY = {"mechanics.end_stop": 1e3, "gear.ratio": 1e5, "motor.p": 50.0, "motor.K_e": 1e-3}


@pytest.mark.parametrize("located", [1.0, 0.0])
@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@pytest.mark.parametrize(
    "start",
    [
        {"initial.motor_speed": 1e22},
        {"initial.motor_speed": 1e300},
        {**RUNAWAY, "initial.motor_position": 1.99999e7, "initial.motor_speed": 1e5, "initial.position": 199.999},
    ],
)
def test_a_rotor_that_runs_away_is_refused_at_once(fidelity: str, start: dict[str, float], located: float) -> None:
    """Angles beyond what a double resolves, speeds beyond any step: a status, and never a step without end."""
    values = {**start, "solver.event_located": located, "solver.step": 1e-6} if fidelity == "HF" else start
    flight = Flight.tried(fidelity, values)
    assert isinstance(flight, Flight)
    statuses = {flight.twin.advance(flight.v, flight.x, (k + 1) * 1e-3) for k in range(3)}
    assert statuses & {Status.STIFF, Status.NOT_FINITE}


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@pytest.mark.parametrize("C, J", [(10.0, 6e-5), (0.1, 1e-6), (0.5, 1e-5), (5e-3, 6e-5)])
def test_a_viscous_rotor_settles_at_net_torque_over_c(fidelity: str, C: float, J: float) -> None:
    """Between Coulomb and static friction a rotor in motion goes on: w = (0.05 - 0.03)/C, by J dw/dt = 0 (h*C/J to 17)."""
    given = {"motor.K_e": 1e-3, "gear.backlash": 0.0, "gear.eta_opposing": 1.0, "gear.eta_aiding": 1.0, "mechanics.C": C}
    off = {"controller.K_p": 0.0, "controller.K_i": 0.0, "mechanics.J": J}
    flight = Flight(fidelity, {**given, **off})
    flown = flight.fly(lambda t: 0.0, n=3000, load=lambda t: -40.0 if t < 0.1 else -10.0)
    assert flown["motor_speed"][-1] == pytest.approx(0.02 / C, rel=5e-3)


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_viscous_friction_alone_gives_a_steady_speed(fidelity: str) -> None:
    """w = T_L/(G*C), reached without a swing from step to step at h*C/J = 1e5."""
    dry = {"mechanics.T_static": 0.0, "mechanics.T_coulomb": 0.0, "mechanics.J": 1e-8, "mechanics.C": 10.0}
    off = {"controller.K_p": 0.0, "controller.K_i": 0.0, "motor.K_e": 1e-3, "gear.eta_opposing": 1.0, "gear.eta_aiding": 1.0}
    flown = Flight(fidelity, {**dry, **off}).fly(lambda t: 0.0, n=50, load=lambda t: -1.0)
    assert flown["motor_speed"][10:] == pytest.approx(1.0 / 200.0 / 10.0, rel=1e-3)


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@pytest.mark.parametrize("play", [0.0, 0.05, 0.1])
def test_a_load_presses_the_user_shaft_against_its_stop(fidelity: str, play: float) -> None:
    """The stop is the user shaft's: no play and no load takes it beyond; the stop then carries the load, not the rotor."""
    flight = Flight(fidelity, {"gear.backlash": play, "load_torque": -10.0, "controller.current_limit": 2.0})
    flown = flight.fly(lambda t: 0.8, n=6000)
    assert np.max(flown["position"]) == pytest.approx(START["mechanics.end_stop"], abs=1e-12)
    assert flown["position"][-1] == np.max(flown["position"])
    if play > 0.0:  # free between its flanks, the rotor stands where only its own torque has pushed it
        pushing = flown["motor_torque"][-1] - flown["end_stop_torque"][-1]
        assert abs(pushing) <= START["mechanics.T_static"] + 1e-9


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_a_play_that_shrinks_at_the_stop_moves_no_rotor(fidelity: str) -> None:
    """The rotor stays where it is, at most: a jump would be a speed that the windings see."""
    flight = Flight(fidelity, {"gear.backlash": 0.02, "fault.backlash": 2.0, "command": 0.7})
    flight.fly(lambda t: 0.7, n=6000)
    before = flight["motor_position"]
    flight.set({"fault.backlash": 1.0})
    flown = flight.fly(lambda t: 0.7, n=20)
    assert np.max(np.abs(flown["motor_position"] - before)) < 1e-9
    assert max(np.max(np.abs(flown[f"phase_current_{j}"])) for j in "abc") < START["controller.current_limit"] + 1.0


@pytest.mark.parametrize("fidelity", ["ELF", "ELF+", "LF"])
def test_a_low_pass_never_rings(fidelity: str) -> None:
    """However long the step beside tau: between its old value and what comes in (here 0 and the current limit)."""
    slow = {"monitor.tau": 1e-4, "controller.period": 0.1, "solver.step": 0.01, "mechanics.J": 1.0, "command": 0.5}
    flown = Flight(fidelity, slow).fly(lambda t: 0.5, n=30, step=0.01)
    limit = START["controller.current_limit"]
    assert np.max(flown["equivalent_current_filtered"]) <= limit * (1.0 + 1e-9)
    assert np.ptp(flown["equivalent_current_filtered"][5:]) < 0.05 * limit


@pytest.mark.parametrize("step, refused", [(2e-5, True), (1e-6, True), (2e-8, False)])
def test_fixed_steps_that_overrun_the_band_are_refused(step: float, refused: bool) -> None:
    """Within a step the current changes by V_dc*h/L: 0.19 A at 2e-8 s, below the half band of 0.25 A; 190 A at 2e-5 s."""
    values = {"motor.L": 1e-5, "motor.R": 0.1, "supply_voltage": 95.0, "solver.event_located": 0.0, "solver.step": step}
    flight = Flight("HF", values)
    assert (flight.twin.advance(flight.v, flight.x, 1e-3) == Status.COARSE) == refused


@pytest.mark.parametrize("p", [10.0, 20.0, 50.0])
def test_lf_knows_the_voltage_across_the_inductance(p: float) -> None:
    """w_e*L*i takes part in the voltage limit: LF says that it is limited for as long as HF does, and is 12 % off at most
    (25 % without)."""
    hf, lf = (Flight(fidelity, {"motor.p": p}).fly(sine(SIN4), n=5000) for fidelity in ("HF", "LF"))
    assert nrmse(lf["position"], hf["position"]) < 0.12
    assert np.mean(lf["voltage_saturated"]) == pytest.approx(np.mean(hf["voltage_saturated"]), abs=0.15)


def test_elf_does_not_feed_a_swing_that_nothing_damps() -> None:
    """A light rotor on a large, nearly lossless inductance: the default step agrees with one of 1e-6 s."""
    values = {
        "motor.R": 0.079, "motor.L": 0.0538, "motor.K_e": 0.344, "motor.p": 1.0, "inverter.R_on": 1.0,
        "mechanics.J": 3.5e-6, "mechanics.C": 6.3e-5, "mechanics.T_static": 1.17e-3, "mechanics.T_coulomb": 5.2e-4,
        "gear.ratio": 175.1, "mechanics.end_stop": 6.34, "controller.K_pos": 3.94, "controller.K_p": 0.0296,
        "controller.K_i": 2.14, "controller.current_limit": 94.7, "supply_voltage": 67.0,
    }  # fmt: skip
    coarse = Flight("ELF+", values).fly(lambda t: -2.88, n=3000)
    fine = Flight("ELF+", {**values, "solver.step": 1e-6}).fly(lambda t: -2.88, n=3000)
    assert coarse["position"][-1] == pytest.approx(fine["position"][-1], rel=0.03)

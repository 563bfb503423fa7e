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
    "SIN4": (SIN4, {"HF": 0.293, "ELF": 0.241, "ELF+": 0.292, "LF": 0.248}),
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

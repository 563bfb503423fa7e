"""The drive as sold: PID, a sampled current loop, a carrier. Each test cites its truth."""

import math

import numpy as np
import pytest
from flight import Flight

from ema_fmu_src import ports
from ema_fmu_src.physics import current_loop, exponential
from ema_fmu_src.twins import Status
from ema_fmu_src.twins.layout import now
from harness.trials import trial

VECTOR = {"controller.current_control": 2.0, "inverter.modulation": 3.0}
TRIANGLE = {"controller.current_control": 2.0, "inverter.modulation": 2.0}
R, R_ON, L, K_E, V_DC, CARRIER, DEAD = (
    ports.VARIABLES[ports.INDEX[name]].start
    for name in (
        "motor.R", "inverter.R_on", "motor.L", "motor.K_e", "supply_voltage", "inverter.carrier_frequency",
        "inverter.dead_time",
    )
)  # fmt: skip
T = 0.5 / CARRIER
HELD = {"mechanics.T_static": 100.0, "mechanics.T_coulomb": 100.0, "sensor.resolver_bits": 0.0}
"""A rotor that friction holds, so that the windings are a star of R and L."""


def difference(found: dict[str, np.ndarray], truth: dict[str, np.ndarray], name: str = "position") -> float:
    """NRMSE of an output."""
    return float(np.sqrt(np.mean((found[name] - truth[name]) ** 2)) / np.ptp(truth[name]))


def flown(fidelity: str, name: str, values: dict[str, float], seconds: float = 2.5) -> dict[str, np.ndarray]:
    """A trial, from its beginning."""
    of = trial(name)
    command = of.inputs["command"]
    return Flight(fidelity, values).fly(lambda t: command[round(t / of.step)], n=round(seconds / of.step))


# numbers


def test_exponential_and_logarithm_agree_with_the_c_library() -> None:
    for x in (0.0, -1e-9, -0.1, -1.0, -7.3, -50.0, -600.0):
        assert exponential.exp(x) == pytest.approx(math.exp(x), rel=2e-13)
    for size in (1e-3, 0.2, 0.99, 1.0, 7.0):
        for angle in (0.0, 1e-6, 0.5, 3.0):
            re, im = exponential.log(size * math.cos(angle), size * math.sin(angle))
            assert re == pytest.approx(math.log(size), abs=2e-12)
            assert im == pytest.approx(angle, abs=2e-12)


@pytest.mark.parametrize(
    "K_p, K_i", [(0.0, 0.0), (2.0, 500.0), (1.0, 60000.0), (L / T * 0.9, 100.0), (3.0, 0.0), (R + R_ON, 1430.0)]
)
def test_steps_of_the_loop_of_any_length_are_powers_of_its_samples(K_p: float, K_i: float) -> None:
    """Truth: the sample's matrix, multiplied; and two halves of a sample are one."""
    K, K_i = current_loop.gains(R + R_ON, L, T, 6283.0, K_p, K_i)
    loop = current_loop.Loop(K, K_i, T, R + R_ON, L, K_E, 1.0, 1.0)
    of = current_loop.response(loop)

    def matrix(h: float) -> np.ndarray:
        passage = current_loop.over(loop, of, h)
        return np.array([[passage.M_xx, passage.M_xy], [passage.M_yx, passage.M_yy]])

    A = math.exp(-loop.R * T / L)
    once = np.array([[A - (1.0 - A) * K / loop.R, (A - 1.0) / loop.R], [K_i * T, 1.0]])
    for n in (1, 2, 4, 13):
        np.testing.assert_allclose(matrix(n * T), np.linalg.matrix_power(once, n), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(matrix(0.5 * T) @ matrix(0.5 * T), once, rtol=1e-6, atol=1e-8)


def test_gains_by_bandwidth_leave_the_pole_that_was_asked_for() -> None:
    K, K_i = current_loop.gains(R, L, T, 6283.0, 0.0, 0.0)
    of = current_loop.response(current_loop.Loop(K, K_i, T, R, L, K_E, 1.0, 1.0))
    assert sorted([of.decay_1, of.decay_2]) == pytest.approx([R / L, 6283.0], rel=1e-9)


# what goes together


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@pytest.mark.parametrize("control, modulation", [(1.0, 2.0), (1.0, 3.0), (2.0, 1.0)])
def test_a_pair_that_does_not_go_together_is_refused(fidelity: str, control: float, modulation: float) -> None:
    found = Flight.tried(fidelity, {"controller.current_control": control, "inverter.modulation": modulation})
    assert found is Status.PAIR


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@pytest.mark.parametrize("K_p, K_i", [(2.5 * L / T, 0.0), (1.5 * L / T, 0.0), (5.0, 1e9)])
def test_a_loop_that_rings_or_grows_is_refused(fidelity: str, K_p: float, K_i: float) -> None:
    found = Flight.tried(fidelity, {**VECTOR, "controller.current.K_p": K_p, "controller.current.K_i": K_i})
    assert found is Status.LOOP


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
def test_a_dead_time_as_long_as_half_a_period_is_refused(fidelity: str) -> None:
    assert Flight.tried(fidelity, {**VECTOR, "inverter.dead_time": 2.5e-5}) is Status.PULSE
    assert isinstance(Flight.tried(fidelity, {**VECTOR, "inverter.dead_time": 2.4e-5}), Flight)


# control laws


@pytest.mark.parametrize("fidelity", ["HF", "ELF+"])
def test_without_limits_the_pid_is_the_cascade(fidelity: str) -> None:
    """K_P = K_pos*K_p + K_i, K_I = K_i*K_pos, K_D = K_p, b = K_pos*K_p/K_P, c = 0, T_f = 0, without play: the same poles."""
    K_pos, K_p, K_i = 40.0, 1.3, 10.0
    same = {"gear.backlash": 0.0, "sensor.resolver_bits": 0.0}
    pid = {
        "controller.structure": 2.0, "controller.pid.K_p": K_pos * K_p + K_i, "controller.pid.K_i": K_i * K_pos,
        "controller.pid.K_d": K_p, "controller.pid.T_f": 0.0, "controller.pid.b": K_pos * K_p / (K_pos * K_p + K_i),
    }  # fmt: skip
    found = flown(fidelity, "SIN", {**same, **pid}, 1.0)
    assert difference(found, flown(fidelity, "SIN", same, 1.0)) < 1e-4


def test_lf_flies_the_pid_in_its_own_form() -> None:
    """Truth: ELF+, which samples it. c*K_d*dr/dt and the feed-forward act on the command."""
    for more in ({}, {"controller.pid.c": 1.0, "controller.pid.T_f": 1e-5}, {"controller.feedforward_speed": 0.5}):
        values = {"controller.structure": 2.0, "gear.backlash": 0.0, **more}
        assert difference(flown("LF", "SIN", values, 1.0), flown("ELF+", "SIN", values, 1.0)) < 1e-3


def test_feed_forward_takes_the_lag_of_a_ramp_away() -> None:
    """A ramp of speed w needs (K_p)*w of the P on speed: as much feed-forward leaves no lag but the integral's."""
    values = {"controller.K_i": 0.0, "mechanics.C": 0.0, "mechanics.T_coulomb": 0.0, "mechanics.T_static": 0.0}
    ramp = {"gear.backlash": 0.0, **values}

    def lag(more: dict[str, float]) -> float:
        flight = Flight("ELF+", {**ramp, **more})
        last = flight.fly(lambda t: 0.2 * t, n=5000)
        return float(0.2 * last["time"][-1] - last["position"][-1])

    assert lag({}) == pytest.approx(0.2 / 40.0, rel=0.02)
    assert abs(lag({"controller.feedforward_speed": 1.3})) < 0.2 / 40.0 * 0.03


def test_the_cascade_s_derivative_is_a_filtered_one() -> None:
    """K_d*D(e) on the speed error adds inertia: K_d*K_t beside J, so that a rotor under P alone answers so much slower."""
    free = {
        "mechanics.T_static": 0.0, "mechanics.T_coulomb": 0.0, "mechanics.C": 0.0, "gear.backlash": 0.0,
        "controller.K_i": 0.0, "controller.K_pos": 0.0, "controller.K_p": 0.01, "initial.motor_speed": 10.0,
        "sensor.resolver_bits": 0.0,
    }  # fmt: skip
    K_t, J, K_p = 1.5 * K_E, 6e-5, 0.01
    for K_d in (0.0, 4e-4):
        found = Flight("ELF+", {**free, "controller.K_d": K_d, "controller.T_d": 0.0}).fly(lambda t: 0.0, n=300)
        rate = -np.polyfit(found["time"][50:], np.log(found["motor_speed"][50:]), 1)[0]
        assert rate == pytest.approx(K_t * K_p / (J + K_d * K_t), rel=0.02)


# current loop and carrier


@pytest.mark.parametrize("bandwidth_hz", [100.0, 500.0, 2000.0])
def test_a_step_of_the_current_has_the_bandwidth_it_was_designed_for(bandwidth_hz: float) -> None:
    """i_q = I*(1 - exp(-bandwidth*t)) after the step of the reference: a fit of its decay, within 2 %; the rotor is held."""
    values = {
        **VECTOR, **HELD, "controller.current.bandwidth": 2.0 * math.pi * bandwidth_hz, "controller.current_limit": 2.0,
        "inverter.dead_time": 0.0, "controller.K_i": 0.0,
    }  # fmt: skip
    found = Flight("HF", values).fly(lambda t: 1.0, n=int(0.6 / bandwidth_hz / T), step=T)
    left = 1.0 - found["equivalent_current"] / 2.0
    rate = -np.polyfit(found["time"], np.log(left), 1)[0]
    assert rate == pytest.approx(2.0 * math.pi * bandwidth_hz, rel=0.02)


def test_ripple_of_the_current() -> None:
    """Peak to peak, a phase against the two others: V/1.5*D*(1 - D)*T/L, D the share of time in which that leg is up and the
    others are down: with space vectors in the middle of each half period; the rotor stands where phase a carries all."""
    values = {**VECTOR, **HELD, "inverter.dead_time": 0.0, "controller.current_limit": 4.0, "controller.K_i": 0.0}
    values |= {"initial.motor_position": -math.pi / 4.0, "controller.K_pos": 1e4, "motor.R": 2.0}
    flight = Flight("HF", {**values, "command": 1.0}).to(0.02)
    found = np.array([flight.to(0.02 + 2e-8 * k)["phase_current_a"] for k in range(1, 5001)])
    assert np.mean(found) == pytest.approx(4.0, rel=0.01)
    D = 2.01 * 4.0 / (V_DC / 1.5)
    assert np.ptp(found) == pytest.approx(V_DC / 1.5 * D * (1.0 - D) * T / L, rel=0.02)


def test_six_steps_and_their_harmonics() -> None:
    """Far beyond the supply the legs switch six times a turn: 2*V/pi in amplitude, its 5th and 7th a 5th and a 7th of it."""
    values = {
        **VECTOR, "controller.current_limit": 1e4, "controller.K_p": 1e3, "motor.K_e": 1e-5, "motor.R": 10.0,
        "motor.L": 1e-6, "mechanics.J": 10.0, "initial.motor_speed": 50.0 * math.pi, "gear.backlash": 0.0,
        "inverter.dead_time": 0.0, "inverter.R_on": 0.0, "mechanics.end_stop": 1e3, "controller.current.bandwidth": 1e5,
        "controller.speed_limit": 1e5,
    }  # fmt: skip
    found = Flight("HF", values).fly(lambda t: 1e3, n=20000, step=1e-6)["phase_current_a"]
    spectrum = 2.0 * np.abs(np.fft.rfft(found)) / len(found)  # one electrical turn takes 0.02 s
    assert 10.0 * spectrum[1] == pytest.approx(2.0 * V_DC / math.pi, rel=0.01)
    assert spectrum[5] / spectrum[1] == pytest.approx(1.0 / 5.0, rel=0.05)
    assert spectrum[7] / spectrum[1] == pytest.approx(1.0 / 7.0, rel=0.05)


def test_the_dead_time_takes_its_voltage() -> None:
    """4/3*V*t_d*f of a vector along a phase (the leg loses t_d*f*V against its current, the two others give as much): the
    integral of the loop makes up for it."""
    values = {
        **VECTOR,
        **HELD,
        "controller.current_limit": 6.0,
        "controller.K_i": 0.0,
        "initial.motor_position": -math.pi / 4.0,
    }
    integral = []
    for dead in (0.0, DEAD):
        flight = Flight("HF", {**values, "inverter.dead_time": dead})
        flight.fly(lambda t: 1.0, n=500)
        integral.append(flight.x[now.xi_q])
        assert flight["equivalent_current"] == pytest.approx(6.0, abs=0.02)
    assert integral[1] - integral[0] == pytest.approx(4.0 / 3.0 * V_DC * DEAD * CARRIER, rel=0.03)


def test_hf_at_a_carrier_converges() -> None:
    """Shorter steps take the error down; the reference is a step of 3e-7 s. SIN passes through currents that die out in
    dead times, where a leg that is tied too long or too short would show."""
    reference = flown("HF", "SIN", {**VECTOR, "solver.step": 3e-7}, 0.25)
    errors = [
        difference(flown("HF", "SIN", {**VECTOR, "solver.step": step}, 0.25), reference, "equivalent_current_filtered")
        for step in (2e-5, 3e-6, 1e-6)
    ]
    assert errors[0] < 2e-4 and max(errors[1:]) < 0.3 * errors[0]


def test_first_law_at_a_carrier() -> None:
    """Supply = losses + mechanical + stored, over fine communication steps: HF to 0.05 %."""
    flight = Flight("HF", VECTOR)
    step, n = 2e-6, 60000
    found = flight.fly(lambda t: 0.5 * math.sin(10.0 * math.pi * t), n=n, step=step)
    supply = V_DC * np.sum(found["supply_current"]) * step
    copper = np.sum(found["copper_loss"]) * step * (1.0 + R_ON / R)
    mechanical = np.trapezoid(found["motor_torque"] * found["motor_speed"], dx=step)
    stored = 0.5 * L * sum(found[f"phase_current_{j}"][-1] ** 2 for j in "abc")
    assert copper + mechanical + stored == pytest.approx(supply, rel=5e-4)


@pytest.mark.parametrize("name, bound", [("SIN", 5e-5), ("SIN4", 1e-3), ("STEP-RAMP", 3e-4)])
@pytest.mark.parametrize("bandwidth_hz", [100.0, 1000.0, 2000.0])
def test_elf_plus_stays_on_hf_with_space_vectors(name: str, bound: float, bandwidth_hz: float) -> None:
    values = {**VECTOR, "controller.current.bandwidth": 2.0 * math.pi * bandwidth_hz}
    assert difference(flown("ELF+", name, values), flown("HF", name, values)) < bound


def test_elf_plus_stays_on_hf_with_sine_against_triangle() -> None:
    assert difference(flown("ELF+", "SIN4", TRIANGLE), flown("HF", "SIN4", TRIANGLE)) < 2e-3


FAULTS = {
    "shorts": {"fault.N_a": 0.8}, "eccentric": {"fault.zeta": 0.1, "fault.phi": 0.5}, "magnet": {"fault.magnet": 0.8},
    "hot": {"fault.resistance": 1.5}, "resolver": {"fault.resolver_offset": 0.1}, "offset": {"fault.current_offset_a": 0.5},
    "sensor": {"fault.current_gain_a": 1.1}, "gain": {"fault.gain": 0.7},
    "all": {"fault.N_b": 0.9, "fault.zeta": 0.05, "fault.current_gain_c": 1.05, "fault.resolver_offset": 0.03},
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_act_alike_at_a_carrier(fault: str) -> None:
    """HF is the truth: STEP-RAMP to 0.03 %, the current to 0.15 %, where the fault itself moves it by more."""
    values = {**VECTOR, **FAULTS[fault]}
    found, truth = flown("ELF+", "STEP-RAMP", values, 1.5), flown("HF", "STEP-RAMP", values, 1.5)
    assert difference(found, truth) < 3e-4
    assert difference(found, truth, "equivalent_current_filtered") < 1.5e-3
    healthy = flown("HF", "STEP-RAMP", VECTOR, 1.5)
    assert difference(healthy, truth, "equivalent_current_filtered") > 2.0 * difference(
        found, truth, "equivalent_current_filtered"
    )


@pytest.mark.parametrize("fault", ["resolver", "offset", "sensor"])
def test_faults_of_sensors_act_in_elf_plus_with_hysteresis_too(fault: str) -> None:
    """HF is the truth; SIN does not saturate. The current is nearer to it than that of a twin that ignores the fault."""
    values = {"fault.current_gain_a": 1.4} if fault == "sensor" else FAULTS[fault]
    found, truth, healthy = flown("ELF+", "SIN", values, 1.0), flown("HF", "SIN", values, 1.0), flown("ELF+", "SIN", {}, 1.0)
    names = ("position", "equivalent_current_filtered")
    assert sum(difference(found, truth, name) for name in names) < 0.8 * sum(
        difference(healthy, truth, name) for name in names
    )


@pytest.mark.parametrize("values", [{}, VECTOR])
def test_a_switch_that_stays_open_acts_in_elf_plus(values: dict[str, float]) -> None:
    """HF is the truth: without it the actuator swings or stands; with it ELF+ is within 2 % of SIN."""
    values = {**values, "fault.open_switch": 1.0}
    found, truth = flown("ELF+", "SIN", values, 1.0), flown("HF", "SIN", values, 1.0)
    assert difference(found, truth) < 0.02 < difference(flown("ELF+", "SIN", {}, 1.0), truth)


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "ELF", "LF"])
def test_results_do_not_depend_on_how_a_run_is_cut(fidelity: str) -> None:
    """The same outputs at 0.03 s by steps that divide nothing as by one; the carrier divides no controller period."""
    values = {**VECTOR, "controller.structure": 2.0, "inverter.carrier_frequency": 16.3e3, "initial.motor_speed": 20.0}
    once = Flight(fidelity, values).to(0.03)
    cut = Flight(fidelity, values)
    for t in (*np.arange(1, 431) * 7e-5 * 0.99, 0.03):
        cut.to(float(t))
    for name in ("position", "motor_speed", "equivalent_current", "equivalent_current_filtered", "measured_current"):
        assert cut[name] == pytest.approx(once[name], rel=1e-9, abs=1e-12), name


# supply, limits, mechanics, sensors as found


def test_utilisation_is_what_the_modulation_reaches() -> None:
    """A stalled rotor, the reference beyond reach: the voltage along a phase is 2/3 of what the legs differ by; a shortest
    pulse does not undo it."""
    values = {**VECTOR, **HELD, "controller.current_limit": 100.0, "initial.motor_position": -math.pi / 4.0}
    values |= {"inverter.dead_time": 0.0, "motor.R": 10.0}
    currents = {}
    for utilisation, least in ((1.0, 0.0), (0.9, 0.0), (0.9, 2e-6)):
        flight = Flight("HF", {**values, "inverter.utilisation": utilisation, "inverter.minimum_pulse": least})
        found = flight.fly(lambda t: 1.0, n=200)["equivalent_current"]
        currents[utilisation, least] = float(np.mean(found[100:]))
    assert currents[1.0, 0.0] == pytest.approx(2.0 / 3.0 * V_DC / 10.01, rel=5e-3)
    assert currents[0.9, 0.0] == pytest.approx(0.9 * currents[1.0, 0.0], rel=5e-3)
    assert currents[0.9, 2e-6] <= currents[0.9, 0.0] * 1.001


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_friction_differs_between_directions(fidelity: str) -> None:
    """A steady speed takes T_coulomb + C*w, with the asymmetry added one way and taken off the other."""
    values = {"mechanics.T_asymmetry": 0.01, "gear.backlash": 0.0}
    torques = []
    for way in (1.0, -1.0):
        found = Flight(fidelity, values).fly(lambda t, way=way: 0.2 * way * t, n=6000)
        torques.append(way * float(np.mean(found["motor_torque"][3000:])))
    assert torques[0] - torques[1] == pytest.approx(0.02, rel=0.03)


def test_the_controller_s_sensor_counts() -> None:
    """`measured_motor_position` is a whole number of counts, at most half of one off at the sample; `measured_current` is
    within the ripple of the true one."""
    values = {**VECTOR, "controller.structure": 2.0, "sensor.counts": 48.0, "controller.pid.T_f": 3e-3}
    found = Flight("HF", values).fly(lambda t: 0.02 * math.sin(20.0 * t), n=2000)
    counts = found["measured_motor_position"] * 48.0 / (2.0 * math.pi)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    moved = np.abs(found["motor_speed"]) * 1e-4 + math.pi / 48.0
    assert np.all(np.abs(found["measured_motor_position"] - found["motor_position"]) <= moved * 1.01 + 1e-9)
    ideal = Flight("ELF+", values).fly(lambda t: 0.02 * math.sin(20.0 * t), n=2000)
    off = np.abs(ideal["measured_motor_position"] - ideal["motor_position"])
    assert np.all(off <= 1.1e-4 * np.max(np.abs(ideal["motor_speed"])))


# what a stranger's drive meets


@pytest.mark.parametrize("fidelity", ["ELF", "ELF+"])
def test_a_leg_without_its_upper_switch_gives_no_current_out(fidelity: str) -> None:
    found = Flight(fidelity, {**VECTOR, "fault.open_switch": 1.0}).fly(lambda t: 0.02, n=600)
    assert np.max(found["phase_current_a"]) < 0.02 * np.max(np.abs(found["phase_current_b"]))


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_a_pid_that_is_started_in_motion_goes_on(fidelity: str) -> None:
    """Truth: the run that was not interrupted, on a ramp, the derivative on the error and feed-forward of the speed."""
    values = {
        **VECTOR, "controller.structure": 2.0, "controller.pid.b": 1.0, "controller.pid.c": 1.0, "controller.pid.K_p": 10.0,
        "controller.pid.K_i": 50.0, "controller.pid.K_d": 0.3, "controller.pid.T_f": 1.6e-3, "gear.backlash": 0.0,
        "controller.feedforward_speed": 0.05, "sensor.resolver_bits": 0.0,
    }  # fmt: skip
    whole = Flight(fidelity, values)
    whole.fly(lambda t: 0.2 * t, n=2500)
    outputs = {
        "motor_position": "motor_position", "motor_speed": "motor_speed", "position": "position",
        "integral": "controller.integral",
        "phase_current_a": "phase_current_a", "phase_current_b": "phase_current_b", "reference_current": "reference_current",
    }  # fmt: skip
    start = {f"initial.{name}": whole[output] for name, output in outputs.items()}
    again = Flight(fidelity, {**values, **start, "command": 0.05})
    found = again.fly(lambda t: 0.05 + 0.2 * t, n=300)
    assert np.max(np.abs(found["reference_current"] - whole["reference_current"])) < 0.25
    assert np.max(np.abs(found["motor_speed"] - 40.0)) < 1.0


@pytest.mark.parametrize("least, utilisation", [(1.3e-5, 1.0), (2.6e-5, 1.0), (1.25e-5, 0.9)])
def test_a_shortest_pulse_that_leaves_no_room_is_refused(least: float, utilisation: float) -> None:
    values = {**VECTOR, "inverter.minimum_pulse": least, "inverter.utilisation": utilisation}
    assert Flight.tried("HF", values) is Status.PULSE
    values["inverter.minimum_pulse"] = 1.2e-5
    assert isinstance(Flight.tried("HF", values), Flight)


@pytest.mark.parametrize("fidelity", ["ELF+", "LF"])
def test_after_a_dip_of_the_supply_the_loop_begins_as_hf_s_does(fidelity: str) -> None:
    """HF is the truth: no back-EMF fed forward, so that the integral carries it; 0 V for 20 ms."""
    values = {**VECTOR, "controller.current.emf_forward": 0.0, "controller.current.bandwidth": 600.0}

    def flown_through(name: str) -> dict[str, np.ndarray]:
        dip = Flight(name, values)
        return dip.fly(lambda t: t, n=1000, supply=lambda t: 0.0 if 0.04 <= t < 0.06 else 48.0)

    assert difference(flown_through(fidelity), flown_through("HF"), "motor_speed") < 0.01


@pytest.mark.parametrize("held", [1, 4, 10])
def test_lf_s_feed_forward_does_not_hang_on_how_finely_a_command_is_held(held: int) -> None:
    """Truth: ELF+, which samples it every 0.4 ms."""
    values = {
        **VECTOR, "controller.structure": 2.0, "controller.period": 4e-4, "controller.pid.K_p": 6.0,
        "controller.pid.K_d": 0.2, "controller.feedforward_acceleration": 8e-5, "gear.backlash": 0.0,
    }  # fmt: skip

    def of(t: float) -> float:
        return 0.02 * math.sin(30.0 * (round(t / 1e-4) // held) * held * 1e-4)

    found, truth = (Flight(name, values).fly(of, n=3000) for name in ("LF", "ELF+"))
    assert difference(found, truth) < 0.02

"""The twins in flight against analytic solutions and symmetries; each test cites its truth."""

import math

import numpy as np
import pytest
from flight import Flight

from ema_fmu_src import ports
from ema_fmu_src.twins import SLOPES

NO_FRICTION = {
    "mechanics.T_static": 0.0,
    "mechanics.T_coulomb": 0.0,
    "mechanics.C": 0.0,
    "gear.eta_opposing": 1.0,
    "gear.eta_aiding": 1.0,
}


@pytest.mark.parametrize("located", [0.0, 1.0])
def test_locked_rotor_rl_step(located):
    """Analytic: with legs b and c low and a high, i_a = V/(1.5 R') * (1 - exp(-t R'/L)), R' = R + R_on.

    The rotor is held by a static friction that no torque overcomes; the band is never reached, because the voltage
    drives at most 1.4 A and the reference is 10 A.
    """
    V, R, L = 2.1, 1.01, 0.7e-3
    flight = Flight(
        "HF",
        {
            "supply_voltage": V,
            "mechanics.T_static": 50.0,
            "mechanics.T_coulomb": 50.0,
            "controller.K_i": 0.0,
            "sensor.resolver_bits": 0,
            "initial.motor_position": -math.pi / 4,  # theta_e = -90 degrees: i_ref = (I, -I/2, -I/2)
            "solver.event_located": located,
            "solver.step": 1e-5 if located else 1e-7,
        },
    )
    flown = flight.fly(lambda t: 0.5, n=30)
    expected = V / (1.5 * R) * (1.0 - np.exp(-flown["time"] * R / L))
    assert flown["reference_current"][0] == 10.0
    assert np.all(flown["motor_speed"] == 0.0)
    # the dead time (0.5 us) and the first comparator decision delay the start
    assert flown["phase_current_a"] == pytest.approx(expected, abs=2e-3 * expected[-1])
    assert flown["phase_current_b"] == pytest.approx(-0.5 * flown["phase_current_a"], abs=1e-9)


def test_back_emf_at_constant_speed():
    """Eq. 2 of the paper: e_j = -N_j*K_e*w*sin(theta_j)*[1 + p*zeta*cos(theta_j - phi)]."""
    K_e, w, p, zeta, phi = 0.05, 120.0, 2, 0.1, 0.4
    flight = Flight(
        "ELF+",
        {"initial.motor_speed": w, "initial.motor_position": 0.3, "fault.N_b": 0.8, "fault.zeta": zeta, "fault.phi": phi},
    )
    for j, (phase, N) in enumerate([("a", 1.0), ("b", 0.8), ("c", 1.0)]):
        theta_j = p * 0.3 - 2.0 * math.pi * j / 3.0
        expected = -N * K_e * w * math.sin(theta_j) * (1.0 + p * zeta * math.cos(theta_j - phi))
        assert flight[f"back_emf_{phase}"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
def test_coast_down(fidelity):
    """Analytic: J dw/dt = -C*w - T_c gives w = (w0 + T_c/C)*exp(-C*t/J) - T_c/C, to zero, where it stays."""
    J, C, T_c, w0 = 6e-5, 5e-4, 0.01, 60.0
    flight = Flight(
        fidelity,
        {
            "initial.motor_speed": w0,
            "mechanics.C": C,
            "mechanics.T_static": 0.02,
            "mechanics.T_coulomb": T_c,
            "controller.current_limit": 0.0,
            "inverter.hysteresis": 50.0,
            "fault.magnet": 0.1,
            "motor.K_e": 1e-5,
        },
    )
    flown = flight.fly(lambda t: 0.0, n=4000)
    stop = J / C * math.log(1.0 + w0 * C / T_c)
    expected = np.where(flown["time"] < stop, (w0 + T_c / C) * np.exp(-C * flown["time"] / J) - T_c / C, 0.0)
    assert flown["motor_speed"] == pytest.approx(expected, abs=0.02)
    assert np.all(flown["motor_speed"][flown["time"] > stop + 2e-4] == 0.0)


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
@pytest.mark.parametrize(("factor", "moves"), [(0.999, False), (1.001, True)])
def test_breakaway_at_exactly_the_static_limit(fidelity, factor, moves):
    """Borello: at rest, friction balances the load up to T_static (motor side, gear without loss), not beyond."""
    flight = Flight(
        fidelity,
        {"gear.eta_opposing": 1.0, "gear.eta_aiding": 1.0, "controller.current_limit": 0.0, "inverter.hysteresis": 50.0},
    )
    flown = flight.fly(lambda t: 0.0, n=20, load=lambda t: factor * 0.06 * 200.0)
    assert bool(np.any(flown["motor_speed"] != 0.0)) is moves
    if not moves:
        assert flown["friction_torque"][-1] == pytest.approx(-factor * 0.06, rel=1e-3)


def test_end_stop_holds_the_user_shaft():
    """The command is beyond the stop; the user shaft must come to rest at it."""
    for fidelity in ("HF", "ELF+", "LF"):
        flown = Flight(fidelity, {"mechanics.end_stop": 0.05}).fly(lambda t: 0.3, n=2500)
        assert np.max(flown["position"]) <= 0.05 + 1e-12
        assert flown["position"][-1] == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_phase_currents_sum_to_zero(fidelity):
    """Kirchhoff at the star point, with unequal phases and in saturation."""
    flight = Flight(fidelity, {"fault.N_a": 0.6, "fault.zeta": 0.2, "supply_voltage": 30.0})
    flown = flight.fly(lambda t: 0.5 * math.sin(31.4 * t), n=1500)
    total = flown["phase_current_a"] + flown["phase_current_b"] + flown["phase_current_c"]
    assert np.max(np.abs(total)) < 1e-9
    assert np.max(np.abs(flown["phase_current_a"])) > 5.0


@pytest.mark.parametrize("fidelity", ["ELF", "ELF+", "LF"])
def test_short_in_b_is_a_short_in_a_seen_120_degrees_later(fidelity):
    """Symmetry: phase b sees at theta_e what phase a saw at theta_e - 120 degrees (end stops and command moved too)."""
    shift = 2.0 * math.pi / 3.0 / 2.0  # mechanical, p = 2
    ratio = 200.0

    def fly(phase, by):
        flight = Flight(
            fidelity,
            {
                f"fault.N_{phase}": 0.7,
                "initial.motor_position": by,
                "initial.position": by / ratio,
                "mechanics.end_stop": 5.0,
            },
        )
        return flight.fly(lambda t: by / ratio + 0.05 * math.sin(20.0 * t), n=2000)

    in_a, in_b = fly("a", 0.0), fly("b", shift)
    assert in_b["motor_position"] - shift == pytest.approx(in_a["motor_position"], abs=1e-8)
    assert in_b["phase_current_b"] == pytest.approx(in_a["phase_current_a"], abs=1e-6)
    assert in_b["phase_current_c"] == pytest.approx(in_a["phase_current_b"], abs=1e-6)
    assert np.ptp(in_a["motor_position"]) > 10.0


def test_hf_short_in_b_is_a_short_in_a_seen_120_degrees_later():
    """As above, but the switching pattern is chaotic in rounding: angles agree, instants of switching do not."""
    shift = math.pi / 3.0

    def fly(phase, by):
        flight = Flight(
            "HF",
            {
                f"fault.N_{phase}": 0.7,
                "initial.motor_position": by,
                "initial.position": by / 200.0,
                "sensor.resolver_bits": 0,
            },
        )
        return flight.fly(lambda t: by / 200.0 + 0.05 * math.sin(20.0 * t), n=2000)

    in_a, in_b = fly("a", 0.0), fly("b", shift)
    difference = in_b["motor_position"] - shift - in_a["motor_position"]
    assert np.max(np.abs(difference)) < 2e-3 * np.ptp(in_a["motor_position"])


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
def test_communication_steps_do_not_change_the_result(fidelity):
    """The twins keep their own ticks: constant inputs, cut at odd points or not at all, give the same."""
    whole = Flight(fidelity, {"command": 0.05}).to(0.05)
    cut = Flight(fidelity, {"command": 0.05})
    rng = np.random.default_rng(3)
    for t in np.sort(rng.uniform(0.0, 0.05, 400)):
        cut.to(float(t))
    cut.to(0.05)
    for name in ("position", "motor_position", "motor_speed", "phase_current_a", "equivalent_current_filtered"):
        assert cut[name] == pytest.approx(whole[name], rel=1e-12, abs=1e-12), name


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_a_fault_set_in_mid_run_takes_effect(fidelity):
    """A change of the gain at 10 ms: nothing before it, another response after it."""
    healthy, faulted = Flight(fidelity, {"command": 0.01}), Flight(fidelity, {"command": 0.01})
    assert healthy.to(0.01)["position"] == faulted.to(0.01)["position"]
    faulted.set({"fault.gain": 0.5})
    assert faulted.to(0.03)["position"] < healthy.to(0.03)["position"]


def test_hf_converges_to_its_fixed_step_solution():
    """Two stepping rules of the same equations: event-located at its default against 1e-7 s fixed, SIN's first 60 ms."""

    def command(t):
        return 0.1 * math.sin(2.0 * math.pi * t)

    located = Flight("HF").fly(command, n=600)
    fixed = Flight("HF", {"solver.event_located": 0.0, "solver.step": 1e-7}).fly(command, n=600)
    for name, share in (("position", 5e-4), ("motor_speed", 2e-3), ("equivalent_current_filtered", 1e-2)):
        rms = math.sqrt(np.mean((located[name] - fixed[name]) ** 2))
        assert rms < share * np.ptp(fixed[name]), name


def test_current_stays_within_limit_and_ripple():
    """Hysteresis in a star: an instantaneous error stays within twice the band (plus what the dead time adds)."""
    flown = Flight("HF").fly(lambda t: 0.1 * math.sin(2.0 * math.pi * t), n=3000)
    assert np.max(np.abs(flown["equivalent_current"][50:] - flown["reference_current"][50:])) < 3.0 * 0.25
    assert ports.VARIABLES[ports.INDEX["inverter.hysteresis"]].start == 0.25


@pytest.mark.parametrize("slope", [0.0, -3.0])
def test_lf_gives_the_integral_that_carries_its_reference_on(slope):
    """By definition (cascade.carrying_integral), with the command as it is at the communication point, held or ramping."""
    flight = Flight("LF", {"command": 0.02, "fault.gain": 0.7})
    flight.to(0.004)
    flight.x[SLOPES["command"]] = slope
    flight.to(0.005)
    command = 0.02 + slope * 0.001
    w_ref = 0.7 * flight["controller.K_pos"] * flight["gear.ratio"] * (command - flight["position"])
    assert abs(w_ref) < flight["controller.speed_limit"]
    expected = flight["reference_current"] - flight["controller.K_p"] * (w_ref - flight["motor_speed"])
    assert flight["controller.integral"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("switch", "sign"), [(1, 1.0), (2, -1.0)])
def test_an_open_switch_takes_away_one_sign_of_its_leg_s_current(switch, sign):
    """The upper switch feeds the positive current of its leg, the lower the negative; diodes alone carry a tenth of it."""

    def mean_current(open_switch):
        flown = Flight("HF", {"fault.open_switch": open_switch}).fly(lambda t: 0.1 * math.sin(2.0 * math.pi * t), n=10000)
        return np.mean(np.maximum(sign * flown["phase_current_a"], 0.0))

    assert mean_current(switch) < 0.15 * mean_current(0)


def test_a_free_rotor_keeps_its_momentum():
    """Newton: without friction, load and current the speed does not change."""
    flight = Flight(
        "ELF+", {**NO_FRICTION, "initial.motor_speed": 10.0, "controller.current_limit": 0.0, "fault.magnet": 0.1}
    )
    assert flight.to(0.05)["motor_speed"] == pytest.approx(10.0, rel=1e-9)
    assert flight["motor_position"] == pytest.approx(0.5, rel=1e-9)


def test_a_circuit_too_fast_to_step_from_event_to_event_says_so():
    """At 2000 V, 1 uH and 1 mA each switching takes a picosecond: the bound on steps ends it, with advice."""
    flight = Flight(
        "HF",
        {"command": 0.1, "supply_voltage": 2000.0, "motor.L": 1e-6, "inverter.hysteresis": 1e-3, "inverter.dead_time": 0.0},
    )
    with pytest.raises(AssertionError, match=r"reached its bound of steps.*solver.event_located=false"):
        flight.to(0.01)

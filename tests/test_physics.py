"""The equations against analytic solutions and symmetries; each test cites its truth."""

import math

import numpy as np
import pytest
from flight import Flight

from ema_fmu_src import ports
from ema_fmu_src.physics import controller, driver, equivalent, mechanics, monitor, sensor, trig, windings

NO_FRICTION = {
    "mechanics__T_static": 0.0,
    "mechanics__T_coulomb": 0.0,
    "mechanics__C": 0.0,
    "gear__eta_opposing": 1.0,
    "gear__eta_aiding": 1.0,
}


def test_sincos_agrees_with_the_c_library():
    """math.sin and math.cos are another implementation, good to half a unit in the last place."""
    angles = np.concatenate([np.linspace(-1e4, 1e4, 20001), np.linspace(-7, 7, 20001)])
    ours = np.array([trig.sincos(angle) for angle in angles])
    theirs = np.column_stack([np.sin(angles), np.cos(angles)])
    assert np.max(np.abs(ours - theirs)) < 1e-12
    assert np.max(np.abs(ours - theirs)[20001:]) < 4e-16
    assert all(math.isnan(value) for value in trig.sincos(math.nan))


def test_rotation_agrees_with_the_addition_theorem():
    for angle in np.linspace(-0.2, 0.2, 41):
        s, c = trig.rotate(math.sin(1.0), math.cos(1.0), angle)
        assert s == pytest.approx(math.sin(1.0 + angle), abs=2e-11)
        assert c == pytest.approx(math.cos(1.0 + angle), abs=2e-11)


@pytest.mark.parametrize("located", [0.0, 1.0])
def test_locked_rotor_rl_step(located):
    """Analytic: with legs b and c low and a high, i_a = V/(1.5 R') * (1 - exp(-t R'/L)), R' = R + R_on.

    The rotor is held by a static friction that no torque overcomes; the band is never reached, because the voltage
    drives at most 1.4 A and the reference is 10 A.
    """
    V, R, L = 2.1, 1.01, 0.7e-3
    flight = Flight(
        "HF",
        supply_voltage=V,
        mechanics__T_static=50.0,
        mechanics__T_coulomb=50.0,
        controller__K_i=0.0,
        sensor__resolver_bits=0,
        initial__motor_position=-math.pi / 4,  # theta_e = -90 degrees: i_ref = (I, -I/2, -I/2)
        solver__event_located=located,
        solver__step=1e-5 if located else 1e-7,
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
        "ELF+", initial__motor_speed=w, initial__motor_position=0.3, fault__N_b=0.8, fault__zeta=zeta, fault__phi=phi
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
        initial__motor_speed=w0,
        mechanics__C=C,
        mechanics__T_static=0.02,
        mechanics__T_coulomb=T_c,
        controller__current_limit=0.0,
        inverter__hysteresis=50.0,
        fault__magnet=0.1,
        motor__K_e=1e-5,
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
        fidelity, gear__eta_opposing=1.0, gear__eta_aiding=1.0, controller__current_limit=0.0, inverter__hysteresis=50.0
    )
    flown = flight.fly(lambda t: 0.0, n=20, load=lambda t: factor * 0.06 * 200.0)
    assert bool(np.any(flown["motor_speed"] != 0.0)) is moves
    if not moves:
        assert flown["friction_torque"][-1] == pytest.approx(-factor * 0.06, rel=1e-3)


def test_friction_depends_on_load_and_direction():
    """DESIGN: (1/eta - 1)*|T_L| when the load opposes, (1 - eta)*|T_L| when it aids."""
    assert mechanics.load_friction(2.0, 1.0, 1.0 / 0.8 - 1.0, 0.1) == pytest.approx(0.5)
    assert mechanics.load_friction(2.0, -1.0, 1.0 / 0.8 - 1.0, 0.1) == pytest.approx(0.2)
    assert mechanics.load_friction(-2.0, -1.0, 1.0 / 0.8 - 1.0, 0.1) == pytest.approx(0.5)


def test_play_draws_its_hysteresis_loop():
    """Analytic: under x = A*sin the loop of a play of width b is a parallelogram of width b and height 2*A - b."""
    A, b = 1.0, 0.3
    x = A * np.sin(np.linspace(0.0, 4.0 * math.pi, 40001))
    y = np.empty_like(x)
    state = 0.0
    for k, value in enumerate(x):
        state = y[k] = mechanics.play(state, value, 0.5 * b)
    loop = slice(20000, 40001)
    area = abs(np.trapezoid(y[loop], x[loop]))
    assert area == pytest.approx(b * (2.0 * A - b), rel=1e-4)
    assert np.max(y[loop]) == pytest.approx(A - b / 2.0)


def test_end_stop_holds_the_user_shaft():
    """The command is beyond the stop; the user shaft must come to rest at it."""
    for fidelity in ("HF", "ELF+", "LF"):
        flown = Flight(fidelity, mechanics__end_stop=0.05).fly(lambda t: 0.3, n=2500)
        assert np.max(flown["position"]) <= 0.05 + 1e-12
        assert flown["position"][-1] == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_phase_currents_sum_to_zero(fidelity):
    """Kirchhoff at the star point, with unequal phases and in saturation."""
    flight = Flight(fidelity, fault__N_a=0.6, fault__zeta=0.2, supply_voltage=30.0)
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
            **{f"fault__N_{phase}": 0.7},
            initial__motor_position=by,
            initial__position=by / ratio,
            mechanics__end_stop=5.0,
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
            **{f"fault__N_{phase}": 0.7},
            initial__motor_position=by,
            initial__position=by / 200.0,
            sensor__resolver_bits=0,
        )
        return flight.fly(lambda t: by / 200.0 + 0.05 * math.sin(20.0 * t), n=2000)

    in_a, in_b = fly("a", 0.0), fly("b", shift)
    difference = in_b["motor_position"] - shift - in_a["motor_position"]
    assert np.max(np.abs(difference)) < 2e-3 * np.ptp(in_a["motor_position"])


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
def test_communication_steps_do_not_change_the_result(fidelity):
    """The twins keep their own ticks: constant inputs, cut at odd points or not at all, give the same."""
    whole = Flight(fidelity, command=0.05).to(0.05)
    cut = Flight(fidelity, command=0.05)
    rng = np.random.default_rng(3)
    for t in np.sort(rng.uniform(0.0, 0.05, 400)):
        cut.to(float(t))
    cut.to(0.05)
    for name in ("position", "motor_position", "motor_speed", "phase_current_a", "equivalent_current_filtered"):
        assert cut[name] == pytest.approx(whole[name], rel=1e-12, abs=1e-12), name


@pytest.mark.parametrize("fidelity", ["HF", "ELF+", "LF"])
def test_a_fault_set_in_mid_run_takes_effect(fidelity):
    """A change of the gain at 10 ms: nothing before it, another response after it."""
    healthy, faulted = Flight(fidelity, command=0.01), Flight(fidelity, command=0.01)
    assert healthy.to(0.01)["position"] == faulted.to(0.01)["position"]
    faulted.set(fault__gain=0.5)
    assert faulted.to(0.03)["position"] < healthy.to(0.03)["position"]


def test_hf_converges_to_its_fixed_step_solution():
    """Two stepping rules of the same equations: event-located at its default against 1e-7 s fixed, SIN's first 60 ms."""

    def command(t):
        return 0.1 * math.sin(2.0 * math.pi * t)

    located = Flight("HF").fly(command, n=600)
    fixed = Flight("HF", solver__event_located=0.0, solver__step=1e-7).fly(command, n=600)
    for name, share in (("position", 5e-4), ("motor_speed", 2e-3), ("equivalent_current_filtered", 1e-2)):
        rms = math.sqrt(np.mean((located[name] - fixed[name]) ** 2))
        assert rms < share * np.ptp(fixed[name]), name


def test_independent_phase_keeps_to_eq_1():
    """Eq. 1 clamps each phase to (+-V - e)/(R*n) on its own."""
    assert driver.independent_phase(90.0, 10.0, 1.0, 0.5, 48.0) == (48.0 - 10.0) / 0.5
    assert driver.independent_phase(-90.0, 10.0, 1.0, 1.0, 48.0) == -58.0
    assert driver.independent_phase(3.0, 10.0, 1.0, 1.0, 48.0) == 3.0


def test_saturated_legs_follow_from_the_star():
    """Independent method: brute force over the middle leg's voltage; it must meet its reference if any voltage can."""
    rng = np.random.default_rng(7)
    for _ in range(200):
        a, c, need = rng.uniform(0.05, 0.2, 3), rng.uniform(-20, 20, 3), rng.uniform(-90, 90, 3)
        if np.ptp(need) <= 48.0:
            continue
        u = np.array(driver.saturated_legs(*need, *a, *c, 48.0))
        order = np.argsort(need)
        assert u[order[2]] == 24.0 and u[order[0]] == -24.0
        middle = order[1]
        wanted = a[middle] * (need[middle] - c[middle])
        grid = np.linspace(-24.0, 24.0, 4801)

        def change(u_m, u=u, a=a, c=c, middle=middle):
            legs = u.copy()
            legs[middle] = u_m
            return a[middle] * (u_m - np.sum(a * (legs - c)) / np.sum(a) - c[middle])

        best = grid[np.argmin([abs(change(value) - wanted) for value in grid])]
        assert u[middle] == pytest.approx(best, abs=0.011)


def test_controller_limits_and_does_not_wind_up():
    """The integral stands still in saturation unless the error drives it back (DESIGN, section 4)."""
    assert controller.speed_reference(1.0, 0.0, 40.0, 200.0, 2000.0) == 2000.0
    assert controller.speed_pi(100.0, 0.0, 0.5, 1.3, 10.0, 1e-4, 10.0) == (10.0, 0.5)
    I_ref, xi = controller.speed_pi(1.0, 0.0, 0.5, 1.3, 10.0, 1e-4, 10.0)
    assert (I_ref, xi) == (pytest.approx(1.8), pytest.approx(0.501))
    _, xi = controller.speed_pi(-1.0, 0.0, 20.0, 1.3, 10.0, 1e-4, 10.0)
    assert xi < 20.0


def test_healthy_shape_functions_are_one():
    for theta in np.linspace(0.0, 6.0, 13):
        s_a, s_b, s_c, c_a, c_b, c_c = trig.three_phases(math.sin(theta), math.cos(theta))
        shares = [equivalent.shape(1.0, s, c, 0.0, 0.0) for s, c in ((s_a, c_a), (s_b, c_b), (s_c, c_c))]
        assert sum(shares) == pytest.approx(1.0)
        assert equivalent.resistance(1.3, 1.0, 1.0, 1.0, s_a, s_b, s_c) == pytest.approx(1.3)


def test_eccentricity_gives_a_third_harmonic_of_p_zeta_half():
    """Eq. 2 with i_j = -I*sin(theta_j): T = 1.5*K_e*I*(1 - (p*zeta/2)*cos(3*theta - phi) + ...) for a balanced machine."""
    depth, phi = 0.2, 0.3
    angles = np.linspace(0.0, 2.0 * math.pi, 360, endpoint=False)
    torque = []
    for theta in angles:
        s_a, s_b, s_c, c_a, c_b, c_c = trig.three_phases(math.sin(theta), math.cos(theta))
        k = [
            windings.back_emf_coefficient(1.0, 0.05, s, c, depth * math.cos(phi), depth * math.sin(phi))
            for s, c in ((s_a, c_a), (s_b, c_b), (s_c, c_c))
        ]
        torque.append(windings.torque(*k, -s_a, -s_b, -s_c))
    spectrum = np.abs(np.fft.rfft(torque)) / len(angles)
    assert 2.0 * spectrum[3] / spectrum[0] == pytest.approx(depth / 2.0, rel=1e-9)
    assert np.max(np.delete(spectrum, [0, 3])) < 1e-12


def test_clarke_and_park_give_back_the_amplitude():
    theta = 0.7
    s_a, s_b, s_c, *_ = trig.three_phases(math.sin(theta), math.cos(theta))
    assert monitor.quadrature_current(-4 * s_a, -4 * s_b, -4 * s_c, math.sin(theta), math.cos(theta)) == pytest.approx(4.0)


def test_resolver_rounds_to_the_nearest_count():
    count = 2.0 * math.pi / 2**10
    assert sensor.resolver(3.4 * count, 10) == pytest.approx(3 * count)
    assert sensor.resolver(-3.6 * count, 10) == pytest.approx(-4 * count)
    assert sensor.resolver(0.1234, 0) == 0.1234


def test_current_stays_within_limit_and_ripple():
    """Hysteresis in a star: an instantaneous error stays within twice the band (plus what the dead time adds)."""
    flown = Flight("HF").fly(lambda t: 0.1 * math.sin(2.0 * math.pi * t), n=3000)
    assert np.max(np.abs(flown["equivalent_current"][50:] - flown["reference_current"][50:])) < 3.0 * 0.25
    assert ports.VARIABLES[ports.INDEX["inverter.hysteresis"]].start == 0.25


@pytest.mark.parametrize(("switch", "sign"), [(1, 1.0), (2, -1.0)])
def test_an_open_switch_takes_away_one_sign_of_its_leg_s_current(switch, sign):
    """The upper switch feeds the positive current of its leg, the lower the negative; diodes alone carry a tenth of it."""

    def mean_current(open_switch):
        flown = Flight("HF", fault__open_switch=open_switch).fly(lambda t: 0.1 * math.sin(2.0 * math.pi * t), n=10000)
        return np.mean(np.maximum(sign * flown["phase_current_a"], 0.0))

    assert mean_current(switch) < 0.15 * mean_current(0)


def test_a_free_rotor_keeps_its_momentum():
    """Newton: without friction, load and current the speed does not change."""
    flight = Flight("ELF+", **NO_FRICTION, initial__motor_speed=10.0, controller__current_limit=0.0, fault__magnet=0.1)
    assert flight.to(0.05)["motor_speed"] == pytest.approx(10.0, rel=1e-9)
    assert flight["motor_position"] == pytest.approx(0.5, rel=1e-9)


def test_a_circuit_too_fast_to_step_from_event_to_event_says_so():
    """At 2000 V, 1 uH and 1 mA each switching takes a picosecond: the bound on steps ends it, with advice."""
    flight = Flight(
        "HF", command=0.1, supply_voltage=2000.0, motor__L=1e-6, inverter__hysteresis=1e-3, inverter__dead_time=0.0
    )
    with pytest.raises(AssertionError, match=r"reached its bound of steps.*solver.event_located=false"):
        flight.to(0.01)

"""The equations one by one, against analytic solutions, independent methods and symmetries; each test cites its truth."""

import math

import numpy as np
import pytest

from ema_fmu_src.physics import mechanics, monitor, sensor, single_phase, trig, voltage_limit, windings
from ema_fmu_src.physics.controller import cascade, derivative
from ema_fmu_src.physics.phases import Abc, three_phases

HEALTHY = Abc(1.0, 1.0, 1.0)


def alike(value: float) -> Abc:
    return Abc(value, value, value)


GAINS = cascade.Gains(
    K_motor=40.0 * 200.0, speed_limit=2000.0, K_p=1.3, K_i=10.0, K_d=0.0, T_d=1e-3, T_c=1e-4, current_limit=10.0
)


def remembered(xi: float) -> derivative.Memory:
    return derivative.Memory(xi, 0.0, 0.0, 0.0)


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


def test_friction_depends_on_load_and_direction():
    """Power through a gear: (1/eta - 1)*|T_L| is lost when the load opposes the motion, (1 - eta)*|T_L| when it aids it."""
    friction = mechanics.Friction(0.06, 0.03, 0.0, loss_opposing=1.0 / 0.8 - 1.0, loss_aiding=0.1, C=0.0)
    assert mechanics.load_friction(2.0, 1.0, friction) == pytest.approx(0.5)
    assert mechanics.load_friction(2.0, -1.0, friction) == pytest.approx(0.2)
    assert mechanics.load_friction(-2.0, -1.0, friction) == pytest.approx(0.5)


def test_the_slowest_speed_stops_at_zero_before_it_turns():
    """Borello: what crosses zero sticks, and at the least speed a double can hold its product with the next is 0."""
    friction = mechanics.Friction(0.06, 0.03, 0.0, loss_opposing=0.0, loss_aiding=0.0, C=0.0)
    for speed in (5e-324, 1e-170, 1e-3):
        assert mechanics.rotor(speed, 0.0, 0.0, friction, 1e-5, 1e-5)[0] == 0.0
        assert mechanics.rotor(-speed, 0.0, 0.0, friction, 1e-5, 1e-5)[0] == 0.0


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


def test_independent_phase_keeps_to_eq_1():
    """Eq. 1 clamps each phase to (+-V - e)/(R*n) on its own."""
    assert voltage_limit.independent_phase(90.0, 10.0, 1.0, 0.5, 48.0) == (48.0 - 10.0) / 0.5
    assert voltage_limit.independent_phase(-90.0, 10.0, 1.0, 1.0, 48.0) == -58.0
    assert voltage_limit.independent_phase(3.0, 10.0, 1.0, 1.0, 48.0) == 3.0


def test_saturated_legs_follow_from_the_star():
    """Independent method: brute force over the middle leg's voltage; it must meet its reference if any voltage can."""
    rng = np.random.default_rng(7)
    for _ in range(200):
        a, hold, need = rng.uniform(0.05, 0.2, 3), rng.uniform(-20, 20, 3), rng.uniform(-90, 90, 3)
        if np.ptp(need) <= 48.0:
            continue
        u = np.array(voltage_limit.saturated_legs(Abc(*need), Abc(*a), Abc(*hold), 48.0))
        order = np.argsort(need)
        assert u[order[2]] == 24.0 and u[order[0]] == -24.0
        middle = order[1]
        wanted = a[middle] * (need[middle] - hold[middle])
        grid = np.linspace(-24.0, 24.0, 4801)

        def change(u_m, u=u, a=a, hold=hold, middle=middle):
            legs = u.copy()
            legs[middle] = u_m
            return a[middle] * (u_m - np.sum(a * (legs - hold)) / np.sum(a) - hold[middle])

        best = grid[np.argmin([abs(change(value) - wanted) for value in grid])]
        assert u[middle] == pytest.approx(best, abs=0.011)


def test_controller_limits_and_does_not_wind_up():
    """The integral stands still in saturation unless the error drives it back (cascade.sampled)."""
    assert cascade.speed_reference(GAINS, 1.0, 0.0) == 2000.0

    def sampled(w_ref: float, xi: float) -> tuple[float, float]:
        I_ref, memory = cascade.sampled(GAINS, 0.0, w_ref / GAINS.K_motor, 0.0, 0.0, remembered(xi))
        return I_ref, memory.xi

    assert sampled(100.0, 0.5) == (10.0, 0.5)
    assert sampled(1.0, 0.5) == (pytest.approx(1.8), pytest.approx(0.501))
    assert sampled(-1.0, 20.0)[1] < 20.0


@pytest.mark.parametrize("I_ref", [-9.0, 0.3, 4.0])
def test_the_carrying_integral_makes_the_next_sample_go_on(I_ref):
    """By its definition: with it, the cascade's next sample has the I_ref that it was made from."""
    position, w = 0.1, 10.0
    xi = cascade.carrying_integral(GAINS, 0.101, position, w, I_ref)
    assert cascade.sampled(GAINS, 0.0, 0.101, position, w, remembered(xi))[0] == pytest.approx(I_ref, rel=1e-12)


def test_healthy_shape_functions_are_one():
    for theta in np.linspace(0.0, 6.0, 13):
        s, c = three_phases(math.sin(theta), math.cos(theta))
        assert single_phase.shape(HEALTHY, windings.Field(0.05, alike(0.0), alike(0.0)), s, c) == pytest.approx(1.0)
        assert single_phase.resistance(1.3, HEALTHY, s) == pytest.approx(1.3)


def test_eccentricity_gives_a_third_harmonic_of_p_zeta_half():
    """Eq. 2 with i_j = -I*sin(theta_j): T = 1.5*K_e*I*(1 - (p*zeta/2)*cos(3*theta - phi) + ...) for a balanced machine."""
    depth, phi = 0.2, 0.3
    angles = np.linspace(0.0, 2.0 * math.pi, 360, endpoint=False)
    field = windings.Field(0.05, alike(depth * math.cos(phi)), alike(depth * math.sin(phi)))
    torque = []
    for theta in angles:
        s, c = three_phases(math.sin(theta), math.cos(theta))
        k = windings.back_emf_coefficients(HEALTHY, field, s, c)
        torque.append(windings.torque(k, Abc(-s.a, -s.b, -s.c)))
    spectrum = np.abs(np.fft.rfft(torque)) / len(angles)
    assert 2.0 * spectrum[3] / spectrum[0] == pytest.approx(depth / 2.0, rel=1e-9)
    assert np.max(np.delete(spectrum, [0, 3])) < 1e-12


def test_clarke_and_park_give_back_the_amplitude():
    theta = 0.7
    s, _ = three_phases(math.sin(theta), math.cos(theta))
    i = Abc(-4.0 * s.a, -4.0 * s.b, -4.0 * s.c)
    assert monitor.quadrature_current(i, math.sin(theta), math.cos(theta)) == pytest.approx(4.0)


def test_resolver_rounds_to_the_nearest_count():
    count = 2.0 * math.pi / 2**10
    assert sensor.resolver(3.4 * count, 10, 0.0) == pytest.approx(3 * count)
    assert sensor.resolver(-3.6 * count, 10, 0.0) == pytest.approx(-4 * count)
    assert sensor.resolver(0.1234, 0, 0.0) == 0.1234

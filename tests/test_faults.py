"""Faults leave the marks that theory gives them, and ELF+ and LF follow HF from healthy to faulted."""

import math
from functools import cache

import numpy as np
import pytest
from flight import Flight
from scipy.signal import butter, sosfiltfilt

from ema_fmu_src.physics import windings
from ema_fmu_src.physics.phases import Abc, three_phases
from harness.trials import trial

STEP = 1e-4  # s


@cache
def equivalent_current(fidelity: str, *faults: tuple[str, float]) -> np.ndarray:
    """Of SIN, through a zero-phase low-pass of 30 Hz [A]; from the filtered output, since sampling the instantaneous one
    every 0.1 ms folds HF's ripple into the band."""
    command = trial("SIN").inputs["command"]
    flight = Flight(fidelity, dict(faults))
    flown = flight.fly(lambda t: command[round(t / STEP)], n=len(command) - 1)
    return sosfiltfilt(butter(2, 30.0, fs=1.0 / STEP, output="sos"), flown["equivalent_current_filtered"])


@pytest.mark.parametrize(
    "fault, most",
    [
        (("fault.N_a", 0.8), 0.10),
        (("fault.friction", 2.0), 0.10),
        (("fault.backlash", 50.0), 0.10),
        (("fault.gain", 0.7), 0.10),
        (("fault.zeta", 0.1), 0.15),
    ],
)
@pytest.mark.parametrize("fidelity", ["ELF+", "LF"])
def test_the_change_from_healthy_to_faulted_is_hfs(fidelity: str, fault: tuple[str, float], most: float) -> None:
    """rms of the difference of the changes, over the rms of HF's change."""
    change = equivalent_current(fidelity, fault) - equivalent_current(fidelity)
    hfs = equivalent_current("HF", fault) - equivalent_current("HF")
    missed = math.sqrt(np.mean((change - hfs) ** 2)) / math.sqrt(np.mean(hfs**2))
    assert missed <= most


def torque_of(turns: tuple[float, float, float]) -> np.ndarray:
    """Torque over a turn of theta_e with currents -sin(theta_j), K_e = 1, some turns shorted."""
    torque = []
    for theta in np.linspace(0.0, 2.0 * math.pi, 360, endpoint=False):
        s, c = three_phases(math.sin(theta), math.cos(theta))
        k = windings.back_emf_coefficients(Abc(*turns), windings.Field(1.0, Abc(0.0, 0.0, 0.0), Abc(0.0, 0.0, 0.0)), s, c)
        torque.append(windings.torque(k, Abc(-s.a, -s.b, -s.c)))
    return np.array(torque)


@pytest.mark.parametrize("turns", [(0.8, 1.0, 1.0), (1.0, 0.8, 1.0), (1.0, 1.0, 0.8)])
def test_a_short_gives_a_second_harmonic(turns: tuple[float, float, float]) -> None:
    """N*sin^2 in one phase: T = 1.5 - (1 - N)*(1 - cos(2*theta_j))/2, a mean and a second harmonic of (1 - N)/2 only."""
    harmonics = np.abs(np.fft.rfft(torque_of(turns))) / 180.0
    assert harmonics[0] / 2.0 == pytest.approx(1.5 - 0.1)
    assert harmonics[2] == pytest.approx(0.1)
    assert np.max(np.delete(harmonics, [0, 2])) < 1e-12


@pytest.mark.parametrize("fidelity", ["HF", "ELF+"])
def test_a_short_at_constant_speed_ripples_twice_a_turn(fidelity: str) -> None:
    """The torque a loaded motor needs is even: its current answers the second harmonic of the short, not the others."""
    flight = Flight(
        fidelity, {"fault.N_a": 0.7, "mechanics.J": 1e-2, "mechanics.end_stop": 1e3, "initial.motor_speed": 100.0}
    )
    flown = flight.fly(lambda t: 100.0 / 200.0 * t + 100.0 / 8000.0, n=6000, load=lambda t: 30.0)
    electrical = 2.0 * flown["motor_position"][3000:]
    torque = flown["motor_torque"][3000:]
    grid = np.arange(electrical[0], electrical[-1], 2.0 * math.pi / 64)
    turns = int((grid[-1] - grid[0]) // (2.0 * math.pi))
    even = np.interp(grid[: 64 * turns], electrical, torque)
    harmonics = np.abs(np.fft.rfft(even))[::turns] / (32.0 * turns)
    assert np.argmax(harmonics[1:10]) + 1 == 2
    assert harmonics[2] == pytest.approx(0.1 / 1.4 * harmonics[0] / 2.0 * 1.5, rel=0.15)


@pytest.mark.parametrize("scale", [1.0, 50.0])
@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
def test_the_shaft_follows_the_rotor_through_its_play(fidelity: str, scale: float) -> None:
    """Analytic: at a reversal the user shaft stands still until the rotor has crossed the play, gear.backlash*scale."""
    command = trial("SIN").inputs["command"]
    flown = Flight(fidelity, {"fault.backlash": scale}).fly(lambda t: command[round(t / STEP)], n=12000)
    gap = flown["motor_position"] / 200.0 - flown["position"]
    half = 0.5e-4 * scale
    assert np.max(np.abs(gap)) == pytest.approx(half, rel=1e-9)
    assert np.max(gap) == pytest.approx(half, rel=1e-9) and np.min(gap) == pytest.approx(-half, rel=1e-9)
    moving = np.abs(np.diff(flown["position"])) > 0.0
    assert np.all(np.isclose(np.abs(gap[1:][moving]), half, rtol=1e-9))


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
def test_a_jam_stops_the_shaft(fidelity: str) -> None:
    flight = Flight(fidelity, {"command": 0.2})
    assert flight.to(0.02)["motor_speed"] > 50.0
    flight.set({"fault.jam": 5.0})
    at = flight.to(0.05)["position"]
    assert flight["motor_speed"] == 0.0
    assert flight.to(0.1)["position"] == at

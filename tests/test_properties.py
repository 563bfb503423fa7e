"""Whatever the parameters, commands and loads within their ranges: finite, bounded, and the same however it is cut."""

import numpy as np
import pytest
from flight import Flight
from hypothesis import given, settings
from hypothesis import strategies as st

from ema_fmu_src import ports

SPAN = 0.03  # s
PARAMETERS = {
    "motor.R": (0.3, 3.0), "motor.L": (2e-4, 3e-3), "motor.K_e": (0.02, 0.1), "motor.p": (1, 4),
    "mechanics.J": (2e-5, 5e-4), "mechanics.C": (0.0, 1e-3), "mechanics.T_static": (0.0, 0.2),
    "mechanics.T_coulomb": (0.0, 0.1), "gear.ratio": (50.0, 500.0), "controller.K_p": (0.1, 2.0),
    "controller.K_i": (0.0, 30.0), "controller.current_limit": (2.0, 20.0), "inverter.hysteresis": (0.1, 1.0),
    "inverter.dead_time": (0.0, 3e-6), "sensor.resolver_bits": (0, 16), "supply_voltage": (10.0, 100.0),
    "fault.friction": (0.0, 5.0), "fault.backlash": (0.0, 200.0), "fault.N_a": (0.3, 1.0), "fault.N_b": (0.3, 1.0),
    "fault.N_c": (0.3, 1.0), "fault.zeta": (0.0, 0.2), "fault.phi": (-3.0, 3.0), "fault.gain": (0.1, 3.0),
    "fault.magnet": (0.3, 1.0), "fault.resistance": (0.5, 3.0), "fault.jam": (0.0, 1.0),
    "fault.open_switch": (0, 6), "fault.current_offset_a": (-1.0, 1.0), "fault.resolver_offset": (-0.3, 0.3),
}  # fmt: skip
"""Name: lowest and highest value drawn; whole numbers for an Integer."""


def draws() -> st.SearchStrategy[dict[str, float]]:
    return st.fixed_dictionaries(
        {},
        optional={
            name: st.integers(low, high) if isinstance(low, int) else st.floats(low, high)
            for name, (low, high) in PARAMETERS.items()
        },
    )


commands = st.floats(-0.5, 0.5)
loads = st.floats(-20.0, 20.0)


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@settings(max_examples=60, deadline=None, derandomize=True)
@given(parameters=draws(), first=commands, second=commands, load=loads)
def test_finite_and_bounded(fidelity: str, parameters: dict[str, float], first: float, second: float, load: float) -> None:
    """Within the end stops; currents within the limit and a ripple (what a rail can add in a dead time and a step)."""
    flight = Flight(fidelity, {"command": first, **parameters})
    stop = flight["mechanics.end_stop"]
    limit, V, L = flight["controller.current_limit"], flight["supply_voltage"], flight["motor.L"]
    turns = min(flight[f"fault.N_{j}"] for j in "abc")
    shorted = max(1.0, 1.0 / turns)
    for k in range(20):
        if k == 10:
            flight.set({"command": second, "load_torque": load})
        flight.to((k + 1) * SPAN / 20)
        for variable in ports.OUTPUTS:
            assert np.isfinite(flight[variable.name])
        assert abs(flight["position"]) <= stop * (1.0 + 1e-12)
        assert abs(flight["reference_current"]) <= limit
        if fidelity != "HF":
            assert abs(flight["equivalent_current"]) <= limit * shorted * 1.2 + V * 1e-4 / (L * turns**2)


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@settings(max_examples=40, deadline=None, derandomize=True)
@given(parameters=draws(), command=commands, load=loads, cuts=st.lists(st.floats(0.0, SPAN), max_size=30))
def test_the_same_however_it_is_cut(
    fidelity: str, parameters: dict[str, float], command: float, load: float, cuts: list[float]
) -> None:
    """Inputs constant: one communication step or many, to rounding."""
    whole = Flight(fidelity, {"command": command, "load_torque": load, **parameters}).to(SPAN)
    cut = Flight(fidelity, {"command": command, "load_torque": load, **parameters})
    for t in sorted({t for t in cuts if t > 1e-7}):
        if t > cut.t + 1e-7 and t < SPAN - 1e-7:
            cut.to(t)
    cut.to(SPAN)
    for name in ("position", "motor_position", "motor_speed"):
        assert cut[name] == pytest.approx(whole[name], rel=1e-9, abs=1e-9), name


@pytest.mark.parametrize("fidelity", ["HF", "ELF", "ELF+", "LF"])
@settings(max_examples=40, deadline=None, derandomize=True)
@given(parameters=draws(), speed=st.floats(-1500.0, 1500.0))
def test_a_motor_without_supply_never_gains_energy(fidelity: str, parameters: dict[str, float], speed: float) -> None:
    """No bus voltage, no load: what the rotor and the inductances hold only falls.

    The rotor alone may take back what the inductances held: a current that is left swings it a little beyond its rest.
    """
    given_ = {name: value for name, value in parameters.items() if name not in ("supply_voltage", "fault.open_switch")}
    flight = Flight(fidelity, {"supply_voltage": 0.0, "initial.motor_speed": speed, "mechanics.end_stop": 100.0, **given_})
    before = held(flight, fidelity)
    for k in range(20):
        now = held(flight.to((k + 1) * 1e-3), fidelity)
        assert now <= before * (1.0 + 1e-9) + 1e-15
        before = now


def held(flight: Flight, fidelity: str) -> float:
    """Kinetic and magnetic energy [J]: L_j = N_j^2*L in three phases, L in LF's one, no inductance in plain ELF."""
    exponents = {"HF": 2.0, "ELF+": 2.0, "LF": 0.0}
    magnetic = 0.0
    if fidelity in exponents:
        squares = [flight[f"fault.N_{j}"] ** exponents[fidelity] * flight[f"phase_current_{j}"] ** 2 for j in "abc"]
        magnetic = 0.5 * flight["motor.L"] * sum(squares)
    return 0.5 * flight["mechanics.J"] * flight["motor_speed"] ** 2 + magnetic

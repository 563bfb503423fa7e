"""Whatever the ports accept, a run is right or it is refused: parameter sets drawn over the declared ranges.

Bounds (ours, from the circuit): no phase current exceeds what supply and back-EMF drive through its resistance; no speed
exceeds that at which the weakest phase's back-EMF reaches the supply, but for what the load and the energy of the
inductances add; no rotor passes its end stops.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest
from flight import Flight

from ema_fmu_src import ports
from ema_fmu_src.twins import Status

FIDELITIES = ("HF", "ELF", "ELF+", "LF")
SETS, GROUP = 500, 20
STEPS, STEP = 10, 2e-4
REFUSED = {Status.STIFF, Status.STUCK, Status.LOOP, Status.PULSE}
DRIVE = ("controller.current_control", "inverter.modulation")
DRAWN = [v for v in ports.PARAMETERS if not v.name.startswith("initial.") and v.kind != "Boolean" and v.name not in DRIVE]


def value(rng: np.random.Generator, variable: ports.Variable) -> float:
    """A value within the declared range: log-uniform where that spans decades, now and then an end of it."""
    low, high = float(variable.minimum or 0.0), float(variable.maximum or 0.0)
    if rng.random() < 0.1:
        return float(rng.choice([low, high]))
    if variable.kind != "Real":
        return float(rng.integers(int(low), int(high) + 1))
    if low > 0.0 and high / low > 50.0:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))
    if low == 0.0 and high > 20.0:
        return float(high * np.exp(rng.uniform(math.log(1e-7), 0.0)))
    return float(rng.uniform(low, high))


def drawn(seed: int) -> tuple[dict[str, float], float, float, float]:
    """Parameters (a third of the plain ones and most faults stay at their start), command, load and supply."""
    rng = np.random.default_rng(seed)
    parameters = {v.name: value(rng, v) for v in DRAWN if rng.random() > (0.7 if v.name.startswith("fault.") else 0.3)}
    if rng.random() < 0.5:
        parameters |= dict(zip(DRIVE, (2.0, float(rng.integers(2, 4))), strict=True))
        parameters["controller.current.K_p"] = parameters.get("controller.current.K_p", 0.0) * float(
            rng.random() < 0.2
        )  # most loops by their bandwidth: they settle
        half = 0.5 / parameters.get("inverter.carrier_frequency", 20e3)
        parameters["inverter.dead_time"] = min(parameters.get("inverter.dead_time", 0.0), 0.5 * half)
    pairs = parameters.get("motor.p", 2.0)
    parameters["fault.zeta"] = min(parameters.get("fault.zeta", 0.0), 0.9 / pairs)
    command = float(rng.choice([-1.0, 1.0]) * np.exp(rng.uniform(math.log(1e-3), math.log(10.0))))
    load = float(rng.choice([-1.0, 0.0, 1.0]) * np.exp(rng.uniform(math.log(1e-2), math.log(1e3))))
    supply = 0.0 if rng.random() < 0.05 else float(np.exp(rng.uniform(math.log(1e-3), math.log(2000.0))))
    return parameters, command, load, supply


def within_bounds(flown: dict[str, np.ndarray], of: Callable[[str], float], load: float, supply: float) -> None:
    """Asserts the bounds above; `of` gives a parameter's value."""
    turns = min(of(f"fault.N_{j}") for j in "abc")
    K_e, eccentric = of("motor.K_e") * of("fault.magnet"), of("motor.p") * of("fault.zeta")
    R = turns * of("motor.R") * of("fault.resistance")
    w = float(np.max(np.abs(flown["motor_speed"])))
    i = max(float(np.max(np.abs(flown[f"phase_current_{j}"]))) for j in "abc")
    from_load = abs(load) / of("gear.ratio") / of("mechanics.J") * STEPS * STEP
    fastest = w + from_load  # between the points at which it is seen
    assert i <= 1.0001 * (supply + 2.0 * K_e * (1.0 + eccentric) * fastest) / R + 1e-9
    ceiling = 1.05 * supply / (K_e * turns * (1.0 - eccentric))
    assert w <= ceiling + math.sqrt(1.5 * of("motor.L") / of("mechanics.J")) * i + from_load + 1e-6
    stop = of("mechanics.end_stop") + 0.5 * of("gear.backlash") * of("fault.backlash")
    assert np.max(np.abs(flown["motor_position"])) <= 1.000001 * stop * of("gear.ratio")


@pytest.mark.parametrize("first", range(0, SETS, GROUP))
def test_a_run_is_within_physical_bounds_or_refused(first: int) -> None:
    for seed in range(first, first + GROUP):
        parameters, command, load, supply = drawn(seed)
        for fidelity in FIDELITIES:
            start = {variable.name: variable.start_for(fidelity.rstrip("+")) for variable in ports.PARAMETERS}
            settings = {**parameters, "load_torque": load, "supply_voltage": supply}
            values = {**start, **parameters}
            flight = Flight.tried(fidelity, settings)
            if isinstance(flight, Status):
                assert flight in REFUSED, (seed, fidelity, flight)
                continue
            flown = flight.fly(lambda t, command=command: command, n=STEPS, step=STEP)
            assert all(np.isfinite(series).all() for series in flown.values()), (seed, fidelity)
            within_bounds(flown, values.__getitem__, load, supply)

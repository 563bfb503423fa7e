"""NASA's progpy: the powertrain model, an electronic speed controller and a DC motor."""

import time

COMPUTES = "an averaged three-phase commutation (ESC) and a DC motor model under a constant duty"
LACKS = "hysteresis control, position loop, dry friction, backlash, saturation of the star"
SIMULATED, STEP = 0.1, 1e-4  # s


def run() -> float:
    """Half duty at 48 V; returns the wall time per simulated second."""
    from progpy.models import ESC, DCMotor, Powertrain

    model = Powertrain(ESC(), DCMotor())
    load = model.InputContainer({"duty": 0.5, "v": 48.0})
    began = time.perf_counter()
    model.simulate_to(SIMULATED, lambda t, x=None: load, dt=STEP, save_freq=1e9)
    return (time.perf_counter() - began) / SIMULATED

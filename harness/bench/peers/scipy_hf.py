"""HF's equations for SciPy's solve_ivp: written again from the design, with the switchings as events.

An independent solution of the same equations (ideal resolver, no dead time), which the tests hold against the FMU.
"""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ema_fmu_src import ports

COMPUTES = "the same circuit, controller and friction; each switching found as an event of the solver"
LACKS = "dead time, diodes, resolver, end stops"
SIMULATED = 0.01  # s

P = {variable.name: variable.start for variable in ports.VARIABLES}
R, L, K_E, PAIRS = P["motor.R"] + P["inverter.R_on"], P["motor.L"], P["motor.K_e"], P["motor.p"]
J, C, G = P["mechanics.J"], P["mechanics.C"], P["gear.ratio"]
BAND, V_DC, T_C = P["inverter.hysteresis"], P["supply_voltage"], P["controller.period"]
PHASE = 2.0 * math.pi / 3.0 * np.arange(3)


def fly(command: Callable[[float], float], duration: float) -> np.ndarray:
    """States (theta, w, i_a, i_b, i_c) at the controller's ticks over `duration` [s], shape (n_ticks + 1, 5)."""
    from scipy.integrate import solve_ivp

    y = np.zeros(5)
    u = -np.ones(3)
    xi, position = 0.0, 0.0
    rows = [y]
    half_play = 0.5 * P["gear.backlash"]
    for tick in range(round(duration / T_C)):
        t0 = tick * T_C
        w_ref = P["controller.K_pos"] * G * (command(t0) - position)
        w_ref = min(max(w_ref, -P["controller.speed_limit"]), P["controller.speed_limit"])
        e = w_ref - y[1]
        wanted = P["controller.K_p"] * e + xi
        I_ref = min(max(wanted, -P["controller.current_limit"]), P["controller.current_limit"])
        if wanted == I_ref or e * wanted < 0.0:
            xi += P["controller.K_i"] * e * T_C
        t = t0
        while t < t0 + T_C:
            u = np.where(u * _error(y, I_ref) <= -BAND * (1.0 - 1e-9), -u, u)
            done = solve_ivp(
                _slopes, (t, t0 + T_C), y, args=(u, I_ref), events=[_event(leg) for leg in range(3)],
                rtol=1e-8, atol=1e-9, max_step=2e-5,
            )  # fmt: skip
            t, y = float(done.t[-1]), done.y[:, -1]
        position = min(max(position, y[0] / G - half_play), y[0] / G + half_play)
        rows.append(y)
    return np.array(rows)


def _error(y: np.ndarray, I_ref: float) -> Any:
    return -I_ref * np.sin(PAIRS * y[0] - PHASE) - y[2:]


def _slopes(t: float, y: np.ndarray, u: np.ndarray, I_ref: float) -> np.ndarray:
    k = -K_E * np.sin(PAIRS * y[0] - PHASE)
    drive = 0.5 * V_DC * u - R * y[2:] - k * y[1]
    torque = float(k @ y[2:])
    if abs(y[1]) < 1e-6 and abs(torque) <= P["mechanics.T_static"]:
        acceleration = 0.0
    else:
        direction = math.copysign(1.0, y[1]) if abs(y[1]) >= 1e-6 else math.copysign(1.0, torque)
        acceleration = (torque - C * y[1] - direction * P["mechanics.T_coulomb"]) / J
    return np.concatenate([[y[1], acceleration], (drive - drive.mean()) / L])


def _event(leg: int) -> Any:
    def crossing(t: float, y: np.ndarray, u: np.ndarray, I_ref: float) -> float:
        return float(u[leg] * _error(y, I_ref)[leg] + BAND)

    crossing.terminal, crossing.direction = True, -1.0  # type: ignore[attr-defined]
    return crossing


def run() -> float:
    """A step of 0.1 rad; returns the wall time per simulated second."""
    import scipy.integrate  # noqa: F401 - before the clock starts

    began = time.perf_counter()
    fly(lambda t: 0.1, SIMULATED)
    return (time.perf_counter() - began) / SIMULATED

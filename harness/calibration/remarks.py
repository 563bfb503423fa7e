"""What a user of a calibration should know: which run would tell more, bounds, correlations, sheets that are off."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from harness.calibration.result import Parameter
from harness.faults import LOADED

Array = NDArray[np.float64]

ALIKE = 0.95
"""Correlation from which two parameters are told together only."""
FAR = 3.0
"""Standard deviations of its tolerance from which a value is said to be off the sheet."""
AT_BOUND = 1e-3
"""Distance from a bound, in standard deviations of the tolerance, that counts as being there."""

FAST = "a command so fast that the voltage saturates"
WOULD_TELL = {
    "motor.K_e": f"{LOADED}, or {FAST}",
    "motor.R": FAST,
    "motor.L": FAST,
    "motor.p": FAST,
    "mechanics.J": "a faster command, with more acceleration",
    "mechanics.C": "a run at high and at low speed",
    "mechanics.T_coulomb": "a slow run that reverses",
    "mechanics.T_static": "a run that stops and starts again, slowly",
    "mechanics.T_asymmetry": "a slow run in both directions",
    "mechanics.T_quadratic": "a run at high speed",
    "gear.backlash": "a run that reverses, with the position measured on the user's side",
    "gear.eta_opposing": f"{LOADED} against the motion",
    "gear.eta_aiding": f"{LOADED} along the motion",
    "controller.current_limit": "a command that asks for more than the current limit",
    "controller.current.bandwidth": "a log of the current at 1000 rows a second or more",
    "inverter.utilisation": FAST,
}
"""Port -> a run that tells it."""
OTHER = "a run in which it matters more"
SCALE_IS_OPEN = (
    "these runs do not tell a factor that torque constant, inertia and friction have in common, for none has a known "
    f"load or saturates the voltage: motor.K_e keeps its tolerance, which the others share; {LOADED} would tell"
)
UNSATURATED = "no voltage saturation in these logs: a fast command is not predicted"


def would_tell(name: str) -> str:
    """Why a parameter stays as it was, and which run would tell it."""
    return f"not told by these runs; {WOULD_TELL.get(name, OTHER)} would tell"


def correlated(names: Sequence[str], correlation: Array) -> list[str]:
    """A line for each two of `names` whose correlation, shape (n, n), is beyond ALIKE."""
    pairs = [(i, j) for i in range(len(names)) for j in range(i) if abs(correlation[i, j]) > ALIKE]
    return [f"{names[j]} and {names[i]} are told together only: correlation {correlation[i, j]:.2f}" for i, j in pairs]


def off_the_sheet(parameters: Sequence[Parameter]) -> list[str]:
    """A line for each value that is far off what was known before."""
    return [
        f"{item.name}: {item.value:.4g} {item.unit} is {abs(item.value - item.start) / item.before:.1f} standard deviations "
        f"of its tolerance off the {item.start:.4g} of the file: is that right?"
        for item in parameters
        if item.freed and abs(item.value - item.start) > FAR * item.before
    ]


def at_bound(names: Sequence[str], u: Array, low: Array, high: Array) -> list[str]:
    """A line for each parameter that has come to a bound; all scaled, shape (n,)."""
    return [
        f"{name} has come to its {'lowest' if value - least < most - value else 'highest'} value: its sigma means little"
        for name, value, least, most in zip(names, u, low, high, strict=True)
        if min(value - least, most - value) < AT_BOUND
    ]

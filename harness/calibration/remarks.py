"""What a user of a calibration should know: which run would tell more, bounds, correlations, sheets that are off."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from harness.calibration.result import Parameter
from harness.faults import LOADED
from harness.inference.experiments import would_tell

Array = NDArray[np.float64]

ALIKE = 0.95
"""Correlation from which two parameters are told together only."""
FAR = 3.0
"""Standard deviations of its tolerance from which a value is said to be off the sheet."""
CONTRADICT = 3.0
"""Times as much as their noise says, by which logs that were fitted one by one may differ before it is said (ours)."""
ROUGH = 30.0
"""Fall of -2 log likelihood that was promised and not kept, from which slopes are said to mislead (ours)."""
AT_BOUND = 1e-3
"""Distance from a bound, in standard deviations of the tolerance, that counts as being there."""

SCALE_IS_OPEN = (
    "these runs do not tell a factor that torque constant, inertia and friction have in common, for none has a known "
    f"load or saturates the voltage: motor.K_e keeps its tolerance, which the others share; {LOADED} would tell"
)
UNSATURATED = "no voltage saturation in these logs: a fast command is not predicted"


def not_told(name: str) -> str:
    """Why a parameter stays as it was, and which run would tell it."""
    return f"not told by these runs; {would_tell(name)} would tell"


def rough(unkept: float) -> list[str]:
    """A line where the search ended at slopes that mislead: the cost would have fallen by `unkept`, and did not."""
    if unkept < ROUGH:
        return []
    return [
        f"the fit ended where the model's slopes mislead (-2 log likelihood should have fallen by {unkept:.3g} more, and "
        "did not): other values fit these logs as well, and the sigmas are too small; a log in which the voltage does not "
        "saturate, or with another command, fitted beside them, would tell"
    ]


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


def not_physical(parameters: Sequence[Parameter]) -> list[str]:
    """A line where a shaft would need less torque to break away than to go on."""
    values = {item.name: item.value for item in parameters}
    static, coulomb = values.get("mechanics.T_static"), values.get("mechanics.T_coulomb")
    if static is None or coulomb is None or static >= coulomb:
        return []
    return [
        f"mechanics.T_static, {static:.4g} N.m, is below mechanics.T_coulomb, {coulomb:.4g} N.m, which no friction is: "
        f"these runs hardly tell it; {would_tell('mechanics.T_static')} would tell"
    ]


def at_bound(names: Sequence[str], u: Array, low: Array, high: Array) -> list[str]:
    """A line for each parameter that has come to a bound; all scaled, shape (n,)."""
    return [
        f"{name} has come to its {'lowest' if value - least < most - value else 'highest'} value: its sigma means little"
        for name, value, least, most in zip(names, u, low, high, strict=True)
        if min(value - least, most - value) < AT_BOUND
    ]

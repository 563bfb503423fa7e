"""How far a candidate's trajectories are from a reference's."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ema_fmu_src import ports
from harness.errors import HarnessError

FIGURES = (
    ("position", "Position [rad]"),
    ("motor_speed", "Motor speed [rad/s]"),
    ("equivalent_current_filtered", "Equivalent current, filtered [A]"),
)
"""The quantities of the paper's Figures 5 to 7."""
INPUTS = frozenset(port.name for port in ports.INPUTS)


def titles(run: xr.Dataset) -> list[str]:
    """The titles of FIGURES, with the units that `run` has."""
    return [f"{title.partition(' [')[0]} [{run[variable].attrs['units']}]" for variable, title in FIGURES]


TUBE = 0.01
"""Half width of the tolerance tube, as a fraction of the reference's range."""


@dataclass(frozen=True)
class Comparison:
    """One variable of one trial.

    `nrmse`: rms of the difference over the reference's range (None where the reference is constant and the candidate
    differs); `max_abs` [unit]: the largest absolute difference, at the time `t_max_abs` [s]; `outside`: the fraction of
    points outside the tube around the reference.
    """

    trial: str
    candidate: str
    reference: str
    variable: str
    unit: str
    nrmse: float | None
    max_abs: float
    t_max_abs: float
    outside: float


def compare(
    candidate: xr.Dataset, reference: xr.Dataset, *, names: tuple[str, str], tube: float = TUBE, absolute: float = 0.0
) -> list[Comparison]:
    """Compare every output of `candidate` with that of `reference`, at the reference's times that lie within both runs.

    `names` are those of candidate and reference. A candidate on other times is interpolated linearly. The tube's half
    width is `tube` times the reference's range, plus `absolute` in the variable's unit. HarnessError if the runs have no
    time or no output in common, or if either holds a value that is not finite.
    """
    start = max(float(candidate.time[0]), float(reference.time[0]))
    stop = min(float(candidate.time[-1]), float(reference.time[-1]))
    inside = (reference.time.values >= start - 1e-12) & (reference.time.values <= stop + 1e-12)
    times = reference.time.values[inside]
    if not times.size:
        raise HarnessError(f"{names[0]} and {names[1]} have no time in common: nothing to compare")
    comparisons = []
    for name in reference.data_vars:
        if name in INPUTS or name not in candidate:
            continue
        expected = reference[name].values[inside].astype(float)
        found = candidate[name].values.astype(float)
        if not np.array_equal(candidate.time.values, times):
            found = np.interp(times, candidate.time.values, found)
        for run, series in zip(names, (found, expected), strict=True):
            if not np.isfinite(series).all():
                when = times[int(np.argmin(np.isfinite(series)))]
                raise HarnessError(f"{run}: its {name} is no finite number at {when:g} s of {reference.attrs['trial']}")
        with np.errstate(over="ignore"):
            difference = np.abs(found - expected)
        spread = float(np.ptp(expected))
        worst = int(np.argmax(difference))
        with np.errstate(over="ignore"):
            rms = float(np.sqrt(np.mean(difference**2)))
        if not np.isfinite(rms):
            raise HarnessError(
                f"{names[0]}: its {name} is {found[worst]:.3g} at {times[worst]:g} s of {reference.attrs['trial']}: "
                "too far from the reference's for an error to be a number"
            )
        comparisons.append(
            Comparison(
                reference.attrs["trial"],
                *names,
                str(name),
                reference[name].attrs["units"],
                rms / spread if spread > 0.0 else (0.0 if rms == 0.0 else None),
                float(difference[worst]),
                float(times[worst]),
                float(np.mean(difference > tube * spread + absolute)),
            )
        )
    if not comparisons:
        raise HarnessError(f"{names[0]} and {names[1]} have no output in common: nothing to compare")
    return comparisons


def percent(item: Comparison | None) -> str:
    """An NRMSE as text for a table; "reference" where there is no comparison."""
    if item is None:
        return "reference"
    return "-" if item.nrmse is None else f"{100.0 * item.nrmse:.4f} %"


def summary(runs: Iterable[tuple[str, str, xr.Dataset]], comparisons: Iterable[Comparison]) -> dict[str, object]:
    """Runs (trial, fidelity, dataset) and their comparisons, as they are written to JSON."""
    keys = ("trial", "candidate", "reference", "variable", "unit", "nrmse", "max_abs", "t_max_abs")
    return {
        "runs": [
            {"trial": trial, "fidelity": fidelity, "wall_s": run.attrs["wall_s"], "simulated_s": run.attrs["simulated_s"]}
            for trial, fidelity, run in runs
        ],
        "comparisons": [{key: getattr(item, key) for key in keys} for item in comparisons],
    }

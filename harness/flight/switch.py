"""Switching fidelities in mid-run: the digital twin's zoom.

A flight of legs: each leg's twin starts where the last one's stands, by the parameters `initial.*`: rotor angle and speed,
user shaft, phase currents, current reference, filtered current, the controller's integral. Each counts its controller's
ticks from its own start, so a switch at a whole multiple of the period keeps the sampling in step. LF has no integral and
gives the one with which the twin after it commands the same current.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr

from ema_fmu_src.fidelities import Fidelity
from harness.comparison import FIGURES
from harness.errors import HarnessError
from harness.fidelity import parse_fidelities
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.trials import Trial

STATE = {
    "initial.motor_position": "motor_position",
    "initial.motor_speed": "motor_speed",
    "initial.position": "position",
    "initial.phase_current_a": "phase_current_a",
    "initial.phase_current_b": "phase_current_b",
    "initial.reference_current": "reference_current",
    "initial.current_filtered": "equivalent_current_filtered",
}
"""A parameter of the next twin, and the output of the last one that it is set to."""
INTEGRAL = ("initial.integral", "controller.integral")
"""The same for the integral, which is no output."""
WATCHED = tuple(variable for variable, _ in FIGURES)


@dataclass(frozen=True)
class Schedule:
    """Fidelities in order, and the times [s] at which each but the first takes over."""

    fidelities: tuple[Fidelity, ...]
    times: tuple[float, ...]

    @property
    def name(self) -> str:
        """Such as ELF+:HF@1.2."""
        parts = [self.fidelities[0].name]
        parts += [f"{one.name}@{time:g}" for one, time in zip(self.fidelities[1:], self.times, strict=True)]
        return ":".join(parts)


@dataclass(frozen=True)
class Jump:
    """What changed at a switch of `trial`, at time `at` [s], from one fidelity to another: each of WATCHED, in its unit."""

    trial: str
    at: float
    before: str
    after: str
    values: dict[str, float]


def parse_schedule(text: str) -> Schedule:
    """A schedule from text such as ELF+:HF@1.2 or HF:ELF+@0.6:HF@1.4; HarnessError for any other."""
    first, *rest = text.split(":")
    wanted = f"--switch {text}: FIDELITY:FIDELITY@SECONDS is needed, such as ELF+:HF@1.2"
    if not rest or "@" in first:
        raise HarnessError(wanted)
    names, times = [first], []
    for part in rest:
        match = re.fullmatch(r"(.+)@([0-9.eE+-]+)", part)
        if not match:
            raise HarnessError(wanted)
        try:
            times.append(float(match[2]))
        except ValueError:
            raise HarnessError(wanted) from None
        names.append(match[1])
    if times != sorted(set(times)) or times[0] <= 0.0:
        raise HarnessError(f"--switch {text}: the times must increase from above 0 s")
    return Schedule(tuple(parse_fidelities(name)[0] for name in names), tuple(times))


def fly(
    schedule: Schedule,
    trial: Trial,
    *,
    fmus: Path,
    parameters: Mapping[str, float],
    on_progress: Callable[[int], object] | None = None,
) -> tuple[xr.Dataset, list[Jump]]:
    """Fly `trial` with one fidelity after another, FMUs from the folder `fmus`; the joined run, and the jump at each switch.

    `on_progress` is that of `Twin.run`: a run that it stops ends there, with its attribute stopped True. HarnessError if a
    time of the schedule lies outside the trial, or if a twin refuses something.
    """
    places = [round((time - trial.start) / trial.step) for time in schedule.times]
    if places[-1] >= len(trial.time) - 1:
        raise HarnessError(f"--switch {schedule.name}: {trial.name} ends at {trial.time[-1]:g} s, before the last switch")
    bounds = [0, *places, len(trial.time) - 1]
    legs: list[xr.Dataset] = []
    jumps: list[Jump] = []
    state: dict[str, float] = {}
    for fidelity, first, last in zip(schedule.fidelities, bounds[:-1], bounds[1:], strict=True):
        with Twin(fmus / fidelity.fmu) as twin:
            settings = merged(fidelity, parameters) | state
            leg = twin.run(_part(trial, first, last), settings, on_progress=on_progress)
            integral = twin.read(INTEGRAL[1])
        if legs:
            values = {name: float(leg[name][0]) - float(legs[-1][name][-1]) for name in WATCHED}
            jumps.append(Jump(trial.name, float(leg.time[0]), legs[-1].attrs["fidelity"], fidelity.name, values))
        leg.attrs["fidelity"] = fidelity.name
        legs.append(leg)
        if leg.attrs["stopped"]:
            break
        state = {parameter: float(leg[output][-1]) for parameter, output in STATE.items()}
        state[INTEGRAL[0]] = integral
    parts = [*(leg.isel(time=slice(None, -1)) for leg in legs[:-1]), legs[-1]]
    joined = xr.concat(parts, dim="time", combine_attrs="override")
    times = trial.time[: joined.sizes["time"]]
    joined = joined.assign_coords(time=("time", times, {"units": "s"}))
    joined.attrs |= {
        "fidelity": schedule.name,
        "wall_s": sum(float(leg.attrs["wall_s"]) for leg in legs),
        "simulated_s": float(times[-1] - times[0]),
        "stopped": legs[-1].attrs["stopped"],
    }
    return joined, jumps


def _part(trial: Trial, first: int, last: int) -> Trial:
    inputs = {name: values[first : last + 1] for name, values in trial.inputs.items()}
    return replace(trial, start=trial.start + first * trial.step, inputs=inputs)

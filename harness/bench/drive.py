"""The field-oriented drive beside the default one, in the same run: what it costs, and how far ELF+ is from HF with it."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from harness.actuators.read import read_actuator
from harness.bench.speed import Check, errors_of, wall
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.trials import PAPER, trial

ORIENTED = "default-oriented"
"""Actuator of the library: the default one with the other drive."""
FAULT = {"fault.N_a": 0.85}
CASES: dict[str, tuple[str, dict[str, float], float]] = {
    "HF": ("HF", {}, 0.67),
    "ELF+": ("ELF+", {}, 1.25),
    "ELF+, N_a = 0.85": ("ELF+", FAULT, 1.4),
}
"""Case -> fidelity, what is set beside the drive, and how much of the default drive's time is allowed."""
ALLOWED = {"SIN": 5e-5, "SIN4": 1e-3, "STEP-RAMP": 3e-4}
"""NRMSE of ELF+'s position against HF that is asked, both with this drive, healthy."""


@dataclass(frozen=True)
class Beside:
    """One case in one trial: wall time per simulated second [s] with the `default` drive and with the `oriented` one, the
    least of several rounds in which they are flown one after the other, so that other work on the machine parts them least;
    their `ratio`. `error`: NRMSE of position against HF with the same drive and faults; None of HF itself."""

    trial: str
    case: str
    default: float
    oriented: float
    ratio: float
    error: float | None


def count_runs(trials: Sequence[str], repeats: int) -> int:
    """Number of runs that `measure` flies."""
    return len(_flown(trials)) * (2 * len(CASES) * repeats + 2)


def _flown(trials: Sequence[str]) -> list[str]:
    return [name for name in trials if name in PAPER]


def measure(
    fmus: Path, trials: Sequence[str] = PAPER, *, repeats: int = 5, on_run: Callable[[str], None] = lambda _: None
) -> list[Beside]:
    """Fly every case of CASES with either drive in those of `trials` that are the paper's, on one core, in `repeats` rounds.

    `on_run` is called with a description before each run.
    """
    drive, found = read_actuator(ORIENTED).parameters, []
    with ExitStack() as stack:
        twins = {name: stack.enter_context(Twin(fmus / FIDELITIES[name].fmu)) for name in ("HF", "ELF+")}

        def fly(name: str, fidelity: str, values: dict[str, float]) -> xr.Dataset:
            on_run(f"{name} {fidelity}")
            return twins[fidelity].run(trial(name), merged(FIDELITIES[fidelity], values))

        for name in _flown(trials):
            truths = {bool(more): fly(name, "HF", {**drive, **more}) for more in ({}, FAULT)}
            for case, (fidelity, more, _) in CASES.items():
                rounds = [
                    (wall(fly(name, fidelity, more)), wall(run := fly(name, fidelity, {**drive, **more})))
                    for _ in range(repeats)
                ]
                error = None if fidelity == "HF" else errors_of(run, truths[bool(more)])["position"]
                default, oriented = (min(walls) for walls in zip(*rounds, strict=True))
                found.append(Beside(name, case, default, oriented, oriented / default, error))
    return found


def checks(found: Sequence[Beside]) -> Iterator[Check]:
    """The limits that this project sets itself."""
    for item in found:
        yield Check(f"{item.trial}: {item.case} field oriented / default drive, time", item.ratio, CASES[item.case][2])
        if item.case == "ELF+":
            yield Check(f"{item.trial}: ELF+ field oriented, error of position", item.error or 0.0, ALLOWED[item.trial])

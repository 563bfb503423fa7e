"""Flies trials with several fidelities and compares each with the reference."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from harness.compare import Comparison, compare
from harness.fidelity import Fidelity
from harness.trials import Trial
from harness.twin import Twin


@dataclass(frozen=True)
class Experiment:
    """What was flown: runs[trial, fidelity], and every candidate's comparison with the reference."""

    runs: dict[tuple[str, str], xr.Dataset]
    comparisons: list[Comparison]
    reference: str


def fly(
    trials: Sequence[Trial],
    fidelities: Sequence[Fidelity],
    reference: Fidelity,
    *,
    fmus: Path,
    parameters: Mapping[str, float],
    on_run: Callable[[str, str], None] = lambda trial, fidelity: None,
    on_progress: Callable[[int], None] | None = None,
) -> Experiment:
    """Fly each trial with each fidelity (the reference too), one open FMU for each file.

    `on_run(trial, fidelity)` is called before each run, `on_progress(points)` during it. HarnessError if an FMU in the
    folder `fmus` cannot be opened or refuses something.
    """
    flown = list(dict.fromkeys([reference.name, *(fidelity.name for fidelity in fidelities)]))
    by_name = {fidelity.name: fidelity for fidelity in (reference, *fidelities)}
    runs: dict[tuple[str, str], xr.Dataset] = {}
    for name in flown:
        with Twin(fmus / by_name[name].fmu) as twin:
            for trial in trials:
                on_run(trial.name, name)
                run = twin.run(trial, {**parameters, **by_name[name].parameters}, on_progress=on_progress)
                run.attrs["fidelity"] = name
                runs[trial.name, name] = run
    comparisons = [
        item
        for trial in trials
        for name in flown
        if name != reference.name
        for item in compare(runs[trial.name, name], runs[trial.name, reference.name], names=(name, reference.name))
    ]
    return Experiment(runs, comparisons, reference.name)

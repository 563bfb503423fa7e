"""Flies trials with several fidelities and compares each with the reference."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import xarray as xr

from harness.comparison import Comparison, compare
from harness.errors import HarnessError
from harness.fidelity import Fidelity
from harness.flight.isolate import Isolated
from harness.flight.twin import Interrupted, Twin
from harness.trials import Trial


@dataclass(frozen=True)
class Experiment:
    """What was flown: runs[trial, fidelity], every candidate's comparison with the reference, and a line for each run that
    failed in its own process."""

    runs: dict[tuple[str, str], xr.Dataset]
    comparisons: list[Comparison]
    reference: str
    failures: list[str] = field(default_factory=list)

    def errors_of(self, trial: str, fidelity: str) -> dict[str, Comparison]:
        """The comparisons of one run with the reference, by variable; empty for the reference itself."""
        return {item.variable: item for item in self.comparisons if item.trial == trial and item.candidate == fidelity}


def fly(
    trials: Sequence[Trial],
    fidelities: Sequence[Fidelity],
    reference: Fidelity,
    *,
    fmus: Path,
    parameters: Mapping[str, float],
    on_run: Callable[[str, str], None] = lambda trial, fidelity: None,
    on_progress: Callable[[int], None] | None = None,
    isolate: bool = False,
) -> Experiment:
    """Fly each trial with each fidelity (the reference too), one open FMU for each file.

    `on_run(trial, fidelity)` is called before each run, `on_progress(points)` during it. HarnessError if an FMU in the
    folder `fmus` cannot be opened or refuses something; with `isolate`, each FMU flies in a process of its own, and a run
    that fails is a line in `failures`, unless it is the reference's. Interrupted (twin.py) holds what was done until then.
    """
    flown = list(dict.fromkeys([reference.name, *(fidelity.name for fidelity in fidelities)]))
    by_name = {fidelity.name: fidelity for fidelity in (reference, *fidelities)}
    runs: dict[tuple[str, str], xr.Dataset] = {}
    failures: list[str] = []
    for name in flown:
        path = fmus / by_name[name].fmu
        settings = {**parameters, **by_name[name].parameters}
        with Isolated(path) if isolate else Twin(path) as twin:
            for trial in trials:
                on_run(trial.name, name)
                try:
                    run = twin.run(trial, settings, on_progress=on_progress)
                except Interrupted as stop:
                    stop.partial.attrs["fidelity"] = name
                    stop.done = runs
                    raise
                except HarnessError as error:
                    if not isolate or name == reference.name:
                        raise
                    failures.append(str(error))
                    continue
                run.attrs["fidelity"] = name
                runs[trial.name, name] = run
    comparisons = [
        item
        for trial in trials
        for name in flown
        if name != reference.name and (trial.name, name) in runs
        for item in compare(runs[trial.name, name], runs[trial.name, reference.name], names=(name, reference.name))
    ]
    return Experiment(runs, comparisons, reference.name, failures)

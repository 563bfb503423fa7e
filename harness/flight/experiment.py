"""Flies trials with several fidelities, or schedules of them, and compares each run with the reference's."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import xarray as xr

from ema_fmu_src.fidelities import Fidelity
from harness.comparison import Comparison, compare
from harness.errors import HarnessError
from harness.flight import switch
from harness.flight.isolate import Isolated
from harness.flight.switch import Jump, Schedule
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.trials import Trial

OnRun = Callable[[str, str], None]
"""Called with the names of trial and fidelity before each run."""
OnProgress = Callable[[int], object]
"""Called with a number of communication points during a run; if it answers True, everything stops there."""


def _no_word(trial: str, fidelity: str) -> None:
    pass


@dataclass(frozen=True)
class Experiment:
    """What was flown: runs[trial, fidelity], and every candidate's comparison with the run of the fidelity `reference`.

    `failures`: a line for each run that failed in its own process. `jumps`: at the switches of schedules. `stopped`: a stop
    was asked for before all was flown and compared; `partial` is the run that was then under way, as far as it got.
    """

    runs: Mapping[tuple[str, str], xr.Dataset]
    comparisons: Sequence[Comparison]
    reference: str
    failures: Sequence[str] = ()
    jumps: Sequence[Jump] = ()
    stopped: bool = False
    partial: xr.Dataset | None = None

    def errors_of(self, trial: str, fidelity: str) -> dict[str, Comparison]:
        """The comparisons of one run with the reference, by variable; empty for the reference itself."""
        return {item.variable: item for item in self.comparisons if item.trial == trial and item.candidate == fidelity}

    def with_run(self, run: xr.Dataset) -> "Experiment":
        """This experiment with a further run, named by its attributes trial and fidelity.

        It is compared with the reference's run of that trial, if there is one. HarnessError as from `compare`.
        """
        trial, fidelity = run.attrs["trial"], run.attrs["fidelity"]
        found: list[Comparison] = []
        if (trial, self.reference) in self.runs:
            found = compare(run, self.runs[trial, self.reference], names=(fidelity, self.reference))
        return replace(self, runs={**self.runs, (trial, fidelity): run}, comparisons=(*self.comparisons, *found))


@dataclass
class _Watch:
    """Passes progress on, and keeps in mind that a stop was asked for."""

    on_progress: OnProgress | None
    stopped: bool = field(default=False, init=False)

    def __call__(self, points: int) -> bool:
        self.stopped = self.stopped or bool(self.on_progress and self.on_progress(points))
        return self.stopped


def fly(
    trials: Sequence[Trial],
    fidelities: Sequence[Fidelity],
    reference: Fidelity,
    *,
    fmus: Path,
    parameters: Mapping[str, float],
    on_run: OnRun = _no_word,
    on_progress: OnProgress | None = None,
    isolate: bool = False,
) -> Experiment:
    """Fly each trial with each fidelity (the reference too), one open FMU from the folder `fmus` for each fidelity.

    HarnessError if an FMU cannot be opened or refuses something; with `isolate`, each FMU flies in a process of its own, and
    a run that fails is a line in `failures`, unless it is the reference's.
    """
    watch = _Watch(on_progress)
    flown = list({fidelity.name: fidelity for fidelity in (reference, *fidelities)}.values())
    runs: dict[tuple[str, str], xr.Dataset] = {}
    failures: list[str] = []
    partial = None
    for outcome in _fly_each(trials, flown, reference, watch, fmus, parameters, on_run, isolate=isolate):
        if isinstance(outcome, str):
            failures.append(outcome)
        elif outcome.attrs["stopped"]:
            partial = outcome
        else:
            runs[outcome.attrs["trial"], outcome.attrs["fidelity"]] = outcome
    comparisons = [
        item
        for trial in ([] if watch.stopped else trials)
        for fidelity in flown
        if fidelity != reference and (trial.name, fidelity.name) in runs
        for item in compare(
            runs[trial.name, fidelity.name], runs[trial.name, reference.name], names=(fidelity.name, reference.name)
        )
    ]
    return Experiment(runs, comparisons, reference.name, failures, stopped=watch.stopped, partial=partial)


def _fly_each(
    trials: Sequence[Trial],
    fidelities: Sequence[Fidelity],
    reference: Fidelity,
    watch: _Watch,
    fmus: Path,
    parameters: Mapping[str, float],
    on_run: OnRun,
    *,
    isolate: bool,
) -> Iterator[xr.Dataset | str]:
    """The runs, or the line that says why one failed, one after another until a stop is asked for."""
    for fidelity in fidelities:
        path, settings = fmus / fidelity.fmu, merged(fidelity, parameters)
        with Isolated(path) if isolate else Twin(path) as twin:
            for trial in trials:
                on_run(trial.name, fidelity.name)
                try:
                    run = twin.run(trial, settings, on_progress=watch)
                except HarnessError as error:
                    if not isolate or (fidelity == reference and not watch.stopped):
                        raise
                    yield str(error)
                else:
                    run.attrs["fidelity"] = fidelity.name
                    yield run
                if watch.stopped:
                    return


def fly_schedules(
    experiment: Experiment,
    schedules: Sequence[Schedule],
    trials: Sequence[Trial],
    *,
    fmus: Path,
    parameters: Mapping[str, float],
    on_run: OnRun = _no_word,
    on_progress: OnProgress | None = None,
) -> Experiment:
    """`experiment` with the runs of each trial by each schedule; HarnessError as from `switch.fly`."""
    watch = _Watch(on_progress)
    for schedule, trial in itertools.product(schedules, trials):
        if experiment.stopped:
            break
        on_run(trial.name, schedule.name)
        run, jumps = switch.fly(schedule, trial, fmus=fmus, parameters=parameters, on_progress=watch)
        if run.attrs["stopped"]:
            experiment = replace(experiment, partial=run, stopped=True)
        else:
            experiment = replace(experiment.with_run(run), jumps=(*experiment.jumps, *jumps), stopped=watch.stopped)
    return experiment

"""`ema run`."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ema_fmu_src.fidelities import FIDELITIES, REFERENCE, Fidelity
from harness.cli.build import fmu_folder
from harness.cli.options import (
    ActuatorOption,
    Columns,
    Figures,
    FmuDir,
    JsonFile,
    Settings,
    TrialFile,
    beyond,
    chosen_actuator,
    chosen_parameters,
    chosen_trials,
    end_stop,
    save_figures,
    small,
)
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import progress, show

FORMATS = ("csv", "parquet", "nc", "mat", "mf4")

if TYPE_CHECKING:
    from collections.abc import Collection

    from harness.actuators.actuator import Actuator
    from harness.flight.experiment import Experiment
    from harness.flight.switch import Schedule
    from harness.provenance import Provenance
    from harness.trials import Trial


def run(
    trials: Annotated[list[str] | None, typer.Argument(metavar="[TRIAL ...]", help="SIN, SIN4, STEP-RAMP, ...")] = None,
    fidelity: Annotated[str, typer.Option(metavar="LIST", help="Fidelities, by commas.")] = ",".join(FIDELITIES),
    trial_file: TrialFile = None,
    actuator: ActuatorOption = None,
    settings: Settings = None,
    reference: Annotated[str, typer.Option(metavar="FIDELITY", help="What the others are compared with.")] = REFERENCE.name,
    switches: Annotated[
        list[str] | None,
        typer.Option(
            "--switch",
            metavar="SCHEDULE",
            help="Also one fidelity after another, such as ELF+:HF@1.2; may be given several times.",
        ),
    ] = None,
    isolate: Annotated[bool, typer.Option("--isolate", help="Each FMU in a process of its own.")] = False,
    columns: Columns = None,
    form: Annotated[str, typer.Option("--format", metavar="|".join(FORMATS), help="Of the trajectories.")] = "csv",
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trajectories and page.")] = Path("results"),
    json_file: JsonFile = None,
    figures: Figures = None,
    fmus: FmuDir = None,
) -> None:
    """Fly trials with all fidelities, compare them, write trajectories and a page (HTML).

    Exit code 1 if an FMU failed in its own process (--isolate). Stopped by Ctrl-C, it writes what has been flown.
    """
    from harness.comparison import summary
    from harness.fidelity import parse_fidelities, parse_fidelity
    from harness.files import results
    from harness.files.writers import check_format
    from harness.flight.switch import parse_schedule
    from harness.show import figures as papers
    from harness.show import report
    from harness.show.outside import experiment_of

    suffix = check_format(form)
    chosen = chosen_actuator(actuator)
    flown = chosen_trials(trials, trial_file, chosen, columns=columns)
    wanted = parse_fidelities(fidelity)
    compared_with = parse_fidelity(reference, "--reference")
    parameters = chosen_parameters(chosen, settings)
    for line in (*small(flown, chosen), *beyond(flown, chosen, parameters), *end_stop(chosen, parameters)):
        typer.echo(line, err=True)
    schedules = [parse_schedule(text) for text in switches or []]
    results.prepare(out)
    if json_file:
        results.prepare_file(json_file)
    if figures:
        papers.prepare(figures)
    names = {compared_with.name, *(each.name for each in wanted), *(each.name for each in schedules)}
    for path in _trajectories(flown, names, out, suffix):
        results.prepare_file(path)
    switched = [each for schedule in schedules for each in schedule.fidelities]
    every = [*wanted, compared_with, *switched]
    folder = fmu_folder(every, fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=every)

    experiment = _fly(flown, wanted, compared_with, schedules, folder, parameters, isolate=isolate)
    experiment = experiment_of(experiment, chosen, record)
    _write_trajectories(experiment, out, suffix)
    if experiment.stopped:
        raise KeyboardInterrupt
    target = _write_page(experiment, parameters, out / "report.html", chosen, record)
    if json_file:
        entries = [(trial, name, dataset) for (trial, name), dataset in experiment.runs.items()]
        write_json(json_file, {"actuator": chosen.identity, **summary(entries, experiment.comparisons)}, record)
    _print(experiment)
    typer.echo(f"page: {target}   trajectories: {out / f'TRIAL_FIDELITY.{suffix}'}")
    save_figures(figures, lambda: report.figures(experiment), target.stem)
    if experiment.failures:
        sys.exit(1)


def _fly(
    trials: "list[Trial]",
    fidelities: list[Fidelity],
    reference: Fidelity,
    schedules: "list[Schedule]",
    folder: Path,
    parameters: dict[str, float],
    *,
    isolate: bool,
) -> "Experiment":
    """Everything that is asked for, with progress shown, until it is done or interrupted."""
    from harness.flight.experiment import fly, fly_schedules
    from harness.flight.interrupt import deferred

    names = {reference.name, *(fidelity.name for fidelity in fidelities), *(schedule.name for schedule in schedules)}
    points = len(names) * sum(len(trial.time) - 1 for trial in trials)
    with deferred() as interrupted, progress() as shown:
        task = shown.add_task("starting", total=points)

        def on_run(trial: str, name: str) -> None:
            shown.update(task, description=f"{trial} {name}")

        def on_progress(done: int) -> bool:
            shown.advance(task, done)
            return interrupted()

        experiment = fly(
            trials,
            fidelities,
            reference,
            fmus=folder,
            parameters=parameters,
            on_run=on_run,
            on_progress=on_progress,
            isolate=isolate,
        )
        experiment = fly_schedules(
            experiment, schedules, trials, fmus=folder, parameters=parameters, on_run=on_run, on_progress=on_progress
        )
    return replace(experiment, stopped=interrupted())


def _trajectories(trials: "list[Trial]", names: "Collection[str]", out: Path, suffix: str) -> list[Path]:
    """The files that will be written, one for each run."""
    from harness.fidelity import file_stem

    return [out / f"{trial.name}_{file_stem(name)}.{suffix}" for trial in trials for name in names]


def _write_trajectories(experiment: "Experiment", out: Path, suffix: str) -> None:
    """A file for each run; if it was stopped, also for the part of a run, with a word on stderr."""
    from harness.fidelity import file_stem
    from harness.files import results
    from harness.files.writers import encode

    for (trial, name), dataset in experiment.runs.items():
        results.write(out / f"{trial}_{file_stem(name)}.{suffix}", encode(dataset, suffix))
    written = out
    if experiment.partial is not None:
        names = experiment.partial.attrs
        written = out / f"{names['trial']}_{file_stem(names['fidelity'])}.partial.{suffix}"
        results.write(written, encode(experiment.partial, suffix))
    if experiment.stopped:
        typer.echo(f"stopped; what was computed is in {written}", err=True)


def _write_page(
    experiment: "Experiment", parameters: dict[str, float], path: Path, actuator: "Actuator", record: "Provenance"
) -> Path:
    from harness.budgets import read_budgets
    from harness.show import report
    from harness.show.page import write_page

    healthy = experiment.reference == REFERENCE.name and not parameters  # what the budgets are for
    budgets = read_budgets() if healthy else None
    page = report.page(experiment, parameters=parameters, record=record, budgets=budgets, actuator=actuator)
    return write_page(path, page)


def _print(experiment: "Experiment") -> None:
    """Errors and wall times, a line for each switch, a line for each failure."""
    from harness.comparison import FIGURES, percent

    rows: list[tuple[str, ...]] = []
    for trial in dict.fromkeys(trial for trial, _ in experiment.runs):
        for (name, fidelity), dataset in experiment.runs.items():
            if name != trial:
                continue
            errors = experiment.errors_of(trial, fidelity)
            cells = [percent(errors.get(variable)) for variable, _ in FIGURES]
            wall = dataset.attrs["wall_s"] / dataset.attrs["simulated_s"]
            rows.append((trial, fidelity, *cells, f"{wall:.4f}"))
        rows.append(())
    heads = ("Trial", "Fidelity", "position", "motor_speed", "current, filtered", "wall s / simulated s")
    show(f"Errors against {experiment.reference} (NRMSE), and wall time", heads, rows, words=("Fidelity",))
    for jump in experiment.jumps:
        values = ", ".join(f"{name} {value:+.3g}" for name, value in jump.values.items())
        typer.echo(f"{jump.trial}: {jump.before} to {jump.after} at {jump.at:g} s jumps by {values}")
    for line in experiment.failures:
        typer.echo(line)

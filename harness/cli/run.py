"""`ema run`."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import FmuDir, JsonFile, Settings, TrialFile, chosen_trials
from harness.cli.terminal import progress, show
from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.fidelity import Fidelity
    from harness.flight.experiment import Experiment
    from harness.flight.switch import Plan
    from harness.trials import Trial


def run(
    trials: Annotated[list[str] | None, typer.Argument(metavar="[TRIAL ...]", help="SIN, SIN4, STEP-RAMP, ...")] = None,
    fidelity: Annotated[str, typer.Option(metavar="LIST", help="Fidelities, by commas.")] = "HF,ELF,ELF+,LF",
    trial_file: TrialFile = None,
    settings: Settings = None,
    reference: Annotated[str, typer.Option(metavar="FIDELITY", help="What the others are compared with.")] = "HF",
    switches: Annotated[
        list[str] | None,
        typer.Option(
            "--switch",
            metavar="PLAN",
            help="Also one fidelity after another, such as ELF+:HF@1.2; may be given several times.",
        ),
    ] = None,
    isolate: Annotated[bool, typer.Option("--isolate", help="Each FMU in a process of its own.")] = False,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trajectories and page.")] = Path("results"),
    json_file: JsonFile = None,
    fmus: FmuDir = None,
) -> None:
    """Fly trials with all fidelities, compare them, write trajectories (CSV) and a page (HTML).

    Exit code 1 if an FMU failed in its own process (--isolate).
    """
    from harness.budgets import read_budgets
    from harness.fidelity import FIDELITIES, file_stem, parse_fidelities
    from harness.files import results
    from harness.flight.switch import parse_switch
    from harness.flight.twin import Interrupted
    from harness.parameters import parse_settings
    from harness.show import report

    flown = chosen_trials(trials, trial_file)
    wanted = parse_fidelities(fidelity)
    referred = parse_fidelities(reference)
    if len(referred) != 1:
        raise HarnessError(f"--reference {reference}: one fidelity is needed, of {', '.join(FIDELITIES)}")
    parameters = parse_settings(settings or [])
    plans = [parse_switch(text) for text in switches or []]
    results.prepare(out)
    if json_file:
        results.prepare_file(json_file)
    zoomed = [fidelity for plan in plans for fidelity in plan.fidelities]
    folder = fmu_folder([*wanted, *referred, *zoomed], fmus)

    try:
        experiment = _fly(flown, wanted, referred[0], folder, parameters, isolate=isolate)
    except Interrupted as stop:
        for (trial, name), dataset in stop.done.items():
            results.write(out / f"{trial}_{file_stem(name)}.csv", results.trajectory_csv(dataset))
        partial = out / f"{stop.partial.attrs['trial']}_{file_stem(stop.partial.attrs['fidelity'])}.partial.csv"
        results.write(partial, results.trajectory_csv(stop.partial))
        typer.echo(f"stopped; what was computed is in {partial}", err=True)
        raise
    jumps = _switch(experiment, plans, flown, folder, parameters)
    for (trial, name), dataset in experiment.runs.items():
        results.write(out / f"{trial}_{file_stem(name)}.csv", results.trajectory_csv(dataset))
    command = shlex.join(["ema", *sys.argv[1:]])
    budgets = read_budgets() if experiment.reference == "HF" and not parameters else None  # they are healthy HF's
    results.write(out / "report.html", report.page(experiment, parameters=parameters, command=command, budgets=budgets))
    if json_file:
        entries = [(trial, name, dataset) for (trial, name), dataset in experiment.runs.items()]
        results.write(json_file, results.as_json(entries, experiment.comparisons))
    _print_table(experiment)
    for line in [*jumps, *experiment.failures]:
        typer.echo(line)
    typer.echo(f"page: {out / 'report.html'}   trajectories: {out / 'TRIAL_FIDELITY.csv'}")
    if experiment.failures:
        sys.exit(1)


def _fly(
    trials: "list[Trial]",
    fidelities: "list[Fidelity]",
    reference: "Fidelity",
    folder: Path,
    parameters: dict[str, float],
    *,
    isolate: bool,
) -> "Experiment":
    from harness.flight.experiment import fly
    from harness.flight.interrupt import held

    names = {reference.name, *(fidelity.name for fidelity in fidelities)}
    points = len(names) * sum(len(trial.time) - 1 for trial in trials)
    with held() as check, progress() as shown:

        def advance(done: int) -> None:
            check()
            shown.advance(task, done)

        task = shown.add_task("starting", total=points)
        return fly(
            trials,
            fidelities,
            reference,
            fmus=folder,
            parameters=parameters,
            on_run=lambda trial, name: shown.update(task, description=f"{trial} {name}"),
            on_progress=advance,
            isolate=isolate,
        )


def _switch(
    experiment: "Experiment", plans: "list[Plan]", trials: "list[Trial]", folder: Path, parameters: dict[str, float]
) -> list[str]:
    """Fly the plans and add them to the experiment; a line for each switch."""
    from harness.comparison import compare
    from harness.flight.switch import fly

    lines = []
    for plan in plans:
        for trial in trials:
            run, jumps = fly(plan, trial, fmus=folder, parameters=parameters)
            reference = experiment.runs[trial.name, experiment.reference]
            experiment.runs[trial.name, plan.name] = run
            experiment.comparisons.extend(compare(run, reference, names=(plan.name, experiment.reference)))
            for jump in jumps:
                values = ", ".join(f"{name} {value:+.3g}" for name, value in jump.values.items())
                lines.append(f"{trial.name}: {jump.before} to {jump.after} at {jump.at:g} s jumps by {values}")
    return lines


def _print_table(experiment: "Experiment") -> None:
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

"""The command line `ema`. Heavy libraries are imported inside the commands, so that help comes at once."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.compare import Comparison
    from harness.experiment import Experiment
    from harness.fidelity import Fidelity
    from harness.trials import Trial

INTERRUPTED = 130
"""Exit code that Typer gives an interrupt from the keyboard."""

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="A parameter or fault for all runs, such as fault.N_a=0.9; or load_torque or supply_voltage, "
        "held at that value where the trial does not give its own. May be given several times.",
    ),
]
JsonFile = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write runs and errors as JSON.")]
FmuDir = Annotated[Path | None, typer.Option("--fmus", metavar="DIR", help="Folder of the FMUs.")]
TrialFile = Annotated[
    Path | None,
    typer.Option(
        "--trial-file", metavar="FILE.csv", help="A trial of your own: time, command[, load_torque, supply_voltage]."
    ),
]


@app.callback()
def _ema() -> None:
    """Digital twins of an electromechanical flight-control actuator: build, fly and compare them as FMUs."""


@app.command()
def build(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the FMUs.")] = None,
    fidelity: Annotated[str, typer.Option(metavar="LIST", help="Fidelities, by commas.")] = "HF,ELF,LF",
) -> None:
    """Build EMA_HF.fmu, EMA_ELF.fmu (which is ELF+ too) and EMA_LF.fmu."""
    from harness.fidelity import FMU_DIR, parse_fidelities

    names = dict.fromkeys(wanted.fmu for wanted in parse_fidelities(fidelity))
    for path in _build(list(names), out or FMU_DIR):
        typer.echo(f"built {path}")


@app.command()
def run(
    trials: Annotated[list[str] | None, typer.Argument(metavar="[TRIAL ...]", help="SIN, SIN4, STEP-RAMP, ...")] = None,
    fidelity: Annotated[str, typer.Option(metavar="LIST", help="Fidelities, by commas.")] = "HF,ELF,ELF+,LF",
    trial_file: TrialFile = None,
    settings: Settings = None,
    reference: Annotated[str, typer.Option(metavar="FIDELITY", help="What the others are compared with.")] = "HF",
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trajectories and page.")] = Path("results"),
    json_file: JsonFile = None,
    fmus: FmuDir = None,
) -> None:
    """Fly trials with all fidelities, compare them, write trajectories (CSV) and a page (HTML)."""
    from harness import report, results
    from harness.fidelity import FIDELITIES, FMU_DIR, parse_fidelities, parse_settings

    flown = _trials(trials, trial_file)
    wanted = parse_fidelities(fidelity)
    referred = parse_fidelities(reference)
    if len(referred) != 1:
        raise HarnessError(f"--reference {reference}: one fidelity is needed, of {', '.join(FIDELITIES)}")
    parameters = parse_settings(settings or [])
    results.prepare(out)
    if json_file:
        results.prepare_file(json_file)
    folder = fmus or FMU_DIR
    _build_missing([*wanted, *referred], folder, own=fmus is None)

    experiment = _fly(flown, wanted, referred[0], folder, parameters)
    for (trial, name), dataset in experiment.runs.items():
        results.write(out / f"{trial}_{FIDELITIES[name].file_stem}.csv", results.trajectory_csv(dataset))
    command = shlex.join(["ema", *sys.argv[1:]])
    results.write(out / "report.html", report.page(experiment, parameters=parameters, command=command))
    if json_file:
        entries = [(trial, name, dataset) for (trial, name), dataset in experiment.runs.items()]
        results.write(json_file, results.as_json(entries, experiment.comparisons))
    _print_table(experiment)
    typer.echo(f"page: {out / 'report.html'}   trajectories: {out / 'TRIAL_FIDELITY.csv'}")


@app.command()
def compare(
    candidate: Annotated[Path, typer.Argument(metavar="CANDIDATE.fmu")],
    reference: Annotated[Path, typer.Option(metavar="REFERENCE.fmu", help="What the candidate is compared with.")],
    trial: Annotated[list[str] | None, typer.Option(metavar="TRIAL", help="Trials; may be given several times.")] = None,
    trial_file: TrialFile = None,
    settings: Settings = None,
    tube: Annotated[float, typer.Option(help="Half width of the tolerance tube, fraction of the range.")] = 0.01,
    json_file: JsonFile = None,
) -> None:
    """Compare any FMU that has the ports with a reference FMU, variable by variable."""
    from rich.console import Console
    from rich.table import Table

    from harness import results
    from harness.compare import compare as compare_runs
    from harness.fidelity import parse_settings
    from harness.interrupt import held
    from harness.report import percent
    from harness.twin import Twin

    flown = _trials(trial, trial_file)
    parameters = parse_settings(settings or [])
    if not 0.0 <= tube <= 1.0:
        raise HarnessError(f"--tube {tube:g}: a fraction of the range from 0 to 1 is needed")
    if json_file:
        results.prepare_file(json_file)
    with held() as check, Twin(candidate) as twin, Twin(reference) as other:
        watch = {"on_progress": lambda done: check()}
        pairs = [(twin.run(item, parameters, **watch), other.run(item, parameters, **watch)) for item in flown]
    names = (candidate.stem, reference.stem)
    comparisons: list[Comparison] = []
    for found, expected in pairs:
        comparisons += compare_runs(found, expected, names=names, tube=tube)
    if json_file:
        entries = [
            (dataset.attrs["trial"], name, dataset) for pair in pairs for name, dataset in zip(names, pair, strict=True)
        ]
        results.write(json_file, results.as_json(entries, comparisons))
    table = Table(title=f"{names[0]} against {names[1]}")
    for heading in ("Trial", "Variable", "NRMSE", "Largest error", "at", f"Outside {100 * tube:g} %"):
        table.add_column(heading, justify="left" if heading in ("Trial", "Variable") else "right")
    for item in comparisons:
        table.add_row(
            item.trial,
            item.variable,
            percent(item),
            f"{item.max_abs:.4g} {item.unit}",
            f"{item.t_max_abs:.4f} s",
            f"{100 * item.outside:.2f} %",
        )
    Console().print(table)


@app.command()
def ports(
    markdown: Annotated[bool, typer.Option("--markdown", help="As a Markdown table.")] = False,
) -> None:
    """List every variable of the FMUs."""
    from rich.console import Console
    from rich.table import Table

    from harness.tables import PORT_HEADINGS, port_rows, ports_markdown

    if markdown:
        typer.echo(ports_markdown())
        return
    table = Table(*PORT_HEADINGS)
    for row in port_rows():
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else 220).print(table)


def _trials(names: list[str] | None, file: Path | None) -> "list[Trial]":
    from harness.trials import PAPER, read_trial, trial

    chosen = {flown.name: flown for flown in map(trial, names or [])}
    if file:
        own = read_trial(file)
        if own.name.upper() in chosen:
            raise HarnessError(f"--trial-file {file}: {own.name} is flown already, rename the file")
        chosen[own.name] = own
    return list(chosen.values()) or [trial(name) for name in PAPER]


def _build(names: list[str], folder: Path) -> list[Path]:
    try:
        from ema_fmu_src.fmu.build import build as build_fmus
    except ImportError as error:
        raise HarnessError(f"building FMUs needs {error.name}: pip install 'ema-twins[build]'") from None
    try:
        return build_fmus([name.removeprefix("EMA_").removesuffix(".fmu") for name in names], out=folder)
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None
    except RuntimeError as error:
        raise HarnessError(str(error)) from None


def _build_missing(fidelities: "list[Fidelity]", folder: Path, *, own: bool) -> None:
    """Build the FMUs that are not in `folder`; in our `own` folder also those whose sources have changed since."""
    names = list(dict.fromkeys(fidelity.fmu for fidelity in fidelities))
    missing = [name for name in names if not (folder / name).is_file()]
    if own:
        try:
            from ema_fmu_src.fmu.build import is_current

            missing = [name for name in names if not is_current(folder / name)]
        except ImportError:  # installed without [build]: what is there is what came with the package
            pass
    if missing:
        for path in _build(missing, folder):
            typer.echo(f"built {path}")


def _fly(
    trials: "list[Trial]",
    fidelities: "list[Fidelity]",
    reference: "Fidelity",
    folder: Path,
    parameters: dict[str, float],
) -> "Experiment":
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from harness.experiment import fly
    from harness.interrupt import held

    names = {reference.name, *(fidelity.name for fidelity in fidelities)}
    points = len(names) * sum(len(trial.time) - 1 for trial in trials)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with held() as check, Progress(*columns, console=Console(stderr=True), transient=True) as progress:

        def advance(done: int) -> None:
            check()
            progress.advance(task, done)

        task = progress.add_task("starting", total=points)
        return fly(
            trials,
            fidelities,
            reference,
            fmus=folder,
            parameters=parameters,
            on_run=lambda trial, name: progress.update(task, description=f"{trial} {name}"),
            on_progress=advance,
        )


def _print_table(experiment: "Experiment") -> None:
    from rich.console import Console
    from rich.table import Table

    from harness.report import FIGURES, errors_of, percent

    table = Table(title=f"Errors against {experiment.reference} (NRMSE), and wall time")
    for heading in ("Trial", "Fidelity", "position", "motor_speed", "current, filtered", "wall s / simulated s"):
        table.add_column(heading, justify="left" if heading in ("Trial", "Fidelity") else "right")
    for trial in dict.fromkeys(trial for trial, _ in experiment.runs):
        for (name, fidelity), dataset in experiment.runs.items():
            if name != trial:
                continue
            errors = errors_of(experiment, trial, fidelity)
            cells = [percent(errors.get(variable)) for variable, _ in FIGURES]
            wall = dataset.attrs["wall_s"] / dataset.attrs["simulated_s"]
            table.add_row(trial, fidelity, *cells, f"{wall:.4f}")
        table.add_section()
    Console().print(table)


def main() -> None:
    """Entry point: bad input is one line on stderr and exit code 2, an interrupt one line and 130."""
    try:
        app()
    except HarnessError as error:
        typer.echo(f"ema: {error}", err=True)
        sys.exit(2)
    except SystemExit as end:
        if end.code == INTERRUPTED:
            typer.echo("ema: interrupted; every file that was written is whole", err=True)
        raise

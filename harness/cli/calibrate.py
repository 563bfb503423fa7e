"""`ema calibrate`."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import (
    ActuatorOption,
    Columns,
    Figures,
    FmuDir,
    Monitor,
    chosen_actuator,
    chosen_columns,
    save_figures,
)
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import progress, show
from harness.errors import HarnessError
from harness.faults import ESTIMATED

if TYPE_CHECKING:
    from harness.actuators.actuator import Actuator
    from harness.calibration.result import Calibration


def calibrate(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Runs of a healthy actuator, in any format.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.toml", help="The actuator file that is written.")],
    check: Annotated[
        list[Path] | None, typer.Option("--check", metavar="LOG", help="A log to predict, not fitted; several times.")
    ] = None,
    actuator: ActuatorOption = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free", metavar="NAME=TOL", help="A tolerance, such as mechanics.J='5 %'; over the file's; several times."
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="[LOG::]NAME=VALUE",
            help="A parameter for all logs, or, behind a log's name, for that alone: 'fast.csv::controller.pid.K_p=6'.",
        ),
    ] = None,
    columns: Columns = None,
    model: Monitor = "ELF+",
    tolerance: Annotated[
        float, typer.Option(metavar="PART", help="Of a channel's range, that may be left unexplained.")
    ] = 0.01,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the result as JSON.")] = None,
    figures: Figures = None,
    fmus: FmuDir = None,
) -> None:
    """Fit an actuator's parameters to runs that are known to be healthy; writes an actuator file, and a page beside it.

    What has a tolerance in the actuator file is fitted, if the logs tell it. Exit code 1 if a log is not explained.
    """
    from ema_fmu_src.fidelities import FIDELITIES, REFERENCE
    from harness.calibration.bench import Bench
    from harness.calibration.calibrate import calibrate as fit
    from harness.calibration.logs import flown_again, named, parse_own, runs_of
    from harness.calibration.page import figures as figures_of
    from harness.calibration.page import page
    from harness.calibration.table import file_text, with_files
    from harness.fidelity import parse_fidelity
    from harness.files import results
    from harness.identification.asked import check_tolerance
    from harness.show import figures as papers

    chosen, freed = _freed(chosen_actuator(actuator), free)
    fidelity = parse_fidelity(model, "--monitor")
    check_tolerance(tolerance, "--tolerance ", 0.01)
    if out.suffix.lower() != ".toml":
        raise HarnessError(f"--out {out}: an actuator file is written, its name has to end with .toml")
    common, own = parse_own(settings or [], [*logs, *(check or [])])
    _check_healthy(chosen, common, *own.values())
    stated = chosen_columns(columns, chosen)

    def given(path: Path) -> dict[str, float]:
        return {**chosen.parameters, **common, **own.get(path, {})}

    read = [(path, *run) for path in logs for run in runs_of(path, given(path), chosen, stated)]
    checks = [(log, own.get(path, {})) for path in check or [] for log, _ in runs_of(path, given(path), chosen, stated)]
    target = out.with_suffix(".html")
    for path in (out, target, *([json_file] if json_file else [])):
        results.prepare_file(path)
    if figures:
        papers.prepare(figures)
    flown = [fidelity, *([REFERENCE] if fidelity is not REFERENCE else [])]
    folder = fmu_folder([FIDELITIES[each.name] for each in flown], fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=flown)
    bench = Bench(folder, fidelity, common, {n: own[path] for n, (path, _, _) in enumerate(read) if path in own})
    with progress() as shown:
        task = shown.add_task("reading", total=None)

        def on_step(text: str) -> None:
            shown.update(task, description=text)

        found = fit(named([run for _, _, run in read]), chosen, bench, tolerance=tolerance, on_step=on_step)
        found = flown_again(found, bench, [log for _, log, _ in read], checks, on_step)
    name = chosen.name if actuator and Path(actuator).suffix else out.stem  # the library's own names stay the library's
    found = replace(found, actuator=replace(with_files(found.actuator, logs), name=name))
    content = file_text(found.actuator, actuator, common, freed)
    results.write(target, page(found, record))
    if json_file:
        write_json(json_file, {"actuator": found.actuator.identity, **found.as_dict()}, record)
    results.write(out, content)
    _print(found)
    typer.echo(f"actuator: {out}   page: {target}")
    save_figures(figures, lambda: figures_of(found), target.stem)
    if found.complaints:
        sys.exit(1)


def _freed(actuator: "Actuator", texts: list[str] | None) -> "tuple[Actuator, dict[str, float]]":
    """The actuator with the tolerances of `--free` over its own, and these."""
    from harness.actuators.calibrated import covariance_of
    from harness.actuators.values import tolerances_of

    table = {}
    for text in texts or []:
        name, equals, width = (part.strip() for part in text.partition("="))
        if not equals or not width:
            raise HarnessError(f"--free {text}: NAME=TOL is needed, such as mechanics.J='5 %'")
        if name.startswith(("fault.", "initial.")):
            raise HarnessError(
                f"--free {text}: a parameter of the actuator is needed; runs known to be healthy have no faults"
            )
        if name in covariance_of(actuator.calibration).names:
            raise HarnessError(
                f"--free {text}: actuator {actuator.name} has it calibrated; its covariance is where this one starts"
            )
        table[name] = width
    freed = tolerances_of(table, actuator.parameters, actuator.output, "--free")
    return replace(actuator, tolerances={**actuator.tolerances, **freed}), freed


def _check_healthy(actuator: "Actuator", *settings: dict[str, float]) -> None:
    """HarnessError if a fault is set: what is calibrated is healthy."""
    faults = {item.port: item.healthy for item in ESTIMATED.values()}
    for port in (port for given in settings for port in given if port in faults):
        raise HarnessError(f"--set {port}: a calibration takes a healthy actuator; no fault can be set")
    for port, healthy in faults.items():
        if actuator.value(port) != healthy:
            raise HarnessError(
                f"--actuator {actuator.name}: {port} = {actuator.value(port):g}: a calibration takes a healthy actuator"
            )


def _print(found: "Calibration") -> None:
    from harness.calibration.page import (
        FIGURES,
        HEADS,
        NUISANCES,
        RESTS,
        figure_rows,
        nuisance_rows,
        parameter_rows,
        rest_rows,
    )

    caption = f"{found.fidelity}: {found.flights} runs of FMUs in {found.seconds:.1f} s"
    show(caption, HEADS, parameter_rows(found), words=("Unit", ""))
    show("What the bench adds", NUISANCES, nuisance_rows(found), words=("Channel",))
    show("What is left, beside what the bench adds", RESTS, rest_rows(found), words=("Channel",))
    show(
        "The logs flown again with the calibrated values, as by ema replay", FIGURES, figure_rows(found), words=("Channel",)
    )
    for line in (*found.complaints, *found.remarks):
        typer.echo(line)

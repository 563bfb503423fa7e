"""`ema identify`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import (
    ActuatorOption,
    Columns,
    Figures,
    FmuDir,
    Limits,
    Monitor,
    Settings,
    Threshold,
    WithFiles,
    chosen_actuator,
    chosen_columns,
    chosen_limits,
    chosen_monitor,
    save_figures,
)
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import show, working
from harness.faults import ESTIMATED, THRESHOLD

if TYPE_CHECKING:
    from harness.identification.diagnosis import Diagnosis


def identify(
    measured: Annotated[Path, typer.Argument(metavar="MEASURED", help="A measured run, in any format.")],
    columns: Columns = None,
    with_files: WithFiles = None,
    model: Monitor = "ELF+",
    actuator: ActuatorOption = None,
    settings: Settings = None,
    limits: Limits = None,
    threshold: Threshold = THRESHOLD,
    tolerance: Annotated[
        float, typer.Option(metavar="PART", help="Of a channel's range, that may be left unexplained.")
    ] = 0.003,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the page.")] = Path("results"),
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the diagnosis as JSON.")] = None,
    figures: Figures = None,
    fmus: FmuDir = None,
) -> None:
    """Identify the faults of a measured run: estimates with intervals, health, a verdict, a page.

    Columns: time, command, position, motor_speed, and equivalent_current_filtered or phase_current_a, _b, _c; optionally
    load_torque and supply_voltage; by these names in SI units, or as --column says. Exit code 1 if the run cannot be
    explained.
    """
    from harness.files import results
    from harness.files.reader import stem
    from harness.identification import asked, diagnosis
    from harness.identification.page import figures as figures_of
    from harness.identification.page import page
    from harness.inference.measured import read_measured
    from harness.show import figures as papers
    from harness.show.page import write_page

    estimated = {parameter.port for parameter in ESTIMATED.values()}
    chosen = chosen_actuator(actuator)
    fidelity, parameters = chosen_monitor(model, settings, estimated=estimated, actuator=chosen)
    health_limits = chosen_limits(chosen, limits)
    asked.check_threshold(threshold, "--threshold ")
    asked.check_tolerance(tolerance, "--tolerance ", 0.003)
    stated = chosen_columns(columns, chosen)
    run = read_measured(measured, parameters, chosen.output, stated, with_files=with_files or ())
    results.prepare(out)
    if json_file:
        results.prepare_file(json_file)
    if figures:
        papers.prepare(figures)
    models = diagnosis.models_for(fidelity)
    folder = fmu_folder(models, fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=models)
    with working() as on_step:
        found = diagnosis.identify(
            run,
            fmus=folder,
            fidelity=fidelity,
            parameters=parameters,
            actuator=chosen,
            limits=health_limits,
            threshold=threshold,
            tolerance=tolerance,
            on_step=on_step,
        )
    target = write_page(out / f"{stem(measured)}_identified.html", page(found, record, chosen, health_limits))
    if json_file:
        write_json(json_file, {"actuator": chosen.identity, **found.as_dict()}, record)
    _print(found)
    typer.echo(f"page: {target}   actuator: {chosen.name}")
    save_figures(figures, lambda: figures_of(found, health_limits), target.stem)
    if found.complaints:
        sys.exit(1)


def _print(found: "Diagnosis") -> None:
    from harness.identification.page import HEADS, rows

    if not found.complaints:
        caption = f"{found.name}, {found.fidelity}: {found.evaluations} runs of FMUs in {found.seconds:.1f} s"
        show(caption, HEADS, rows(found), words=("",))
    for line in (found.verdict, *found.remarks):
        typer.echo(line)

"""`ema monitor`."""

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
    chosen_actuator,
    chosen_columns,
    chosen_limits,
    chosen_monitor,
    save_figures,
)
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import progress, show
from harness.errors import required_extra
from harness.faults import ESTIMATED, THRESHOLD

if TYPE_CHECKING:
    from harness.prognosis.outlook import Outlook


def monitor(
    runs: Annotated[Path, typer.Argument(metavar="RUNS", help="A folder of measured runs, or a list: date,file.")],
    columns: Columns = None,
    model: Monitor = "ELF+",
    actuator: ActuatorOption = None,
    settings: Settings = None,
    limits: Limits = None,
    threshold: Threshold = THRESHOLD,
    workers: Annotated[int, typer.Option(metavar="N", help="Processes; 0: one a core.")] = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the page.")] = Path("results"),
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the outlook as JSON.")] = None,
    figures: Figures = None,
    fmus: FmuDir = None,
) -> None:
    """Follow faults over measured runs, one a flight: trends, and the remaining useful life until their limits.

    Files are as for ema identify. Exit code 1 if a run had to be left out.
    """
    from harness.files import results
    from harness.identification.diagnosis import models_for
    from harness.prognosis.history import identify_all, read_flights
    from harness.show import figures as papers
    from harness.show.page import write_page

    with required_extra("prognosis"):
        from harness.prognosis.outlook import outlook
        from harness.prognosis.page import figures as figures_of
        from harness.prognosis.page import page

    estimated = {parameter.port for parameter in ESTIMATED.values()}
    chosen = chosen_actuator(actuator)
    fidelity, parameters = chosen_monitor(model, settings, estimated=estimated, actuator=chosen)
    health_limits = chosen_limits(chosen, limits)
    flights, unit = read_flights(runs)
    with results.kept(flight.path for flight in flights):
        results.prepare(out)
        if json_file:
            results.prepare_file(json_file)
    if figures:
        papers.prepare(figures)
    folder = fmu_folder(models_for(fidelity), fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=models_for(fidelity), also=[flight.path for flight in flights])
    with progress() as shown:
        task = shown.add_task("identifying", total=len(flights))
        history = identify_all(
            flights,
            fmus=folder,
            fidelity=fidelity,
            parameters=parameters,
            limits=health_limits,
            threshold=threshold,
            workers=workers,
            actuator=chosen,
            columns=chosen_columns(columns, chosen),
            on_flight=lambda: shown.advance(task),
        )
    found = outlook(history, health_limits, unit)
    target = write_page(out / "monitor.html", page(found, history, record, chosen))
    if json_file:
        write_json(json_file, {"actuator": chosen.identity, **found.as_dict()}, record)
    _print(found)
    typer.echo(f"page: {target}")
    save_figures(figures, lambda: figures_of(found), target.stem)
    if found.problems:
        sys.exit(1)


def _print(found: "Outlook") -> None:
    from harness.prognosis.page import HEADS, rows

    show(f"{found.runs} runs; times in {found.unit}", HEADS, rows(found), words=(HEADS[-1],))
    for line in found.problems:
        typer.echo(f"left out: {line}")
    for line in found.not_followed:
        typer.echo(f"not followed: {line}")
    typer.echo(found.verdict)

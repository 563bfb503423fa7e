"""`ema replay`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import (
    ActuatorOption,
    Columns,
    Figures,
    FmuDir,
    Settings,
    WithFiles,
    chosen_actuator,
    chosen_columns,
    chosen_parameters,
    end_stop,
    save_figures,
)
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import show

if TYPE_CHECKING:
    from harness.replays.replay import Replay


def replay(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A measured run, or several, in any format.")],
    actuator: ActuatorOption = None,
    columns: Columns = None,
    with_files: WithFiles = None,
    fidelity: Annotated[str, typer.Option(metavar="FIDELITY", help="The twin that flies it.")] = "ELF+",
    settings: Settings = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the page.")] = Path("results"),
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON.")] = None,
    figures: Figures = None,
    fmus: FmuDir = None,
) -> None:
    """Fly a twin along the command of a log, and say how far it is from what was measured, channel by channel."""
    from harness.fidelity import parse_fidelity
    from harness.files import results
    from harness.files.reader import stem
    from harness.flight.interrupt import deferred
    from harness.flight.twin import Twin
    from harness.logs.read import read_log
    from harness.replays.page import figures as figures_of
    from harness.replays.page import page
    from harness.replays.replay import replay as fly
    from harness.show import figures as papers
    from harness.show.page import write_page

    chosen = chosen_actuator(actuator)
    flown = parse_fidelity(fidelity, "--fidelity")
    parameters = chosen_parameters(chosen, settings)
    for line in end_stop(chosen, parameters):
        typer.echo(line, err=True)
    logs = read_log(log, chosen_columns(columns, chosen), chosen.output, parameters, with_files=with_files or ())
    results.prepare(out)
    if json_file:
        results.prepare_file(json_file)
    if figures:
        papers.prepare(figures)
    folder = fmu_folder([flown], fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=[flown])
    with deferred() as interrupted, Twin(folder / flown.fmu) as twin:
        found = [fly(each, twin, flown, parameters, on_progress=lambda done: interrupted()) for each in logs]
    target = write_page(out / f"{stem(log)}_replayed.html", page(found, record, chosen))
    if json_file:
        write_json(json_file, _as_dict(found, log, chosen.identity), record)
    for item in found:
        _print(item)
    typer.echo(f"page: {target}   actuator: {chosen.name}")
    save_figures(figures, lambda: figures_of(found), target.stem)


def _as_dict(found: "list[Replay]", log: Path, actuator: dict[str, str]) -> dict[str, object]:
    """For JSON: the one run at the top, or all under `runs`."""
    origin: dict[str, object] = {"log": str(log), "actuator": actuator}
    if len(found) == 1:
        return origin | found[0].as_dict()
    return origin | {"fidelity": found[0].fidelity, "runs": [item.as_dict() for item in found]}


def _print(item: "Replay") -> None:
    from harness.replays.page import HEADS, TRACKING, rows, tracking_rows

    caption = f"{item.log.name}, {item.fidelity}: {len(item.log.time)} rows, command {item.between.value} between them"
    show(caption, HEADS, rows(item), words=("Unit",))
    if tracked := tracking_rows(item):
        show("Position minus command", TRACKING, tracked, words=("Unit",))
    for line in item.remarks:
        typer.echo(line)

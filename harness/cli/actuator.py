"""`ema actuator new`, `ema actuator show`, `ema actuator list`."""

from pathlib import Path
from typing import Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.guarded import Guarded
from harness.cli.options import FmuDir, chosen_actuator
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import show as show_table
from harness.errors import HarnessError

FOLDED = 120
"""Characters a line of the tables, whose last columns hold sentences."""
actuator = typer.Typer(help="Actuator files: begin one, look at one, list those that come with the package.")


@actuator.command()
def new(file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="Must not be there yet.")]) -> None:
    """Write a commented actuator file to begin with."""
    from harness.actuators.template import template
    from harness.files import results

    if file.suffix.lower() != ".toml":
        raise HarnessError(f"{file}: the name of a .toml file is needed")
    if file.exists():
        raise HarnessError(f"{file}: is there already; ema actuator new replaces nothing")
    results.prepare_file(file)
    results.write(file, template(file.stem))
    typer.echo(f"wrote {file}; ema actuator show {file} prints what comes of it")


@actuator.command(cls=Guarded)
def show(
    name: Annotated[str, typer.Argument(metavar="NAME_OR_FILE", help="As for --actuator.")],
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write all of it as JSON.")] = None,
    fmus: FmuDir = None,
) -> None:
    """Print an actuator resolved: values with their origins, what follows from them, and which fidelities fly it.

    Contradictions in what is stated are warnings on stderr.
    """
    from ema_fmu_src.fidelities import FIDELITIES
    from harness.actuators import drive
    from harness.files import results
    from harness.flight.tryout import refusals
    from harness.show import actuator as shown

    chosen = chosen_actuator(name)
    if json_file:
        results.prepare_file(json_file)
    folder = fmu_folder(FIDELITIES.values(), fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=FIDELITIES.values())
    told = refusals(folder, chosen.parameters)
    typer.echo(f"{chosen.name}: {chosen.description}" if chosen.description else chosen.name)
    show_table("Parameters", shown.PARAMETER_HEADS, shown.parameter_rows(chosen), words=("Unit", "Origin"), wide=FOLDED)
    typer.echo("Faults and the state at the start that are not listed are healthy and at rest, as ema ports lists them.")
    show_table(
        "What follows, healthy", shown.DERIVED_HEADS, shown.derived_rows(chosen), words=("Unit", "Formula"), wide=FOLDED
    )
    for line in drive.lines(chosen):
        typer.echo(line)
    show_table("Fidelities", shown.FLIGHT_HEADS, shown.flight_rows(told), words=("Flies",), wide=FOLDED)
    for title, table in (("log", chosen.log), ("limits", chosen.limits)):
        if table:
            typer.echo(f"{title}: {', '.join(f'{key} = {value}' for key, value in table.items())}")
    for line in shown.unstated_lines(chosen):
        typer.echo(line)
    typer.echo(f"SHA-256 of the resolved parameters: {chosen.sha256}")
    for line in chosen.warnings:
        typer.echo(f"warning: {line}", err=True)
    if json_file:
        write_json(json_file, shown.as_dict(chosen, told), record)


@actuator.command("list")
def list_() -> None:
    """List the actuators that come with the package."""
    from harness.actuators.read import library, read_actuator

    rows = []
    for name in library():
        item = read_actuator(name)
        lead = item.output.lead
        rows.append((name, "rotary" if lead is None else "linear", item.description))
    show_table("Actuators of the library", ("Name", "Output", "Description"), rows, words=("Output", "Description"))

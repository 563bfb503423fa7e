"""The command line `ema`, one command a file; heavy libraries are imported inside the commands: help comes at once."""

import logging
import sys
from typing import Annotated

import typer

from ema_fmu_src import __version__
from harness.cli.actuator import actuator
from harness.cli.bench import bench
from harness.cli.build import build
from harness.cli.calibrate import calibrate
from harness.cli.campaign import campaign
from harness.cli.check import check
from harness.cli.columns import columns
from harness.cli.compare import compare
from harness.cli.ending import clear
from harness.cli.export import export
from harness.cli.guarded import Guarded
from harness.cli.identify import identify
from harness.cli.monitor import monitor
from harness.cli.ports import ports
from harness.cli.reference import reference
from harness.cli.replay import replay
from harness.cli.run import run
from harness.cli.serve import serve
from harness.flight.interrupt import insisted

app = typer.Typer(no_args_is_help=True, rich_markup_mode="markdown", pretty_exceptions_enable=False)
for command in (
    build,
    run,
    replay,
    columns,
    calibrate,
    campaign,
    identify,
    monitor,
    check,
    serve,
    compare,
    export,
    reference,
    ports,
):
    app.command(cls=Guarded)(command)
app.add_typer(actuator, name="actuator", no_args_is_help=True)
app.add_typer(bench, name="bench")


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"EMA twins {__version__}")
        raise typer.Exit


def _tell_more(wanted: bool) -> None:
    if wanted:
        logging.basicConfig(stream=sys.stderr, format="%(name)s: %(message)s")
        logging.getLogger("harness").setLevel(logging.INFO)


@app.callback()
def _ema(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option("--verbose", "-v", callback=_tell_more, help="Tell what is written, and where it failed."),
    ] = False,
) -> None:
    """Digital twins of an electromechanical flight-control actuator: build, fly, compare and diagnose them as FMUs."""


def main() -> None:
    """Entry point: bad input is one line on stderr and exit code 2, an interrupt one line and 130."""
    with clear(), insisted():
        app()

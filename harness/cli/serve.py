"""`ema serve`."""

from typing import Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import ActuatorOption, FmuDir, chosen_actuator
from harness.errors import required_extra


def serve(
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="This machine alone, unless told otherwise.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(metavar="N", help="0 takes a free one.")] = 8050,
    allowed: Annotated[
        list[str] | None,
        typer.Option("--allow-host", metavar="NAME", help="A further name by which browsers call it; several times."),
    ] = None,
    actuator: ActuatorOption = None,
    fmus: FmuDir = None,
) -> None:
    """Fly the twins on a live page: trials, own ones too, fidelities, actuators, loads, faults by sliders."""
    import logging

    from ema_fmu_src.fidelities import FIDELITIES

    with required_extra("serve"):
        from harness.show.live.guard import is_loopback
        from harness.show.live.server import Server
    chosen = chosen_actuator(actuator)
    folder = fmu_folder(FIDELITIES.values(), fmus, chosen)
    logging.getLogger("werkzeug").setLevel(logging.WARNING)
    server = Server(folder, host=host, port=port, actuator=chosen, named=actuator, hosts=allowed or [])
    if not is_loopback(host):
        typer.echo(f"--host {host}: whoever reaches this address can fly; there is no password", err=True)
    typer.echo(f"{server.url}   Ctrl-C ends it")
    server.run()

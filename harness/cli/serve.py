"""`ema serve`."""

from typing import Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import FmuDir
from harness.errors import required_extra


def serve(
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="This machine alone, unless told otherwise.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(metavar="N", help="0 takes a free one.")] = 8050,
    fmus: FmuDir = None,
) -> None:
    """Fly the twins on a live page: trial, fidelities and faults by sliders."""
    import logging

    from ema_fmu_src.fidelities import FIDELITIES

    with required_extra("serve"):
        from harness.show.live import Server
    folder = fmu_folder(FIDELITIES.values(), fmus)
    logging.getLogger("werkzeug").setLevel(logging.WARNING)
    server = Server(folder, host=host, port=port)
    typer.echo(f"{server.url}   Ctrl-C ends it")
    server.run()

"""`ema reference`."""

from pathlib import Path
from typing import Annotated

import typer

from harness.cli.options import FmuDir


def reference(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the files; fmus/reference by default.")] = None,
    fmus: FmuDir = None,
) -> None:
    """Write the reference results that go into the FMUs (after a change of the physics; then build again)."""
    from ema_fmu_src.fidelities import FIDELITIES
    from ema_fmu_src.fmu.crosscheck import FOLDER
    from harness.cli.build import fmu_folder
    from harness.crosscheck import make

    for path in make(fmu_folder(FIDELITIES.values(), fmus), out or FOLDER):
        typer.echo(f"wrote {path}")

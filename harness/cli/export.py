"""`ema export`."""

from pathlib import Path
from typing import Annotated

import typer

from harness.errors import HarnessError


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where the copies go; made if it is not there.")],
    force: Annotated[bool, typer.Option("--force", help="Replace files of these names that differ.")] = False,
) -> None:
    """Copy the FMUs and the SSP package, ready for another tool, into a folder."""
    from ema_fmu_src.fidelities import FIDELITIES
    from harness.cli.build import fmu_folder
    from harness.files import results

    own = fmu_folder(FIDELITIES.values())
    sources = sorted([*own.glob("EMA_*.fmu"), *own.glob("*.ssp")])
    results.prepare(folder)
    contents = {folder / source.name: source.read_bytes() for source in sources}
    differing = [path for path, content in contents.items() if path.exists() and path.read_bytes() != content]
    if differing and not force:
        raise HarnessError(f"{differing[0]}: is there and differs; --force replaces it")
    for path, content in contents.items():
        results.write(path, content)
        typer.echo(f"exported {path}")

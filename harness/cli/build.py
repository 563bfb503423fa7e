"""`ema build`, and the building of what another command misses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.fidelity import Fidelity


def build(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the FMUs.")] = None,
    fidelity: Annotated[str, typer.Option(metavar="LIST", help="Fidelities, by commas.")] = "HF,ELF,LF",
) -> None:
    """Build EMA_HF.fmu, EMA_ELF.fmu (which is ELF+ too) and EMA_LF.fmu."""
    from harness.fidelity import FMU_DIR, parse_fidelities

    names = dict.fromkeys(wanted.fmu for wanted in parse_fidelities(fidelity))
    for path in build_into(list(names), out or FMU_DIR):
        typer.echo(f"built {path}")


def build_into(names: list[str], folder: Path) -> list[Path]:
    """Build the FMUs with these file names; HarnessError if that cannot be."""
    try:
        from ema_fmu_src.fmu.build import build as build_fmus
    except ImportError as error:
        raise HarnessError(f"building FMUs needs {error.name}: pip install 'ema-twins[build]'") from None
    try:
        return build_fmus([name.removeprefix("EMA_").removesuffix(".fmu") for name in names], out=folder)
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None
    except RuntimeError as error:
        raise HarnessError(str(error)) from None


def build_missing(fidelities: "list[Fidelity]", folder: Path, *, own: bool) -> None:
    """Build the FMUs that are not in `folder`; in our `own` folder also those whose sources have changed since."""
    names = list(dict.fromkeys(fidelity.fmu for fidelity in fidelities))
    missing = [name for name in names if not (folder / name).is_file()]
    if own:
        try:
            from ema_fmu_src.fmu.build import is_current

            missing = [name for name in names if not is_current(folder / name)]
        except ImportError:  # installed without [build]: what is there is what came with the package
            pass
    if missing:
        for path in build_into(missing, folder):
            typer.echo(f"built {path}")

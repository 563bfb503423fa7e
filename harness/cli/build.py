"""`ema build`, and the building of what another command misses."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.errors import HarnessError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from harness.fidelity import Fidelity


def build(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the FMUs.")] = None,
    fidelity: Annotated[str, typer.Option(metavar="LIST", help="Fidelities, by commas.")] = "HF,ELF,LF",
    runtime: Annotated[
        str, typer.Option(metavar="NAME", help="native: no Python behind it; python: pythonfmu's, to hack the physics.")
    ] = "native",
    platform: Annotated[
        str | None,
        typer.Option(
            metavar="LIST",
            help="host (default), all, or some of linux64, linux-arm64, win64, darwin64, by commas; native only.",
        ),
    ] = None,
) -> None:
    """Build EMA_HF.fmu, EMA_ELF.fmu (which is ELF+ too) and EMA_LF.fmu."""
    from harness.fidelity import FMU_DIR, parse_fidelities

    names = dict.fromkeys(wanted.fmu for wanted in parse_fidelities(fidelity))
    for path in build_into(list(names), out or FMU_DIR, runtime=runtime, platform=platform):
        typer.echo(f"built {path}")


def build_into(names: list[str], folder: Path, *, runtime: str = "native", platform: str | None = None) -> list[Path]:
    """Build the FMUs with these file names; HarnessError if that cannot be."""
    try:
        from ema_fmu_src.fmu import build
        from ema_fmu_src.fmu.native import targets
    except ImportError as error:
        raise HarnessError(f"building FMUs needs {error.name}: pip install 'ema-twins[build]'") from None
    models = [name.removeprefix("EMA_").removesuffix(".fmu") for name in names]
    try:
        platforms = targets.parse(platform) if platform else None
        return build.build(models, out=folder, runtime=runtime, platforms=platforms)
    except ImportError as error:
        raise HarnessError(f"building FMUs needs {error.name}: pip install 'ema-twins[build]'") from None
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None
    except (RuntimeError, ValueError) as error:
        raise HarnessError(str(error)) from None


def fmu_folder(fidelities: "Iterable[Fidelity]", given: Path | None = None) -> Path:
    """The folder of the FMUs, `given` or our own, with what these fidelities need: FMUs that are missing are built, in our
    own folder also those whose sources have changed since."""
    from harness.fidelity import FMU_DIR

    folder = given or FMU_DIR
    names = list(dict.fromkeys(fidelity.fmu for fidelity in fidelities))
    missing = [name for name in names if not (folder / name).is_file()]
    if given is None and find_spec("ziglang"):  # without the extra [build], what is there is what came with the package
        from ema_fmu_src.fmu.build import is_current

        missing = [name for name in names if not is_current(folder / name)]
    if missing:
        for path in build_into(missing, folder):
            typer.echo(f"built {path}")
    return folder

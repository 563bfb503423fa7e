"""`ema build`, and the building of what another command misses."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ema_fmu_src.fidelities import MODELS, Fidelity, fmu_name
from harness.errors import HarnessError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def build(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the FMUs.")] = None,
    fidelity: Annotated[str, typer.Option(metavar="LIST", help="Fidelities, by commas.")] = ",".join(MODELS),
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
    """Build the FMUs of these fidelities; those that differ only in parameters share one."""
    from harness.fidelity import FMU_DIR, parse_fidelities

    models = dict.fromkeys(wanted.model for wanted in parse_fidelities(fidelity))
    for path in build_into(list(models), out or FMU_DIR, runtime=runtime, platform=platform):
        typer.echo(f"built {path}")


def build_into(models: "Sequence[str]", folder: Path, *, runtime: str = "native", platform: str | None = None) -> list[Path]:
    """Build the FMUs of `models` into `folder`; HarnessError if that fails."""
    try:
        from ema_fmu_src.fmu import build
        from ema_fmu_src.fmu.native import targets

        platforms = targets.parse(platform) if platform else None
        return build.build(models, out=folder, runtime=runtime, platforms=platforms)
    except ImportError as error:
        raise HarnessError(f"building FMUs needs {error.name}: pip install 'ema-twins[build]'") from None
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None
    except (RuntimeError, ValueError) as error:
        raise HarnessError(str(error)) from None


def fmu_folder(fidelities: "Iterable[Fidelity]", given: Path | None = None) -> Path:
    """The folder `given`, or our own, with the FMUs that these fidelities need: those that are missing are built.

    In our own folder, those whose sources have changed since they were built are built again.
    """
    from harness.fidelity import FMU_DIR

    folder = given or FMU_DIR
    models = list(dict.fromkeys(fidelity.model for fidelity in fidelities))
    missing = [model for model in models if not (folder / fmu_name(model)).is_file()]
    if given is None and find_spec("ziglang"):  # without the extra [build], what is there is what came with the package
        from ema_fmu_src.fmu.build import is_current

        missing = [model for model in models if not is_current(folder / fmu_name(model))]
    if missing:
        for path in build_into(missing, folder):
            typer.echo(f"built {path}")
    return folder

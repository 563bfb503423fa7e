"""`ema build`, and the building of what another command misses."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ema_fmu_src.fidelities import MODELS, Fidelity, fmu_name
from harness.cli.options import ActuatorOption, chosen_actuator
from harness.errors import HarnessError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from harness.actuators.actuator import Actuator


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
    actuator: ActuatorOption = None,
) -> None:
    """Build the FMUs of these fidelities; those that differ only in parameters share one.

    With --actuator they start as that actuator, and their name and description say so.
    """
    from harness.fidelity import FMU_DIR, parse_fidelities

    chosen = chosen_actuator(actuator)
    if actuator is not None and out is None:
        raise HarnessError(f"--actuator {actuator}: --out DIR is needed; {FMU_DIR} is for the FMUs of the default actuator")
    models = dict.fromkeys(wanted.model for wanted in parse_fidelities(fidelity))
    for path in build_into(list(models), out or FMU_DIR, runtime=runtime, platform=platform, actuator=chosen):
        typer.echo(f"built {path}")


def build_into(
    models: "Sequence[str]",
    folder: Path,
    *,
    runtime: str = "native",
    platform: str | None = None,
    actuator: "Actuator | None" = None,
) -> list[Path]:
    """Build the FMUs of `models`, which start as `actuator`, into `folder`; HarnessError if that fails."""
    from harness.actuators.actuator import DEFAULT
    from harness.actuators.fmus import variant
    from harness.files import results

    results.prepare(folder)
    try:
        from ema_fmu_src.fmu import build
        from ema_fmu_src.fmu.native import targets

        platforms = targets.parse(platform) if platform else None
        return build.build(models, out=folder, runtime=runtime, platforms=platforms, variant=variant(actuator or DEFAULT))
    except ImportError as error:
        raise HarnessError(f"building FMUs needs {error.name}: pip install -e '.[build]' in the checkout") from None
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None
    except (RuntimeError, ValueError) as error:  # a compiler's or a program's own report may be long
        raise HarnessError(_reason(str(error))) from error


def _reason(report: str) -> str:
    """The line of a report that says why: a compiler's first error, or the last one, as under a traceback."""
    lines = [line.strip() for line in report.splitlines() if line.strip()]
    why = next((line for line in lines if "error:" in line), lines[-1])
    return lines[0] if why == lines[0] else f"{lines[0]} {why}"


def fmu_folder(fidelities: "Iterable[Fidelity]", given: Path | None = None, actuator: "Actuator | None" = None) -> Path:
    """The folder `given`, or our own, with the FMUs that these fidelities need: those that are missing are built.

    In our own folder, those whose sources have changed since they were built are built again. HarnessError as from
    `refuse_another`, for `actuator`.
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
    refuse_another([folder / fmu_name(model) for model in models], actuator)
    return folder


def refuse_another(paths: "Iterable[Path]", actuator: "Actuator | None") -> None:
    """HarnessError if one of the FMUs at `paths` was built for an actuator that is not `actuator` (None: the default one).

    What that actuator leaves to the ports' defaults would be the other's, and its gear ratio unknown to who reads a log.
    """
    from harness.actuators.actuator import DEFAULT
    from harness.actuators.fmus import belongs_to_another, record_of

    for path in paths:
        record = record_of(path)
        if belongs_to_another(record, actuator or DEFAULT):
            raise HarnessError(
                f"{path}: was built for another actuator, {record['actuator']}; give --actuator with its file "
                f"(or with healthy.ssv out of the ema.ssp beside it), or build it again with ema build"
            )

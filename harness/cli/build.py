"""`ema build`, and the building of what another command misses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ema_fmu_src.fidelities import MODELS, Fidelity
from harness.cli.options import ActuatorOption, chosen_actuator
from harness.errors import HarnessError

if TYPE_CHECKING:
    from collections.abc import Iterable

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
    from harness.ready import build_into

    chosen = chosen_actuator(actuator)
    if actuator is not None and out is None:
        raise HarnessError(f"--actuator {actuator}: --out DIR is needed; {FMU_DIR} is for the FMUs of the default actuator")
    models = dict.fromkeys(wanted.model for wanted in parse_fidelities(fidelity))
    for path in build_into(list(models), out or FMU_DIR, runtime=runtime, platform=platform, actuator=chosen):
        typer.echo(f"built {path}")


def fmu_folder(fidelities: "Iterable[Fidelity]", given: Path | None = None, actuator: "Actuator | None" = None) -> Path:
    """As `ready.fmu_folder`; what is built is told."""
    from harness import ready

    return ready.fmu_folder(fidelities, given, actuator, on_built=lambda path: typer.echo(f"built {path}"))


def refuse_another(paths: "Iterable[Path]", actuator: "Actuator | None") -> None:
    """As `ready.refuse_another`."""
    from harness import ready

    ready.refuse_another(paths, actuator)

"""`ema export`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.options import ActuatorOption, chosen_actuator
from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.actuators.actuator import Actuator


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where the copies go; made if it is not there.")],
    force: Annotated[bool, typer.Option("--force", help="Replace files of these names that differ.")] = False,
    actuator: ActuatorOption = None,
) -> None:
    """Copy the FMUs and the SSP package, ready for another tool, into a folder.

    With --actuator, every parameter set in the SSP package holds that actuator's parameters, and NAME.ssv beside it has them
    alone; the FMUs stay as they are (ema build --actuator makes some that start as that actuator).
    """
    from ema_fmu_src.fidelities import FIDELITIES
    from ema_fmu_src.fmu.build import SSP
    from harness.actuators.fmus import rod
    from harness.cli.build import fmu_folder
    from harness.fidelity import file_stem
    from harness.files import results

    chosen = chosen_actuator(actuator)
    own = fmu_folder(FIDELITIES.values())
    sources = sorted([*own.glob("EMA_*.fmu"), *own.glob("*.ssp")])
    results.prepare(folder)
    contents = {folder / source.name: source.read_bytes() for source in sources}
    if actuator is not None:
        contents |= {folder / name: content for name, content in _parameter_sets(chosen, own).items()}
    for path in contents:
        results.prepare_file(path)
    differing = [path for path, content in contents.items() if path.exists() and path.read_bytes() != content]
    if differing and not force:
        raise HarnessError(f"{differing[0]}: is there and differs; --force replaces it")
    for path, content in contents.items():
        results.write(path, content)
        typer.echo(f"exported {path}")
    if actuator is not None and not chosen.is_default:
        typer.echo(
            f"the FMUs are the default actuator's; {SSP} and {file_stem(chosen.name)}.ssv make them {chosen.name} "
            "(ema build --actuator makes some that start as it)"
        )
        if told := rod(chosen.output):
            typer.echo(told)


def _parameter_sets(actuator: "Actuator", fmus: Path) -> dict[str, bytes]:
    """The SSP package with the parameters of `actuator`, and its own set, by file name."""
    from ema_fmu_src.fidelities import REFERENCE
    from ema_fmu_src.fmu import ssp
    from ema_fmu_src.fmu.build import SSP
    from harness import scratch
    from harness.actuators.fmus import variant
    from harness.fidelity import file_stem

    chosen = variant(actuator)
    with scratch.folder("export") as made:
        package = made / SSP
        ssp.write(package, fmus / REFERENCE.fmu, chosen)
        return {SSP: package.read_bytes(), f"{file_stem(actuator.name)}.ssv": ssp.parameter_set("healthy", {}, chosen)}

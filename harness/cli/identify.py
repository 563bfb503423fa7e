"""`ema identify`."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import (
    Columns,
    FmuDir,
    Limits,
    Monitor,
    Settings,
    Threshold,
    WithFiles,
    chosen_columns,
    chosen_monitor,
)
from harness.cli.terminal import show
from harness.errors import HarnessError
from harness.faults import ESTIMATED, THRESHOLD, parse_limits

if TYPE_CHECKING:
    from harness.identification.diagnosis import Diagnosis


def identify(
    measured: Annotated[Path, typer.Argument(metavar="MEASURED", help="A measured run, in any format.")],
    columns: Columns = None,
    with_files: WithFiles = None,
    model: Monitor = "ELF+",
    settings: Settings = None,
    limits: Limits = None,
    threshold: Threshold = THRESHOLD,
    tolerance: Annotated[
        float, typer.Option(metavar="PART", help="Of a channel's range, that may be left unexplained.")
    ] = 0.003,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the page.")] = Path("results"),
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the diagnosis as JSON.")] = None,
    fmus: FmuDir = None,
) -> None:
    """Identify the faults of a measured run: estimates with intervals, health, a verdict, a page.

    Columns: time, command, position, motor_speed, and equivalent_current_filtered or phase_current_a, _b, _c; optionally
    load_torque and supply_voltage; by these names in SI units, or as --column says. Exit code 1 if the run cannot be
    explained.
    """
    from harness.files import results
    from harness.files.reader import stem
    from harness.identification import diagnosis
    from harness.identification.measured import read_measured
    from harness.identification.page import page

    estimated = {parameter.port for parameter in ESTIMATED.values()}
    fidelity, parameters = chosen_monitor(model, settings, estimated=estimated)
    health_limits = parse_limits(limits or [])
    if not 0.0 <= threshold < 1.0:
        raise HarnessError(f"--threshold {threshold:g}: 0 up to less than 1 is needed")
    if not tolerance > 0.0:
        raise HarnessError(f"--tolerance {tolerance:g}: more than 0 is needed, such as 0.003")
    run = read_measured(measured, parameters, columns=chosen_columns(columns), with_files=with_files or ())
    results.prepare(out)
    if json_file:
        results.prepare_file(json_file)
    folder = fmu_folder(diagnosis.models_for(fidelity), fmus)
    found = diagnosis.identify(
        run,
        fmus=folder,
        fidelity=fidelity,
        parameters=parameters,
        limits=health_limits,
        threshold=threshold,
        tolerance=tolerance,
    )
    target = out / f"{stem(measured)}_identified.html"
    results.write(target, page(found, shlex.join(["ema", *sys.argv[1:]])))
    if json_file:
        results.write_json(json_file, found.as_dict())
    _print(found)
    typer.echo(f"page: {target}")
    if found.complaints:
        sys.exit(1)


def _print(found: "Diagnosis") -> None:
    from harness.identification.page import HEADS, rows

    if not found.complaints:
        caption = f"{found.name}, {found.fidelity}: {found.evaluations} runs of FMUs in {found.seconds:.1f} s"
        show(caption, HEADS, rows(found), words=("",))
    for line in (found.verdict, *found.remarks):
        typer.echo(line)

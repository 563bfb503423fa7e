"""`ema columns`."""

from pathlib import Path
from typing import Annotated

import typer

from harness.cli.options import ActuatorOption, Columns, chosen_actuator, chosen_columns
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import show


def columns(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Measurements, a trial or a run, in any format.")],
    mapping: Columns = None,
    actuator: ActuatorOption = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the table as JSON.")] = None,
) -> None:
    """Show the columns of a file: words, units, ranges, curves, what they are taken as, and what they look like."""
    from harness.files import results
    from harness.logs.describe import describe

    chosen = chosen_actuator(actuator)
    if json_file:
        results.prepare_file(json_file)
    found = describe(file, chosen_columns(mapping, chosen), chosen.output)
    if json_file:
        write_json(json_file, found.as_dict(), provenance(chosen))
    rows = [
        (
            str(each.number),
            each.name,
            each.unit,
            "" if each.low is None else f"{each.low:.6g}",
            "" if each.high is None else f"{each.high:.6g}",
            str(each.missing) if each.missing else "",
            each.port or (f"{each.guess}?" if each.guess else ""),
            each.curve,
        )
        for each in found.columns
    ]
    heads = ("No.", "Word", "Unit", "from", "to", "missing", "is", "Curve")
    count = max((each.rows for each in found.columns), default=0)
    show(f"{file.name}: {count} rows", heads, rows, words=("Word", "Unit", "is", "Curve"))
    if found.rate is not None:
        typer.echo(f"{found.rate:.6g} rows a second, {found.gaps} gap(s)")
    for line in found.remarks:
        typer.echo(line)
    flags = [each.flag for each in found.columns if each.flag]
    if flags:
        typer.echo(f"to take them as they look: {' '.join(flags)}")

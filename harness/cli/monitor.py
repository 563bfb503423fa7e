"""`ema monitor`."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import FmuDir, Limits, Monitor, Settings, Threshold, chosen_monitor, required_extra
from harness.cli.terminal import progress, show

if TYPE_CHECKING:
    from harness.prognosis.outlook import Outlook


def monitor(
    runs: Annotated[Path, typer.Argument(metavar="RUNS", help="A folder of measured runs, or a CSV list: date,file.")],
    fidelity: Monitor = "ELF+",
    settings: Settings = None,
    limits: Limits = None,
    threshold: Threshold = 0.05,
    workers: Annotated[int, typer.Option(metavar="N", help="Processes; 0: one a core.")] = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the page.")] = Path("results"),
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the outlook as JSON.")] = None,
    fmus: FmuDir = None,
) -> None:
    """Follow faults over measured runs, one a flight: trends, and the remaining useful life until their limits.

    Files are as for ema identify. Exit code 1 if a run had to be left out.
    """
    import json

    from harness.files import results
    from harness.identification.diagnosis import flown_for
    from harness.identification.faults import FAULTS, parse_limits
    from harness.prognosis.history import identify_all, read_flights

    with required_extra("prognosis"):
        from harness.prognosis.outlook import outlook
        from harness.prognosis.page import page

    model, parameters = chosen_monitor(fidelity, settings, estimated={fault.port for fault in FAULTS.values()})
    ends = parse_limits(limits or [])
    flights, unit = read_flights(runs)
    results.prepare(out)
    if json_file:
        results.prepare_file(json_file)
    folder = fmu_folder(flown_for(model), fmus)
    with progress() as shown:
        task = shown.add_task("identifying", total=len(flights))
        history = identify_all(
            flights,
            fmus=folder,
            monitor=model,
            parameters=parameters,
            limits=ends,
            threshold=threshold,
            workers=workers,
            on_flight=lambda: shown.advance(task),
        )
    seen = outlook(history, ends, unit)
    results.write(out / "monitor.html", page(seen, history, shlex.join(["ema", *sys.argv[1:]])))
    if json_file:
        results.write(json_file, json.dumps(seen.as_dict(), indent=1, allow_nan=False) + "\n")
    _print(seen)
    typer.echo(f"page: {out / 'monitor.html'}")
    if seen.problems:
        sys.exit(1)


def _print(seen: "Outlook") -> None:
    from harness.prognosis.page import HEADS, rows

    show(f"{seen.runs} runs; times in {seen.unit}", HEADS, rows(seen), words=(HEADS[-1],))
    for line in seen.problems:
        typer.echo(f"left out: {line}")
    typer.echo(seen.verdict)

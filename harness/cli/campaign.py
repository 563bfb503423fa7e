"""`ema campaign`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harness.cli.build import fmu_folder
from harness.cli.options import ActuatorOption, Columns, FmuDir, Settings, TrialFile, chosen_actuator, chosen_columns, small
from harness.cli.origin import provenance
from harness.cli.terminal import progress
from harness.errors import HarnessError, required_extra

if TYPE_CHECKING:
    from harness.actuators.actuator import Actuator
    from harness.campaigns.plan import Plan
    from harness.campaigns.run import Summary
    from harness.provenance import Provenance

PAGE = "campaign.html"


def campaign(
    file: Annotated[
        Path | None, typer.Argument(metavar="[CAMPAIGN.toml]", help="The plan; options take precedence.")
    ] = None,
    trials: Annotated[str | None, typer.Option("--trials", metavar="LIST", help="By commas; SIN if none is given.")] = None,
    trial_file: TrialFile = None,
    columns: Columns = None,
    fidelities: Annotated[str | None, typer.Option("--fidelities", metavar="LIST", help="By commas; ELF+.")] = None,
    ranges: Annotated[
        list[str] | None, typer.Option("--range", metavar="NAME=LOW:HIGH", help="Sampled; may be given several times.")
    ] = None,
    grid: Annotated[
        list[str] | None, typer.Option("--grid", metavar="NAME=A,B,...", help="All combinations; several times.")
    ] = None,
    cases: Annotated[
        Path | None, typer.Option("--cases", metavar="FILE.csv", help="A case a row, parameters as columns.")
    ] = None,
    actuator: ActuatorOption = None,
    settings: Settings = None,
    samples: Annotated[int | None, typer.Option("--samples", metavar="N", help="Of the ranges.")] = None,
    sampling: Annotated[
        str | None, typer.Option("--sampling", metavar="lhs|sobol", help="Latin hypercube or Sobol.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", metavar="N", help="Of samples and noise.")] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option("--noise", metavar="OUTPUT=SIGMA", help="In its unit, or '1 %' of its range; several times."),
    ] = None,
    outputs: Annotated[str | None, typer.Option("--outputs", metavar="LIST", help="To keep, by commas.")] = None,
    rate: Annotated[float | None, typer.Option("--rate", metavar="HZ", help="Of what is kept; 500.")] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the dataset; the same folder goes on.")] = Path(
        "campaign"
    ),
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, such as tcp://10.0.0.1:8786.")
    ] = None,
    workers: Annotated[int, typer.Option(metavar="N", help="Processes on this machine; 0: one a core.")] = 0,
    fmus: FmuDir = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="Check every file of the dataset in --out against its checksum; fly nothing.")
    ] = False,
) -> None:
    """Fly many cases over the fault space into one dataset: campaign.zarr, features.parquet, and a page.

    Interrupted, killed or failed, the same command goes on where it stopped; what is damaged is flown again. Exit code 1 if
    a case failed, or with --verify if something is damaged or missing.
    """
    import sys

    from harness.files import results
    from harness.logs.trialfile import read_trial
    from harness.parameters import parse_settings

    if verify:
        sys.exit(_verify(out))
    with required_extra("campaign"):
        from harness.campaigns.planfile import parse_assignments, parse_numbers, read_plan
        from harness.campaigns.run import cluster, run

    options: dict[str, Any] = {}
    for key, text in (("trials", trials), ("fidelities", fidelities), ("outputs", outputs)):
        if text is not None:
            options[key] = [part.strip() for part in text.split(",") if part.strip()]
    plain = {"samples": samples, "sampling": sampling, "seed": seed, "rate": rate, "cases": cases}
    options |= {key: value for key, value in plain.items() if value is not None}
    if ranges:
        given = parse_assignments(ranges, "--range")
        options["ranges"] = {n: parse_numbers(text, ":", f"--range {n}") for n, text in given.items()}
    if grid:
        given = parse_assignments(grid, "--grid")
        options["grid"] = {n: parse_numbers(text, ",", f"--grid {n}") for n, text in given.items()}
    if noise:
        options["noise"] = parse_assignments(noise, "--noise")
    if settings:
        options["set"] = parse_settings(settings)
    if workers < 0:
        raise HarnessError(f"--workers {workers}: 0 or more is needed")
    chosen = chosen_actuator(actuator)
    own = read_trial(trial_file, chosen.output, chosen_columns(columns)) if trial_file else None
    plan = read_plan(file, options, own, chosen)
    for line in small(plan.trials, chosen):
        typer.echo(line, err=True)
    results.prepare(out)
    folder = fmu_folder(plan.fidelities, fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=plan.fidelities)
    with cluster(scheduler, workers or os.cpu_count() or 1, _tell) as crew:
        summary = _with_progress(run, plan, crew, fmus=folder, out=out, record=record)
    for line in summary.damaged:
        _tell(f"{line}; made again")
    _print(summary, out, _write_page(out, summary, record, chosen))
    if summary.failures:
        sys.exit(1)


def _tell(line: str) -> None:
    typer.echo(line, err=True)


def _verify(out: Path) -> int:
    """Say what of the campaign in `out` is whole; the exit code."""
    with required_extra("campaign"):
        from harness.campaigns.lock import refuse_locked
        from harness.campaigns.verify import verify

    refuse_locked(out)
    found = verify(out)
    for line in found.problems:
        typer.echo(line)
    typer.echo(f"{found.whole} of {found.cases} cases are whole")
    if not found.problems and found.whole == found.cases:
        return 0
    typer.echo("the command that made it flies again what is damaged or missing, and leaves the rest as it is")
    return 1


def _write_page(out: Path, summary: "Summary", record: "Provenance", actuator: "Actuator") -> Path:
    import xarray as xr

    from harness.files import results
    from harness.show.campaign import page

    with xr.open_zarr(out / "campaign.zarr", chunks=None) as held:
        content = page(held, summary.failures, record, actuator)
    results.write(out / PAGE, content)  # the folder holds this campaign alone, and so this page
    return out / PAGE


def _with_progress(run: Any, plan: "Plan", crew: Any, *, fmus: Path, out: Path, record: "Provenance") -> "Summary":
    with progress() as shown:
        task = shown.add_task("cases", total=None)
        summary: Summary = run(
            plan,
            crew,
            fmus=fmus,
            out=out,
            record=record,
            on_start=lambda total, done: shown.update(task, total=total, completed=done),
            on_cases=lambda cases: shown.advance(task, cases),
        )
        return summary


def _print(summary: "Summary", out: Path, page: Path) -> None:
    for case, reason in summary.failures[:10]:
        typer.echo(f"case {case} failed: {reason}")
    if len(summary.failures) > 10:
        typer.echo(f"... and {len(summary.failures) - 10} more; see the variable 'failure'")
    if summary.cases:
        share = summary.fmu_seconds / (summary.wall * summary.threads)
        typer.echo(
            f"{summary.cases} cases in {summary.wall:.2f} s on {summary.threads} threads, "
            f"{summary.before} were done before; "
            f"{1e3 * summary.fmu_seconds / summary.cases:.2f} ms a case in the FMU, {100.0 * share:.0f} % of all time"
        )
    else:
        typer.echo(f"all {summary.before} cases were done before")
    typer.echo(f"dataset: {out / 'campaign.zarr'} (xarray.open_zarr)   features: {out / 'features.parquet'}")
    typer.echo(f"page: {page}")

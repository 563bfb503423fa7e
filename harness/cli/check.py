"""`ema check`."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from ema_fmu_src.fidelities import FIDELITIES, REFERENCE
from harness.cli.build import fmu_folder
from harness.cli.options import FmuDir, Settings
from harness.errors import HarnessError

OUTSIDE = 1
"""Exit code if a budget is exceeded; 2 is that of bad input."""


def check(
    fmus: FmuDir = None,
    budgets: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="Budgets of your own.")] = None,
    reference: Annotated[
        Path | None, typer.Option(metavar="FILE.fmu", help=f"Instead of {REFERENCE.fmu} in the folder.")
    ] = None,
    stored: Annotated[
        Path | None, typer.Option(metavar="DIR", help=f"Compare with TRIAL_{REFERENCE.name}.csv in DIR.")
    ] = None,
    settings: Settings = None,
    time_limit: Annotated[float, typer.Option(metavar="S", help="For one run of an FMU, which is then ended.")] = 60.0,
    junit: Annotated[Path | None, typer.Option(metavar="FILE.xml", help="JUnit XML for a CI server.")] = None,
    page: Annotated[Path | None, typer.Option(metavar="FILE.html", help="The report page, as ema run writes it.")] = None,
    markdown: Annotated[Path | None, typer.Option(metavar="FILE.md", help="A summary; appended to, if it is there.")] = None,
) -> None:
    """Check every fidelity against its budget of the reference; exit code 0 within, 1 outside, 2 could not run."""
    from harness import budgets as budgeting
    from harness.files import results
    from harness.parameters import parse_settings
    from harness.show import report, verdicts

    allowed = budgeting.read_budgets(budgets or budgeting.DEFAULT)
    parameters = parse_settings(settings or [])
    if not time_limit > 0.0:
        raise HarnessError(f"--time-limit {time_limit:g}: more than 0 s is needed")
    if reference and stored:
        raise HarnessError("--reference and --stored: one of the two can be the reference")
    for path in (junit, markdown, page):
        if path:
            results.prepare_file(path)
    wanted = {REFERENCE.name, *(fidelity for fidelities in allowed.values() for fidelity in fidelities)}
    folder = fmus or fmu_folder(FIDELITIES[name] for name in sorted(wanted))
    judged, flown = budgeting.check(
        allowed, fmus=folder, reference=reference, stored=stored, parameters=parameters, time_limit=time_limit
    )
    if junit:
        results.write(junit, verdicts.junit(judged))
    if markdown:
        before = markdown.read_text(encoding="utf-8") if markdown.exists() else ""
        results.write(markdown, before + verdicts.markdown(judged))
    if page:
        command = shlex.join(["ema", *sys.argv[1:]])
        results.write(page, report.page(flown, parameters=parameters, command=command, budgets=allowed))
    outside = [verdict for verdict in judged if not verdict.passed]
    for line in dict.fromkeys(verdict.line for verdict in outside):
        typer.echo(line)
    typer.echo(f"{len(judged) - len(outside)} of {len(judged)} budgets kept")
    if outside:
        sys.exit(OUTSIDE)

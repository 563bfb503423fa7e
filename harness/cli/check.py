"""`ema check`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ema_fmu_src.fidelities import FIDELITIES, REFERENCE
from harness.cli.build import fmu_folder, refuse_another
from harness.cli.options import ActuatorOption, FmuDir, JsonFile, Settings, beyond, chosen_actuator, chosen_parameters, small
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import show
from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.budgets import Verdict

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
    actuator: ActuatorOption = None,
    settings: Settings = None,
    time_limit: Annotated[float, typer.Option(metavar="S", help="For one run of an FMU, which is then ended.")] = 60.0,
    junit: Annotated[Path | None, typer.Option(metavar="FILE.xml", help="JUnit XML for a CI server.")] = None,
    page: Annotated[Path | None, typer.Option(metavar="FILE.html", help="The report page, as ema run writes it.")] = None,
    json_file: JsonFile = None,
    markdown: Annotated[Path | None, typer.Option(metavar="FILE.md", help="A summary; appended to, if it is there.")] = None,
) -> None:
    """Check every fidelity against its budget of the reference; exit code 0 within, 1 outside, 2 could not run.

    The budgets that come with the package are those of the default actuator, with its own drive and with a field-oriented
    one. Another one (--actuator) is flown and its errors are told, exit code 1 if a fidelity failed; it is held to budgets
    where --budgets gives its own.
    """
    from harness import budgets as budgeting
    from harness.files import results
    from harness.show import report, verdicts
    from harness.show.outside import experiment_of
    from harness.trials import trial

    chosen = chosen_actuator(actuator)
    parameters = chosen_parameters(chosen, settings)
    own = budgets or budgeting.budgets_for(chosen, parameters)
    allowed = budgeting.read_budgets(own or budgeting.DEFAULT)
    if own is None:
        allowed = budgeting.without_limits(allowed)
    trials = budgeting.read_trials(own, chosen.output) if own else {}
    named = [trials.get(name) or trial(name) for name in allowed]
    for line in (*small(named, chosen), *beyond(named, chosen, parameters)):
        typer.echo(line, err=True)
    if not time_limit > 0.0:
        raise HarnessError(f"--time-limit {time_limit:g}: more than 0 s is needed")
    if reference and stored:
        raise HarnessError("--reference and --stored: one of the two can be the reference")
    for path in (junit, markdown, page, json_file):
        if path:
            results.prepare_file(path)
    wanted = {REFERENCE.name, *(fidelity for fidelities in allowed.values() for fidelity in fidelities)}
    folder = fmus or fmu_folder(FIDELITIES[name] for name in sorted(wanted))
    refuse_another([folder / FIDELITIES[name].fmu for name in wanted], chosen)
    record = provenance(chosen, fmus=folder, fidelities=[FIDELITIES[name] for name in FIDELITIES if name in wanted])
    judged, flown = budgeting.check(
        allowed,
        fmus=folder,
        reference=reference,
        stored=stored,
        parameters=parameters,
        time_limit=time_limit,
        output=chosen.output,
        trials=trials,
    )
    if json_file:
        write_json(json_file, {"actuator": chosen.identity, "verdicts": [item.as_dict() for item in judged]}, record)
    if junit:
        results.write(junit, verdicts.junit(judged))
    if markdown:
        before = markdown.read_text(encoding="utf-8") if markdown.exists() else ""
        results.write(markdown, before + verdicts.markdown(judged))
    if page:
        flown = experiment_of(flown, chosen, record)
        content = report.page(flown, parameters=parameters, record=record, budgets=allowed, actuator=chosen)
        results.write(page, content)
    outside = [verdict for verdict in judged if not verdict.passed]
    for line in dict.fromkeys(verdict.line for verdict in outside):
        typer.echo(line)
    if any(verdict.judged for verdict in judged):
        typer.echo(f"{len(judged) - len(outside)} of {len(judged)} budgets kept")
    else:
        _tell_errors(judged, chosen.name)
    if outside:
        sys.exit(OUTSIDE)


def _tell_errors(found: "list[Verdict]", actuator: str) -> None:
    """The errors of an actuator for which there are no budgets."""
    rows = [
        (item.trial, item.fidelity, item.variable, "-" if item.found is None else f"{100.0 * item.found:.4f} %")
        for item in found
    ]
    show(f"Errors of {actuator} (NRMSE)", ("Trial", "Fidelity", "Variable", "NRMSE"), rows, words=("Fidelity", "Variable"))
    typer.echo(
        f"{len(rows)} errors told, none judged: the budgets are the default actuator's; --budgets takes those of {actuator}"
    )

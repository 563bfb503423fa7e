"""`ema compare`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.options import Columns, Figures, JsonFile, Settings, TrialFile, chosen_trials, save_figures
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import show
from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.comparison import Comparison

LONGEST = 86400.0
"""A run may take [s]: a day, as Ctrl-C ends it before."""


def compare(
    candidate: Annotated[Path, typer.Argument(metavar="CANDIDATE.fmu")],
    reference: Annotated[Path, typer.Option(metavar="REFERENCE.fmu", help="What the candidate is compared with.")],
    trial: Annotated[list[str] | None, typer.Option(metavar="TRIAL", help="Trials; may be given several times.")] = None,
    trial_file: TrialFile = None,
    settings: Settings = None,
    columns: Columns = None,
    tube: Annotated[float, typer.Option(help="Half width of the tolerance tube, fraction of the range.")] = 0.01,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the page.")] = Path("results"),
    json_file: JsonFile = None,
    figures: Figures = None,
) -> None:
    """Compare any FMU that has the ports with a reference FMU, variable by variable: a table, a page.

    Each flies in a process of its own, so that one that ends its process is told apart from one that has been compared.
    """
    from harness.comparison import compare as compare_runs
    from harness.comparison import summary
    from harness.files import results
    from harness.flight import fmufile
    from harness.flight.isolate import Isolated
    from harness.parameters import parse_settings
    from harness.show import compared
    from harness.show import figures as papers
    from harness.show.page import write_page

    flown = chosen_trials(trial, trial_file, columns=columns)
    parameters = parse_settings(settings or [])
    if not 0.0 <= tube <= 1.0:
        raise HarnessError(f"--tube {tube:g}: a fraction of the range from 0 to 1 is needed")
    if json_file:
        results.prepare_file(json_file)
    for path in (candidate, reference):
        fmufile.require_ports(path, fmufile.describe(path))  # no folder is made for what is no such FMU
    results.prepare(out)
    if figures:
        papers.prepare(figures)
    record = provenance()
    with Isolated(candidate, time_limit=LONGEST) as twin, Isolated(reference, time_limit=LONGEST) as other:
        pairs = [(twin.run(item, parameters), other.run(item, parameters)) for item in flown]
    names = (candidate.stem, reference.stem)
    comparisons: list[Comparison] = []
    for found, expected in pairs:
        comparisons += compare_runs(found, expected, names=names, tube=tube)
    if json_file:
        entries = [
            (dataset.attrs["trial"], name, dataset) for pair in pairs for name, dataset in zip(names, pair, strict=True)
        ]
        write_json(json_file, summary(entries, comparisons), record)
    page = compared.page(comparisons, pairs, names, tube, record)
    target = write_page(out / f"{names[0]}_against_{names[1]}.html", page)
    show(f"{names[0]} against {names[1]}", compared.heads(tube), compared.table_rows(comparisons), words=("Variable",))
    typer.echo(f"page: {target}")
    save_figures(figures, lambda: compared.figures(comparisons, pairs, names), target.stem)

"""`ema bench identify --actuators N`: the table on random actuators."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from harness import scratch
from harness.cli.bench.tables import check_table, show
from harness.cli.build import fmu_folder
from harness.cli.options import save_figures
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import progress
from harness.errors import HarnessError, unknown

if TYPE_CHECKING:
    from harness.bench.kept import Kept

PAGE = "bench_actuators.html"


@dataclass(frozen=True)
class Wanted:
    """What the command line asks for: so many random `actuators`, and single faults of each kind with `exact` parameters;
    the names of the `parts`, none for all; the folder that `keep`s the cases."""

    actuators: int
    exact: int
    parts: Collection[str]
    keep: Path | None
    seed: int
    rate: float
    workers: int

    def check(self) -> None:
        """HarnessError for what cannot be."""
        from harness.bench.jobs import PARTS

        for part in self.parts:
            if part not in PARTS:
                raise unknown("--part", part, PARTS)
        if self.actuators < 0 or self.exact < 0 or self.seed < 0:
            raise HarnessError("--actuators, --exact and --seed of 0 or more are needed")


def actuators(
    wanted: Wanted, json_file: Path | None, out: Path | None, fmus: Path | None, figures: Path | None = None
) -> None:
    """Do what is not yet done, and print, write and draw what there is."""
    from harness.bench import jobs, table
    from harness.bench.kept import Kept
    from harness.bench.pictures import figures as figures_of
    from harness.bench.pictures import page
    from harness.fidelity import FIDELITIES
    from harness.files import results
    from harness.show import figures as papers
    from harness.show.page import write_page

    wanted.check()
    for path in (out / PAGE if out else None, json_file):
        if path:
            results.prepare_file(path)
    if figures:
        papers.prepare(figures)
    models = [FIDELITIES[name] for name in ("HF", "ELF+")]
    folder = fmu_folder(models, fmus)
    record = provenance(fmus=folder, fidelities=models)
    with _folder(wanted.keep) as keep:
        kept = Kept.opened(keep, wanted.seed, wanted.rate, folder)
        _do(wanted, kept, folder)
        found = [jobs.Found.from_dict(item) for item in kept.all()]
        calibrations = kept.calibrations()
    if not found:
        raise HarnessError("no case is done; --actuators of 1 or more is needed, or --keep of a folder that holds some")
    listed = table.checks(found, calibrations)
    tables = [*table.tables(found), check_table(listed)]
    for each in tables:
        show(each)
    if json_file:
        content = {"cases": [item.as_dict() for item in found], "calibrations": calibrations}
        write_json(json_file, {**kept.as_dict(), **content, "checks": [check.as_dict() for check in listed]}, record)
    if out:
        typer.echo(f"page: {write_page(out / PAGE, page(found, tables, record, kept.as_dict()))}")
    save_figures(figures, lambda: figures_of(found), Path(PAGE).stem)


def _do(wanted: Wanted, kept: "Kept", fmus: Path) -> None:
    from harness.bench import jobs

    listed = jobs.jobs(wanted.actuators, wanted.exact, wanted.seed, wanted.parts or jobs.PARTS)
    todo, numbers = jobs.missing(listed, kept)
    if not todo:
        return
    with progress() as shown:
        task = shown.add_task("identifying", total=len(todo) + len(numbers))
        jobs.run(listed, kept, fmus, workers=wanted.workers, on_case=lambda: shown.advance(task))


@contextmanager
def _folder(keep: Path | None) -> Iterator[Path]:
    """The folder that keeps the cases, or one that goes."""
    if keep is not None:
        yield keep
        return
    with scratch.folder("bench") as made:
        yield made

"""`ema bench identify`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harness.cli.bench.tables import check_table, show
from harness.cli.build import fmu_folder
from harness.cli.options import ActuatorOption, Figures, FmuDir, chosen_actuator
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import progress
from harness.errors import HarnessError

if TYPE_CHECKING:
    from harness.actuators.actuator import Actuator
    from harness.bench.evolution import Evolved
    from harness.bench.identify import IdentifiedCase
    from harness.bench.page import Table


def identify(
    cases: Annotated[int, typer.Option(metavar="N", help="Faulted cases, each with single or combined faults.")] = 60,
    healthy: Annotated[int, typer.Option(metavar="N", help="Healthy cases.")] = 20,
    evolution: Annotated[int, typer.Option(metavar="N", help="Cases also given to differential evolution.")] = 6,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Rows a second of the measurements.")] = 2000.0,
    seed: Annotated[int, typer.Option(metavar="N", help="Of the faults and the noise.")] = 1,
    workers: Annotated[int, typer.Option(metavar="N", help="Processes of one thread; 0: one a core.")] = 0,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write every case as JSON.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the page, bench_identify.html.")] = None,
    actuator: ActuatorOption = None,
    figures: Figures = None,
    fmus: FmuDir = None,
    actuators: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Instead, cases on N random actuators, calibrated or not, and sensor effects and rare faults; "
            "0: only show what --keep holds.",
        ),
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="With --actuators: keeps each finished case; what is there is not done again."),
    ] = None,
    exact: Annotated[
        int, typer.Option(metavar="N", help="With --actuators: single faults of each kind with exact parameters.")
    ] = 20,
    parts: Annotated[
        list[str] | None,
        typer.Option(
            "--part", metavar="NAME", help="With --actuators: only actuators, effects, rare or exact; several times."
        ),
    ] = None,
) -> None:
    """Put `ema identify` to the test: HF as the plant with known faults and noise, ELF+ and LF as models.

    With another actuator (--actuator), the limits that this project sets itself are the default one's and are left out.
    With --actuators, the plants are random actuators whose parameters the diagnosis does not know.
    """
    from harness.bench import identify as bench
    from harness.bench import summary
    from harness.fidelity import FIDELITIES
    from harness.files import results
    from harness.show.page import document, flown_actuator, write_page
    from harness.show.page import table as as_html

    _check_rate(rate)
    if actuators is not None:
        from harness.cli.bench.actuators import Wanted
        from harness.cli.bench.actuators import actuators as on_actuators

        if actuator is not None:
            raise HarnessError("--actuators draws from the default actuator; --actuator cannot be given too")
        on_actuators(Wanted(actuators, exact, parts or (), keep, seed, rate, workers), json_file, out, fmus, figures)
        return
    if keep is not None or parts or figures is not None:
        raise HarnessError("--keep, --part and --figures need --actuators")
    if cases < 1 or healthy < 0 or not 0 <= evolution <= cases:
        raise HarnessError(
            "--cases of 1 or more, --healthy of 0 or more, --evolution of 0 to the number of cases are needed"
        )
    for path in (out / "bench_identify.html" if out else None, json_file):
        if path:
            results.prepare_file(path)
    chosen = chosen_actuator(actuator)
    _refuse_extremes(chosen)
    folder = fmu_folder(FIDELITIES.values(), fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=FIDELITIES.values())
    with progress() as shown:
        task = shown.add_task("identifying", total=cases + healthy + evolution)
        found, others = bench.run(
            folder,
            count=cases,
            healthy=healthy,
            evolved=evolution,
            seed=seed,
            rate=rate,
            workers=workers,
            parameters=chosen.parameters,
            on_case=lambda: shown.advance(task),
        )
    listed = summary.checks(found, others) if chosen.is_default else []
    tables = [*(_fault_table(found, name) for name in bench.TESTED), _case_table(found), _evolution_table(others)]
    tables = [table for table in (*tables, check_table(listed)) if table[2]]
    for table in tables:
        show(table)
    if json_file:
        write_json(json_file, {"actuator": chosen.identity, **summary.as_dict(found, others, listed)}, record)
    if out:
        body = "<h1>Identification, measured</h1>" + flown_actuator(chosen) + "".join(as_html(*table) for table in tables)
        content = document("EMA twins: identification, measured", body, record)
        typer.echo(f"page: {write_page(out / 'bench_identify.html', content)}")


def _check_rate(rate: float) -> None:
    """HarnessError if the rows of a trial cannot be those of such a measurement."""
    if round(10000.0 / rate if rate > 0.0 else 0.0) not in range(1, 21) or abs(10000.0 / rate % 1.0) > 1e-9:
        raise HarnessError(f"--rate {rate:g}: 10000 Hz over a whole number, 500 Hz or more, is needed")


def _refuse_extremes(actuator: "Actuator") -> None:
    """HarnessError if faults that the bench draws cannot be those of `actuator`."""
    from harness.faults import FAULTS

    largest, pairs = FAULTS["zeta"].studied[1], actuator.value("motor.p")
    if pairs * largest >= 1.0:
        raise HarnessError(
            f"--actuator {actuator.name}: the bench draws eccentricities up to {largest:g}, too many for its "
            f"{pairs:g} pole pairs: motor.p * fault.zeta has to stay below 1"
        )


def _fault_table(found: "list[IdentifiedCase]", fidelity: str) -> "Table":
    import numpy as np

    from harness.bench.summary import identifiable_errors, outcomes_by_scope
    from harness.faults import ESTIMATED

    rows: list[tuple[str, ...]] = []
    for fault in ESTIMATED:
        for scope, outcomes in outcomes_by_scope(found, fidelity, fault).items():
            errors, covered = identifiable_errors(outcomes)
            figures = ["-"] * 4
            if errors:
                figures = [f"{figure:.3f}" for figure in (np.median(errors), np.percentile(errors, 95), max(errors))]
                figures.append(f"{covered:.0f} %")
            alarms = [sum(out.missed for out in outcomes), sum(out.false_alarm for out in outcomes)]
            rows.append((fault, scope, f"{len(errors)} of {len(outcomes)}", *figures, *map(str, alarms)))
    heads = ("Fault", "runs", "identifiable", "median", "95th", "largest", "covered", "missed", "false")
    return f"{fidelity}: errors in % of each fault's range, where it was said to be identifiable", heads, rows


def _case_table(found: "list[IdentifiedCase]") -> "Table":
    import numpy as np

    from harness.bench.identify import TESTED

    rows: list[tuple[str, ...]] = []
    for fidelity in TESTED:
        own = [item for item in found if item.fidelity == fidelity]
        sound = [item for item in own if not item.case.truth]
        seconds, evaluations = [item.seconds for item in own], [item.evaluations for item in own]
        alarmed = sum(any(out.alarm for out in item.outcomes) for item in sound)
        rows.append(
            (
                fidelity,
                f"{np.median(seconds):.2f}, {max(seconds):.2f}",
                f"{np.median(evaluations):.0f}, {max(evaluations)}",
                f"{alarmed} of {len(sound)}",
                f"{sum(not item.explained for item in own)} of {len(own)}",
            )
        )
    heads = ("Fidelity", "s a case: median, most", "evaluations: median, most", "healthy runs alarmed", "not explained")
    return "A case on one core", heads, rows


def _evolution_table(others: "list[Evolved]") -> "Table":
    rows: list[tuple[str, ...]] = [
        (
            str(item.case),
            item.trial,
            str(item.least_squares),
            f"{'' if item.reached else 'not in '}{item.evaluations}",
            f"{'' if item.reached else '> '}{item.evaluations / item.least_squares:.0f}",
            f"{100.0 * item.least_squares_error:.2f} %",
            f"{100.0 * item.error:.2f} %",
        )
        for item in others
    ]
    heads = ("Case", "Trial", "least squares", "differential evolution", "ratio", "error, least squares", "error, evolution")
    caption = "Runs of ELF+ until the sum of squares is that of the least squares (within 0.5 %), and the largest error then"
    return caption, heads, rows

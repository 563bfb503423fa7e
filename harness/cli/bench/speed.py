"""`ema bench`, `ema bench speed`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from harness.cli.bench.tables import check_table, show
from harness.cli.build import fmu_folder
from harness.cli.options import ActuatorOption, Figures, FmuDir, JsonFile, chosen_actuator, save_figures, small
from harness.cli.origin import provenance, write_json
from harness.cli.terminal import progress
from harness.errors import HarnessError

if TYPE_CHECKING:
    from collections.abc import Callable

    from harness.bench.drive import Beside
    from harness.bench.overhead import Overhead
    from harness.bench.page import Table
    from harness.bench.peers import Peer
    from harness.bench.speed import Check, Speed

T = TypeVar("T")
OVERHEAD_OF = ("ELF+", "LF")
"""Fidelities for which the overhead of the master is measured."""


def speed(
    trials: Annotated[list[str] | None, typer.Argument(metavar="[TRIAL ...]", help="All six if none is named.")] = None,
    repeats: Annotated[int, typer.Option(metavar="N", help="Runs of which the median is taken.")] = 5,
    peers: Annotated[bool, typer.Option("--peers/--no-peers", help="Also those of the extra [bench].")] = True,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the page, bench.html.")] = None,
    json_file: JsonFile = None,
    actuator: ActuatorOption = None,
    figures: Figures = None,
    fmus: FmuDir = None,
) -> None:
    """Measure speed and accuracy of every fidelity, the master's overhead, and peers, in one run.

    Another actuator (--actuator) is timed and its errors are told; peers, overhead, limits and the comparison of drives are
    the default one's.
    """
    from harness.bench import drive, overhead
    from harness.bench import speed as timing
    from harness.bench.page import figures as figures_of
    from harness.bench.page import page
    from harness.bench.peers import measure as measure_peers
    from harness.fidelity import FIDELITIES
    from harness.files import results
    from harness.show import figures as papers
    from harness.show.page import write_page
    from harness.trials import BUILT_IN, trial

    if repeats < 1:
        raise HarnessError(f"--repeats {repeats}: at least 1 is needed")
    names = [trial(name).name for name in trials or BUILT_IN]
    for path in (out / "bench.html" if out else None, json_file):
        if path:
            results.prepare_file(path)
    if figures:
        papers.prepare(figures)
    chosen = chosen_actuator(actuator)
    for line in small([trial(name) for name in names], chosen):
        typer.echo(line, err=True)
    folder = fmu_folder(FIDELITIES.values(), fmus, chosen)
    record = provenance(chosen, fmus=folder, fidelities=FIDELITIES.values())
    measured = _with_progress(
        lambda on_run: timing.measure(folder, names, repeats=repeats, actuator=chosen, on_run=on_run),
        timing.count_runs(names, repeats, chosen),
    )
    own = chosen.is_default
    beside = (
        _with_progress(
            lambda on_run: drive.measure(folder, names, repeats=repeats, on_run=on_run), drive.count_runs(names, repeats)
        )
        if own
        else []
    )
    added = [overhead.measure(folder, name) for name in OVERHEAD_OF if own]
    peer_times = measure_peers() if peers and own else []
    found = [*timing.checks(measured), *drive.checks(beside), *map(_overhead_check, added)] if own else []
    tables = [
        _speed_table(measured),
        _changed_table(measured),
        _drive_table(beside),
        _overhead_table(added),
        _peer_table(peer_times),
        check_table(found),
    ]
    tables = [table for table in tables if table[2]]
    for table in tables:
        show(table)
    if out:
        target = write_page(out / "bench.html", page(tables, measured, record, chosen))
        typer.echo(f"page: {target}")
    if json_file:
        content = {
            "actuator": chosen.identity,
            "rows": [vars(row) for row in measured.rows],
            "changed": [dict(zip(("change", "trial", "mode"), key, strict=True)) | e for key, e in measured.changed.items()],
            "drive": [vars(item) for item in beside],
            "overhead": [item.as_dict() for item in added],
            "peers": [vars(peer) for peer in peer_times],
            "checks": [check.as_dict() for check in found],
        }
        write_json(json_file, content, record)
    save_figures(figures, lambda: figures_of(measured), "bench")


def _with_progress(run: "Callable[[Callable[[str], None]], T]", total: int) -> "T":
    with progress() as shown:
        task = shown.add_task("starting", total=total)
        return run(lambda text: shown.update(task, description=text, advance=1))


def _percent(error: float | None) -> str:
    return "-" if error is None else f"{100.0 * error:.4f} %"


def _overhead_check(added: "Overhead") -> "Check":
    from harness.bench.speed import Check

    return Check(f"{added.fidelity}: overhead of fmpy.simulate_fmu / the master's", added.fmpy / added.master, 50.0, True)


def _speed_table(speed: "Speed") -> "Table":
    from harness.bench.speed import PAPER_TIMES, VARIABLES

    rows = []
    for row in speed.rows:
        errors = [_percent(row.errors[name]) if row.errors else "reference" for name in VARIABLES]
        rows.append(
            (
                row.trial,
                row.mode,
                f"{1e3 * row.wall:.3f}",
                f"{1.0 / row.relative:.3g}",
                *errors,
                PAPER_TIMES.get(row.mode, ""),
            )
        )
    heads = ("Trial", "Fidelity", "ms / s", "HF / this", "position", "motor_speed", "current, filtered", "paper, a run")
    return "Wall time per simulated second, and errors (NRMSE) against HF at a fixed 1e-7 s", heads, rows


def _changed_table(speed: "Speed") -> "Table":
    from harness.bench.speed import VARIABLES

    rows = [(*key, *(_percent(errors[name]) for name in VARIABLES)) for key, errors in speed.changed.items()]
    return "One parameter changed", ("Change", "Trial", "Fidelity", "position", "motor_speed", "current, filtered"), rows


def _drive_table(found: "list[Beside]") -> "Table":
    rows: list[tuple[str, ...]] = [
        (item.trial, item.case, f"{1e3 * item.default:.3f}", f"{1e3 * item.oriented:.3f}", f"{item.ratio:.3f}",
         "reference" if item.error is None else _percent(item.error))
        for item in found
    ]  # fmt: skip
    heads = ("Trial", "Fidelity", "default drive, ms / s", "field oriented, ms / s", "ratio", "position against HF")
    return "The field-oriented drive at a carrier of 20 kHz beside the default one", heads, rows


def _overhead_table(added: "list[Overhead]") -> "Table":
    rows = [
        (item.fidelity, *(f"{1e9 * value:.1f}" for value in (item.fmu, item.master, item.fmpy)),
         f"{item.fmpy / item.master:.0f}", "yes" if item.identical else "NO")
        for item in added
    ]  # fmt: skip
    heads = ("FMU", "its own ns", "master ns", "fmpy.simulate_fmu ns", "fmpy / master", "same bits")
    return "A communication step: the FMU's own time, and what the loop around it adds", heads, rows


def _peer_table(peers: "list[Peer]") -> "Table":
    rows: list[tuple[str, ...]] = [
        (peer.name, f"{peer.wall:.3g}" if peer.wall else "-", peer.computes, peer.lacks) for peer in peers
    ]
    return "Peers, wall seconds per simulated second", ("Peer", "wall s / s", "computes", "does not"), rows

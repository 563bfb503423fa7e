"""A series of measured runs, and the faults identified in each."""

import csv
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from harness.actuators.actuator import DEFAULT, Actuator
from harness.errors import HarnessError
from harness.fidelity import Fidelity
from harness.files.reader import is_readable
from harness.identification.diagnosis import identify
from harness.identification.estimates import Estimate
from harness.inference.measured import read_measured
from harness.parallel import processes

DATE = re.compile(r"(?<!\d)\d{4}-\d{2}-\d{2}(?!\d)")


@dataclass(frozen=True)
class Flight:
    """A measured run: its file, the label under which it is shown, and when it was flown, in the unit of the series."""

    path: Path
    label: str
    at: float


@dataclass(frozen=True)
class IdentifiedFlight:
    """A flight's estimates by short name, or the problem for which there are none."""

    flight: Flight
    estimates: dict[str, Estimate]
    problem: str


def read_flights(source: Path) -> tuple[list[Flight], str]:
    """Flights in their order, and the unit of their times: "days", or "flights" if no dates are known.

    `source`: a folder of measured runs in any format, sorted by name, or by date if every name holds one as in
    2026-03-01.csv; or a CSV list with columns date (YYYY-MM-DD) and file (relative to the list). HarnessError if it holds
    no flights.
    """
    if source.is_dir():
        paths = sorted(path for path in source.rglob("*") if path.is_file() and is_readable(path))
        if not paths:
            raise HarnessError(f"{source}: holds no .csv or other file of columns; one for each measured run is needed")
        labels = [str(path.relative_to(source)) for path in paths]
        found = [DATE.search(label) for label in labels]
        dates = [_date(match.group(), str(path)) for match, path in zip(found, paths, strict=True) if match]
        if len(dates) < len(paths):
            return [
                Flight(path, label, float(n)) for n, (path, label) in enumerate(zip(paths, labels, strict=True))
            ], "flights"
        return _dated(list(zip(dates, paths, labels, strict=True))), "days"
    return _dated(_listed(source)), "days"


def _listed(source: Path) -> list[tuple[date, Path, str]]:
    try:
        rows = list(csv.DictReader(source.read_text(encoding="utf-8-sig").splitlines(), skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise HarnessError(f"{source}: cannot be read: {reason}") from None
    if not rows or not {"date", "file"} <= set(rows[0]):
        raise HarnessError(f"{source}: a folder of runs, or a CSV list with columns date and file, is needed")
    listed = []
    for number, row in enumerate(rows, start=2):
        path = source.parent / (row["file"] or "").strip()
        if not path.is_file():
            raise HarnessError(f"{source}, line {number}: there is no file {path}")
        listed.append((_date((row["date"] or "").strip(), f"{source}, line {number}"), path, (row["date"] or "").strip()))
    return listed


def _date(text: str, where: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise HarnessError(f"{where}: '{text}' is not a date; YYYY-MM-DD is needed") from None


def _dated(listed: list[tuple[date, Path, str]]) -> list[Flight]:
    """Flights by date; those of one day are spread evenly over it, in their order."""
    listed = sorted(listed, key=lambda entry: entry[0])
    first = listed[0][0]
    on_day = [sum(other[0] == entry[0] for other in listed) for entry in listed]
    seen: dict[date, int] = {}
    flights = []
    for (day, path, label), count in zip(listed, on_day, strict=True):
        place = seen[day] = seen.get(day, -1) + 1
        flights.append(Flight(path, label, (day - first).days + place / count))
    return flights


def identify_all(
    flights: list[Flight],
    *,
    fmus: Path,
    fidelity: Fidelity,
    parameters: Mapping[str, float],
    limits: Mapping[str, float],
    threshold: float,
    workers: int,
    columns: Mapping[str, str] | None = None,
    actuator: Actuator = DEFAULT,
    on_flight: Callable[[], object] = lambda: None,
) -> list[IdentifiedFlight]:
    """Identify every flight with the model `fidelity`, in `workers` processes (0: one a core).

    The other options are those of `identify` and of `read_measured`; `on_flight` is called after each flight. A flight that
    cannot be used stops nothing; HarnessError if none can.
    """
    shared = (fmus, fidelity, dict(parameters), dict(limits), threshold, dict(columns or {}), actuator)
    with processes(workers) as pool:
        waiting = [pool.submit(_identify, flight, *shared) for flight in flights]
        found = []
        for future in waiting:
            found.append(future.result())
            on_flight()
    if all(item.problem for item in found):
        raise HarnessError(f"none of the {len(found)} runs can be used; the first: {found[0].problem}")
    return found


def _identify(
    flight: Flight,
    fmus: Path,
    fidelity: Fidelity,
    parameters: dict[str, float],
    limits: dict[str, float],
    threshold: float,
    columns: dict[str, str],
    actuator: Actuator,
) -> IdentifiedFlight:
    try:
        run = read_measured(flight.path, parameters, actuator.output, columns)
        diagnosis = identify(
            run,
            fmus=fmus,
            fidelity=fidelity,
            parameters=parameters,
            actuator=actuator,
            limits=limits,
            threshold=threshold,
        )
    except HarnessError as error:
        return IdentifiedFlight(flight, {}, str(error))
    if diagnosis.complaints:
        return IdentifiedFlight(flight, {}, f"{flight.path}: {diagnosis.verdict}")
    return IdentifiedFlight(flight, {item.fault: item for item in diagnosis.estimates}, "")

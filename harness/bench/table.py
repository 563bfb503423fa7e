"""What the bench finds on random actuators and beside them: its figures, with what this project asks of itself."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import norm

from harness.bench.identify import Outcome
from harness.bench.jobs import CALIBRATED, RARE, SHEET, Found
from harness.bench.speed import Check
from harness.faults import FAULTS, KINDS

Rows = list[tuple[str, ...]]
Table = tuple[str, tuple[str, ...], Rows]
"""Caption, headings, rows; that of the bench's pages."""

MEDIAN = float(norm.ppf(0.75))
"""Median of the absolute value of a normal error, in its standard deviations."""
NEAR_BOUND = 1.3
"""Median error over that of an estimator that reaches Cramer and Rao's bound: most that is asked."""
ERRORS = {"friction": 0.3, "backlash": 0.5, "N": 1.5, "zeta": 1.5, "gain": 0.1}
"""Median error [% of a fault's range] with a calibrated actuator, by kind of fault: most that is asked."""
COVERED = (90.0, 99.0)
"""Part of the 95 % intervals that cover the truth [%]: least and most that is asked."""
MANY = 50
"""Intervals from which too many that cover the truth say something."""
FALSE_ALARMS, RIGHT = 2.0, 90.0
"""Healthy runs with a false alarm [%], at most; faulted runs with exactly the true alarms [%], at least."""
SECONDS, CALIBRATION_SECONDS = 6.0, 15.0
"""Of two cores: a diagnosis and a calibration; judged by those of one core, which take longer."""
NOTHING, UNEXPLAINED = "nothing", "not explained"


def percent(part: int, of: int) -> float:
    """Not a number of nothing."""
    return 100.0 * part / of if of else math.nan


def of_actuators(found: Iterable[Found], known: str, *, faulted: bool) -> list[Found]:
    """The cases of random actuators of which so much is `known`, those with faults or the healthy ones."""
    own = of_part(found, "actuators")
    return [item for item in own if item.job.known == known and bool(item.job.faults) == faulted]


def of_part(found: Iterable[Found], part: str) -> list[Found]:
    """The cases of a part."""
    return [item for item in found if item.job.part == part]


def present(found: Iterable[Found], kind: str) -> list[Outcome]:
    """The outcomes of faults of a kind that were there, in the runs that were explained."""
    names = {fault.name for fault in KINDS[kind]}
    return [out for item in found if item.explained for out in item.outcomes if out.fault in names and out.present]


def median_error(outcomes: Sequence[Outcome]) -> float:
    """In % of a range; not a number of none."""
    return 100.0 * float(np.median([out.error for out in outcomes])) if outcomes else math.nan


def coverage(outcomes: Sequence[Outcome]) -> float:
    """Intervals that cover the truth [%]."""
    return percent(sum(out.covered for out in outcomes), len(outcomes))


def bound(found: Iterable[Found], kind: str) -> float:
    """The median error [% of a range] of an estimator that reaches Cramer and Rao's bound: MEDIAN standard deviations;
    median over the cases with a single fault of this kind."""
    names = {fault.name for fault in KINDS[kind]}
    own = [item.bound for item in found if item.job.faults <= names and item.explained and item.bound is not None]
    return 100.0 * MEDIAN * float(np.median(own)) if own else math.nan


def told(item: Found) -> str:
    """How a rare fault is told: right, or in a group that holds it; else wrong.

    In a group it is among the alternatives to what is alarmed, or in a combination that the run cannot tell apart: with one
    that is alarmed, or, if none is, itself said not to be identifiable.
    """
    (name,) = item.job.faults
    if item.right:
        return "right"
    if not item.explained:
        return "wrong"
    alarms = set(item.alarms)
    open_ = any(out.fault == name and not out.identifiable for out in item.outcomes)
    grouped = any(name in members and (alarms & set(members) or (open_ and not alarms)) for members in item.groups)
    other = bool(alarms) and any(name in faults for faults in item.alternatives)
    return "in a group" if grouped or other else "wrong"


def checks(found: Sequence[Found], calibrations: Sequence[Mapping[str, Any]]) -> list[Check]:
    """The figures with what is asked; those of which there are no cases are left out."""
    listed = [*_alarm_checks(found), *_fault_checks(found), *_other_checks(found), *_time_checks(found, calibrations)]
    return [check for check in listed if not math.isnan(check.value)]


def _alarm_checks(found: Sequence[Found]) -> Iterator[Check]:
    for known in (CALIBRATED, SHEET):
        own = of_actuators(found, known, faulted=False)
        false = percent(sum(bool(item.alarms) for item in own), len(own))
        yield Check(f"healthy, {known}: false alarms in {len(own)} runs, %", false, FALSE_ALARMS)
    own = of_actuators(found, CALIBRATED, faulted=True)
    right = percent(sum(item.right for item in own), len(own))
    yield Check(f"single and double faults, {CALIBRATED}: exactly the true alarms in {len(own)} runs, %", right, RIGHT, True)


def _fault_checks(found: Sequence[Found]) -> Iterator[Check]:
    of_calibrated, exact = of_actuators(found, CALIBRATED, faulted=True), of_part(found, "exact")
    for kind in ERRORS:
        own = present(of_calibrated, kind)
        yield Check(f"{kind}: 95 % intervals that cover the truth, of {len(own)}, %", coverage(own), COVERED[0], True)
        if len(own) >= MANY:
            yield Check(f"{kind}: 95 % intervals that cover the truth, at most, %", coverage(own), COVERED[1])
    for kind, most in ERRORS.items():
        yield Check(f"{kind}, {CALIBRATED}: median error, % of its range", median_error(present(of_calibrated, kind)), most)
    for kind in ERRORS:
        ratio = median_error(present(exact, kind)) / (bound(exact, kind) or math.nan)
        yield Check(f"{kind}, exact: median error / that at Cramer and Rao's bound", ratio, NEAR_BOUND)


def _other_checks(found: Sequence[Found]) -> Iterator[Check]:
    effects, rare = of_part(found, "effects"), of_part(found, "rare")
    if effects:
        right = sum(item.right for item in effects)
        yield Check(f"sensor effects and loads: right of {len(effects)}", right, len(effects), True)
    if rare:
        right = sum(told(item) != "wrong" for item in rare)
        yield Check(f"rare faults: right, or in a group that holds them, of {len(rare)}", right, len(rare), True)


def _time_checks(found: Sequence[Found], calibrations: Sequence[Mapping[str, Any]]) -> Iterator[Check]:
    times = [item.seconds for item in found]
    yield Check("seconds a diagnosis, on one core, median", _median(times), SECONDS)
    own = [float(item["seconds"]) for item in calibrations]
    yield Check("seconds a calibration of two runs, on one core, median", _median(own), CALIBRATION_SECONDS)


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan


def tables(found: Sequence[Found]) -> list[Table]:
    """What the checks are made of: alarms, each fault, each effect and each rare fault; without those that have no rows."""
    every = [_alarms(found), _faults(found), _effects(found), _rare(found), _confusion(found)]
    return [table for table in every if table[2]]


def _alarms(found: Sequence[Found]) -> Table:
    rows: Rows = []
    for known, faulted in ((CALIBRATED, False), (SHEET, False), (CALIBRATED, True)):
        own = of_actuators(found, known, faulted=faulted)
        if own:
            counts = (
                sum(item.right for item in own),
                sum(bool(set(item.alarms) - item.job.faults) for item in own),
                sum(item.explained and bool(item.job.faults - set(item.alarms)) for item in own),
                sum(not item.explained for item in own),
                sum("not identifiable" in item.verdict for item in own),
            )
            rows.append((f"{'faulted' if faulted else 'healthy'}, {known}", str(len(own)), *map(str, counts)))
    heads = ("Random actuators", "runs", "right", "false alarm", "missed", UNEXPLAINED, "some said to be open")
    return "Alarms", heads, rows


def _faults(found: Sequence[Found]) -> Table:
    of_calibrated, exact = of_actuators(found, CALIBRATED, faulted=True), of_part(found, "exact")
    rows: Rows = []
    for kind in ERRORS:
        own, best = present(of_calibrated, kind), present(exact, kind)
        figures = [_text(median_error(own)), _text(coverage(own), 0), str(len(best)), _text(median_error(best))]
        limit = bound(exact, kind)
        ratio = median_error(best) / (limit or math.nan)
        if own or best:
            rows.append((kind, str(len(own)), *figures, _text(limit), _text(ratio, 2)))
    heads = ("Fault", "calibrated", "error", "covered, %", "exact", "error", "at the bound", "ratio")
    return "Median errors in % of each fault's range, in runs that have it", heads, rows


def _text(value: float, digits: int = 3) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _effects(found: Sequence[Found]) -> Table:
    own = of_part(found, "effects")
    rows: Rows = [
        (item.job.effect, _named(item.job.faults), "right" if item.right else "WRONG", _said(item))
        for item in sorted(own, key=lambda item: item.job.case.number)
    ]
    return "Sensor effects and unknown loads", ("Effect", "there", "", "told"), rows


def _rare(found: Sequence[Found]) -> Table:
    rows: Rows = []
    for item in sorted(of_part(found, "rare"), key=lambda item: item.job.case.number):
        (name,) = item.job.faults
        how = told(item)
        rows.append((f"{name} = {RARE[name]:g}", how.upper() if how == "wrong" else how, _said(item)))
    return "Rare faults", ("There", "", "told"), rows


def _named(faults: Iterable[str]) -> str:
    return ", ".join(name for name in (*FAULTS, "open_switch") if name in set(faults)) or NOTHING


def _said(item: Found) -> str:
    if not item.explained:
        return item.verdict
    values = {out.fault: out.value for out in item.outcomes}
    named = ", ".join(f"{name} = {values[name]:.4g}" if name in values else name for name in item.alarms)
    return named or NOTHING


def confusion(found: Iterable[Found]) -> dict[tuple[str, str], int]:
    """(what is there, what is told) -> how often, in runs of random actuators and of effects: each true fault with itself if
    it is told, else with what is told in its place; what is told beside, with nothing."""
    counts: dict[tuple[str, str], int] = {}
    for item in found:
        if item.job.part not in ("actuators", "effects"):
            continue
        for pair in _pairs(item):
            counts[pair] = counts.get(pair, 0) + 1
    return counts


def _pairs(item: Found) -> list[tuple[str, str]]:
    there = [name for name in FAULTS if name in item.job.faults]
    if not item.explained:
        return [(name, UNEXPLAINED) for name in there or [NOTHING]]
    alarms = list(item.alarms)
    missed, beside = [name for name in there if name not in alarms], [name for name in alarms if name not in there]
    pairs = [(name, name) for name in there if name in alarms]
    for place in range(max(len(missed), len(beside))):
        true = missed[place] if place < len(missed) else NOTHING
        pairs.append((true, beside[place] if place < len(beside) else NOTHING))
    return pairs or [(NOTHING, NOTHING)]


def labels(counts: Mapping[tuple[str, str], int]) -> tuple[list[str], list[str]]:
    """Rows and columns of the confusion matrix, in the order of the faults."""
    order = [NOTHING, *FAULTS, "open_switch", UNEXPLAINED]
    there, said = {true for true, _ in counts}, {name for _, name in counts}
    return [name for name in order if name in there], [name for name in order if name in said]


def _confusion(found: Sequence[Found]) -> Table:
    counts = confusion(found)
    there, said = labels(counts)
    rows: Rows = [(true, *(str(counts.get((true, name), "")) for name in said)) for true in there]
    return "There (rows) and told (columns)", ("", *said), rows

"""What the identification bench finds over all cases: errors by fault, and the limits that this project sets itself."""

import math
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from harness.bench.evolution import Evolved
from harness.bench.identify import IdentifiedCase, Outcome
from harness.bench.speed import Check
from harness.faults import ESTIMATED


def outcomes_by_scope(found: Sequence[IdentifiedCase], fidelity: str, fault: str) -> dict[str, list[Outcome]]:
    """The outcomes of one fault with one fidelity: in all runs, and in those that have it; the rest flatter a median."""
    outcomes = [out for item in found if item.fidelity == fidelity for out in item.outcomes if out.fault == fault]
    return {"all runs": outcomes, "runs with it": [out for out in outcomes if out.present]}


def identifiable_errors(outcomes: Sequence[Outcome]) -> tuple[list[float], float]:
    """Of the outcomes that were said to be identifiable: their errors [% of a span], and how many intervals cover [%]."""
    known = [out for out in outcomes if out.identifiable]
    covered = 100.0 * sum(out.covered for out in known) / len(known) if known else math.nan
    return [100.0 * out.error for out in known], covered


def checks(found: Sequence[IdentifiedCase], others: Sequence[Evolved]) -> list[Check]:
    """The limits that this project sets itself, for ELF+; errors in all runs, and in those that have the fault."""
    listed = []
    for fault in ESTIMATED:
        for scope, outcomes in outcomes_by_scope(found, "ELF+", fault).items():
            errors, covered = identifiable_errors(outcomes)
            if not errors:
                continue
            listed += [
                Check(f"{fault}, {scope}: median error, % of its range", float(np.median(errors)), 1.0),
                Check(f"{fault}, {scope}: 95th percentile, % of its range", float(np.percentile(errors, 95)), 5.0),
            ]
            if scope == "all runs":
                listed.append(Check(f"{fault}: 95 % intervals that cover the truth, %", covered, 85.0, True))
    elf = [item for item in found if item.fidelity == "ELF+"]
    sound = [item for item in elf if not item.case.truth]
    listed += [
        Check("healthy runs with a false alarm", sum(any(out.alarm for out in item.outcomes) for item in sound), 0),
        Check("runs that ELF+ is said not to explain", sum(not item.explained for item in elf), 0),
        Check("seconds a case on one core, median", float(np.median([item.seconds for item in elf])), 5.0),
    ]
    if others:
        ratio = float(np.median([item.evaluations / item.least_squares for item in others]))
        listed.append(Check("evaluations of differential evolution / of the least squares, median", ratio, 10.0, True))
    return listed


def as_dict(found: Sequence[IdentifiedCase], others: Sequence[Evolved], listed: Sequence[Check]) -> dict[str, object]:
    """For JSON: `listed` are the `checks`."""
    return {
        "cases": [item.as_dict() for item in found],
        "differential_evolution": [asdict(item) for item in others],
        "checks": [check.as_dict() for check in listed],
    }

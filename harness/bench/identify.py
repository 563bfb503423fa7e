"""Identification put to the test: cases with known faults, identified with two fidelities and compared with the truth."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from harness.bench.cases import Case, cases, measure
from harness.bench.evolution import Evolved, evolve
from harness.faults import ESTIMATED, FAULTS, THRESHOLD
from harness.fidelity import FIDELITIES
from harness.identification.diagnosis import Diagnosis, identify
from harness.identification.estimates import Estimate
from harness.parallel import processes

TESTED = ("ELF+", "LF")
"""Fidelities that identify every case."""


@dataclass(frozen=True)
class Outcome:
    """One estimate in one case, with one fidelity as the model.

    `present`: whether the fault is there; for an angle, whether its fault is. `error`: |estimate - truth| in spans of the
    fault; for an angle, its error times the true amplitude, in spans of the amplitude. `covered`: whether the interval holds
    the truth. `missed`: no alarm though more than twice the alarm's threshold of health is lost; `false_alarm`: an alarm
    though nothing is lost.
    """

    case: int
    trial: str
    fidelity: str
    fault: str
    truth: float
    present: bool
    value: float
    error: float
    identifiable: bool
    covered: bool
    alarm: bool
    missed: bool
    false_alarm: bool

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return {"monitor" if name == "fidelity" else name: value for name, value in vars(self).items()}


@dataclass(frozen=True)
class IdentifiedCase:
    """A case identified with one fidelity; `seconds` on one core."""

    case: Case
    fidelity: str
    explained: bool
    evaluations: int
    seconds: float
    outcomes: list[Outcome]

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return {
            "case": vars(self.case),
            "monitor": self.fidelity,
            "explained": self.explained,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "outcomes": [outcome.as_dict() for outcome in self.outcomes],
        }


def identify_case(case: Case, fmus: Path, rate: float, parameters: Mapping[str, float]) -> list[IdentifiedCase]:
    """The case, measured at `rate` rows a second and identified with each of TESTED; `parameters`: the actuator's."""
    run = measure(case, fmus, rate, parameters)
    found = []
    for name in TESTED:
        diagnosis = identify(run, fmus=fmus, fidelity=FIDELITIES[name], parameters=parameters)
        explained, outcomes = not diagnosis.complaints, outcomes_of(case, diagnosis)
        found.append(IdentifiedCase(case, name, explained, diagnosis.evaluations, diagnosis.seconds, outcomes))
    return found


def outcomes_of(case: Case, diagnosis: Diagnosis) -> list[Outcome]:
    """An outcome for each estimate, in their order."""
    truth = {name: case.truth.get(name, parameter.healthy) for name, parameter in ESTIMATED.items()}

    def outcome(item: Estimate, error: float, covered: bool, lost: float) -> Outcome:
        return Outcome(
            case=case.number,
            trial=case.trial,
            fidelity=diagnosis.fidelity,
            fault=item.fault,
            truth=truth[item.fault],
            present=item.fault in case.truth,
            value=item.value,
            error=error,
            identifiable=item.identifiable,
            covered=covered,
            alarm=item.alarm,
            missed=lost > 2.0 * THRESHOLD and not item.alarm,
            false_alarm=item.alarm and lost == 0.0,
        )

    outcomes = []
    for name, fault in FAULTS.items():
        item = diagnosis.estimate(name)
        error, covered = abs(item.value - truth[name]) / fault.span, item.low <= truth[name] <= item.high
        outcomes.append(outcome(item, error, covered, 1.0 - fault.health(truth[name])))
        if fault.angle is not None:
            item = diagnosis.estimate(fault.angle.name)
            turn = (item.value - truth[item.fault] + math.pi) % (2.0 * math.pi) - math.pi
            error, covered = abs(turn * truth[name]) / fault.span, abs(turn) <= 0.5 * (item.high - item.low)
            outcomes.append(outcome(item, error, covered, 0.0))
    return outcomes


def run(
    fmus: Path,
    *,
    count: int,
    healthy: int,
    evolved: int,
    seed: int,
    rate: float,
    workers: int,
    parameters: Mapping[str, float] | None = None,
    on_case: Callable[[], object] = lambda: None,
) -> tuple[list[IdentifiedCase], list[Evolved]]:
    """All cases with each of TESTED, and the first `evolved` of them by differential evolution.

    `count` faulted and `healthy` healthy cases, at `rate` rows a second, in `workers` processes of one thread each (0: one a
    core); `parameters`: the actuator's, by port name; `on_case` is called after each.
    """
    own = dict(parameters or {})
    drawn = cases(count, healthy, seed)
    with processes(workers) as pool:
        identifying = [pool.submit(identify_case, case, fmus, rate, own) for case in drawn]
        evolving = [pool.submit(evolve, case, fmus, rate, own) for case in drawn[:evolved]]
        found = []
        for future in identifying:
            found.extend(future.result())
            on_case()
        others = []
        for other in evolving:
            others.append(other.result())
            on_case()
    return found, others

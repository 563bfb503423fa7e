"""Identification put to the test: HF as the plant with known faults and noise, each case identified by other fidelities.

Beside it differential evolution with the same model and the same sum of squares, as the literature on this actuator does it.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from ema_fmu_src import ports
from harness import trials
from harness.bench.speed import Check
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.identification import faults
from harness.identification.diagnosis import THRESHOLD, identify
from harness.identification.faults import FAULTS
from harness.identification.measured import CURRENT, Measured, measured
from harness.identification.model import Monitor
from harness.identification.search import Problem
from harness.parallel import processes

TRIALS = ("SIN", "STEP-RAMP", "CHIRP")
NOISE = {"position": 0.001, "motor_speed": 0.001, CURRENT: 0.01}
"""Standard deviation of the white noise, as a fraction of the channel's range."""
RANGES = {"friction": (1.0, 3.0), "backlash": (1.0, 100.0), "N": (0.7, 1.0), "zeta": (0.0, 0.15), "gain": (0.5, 1.5)}
MONITORS = ("ELF+", "LF")
POPULATION, GENERATIONS = 15, 160
"""Of differential evolution: SciPy's default population of 15 for each of the 8 coordinates, and when it is given up."""


@dataclass(frozen=True)
class Case:
    """One run: the trial, the true faults by short name (those not named are healthy), the seed of its noise."""

    number: int
    trial: str
    truth: dict[str, float]
    seed: int


@dataclass(frozen=True)
class Outcome:
    """One fault of one case as a monitor has it.

    `present`: whether the fault is there (phi: whether zeta is not 0). `error`: |estimate - truth| over the fault's span
    (phi: the angle's error times the true zeta, over zeta's span).
    """

    case: int
    trial: str
    monitor: str
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


@dataclass(frozen=True)
class Identified:
    """A case identified with one monitor; seconds on one core."""

    case: Case
    monitor: str
    explained: bool
    evaluations: int
    seconds: float
    outcomes: list[Outcome]


@dataclass(frozen=True)
class Evolved:
    """Differential evolution on a case: evaluations until its sum of squares was as low as that of the least squares, within
    half a percent; `reached` False if it was given up before.

    `least_squares`: evaluations of the latter. `error`, `least_squares_error`: the largest over the coordinates of
    |estimate - truth|, in spans, of both.
    """

    case: int
    trial: str
    evaluations: int
    reached: bool
    error: float
    least_squares: int
    least_squares_error: float


def cases(count: int, healthy: int, seed: int) -> list[Case]:
    """`count` faulted cases, every other with a single fault, the rest with two or three; then `healthy` ones."""
    rng = np.random.default_rng(seed)
    drawn = []
    for number in range(count):
        kinds = rng.choice(list(RANGES), size=1 if number % 2 == 0 else int(rng.integers(2, 4)), replace=False)
        truth: dict[str, float] = {}
        for kind in kinds:
            value = float(rng.uniform(*RANGES[kind]))
            name = str(rng.choice(["N_a", "N_b", "N_c"])) if kind == "N" else str(kind)
            truth[name] = value
        if "zeta" in truth:
            truth["phi"] = float(rng.uniform(-math.pi, math.pi))
        drawn.append(Case(number, TRIALS[number % len(TRIALS)], truth, int(rng.integers(2**32))))
    sound = [Case(count + n, TRIALS[n % len(TRIALS)], {}, int(rng.integers(2**32))) for n in range(healthy)]
    return drawn + sound


def measure(case: Case, fmus: Path, rate: float) -> Measured:
    """HF flown with the case's faults, its outputs noisy, at `rate` rows a second."""
    trial = trials.trial(case.trial)
    outputs = [port for port in ports.OUTPUTS if port.name in NOISE]
    with Twin(fmus / FIDELITIES["HF"].fmu) as plant:
        values, _ = plant.record(trial, faults.to_parameters(faults.from_values(case.truth)), outputs)
    every = round(1.0 / (rate * trial.step))
    values, time = values[::every], trial.time[::every]
    sigma = np.ptp(values, axis=0) * [NOISE[port.name] for port in outputs]
    noisy = values + np.random.default_rng(case.seed).normal(size=values.shape) * sigma
    channels = {name: noisy[:, [port.name for port in outputs].index(name)] for name in NOISE}
    return measured(case.trial, time, {"command": trial.inputs["command"][::every]}, channels, {}, where=case.trial)


def run_case(case: Case, fmus: Path, rate: float) -> list[Identified]:
    """The case, identified with each of MONITORS."""
    run = measure(case, fmus, rate)
    truth = {name: case.truth.get(name, fault.healthy) for name, fault in FAULTS.items()}
    found = []
    for monitor in MONITORS:
        diagnosis = identify(run, fmus=fmus, monitor=FIDELITIES[monitor])
        outcomes = []
        for item in diagnosis.estimates:
            fault = FAULTS[item.fault]
            off = item.value - truth[item.fault]
            span = fault.span
            covered = bool(item.low <= truth[item.fault] <= item.high)
            if item.fault == "phi":
                off = (off + math.pi) % (2.0 * math.pi) - math.pi
                covered = bool(abs(off) <= 0.5 * (item.high - item.low))
                off, span = off * truth["zeta"], FAULTS["zeta"].span
            lost = 1.0 - fault.health(truth[item.fault])
            outcomes.append(
                Outcome(
                    case.number,
                    case.trial,
                    monitor,
                    item.fault,
                    truth[item.fault],
                    item.fault in case.truth,
                    item.value,
                    abs(off) / span,
                    item.identifiable,
                    covered,
                    item.alarm,
                    missed=lost > 2.0 * THRESHOLD and not item.alarm,
                    false_alarm=item.alarm and lost == 0.0,
                )
            )
        found.append(Identified(case, monitor, not diagnosis.complaints, diagnosis.evaluations, diagnosis.seconds, outcomes))
    return found


def evolve(case: Case, fmus: Path, rate: float) -> Evolved:
    """Differential evolution on the case with ELF+, over the same coordinates, until it is as good as the least squares."""
    run = measure(case, fmus, rate)
    diagnosis = identify(run, fmus=fmus, monitor=FIDELITIES["ELF+"])
    with Monitor(fmus, FIDELITIES["ELF+"], run, {}) as model:
        problem = Problem(model, run)
        goal = 1.005 * problem.cost(diagnosis.fit.z)
        bounds = list(zip(faults.scaled(np.array([1, 1, 0.7, 0.7, 0.7, -0.15, -0.15, 0.5])),
                          faults.scaled(np.array([3, 100, 1, 1, 1, 0.15, 0.15, 1.5])), strict=True))  # fmt: skip
        model.evaluations = 0
        reached: list[tuple[int, np.ndarray]] = []

        def counted(z: np.ndarray) -> float:
            value = problem.cost(z)
            if value <= goal and not reached:
                reached.append((model.evaluations, z.copy()))
            return value

        last = differential_evolution(
            counted,
            bounds,
            popsize=POPULATION,
            maxiter=GENERATIONS,
            polish=False,
            rng=case.seed,
            callback=lambda *_, **__: bool(reached),
        )
        evaluations, best = reached[0] if reached else (model.evaluations, last.x)
    errors = [float(np.max(np.abs(z - faults.from_values(case.truth)))) for z in (best, diagnosis.fit.z)]
    return Evolved(case.number, case.trial, evaluations, bool(reached), errors[0], diagnosis.evaluations, errors[1])


def run(
    fmus: Path,
    *,
    count: int,
    healthy: int,
    evolved: int,
    seed: int,
    rate: float,
    workers: int,
    on_case: Callable[[], object] = lambda: None,
) -> tuple[list[Identified], list[Evolved]]:
    """All cases, in `workers` processes of one thread each; `on_case` is called after each."""
    drawn = cases(count, healthy, seed)
    with processes(workers) as pool:
        started = [pool.submit(run_case, case, fmus, rate) for case in drawn]
        beside = [pool.submit(evolve, case, fmus, rate) for case in drawn[:evolved]]
        found = []
        for future in started:
            found.extend(future.result())
            on_case()
        others = []
        for other in beside:
            others.append(other.result())
            on_case()
    return found, others


def of(found: list[Identified], monitor: str, fault: str) -> list[Outcome]:
    """The outcomes of one fault with one monitor."""
    return [out for item in found if item.monitor == monitor for out in item.outcomes if out.fault == fault]


def by_scope(found: list[Identified], monitor: str, fault: str) -> dict[str, list[Outcome]]:
    """The same, in all runs, and in those that have the fault: healthy ones flatter a median."""
    outcomes = of(found, monitor, fault)
    return {"all runs": outcomes, "runs with it": [out for out in outcomes if out.present]}


def told(outcomes: list[Outcome]) -> tuple[list[float], float]:
    """Where the fault was said to be identifiable: errors [% of its range], and the part of intervals that cover [%]."""
    known = [out for out in outcomes if out.identifiable]
    covered = 100.0 * sum(out.covered for out in known) / len(known) if known else math.nan
    return [100.0 * out.error for out in known], covered


def checks(found: list[Identified], others: list[Evolved]) -> list[Check]:
    """The limits that this project sets itself, for ELF+; errors in all runs, and in those where the fault is present."""
    listed = []
    for fault in FAULTS:
        for scope, outcomes in by_scope(found, "ELF+", fault).items():
            errors, covered = told(outcomes)
            if not errors:
                continue
            listed += [
                Check(f"{fault}, {scope}: median error, % of its range", float(np.median(errors)), 1.0),
                Check(f"{fault}, {scope}: 95th percentile, % of its range", float(np.percentile(errors, 95)), 5.0),
            ]
            if scope == "all runs":
                listed.append(Check(f"{fault}: 95 % intervals that cover the truth, %", covered, 85.0, True))
    elf = [item for item in found if item.monitor == "ELF+"]
    sound = [item for item in elf if not item.case.truth]
    listed += [
        Check("healthy runs with a false alarm", sum(any(o.alarm for o in item.outcomes) for item in sound), 0),
        Check("runs that ELF+ is said not to explain", sum(not item.explained for item in elf), 0),
        Check("seconds a case on one core, median", float(np.median([item.seconds for item in elf])), 5.0),
    ]
    if others:
        ratio = float(np.median([item.evaluations / item.least_squares for item in others]))
        listed.append(Check("evaluations of differential evolution / of the least squares, median", ratio, 10.0, True))
    return listed


def as_dict(found: list[Identified], others: list[Evolved], listed: list[Check]) -> dict[str, object]:
    """For JSON."""
    return {
        "cases": [asdict(item) for item in found],
        "differential_evolution": [asdict(item) for item in others],
        "checks": [check.as_dict() for check in listed],
    }

"""The cases on random actuators and beside them: which there are, and what the diagnosis says in each."""

import math
import os
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from harness import trials
from harness.actuators.actuator import DEFAULT, Actuator
from harness.bench import hidden
from harness.bench.cases import COMMON_KINDS, Case, as_measured, flown, noisy, ports_of
from harness.bench.effects import EFFECTS, Effect
from harness.bench.hidden import seed_of
from harness.bench.identify import Outcome, outcomes_of
from harness.bench.kept import Kept
from harness.errors import HarnessError
from harness.faults import FAULTS, Fault
from harness.fidelity import FIDELITIES
from harness.identification.diagnosis import Diagnosis, identify
from harness.inference import coordinates
from harness.inference.unknowns import N_FAULTS
from harness.parallel import processes

TRIAL = "CHIRP"
WAY = (0.1, 0.6)
"""How far a fault has gone from healthy to its limit: least and most."""
PARTS = ("actuators", "effects", "rare", "exact")
"""Cases of random actuators; then, with the default one known exactly: what sensors do, rare faults, single faults."""
EXACT, SHEET, CALIBRATED = "exact", "data sheet", "calibrated"
"""What the diagnosis knows of the actuator."""
WITH_EFFECT: tuple[dict[str, float], ...] = ({}, {"N_a": 0.85, "friction": 1.5})
"""Faults with which each effect is tried."""
RARE = {"resistance": 1.4, "magnet": 0.9, "current_offset_a": 0.3, "resolver_offset": 0.05, "jam": 0.03}
"""The rare faults that are tried, each alone."""


@dataclass(frozen=True)
class Job:
    """A case to be identified: `name`, that of its file; one of PARTS; what is `known` of the actuator, the random one of
    number `actuator`, or the default one; and the name of an effect, if there is one."""

    name: str
    part: str
    case: Case
    known: str = EXACT
    actuator: int | None = None
    effect: str = ""

    @property
    def faults(self) -> set[str]:
        """Short names of the faults that are there."""
        return {name for name in self.case.truth if name in FAULTS}

    @property
    def waits(self) -> bool:
        """Whether a calibration has to be there first."""
        return self.known == CALIBRATED


@dataclass(frozen=True)
class Found:
    """What the diagnosis says in a job.

    `alarms`: short names of faults, an open switch among them; `outcomes`: of every estimate, none if the run was refused;
    `alternatives`, `groups`: names of what explains the run as well, and of what it cannot tell apart. `bound`: of a single
    fault, Cramer and Rao's bound on its standard deviation, in spans; None for other jobs. `distance`: of a random actuator
    from nominal, in standard deviations. `seconds`: of one core.
    """

    job: Job
    explained: bool
    verdict: str
    alarms: tuple[str, ...] = ()
    outcomes: tuple[Outcome, ...] = field(default=(), repr=False)
    alternatives: tuple[tuple[str, ...], ...] = ()
    groups: tuple[tuple[str, ...], ...] = ()
    bound: float | None = None
    distance: float | None = None
    seconds: float = 0.0

    @property
    def right(self) -> bool:
        """Whether the alarms are exactly the faults that are there."""
        return self.explained and set(self.alarms) == self.job.faults

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The inverse of `as_dict`."""
        job = Job(**{**content["job"], "case": Case(**content["job"]["case"])})
        tuples = {name: tuple(map(tuple, content[name])) for name in ("alternatives", "groups")}
        outcomes = tuple(Outcome(**item) for item in content["outcomes"])
        return cls(**{**content, **tuples, "job": job, "outcomes": outcomes, "alarms": tuple(content["alarms"])})


def jobs(actuators: int, exact: int, seed: int, parts: Collection[str] = PARTS) -> list[Job]:
    """All jobs of `parts`: with `actuators` random actuators, and `exact` single faults of each common kind."""
    listed = {"effects": _with_effects(seed), "rare": _rare(seed), "exact": _exact(exact, seed)}
    listed["actuators"] = [job for number in range(actuators) for job in _of_actuator(number, seed)]
    return [job for part, own in listed.items() if part in parts for job in own]


def _case(number: int, truth: Mapping[str, float], *where: int) -> Case:
    return Case(number, TRIAL, dict(truth), seed_of(*where))


def _with_effects(seed: int) -> list[Job]:
    found = []
    for place, effect in enumerate(EFFECTS):
        for faulted, truth in enumerate(WITH_EFFECT):
            case = _case(2 * place + faulted, truth, seed, place, faulted, 1)
            found.append(Job(f"effect-{place:02d}-{'faulted' if faulted else 'healthy'}", "effects", case, effect=effect))
    return found


def _rare(seed: int) -> list[Job]:
    return [
        Job(f"rare-{name}", "rare", _case(place, {name: value}, seed, place, 2))
        for place, (name, value) in enumerate(RARE.items())
    ]


def _exact(count: int, seed: int) -> list[Job]:
    found = []
    for number in range(count):
        for place, (kind, members) in enumerate(COMMON_KINDS.items()):
            where = seed, number, place, 3
            truth = _drawn(members, np.random.default_rng(seed_of(*where, 0)))
            found.append(Job(f"exact-{kind}-{number:03d}", "exact", _case(number, truth, *where)))
    return found


def _of_actuator(number: int, seed: int) -> list[Job]:
    rng = np.random.default_rng(seed_of(seed, number, 4))
    truths = {"healthy": {}, "sheet": {}, "single": _faults(1, rng), "double": _faults(2, rng)}
    return [
        Job(
            name=f"actuator-{number:03d}-{label}",
            part="actuators",
            case=_case(number, truth, seed, number, place, 4),
            known=SHEET if label == "sheet" else CALIBRATED,
            actuator=number,
        )
        for place, (label, truth) in enumerate(truths.items())
    ]


def _faults(count: int, rng: np.random.Generator) -> dict[str, float]:
    """So many faults of different common kinds."""
    kinds = rng.choice(list(COMMON_KINDS), size=count, replace=False)
    return {name: value for kind in kinds for name, value in _drawn(COMMON_KINDS[str(kind)], rng).items()}


def _drawn(members: Sequence[Fault], rng: np.random.Generator) -> dict[str, float]:
    """One of these faults, to either side if it may go there, with its angle if it has one."""
    fault = members[int(rng.integers(len(members)))]
    limit = fault.limit_towards(fault.healthy + fault.span * float(rng.choice([-1.0, 1.0])))
    truth = {fault.name: fault.healthy + float(rng.uniform(*WAY)) * (limit - fault.healthy)}
    if fault.angle is not None:
        truth[fault.angle.name] = float(rng.uniform(-math.pi, math.pi))
    return truth


def do(job: Job, kept: Kept, fmus: Path) -> None:
    """Do the job, and keep what was found."""
    started = time.process_time()
    own = {} if job.actuator is None else hidden.hidden(job.actuator, kept.seed)
    try:
        found = _identified(job, own, _known(job, kept), fmus, kept.rate)
    except HarnessError as error:
        found = Found(job, False, f"refused: {error}")
    far = hidden.distance(own) if own else None
    kept.write(job.name, replace(found, distance=far, seconds=time.process_time() - started).as_dict())


def _known(job: Job, kept: Kept) -> Actuator:
    if job.known == EXACT:
        return DEFAULT
    if job.known == SHEET or job.actuator is None:
        return hidden.data_sheet()
    return hidden.known(kept.calibration(job.actuator))


def _identified(job: Job, own: Mapping[str, float], actuator: Actuator, fmus: Path, rate: float) -> Found:
    case, effect = job.case, EFFECTS[job.effect] if job.effect else Effect()
    trial = trials.trial(case.trial)
    if effect.load is not None:
        trial = replace(trial, inputs={**trial.inputs, "load_torque": effect.load(trial.time)})
    table = noisy(flown(trial, fmus, rate, {**own, **ports_of(case.truth)}), case.seed)
    run = as_measured(case.trial, effect.logged(table, np.random.default_rng(seed_of(case.seed, 1))), actuator.parameters)
    said = identify(run, fmus=fmus, fidelity=FIDELITIES["ELF+"], parameters=actuator.parameters, actuator=actuator)
    alarms = [item.fault for item in said.estimates if item.alarm]
    if said.open_switch:
        alarms.append("open_switch")
    return Found(
        job=job,
        explained=not said.complaints,
        verdict=said.verdict,
        alarms=tuple(alarms),
        outcomes=tuple(outcomes_of(case, said)),
        alternatives=tuple(tuple(other["faults"]) for other in said.alternatives),
        groups=tuple(tuple(group.members) for group in said.groups),
        bound=_bound(job, said) if job.part == "exact" else None,
    )


def _bound(job: Job, said: Diagnosis) -> float | None:
    """Cramer and Rao's bound on the standard deviation of the job's single fault, in spans: from the information at the best
    explanation, with this fault and the nuisances free. Of an amplitude with an angle, along the true direction. None if the
    run says nothing of it."""
    (name,) = job.faults
    around, dead = said.explained.around, said.explained.problem.dead
    places = coordinates.PLACES[name]
    free = around.free & ~dead
    free[:N_FAULTS] = False
    free[places] = around.free[places] & ~dead[places]
    if not free[places].all():
        return None
    along = coordinates.from_values(job.case.truth)[places]
    along /= np.linalg.norm(along)
    hessian = around.hessian.copy()
    hessian[np.ix_(places, places)] = around.data[np.ix_(places, places)]  # without the pull towards healthy
    covariance = replace(around, hessian=hessian).covariance(free)[np.ix_(places, places)]
    return float(np.sqrt(along @ covariance @ along))


def calibrate(number: int, kept: Kept, fmus: Path) -> None:
    """Calibrate the random actuator `number`, and keep what was found."""
    started = time.process_time()
    found = hidden.calibrated(number, kept.seed, fmus, kept.rate)
    kept.write_calibration(number, {**found, "seconds": time.process_time() - started})


def missing(listed: Sequence[Job], kept: Kept) -> tuple[list[Job], list[int]]:
    """The jobs that are not yet done, and the actuators that have to be calibrated for them."""
    todo = [job for job in listed if not kept.has(job.name)]
    numbers = dict.fromkeys(job.actuator for job in todo if job.waits and job.actuator is not None)
    return todo, [number for number in numbers if not kept.has_calibration(number)]


def run(
    listed: Sequence[Job], kept: Kept, fmus: Path, *, workers: int, on_case: Callable[[], object] = lambda: None
) -> None:
    """Do the jobs that are `missing`, in `workers` processes of one thread each (0: one a core); `on_case` is called after
    each, calibrations too. What is interrupted is done anew by the next call, the rest is kept."""
    todo, numbers = missing(listed, kept)
    blocked = {number: [job for job in todo if job.waits and job.actuator == number] for number in numbers}
    waiting = {job.name for own in blocked.values() for job in own}
    ready: deque[Job | int] = deque([job for job in todo if job.name not in waiting])
    ready.extend(numbers)
    with processes(workers) as pool:
        running: dict[Future[None], Job | int] = {}
        while ready or running:
            while ready and len(running) < 2 * (workers or os.cpu_count() or 1):
                step = ready.popleft()
                work = (
                    pool.submit(calibrate, step, kept, fmus) if isinstance(step, int) else pool.submit(do, step, kept, fmus)
                )
                running[work] = step
            for work in wait(running, return_when=FIRST_COMPLETED).done:
                work.result()
                step = running.pop(work)
                ready.extendleft(reversed(blocked[step]) if isinstance(step, int) else [])
                on_case()

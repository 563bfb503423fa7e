"""Wall time of every fidelity per simulated second, and its errors against HF at a fixed step of 1e-7 s."""

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path

import xarray as xr

from harness.actuators.actuator import DEFAULT, Actuator
from harness.comparison import compare
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.trials import BUILT_IN, PAPER, trial

VARIABLES = ("position", "motor_speed", "equivalent_current_filtered")
REFERENCE = "HF fixed 1e-7 s"
AS_ACCURATE = "HF fixed 1e-6 s"
"""The fixed step with which HF is about as accurate as from event to event: what that gains at equal accuracy."""
MODES: dict[str, tuple[str, dict[str, float]]] = {
    REFERENCE: ("HF", {"solver.event_located": 0.0, "solver.step": 1e-7}),
    AS_ACCURATE: ("HF", {"solver.event_located": 0.0, "solver.step": 1e-6}),
    "HF": ("HF", {}),
    "ELF": ("ELF", {}),
    "ELF+": ("ELF+", {}),
    "LF": ("LF", {}),
}
"""Rows of the table: name -> fidelity, and the parameters set for it."""
PAPER_TIMES = {"HF": "180 s, 17.5 s accelerated", "ELF": "1.8 s, 0.8 s accelerated"}
"""The paper's wall times (Simulink, i7-9750H) of a run whose duration it does not give."""
CHANGES: dict[str, dict[str, float]] = {
    "supply 36 V": {"supply_voltage": 36.0},
    "current limit 20 A": {"controller.current_limit": 20.0},
    "R = 2 Ohm": {"motor.R": 2.0},
    "N_a = 0.7": {"fault.N_a": 0.7},
    "zeta = 0.1": {"fault.zeta": 0.1},
}
FAULTY = ("N_a = 0.7", "zeta = 0.1")
"""Those of CHANGES that are faults."""


@dataclass(frozen=True)
class Row:
    """One mode in one trial: wall time per simulated second [s], and over HF's; NRMSE by variable.

    Both are medians of several rounds, in each of which all modes are flown one after another: `relative` compares
    neighbours, so that a machine whose speed drifts does not part them. The reference itself has no errors.
    """

    trial: str
    mode: str
    wall: float
    relative: float
    errors: dict[str, float | None]


@dataclass(frozen=True)
class Check:
    """One figure with the limit that this project sets itself."""

    what: str
    value: float
    limit: float
    at_least: bool = False

    @property
    def met(self) -> bool:
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def as_dict(self) -> dict[str, object]:
        return asdict(self) | {"met": self.met}


@dataclass
class Speed:
    """What was measured: rows of the table, and errors with one parameter changed."""

    rows: list[Row] = field(default_factory=list)
    changed: dict[tuple[str, str, str], dict[str, float | None]] = field(default_factory=dict)
    """(what is changed, trial, mode) -> errors against the fixed-step HF with the same change."""

    def row(self, name: str, mode: str) -> Row:
        """The row of the trial `name` in one mode."""
        return next(row for row in self.rows if (row.trial, row.mode) == (name, mode))

    def trials(self) -> list[str]:
        return list(dict.fromkeys(row.trial for row in self.rows))


def count_runs(trials: Sequence[str], repeats: int, actuator: Actuator = DEFAULT) -> int:
    """Number of runs that `measure` flies."""
    if not actuator.is_default:
        return len(trials) * repeats * len(MODES)
    changed = [name for name in ("SIN4", "SIN", "STEP-RAMP") if name in trials]
    extra = sum(len(CHANGES) if name == "SIN4" else len(FAULTY) for name in changed)
    return len(trials) * repeats * len(MODES) + 3 * extra


def measure(
    fmus: Path,
    trials: Sequence[str] = tuple(BUILT_IN),
    *,
    repeats: int = 5,
    actuator: Actuator = DEFAULT,
    on_run: Callable[[str], None] = lambda _: None,
) -> Speed:
    """Fly every mode of MODES in `trials` with the FMUs in the folder `fmus` on one core, in `repeats` rounds.

    What changes one parameter is flown for the default actuator alone. `on_run` is called with a description before each
    run.
    """
    speed = Speed()
    with ExitStack() as stack:
        twins = {name: stack.enter_context(Twin(fmus / chosen.fmu)) for name, chosen in FIDELITIES.items()}

        def fly(name: str, mode: str, also: Mapping[str, float] = {}) -> xr.Dataset:
            on_run(f"{name} {mode}")
            fidelity, parameters = MODES[mode]
            return twins[fidelity].run(
                trial(name), merged(FIDELITIES[fidelity], {**actuator.parameters, **parameters, **also})
            )

        for name in trials:
            runs = {mode: fly(name, mode) for mode in MODES}
            walls = [{mode: wall(run) for mode, run in runs.items()}]
            walls += [{mode: wall(fly(name, mode)) for mode in MODES} for _ in range(repeats - 1)]
            for mode, run in runs.items():
                median = statistics.median(of[mode] for of in walls)
                relative = statistics.median(of[mode] / of["HF"] for of in walls)
                errors = {} if mode == REFERENCE else errors_of(run, runs[REFERENCE])
                speed.rows.append(Row(name, mode, median, relative, errors))
        for name, changes in (("SIN4", tuple(CHANGES)), ("SIN", FAULTY), ("STEP-RAMP", FAULTY)):
            for change in changes if name in trials and actuator.is_default else ():
                reference = fly(name, REFERENCE, CHANGES[change])
                for mode in ("HF", "ELF+"):
                    speed.changed[change, name, mode] = errors_of(fly(name, mode, CHANGES[change]), reference)
    return speed


def wall(run: xr.Dataset) -> float:
    """Wall time per simulated second [s] of a run."""
    return float(run.attrs["wall_s"] / run.attrs["simulated_s"])


def errors_of(run: xr.Dataset, reference: xr.Dataset) -> dict[str, float | None]:
    """NRMSE of each of VARIABLES; None where it is not defined."""
    found = compare(run, reference, names=("candidate", "reference"))
    return {item.variable: item.nrmse for item in found if item.variable in VARIABLES}


def checks(speed: Speed) -> Iterator[Check]:
    """The limits that this project sets itself, for the trials that were flown."""
    position, motor_speed, current = VARIABLES
    for name in speed.trials():
        hf, plus, lf, fixed, accurate = (speed.row(name, mode) for mode in ("HF", "ELF+", "LF", REFERENCE, AS_ACCURATE))
        for variable, limit in ((position, 5e-4), (motor_speed, 5e-4), (current, 5e-3)):
            yield Check(f"{name}: HF, error of {variable}", hf.errors[variable] or 0.0, limit)
        yield Check(f"{name}: HF, wall s / simulated s", hf.wall, 0.020)
        yield Check(f"{name}: HF fixed 1e-7 s / HF, time", fixed.relative, 40.0, at_least=True)
        yield Check(f"{name}: HF fixed 1e-6 s (as accurate) / HF, time", accurate.relative, 4.0, at_least=True)
        yield Check(f"{name}: ELF+, error of position", plus.errors[position] or 0.0, 1.5e-3 if name == "SIN4" else 5e-4)
        if name == "SIN4":
            yield Check(f"{name}: ELF+, error of motor_speed", plus.errors[motor_speed] or 0.0, 2e-3)
            yield Check(f"{name}: ELF+, error of {current}", plus.errors[current] or 0.0, 5e-3)
        yield Check(f"{name}: ELF+, wall s / simulated s", plus.wall, 0.001)
        yield Check(f"{name}: HF / ELF+, time", 1.0 / plus.relative, 15.0, at_least=True)
        yield Check(f"{name}: HF fixed 1e-7 s / ELF+, time", fixed.relative / plus.relative, 1000.0, at_least=True)
        yield Check(f"{name}: LF, wall s / simulated s", lf.wall, 0.0005)
    for (change, name, mode), errors in speed.changed.items():
        if mode == "ELF+":
            spread = 2.0 * (speed.changed[change, name, "HF"][position] or 0.0)
            limit = 1e-3 if name in PAPER and name != "SIN4" else spread if change in FAULTY else 2e-3
            yield Check(f"{name}, {change}: ELF+, error of position", errors[position] or 0.0, limit)

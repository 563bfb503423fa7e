"""Cross-fidelity check: does every fidelity stay within its budget of the reference?"""

import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES, REFERENCE
from harness.actuators.actuator import DEFAULT as ACTUATOR
from harness.actuators.actuator import Actuator, Output
from harness.actuators.drive import chosen, is_oriented
from harness.comparison import Comparison
from harness.errors import HarnessError
from harness.files.reader import read_table
from harness.files.toml import read_toml
from harness.files.writers import FORMATS
from harness.flight.experiment import Experiment
from harness.flight.isolate import TIME_LIMIT, Isolated
from harness.logs.axes import axis_of
from harness.logs.convert import inside
from harness.logs.find import Found
from harness.logs.mapping import ColumnSpec
from harness.logs.trialfile import read_trial
from harness.parameters import merged
from harness.provenance import file_hash
from harness.trials import BUILT_IN, Trial, trial

ROTARY = ACTUATOR.output
DEFAULT = Path(__file__).with_name("budgets.toml")
ORIENTED = Path(__file__).with_name("budgets_oriented.toml")
"""Those of the default actuator with a field-oriented drive and space vectors."""
DRIVE = ("controller.current_control", "controller.current.bandwidth", "inverter.modulation")
"""In what that one may differ from the default actuator, within BANDWIDTHS [rad/s]: 100 Hz to 2 kHz, and what rounds."""
BANDWIDTHS = (2.0 * math.pi * 99.9, 2.0 * math.pi * 2001.0)
PEAK_FACTOR = 5.0
"""A budget is an rms: single points may differ by so many budgets before the trajectory has left its tube."""

TRIALS = "trials"
"""The table of a file of budgets that names trials of its own."""
Budgets = dict[str, dict[str, dict[str, float]]]
"""Trial -> fidelity -> variable -> NRMSE allowed."""


@dataclass(frozen=True)
class Verdict:
    """One variable of one fidelity in one trial.

    `budget` and `found`: NRMSE allowed (infinite: any) and found (None where there is nothing to compare with); `left` [s]:
    when the trajectory left its tube, None if it did not; `failure`: why the fidelity could not be flown; `wall` [s]: what
    its run took.
    """

    trial: str
    fidelity: str
    variable: str
    budget: float
    found: float | None = None
    left: float | None = None
    failure: str = ""
    wall: float | None = None

    def as_dict(self) -> dict[str, object]:
        """For JSON; the budget is None where there is none."""
        return {
            "trial": self.trial,
            "fidelity": self.fidelity,
            "variable": self.variable,
            "passed": self.passed,
            "nrmse": self.found,
            "budget": self.budget if self.judged else None,
            "left_s": self.left,
            "failure": self.failure,
            "wall_s": self.wall,
        }

    @property
    def judged(self) -> bool:
        """Whether there is a limit."""
        return math.isfinite(self.budget)

    @property
    def passed(self) -> bool:
        """Whether the budget is kept."""
        if not self.judged:
            return not self.failure
        return not self.failure and self.found is not None and self.found <= self.budget

    @property
    def line(self) -> str:
        """What is wrong, in one line."""
        where = f"{self.trial} {self.fidelity}"
        if self.failure:
            return f"{where}: {self.failure}"
        found = "nothing to compare with" if self.found is None else f"{100.0 * self.found:.4f} %"
        left = "" if self.left is None else f", left the tube at {self.left:.4f} s"
        return f"{where} {self.variable}: {found}, budget {100.0 * self.budget:.4f} %{left}"


def read_budgets(path: Path = DEFAULT) -> Budgets:
    """The budgets in a TOML file; HarnessError with a line for each mistake in it."""
    return _read(path)[0]


def read_trials(path: Path, output: Output = ROTARY) -> dict[str, Trial]:
    """The trials that the file of budgets brings, by name: those of its table `[trials]`, NAME = FILE, beside it; `output`:
    what moves at the user's side. HarnessError as from `read_budgets` and `read_trial`."""
    return {name: replace(read_trial(path.parent / file, output), name=name) for name, file in _read(path)[1].items()}


def _read(path: Path) -> tuple[Budgets, dict[str, str]]:
    content = read_toml(path)
    own = content.pop(TRIALS, {})
    problems = list(_problems_of_trials(own)) or list(_problems(content, own))
    if problems:
        raise HarnessError("; ".join(f"{path}: {problem}" for problem in problems))
    return content, own


def budgets_for(actuator: Actuator, parameters: Mapping[str, float]) -> Path | None:
    """The file with the budgets of `actuator`, of which `parameters` are flown; None if there is none for it."""
    if not is_oriented(parameters):
        return DEFAULT if actuator.is_default else None
    alike = all(actuator.value(name) == ACTUATOR.value(name) for name in actuator.parameters if name not in DRIVE)
    vectors = chosen(parameters, "inverter.modulation") == "space_vector" and actuator.output.lead is None
    low, high = BANDWIDTHS
    bandwidth = parameters.get("controller.current.bandwidth", ACTUATOR.value("controller.current.bandwidth"))
    return ORIENTED if alike and vectors and low <= bandwidth <= high else None


def without_limits(budgets: Budgets) -> Budgets:
    """The same trials, fidelities and variables, flown but held to nothing."""
    return {
        trial: {fidelity: dict.fromkeys(variables, math.inf) for fidelity, variables in fidelities.items()}
        for trial, fidelities in budgets.items()
    }


def _problems_of_trials(own: object) -> Iterator[str]:
    if not isinstance(own, dict):
        yield f"{TRIALS}: a table of lines NAME = FILE is needed"
        return
    for name, file in own.items():
        if name in BUILT_IN:
            yield f"[{TRIALS}] {name}: a trial of that name is built in; another name is needed"
        if not isinstance(file, str):
            yield f"[{TRIALS}] {name} = {file}: the path of a trial's file is needed"


def _problems(content: Mapping[str, Any], own: Mapping[str, str]) -> Iterator[str]:
    outputs = {port.name for port in ports.OUTPUTS}
    if not content:
        yield "no budgets; a table [TRIAL.FIDELITY] with lines VARIABLE = NRMSE is needed"
    for name, fidelities in content.items():
        if name not in BUILT_IN and name not in own:
            yield f"[{name}]: no such trial: {', '.join((*BUILT_IN, *own))}; [{TRIALS}] takes your own"
        if not isinstance(fidelities, dict):
            yield f"{name}: a table of fidelities is needed"
            continue
        for fidelity, variables in fidelities.items():
            if fidelity not in FIDELITIES:
                yield f"[{name}.{fidelity}]: no such fidelity: {', '.join(FIDELITIES)}"
            if not isinstance(variables, dict):
                yield f"[{name}] {fidelity}: a table of variables is needed"
                continue
            for variable, budget in variables.items():
                if variable not in outputs:
                    yield f"[{name}.{fidelity}] {variable}: no such output: see ema ports"
                if not isinstance(budget, int | float) or isinstance(budget, bool) or not 0.0 <= budget < float("inf"):
                    yield f"[{name}.{fidelity}] {variable} = {budget}: a number from 0 on is needed"


def check(
    budgets: Budgets,
    *,
    fmus: Path,
    reference: Path | None = None,
    stored: Path | None = None,
    parameters: Mapping[str, float] | None = None,
    time_limit: float = TIME_LIMIT,
    output: Output = ROTARY,
    trials: Mapping[str, Trial] | None = None,
) -> tuple[list[Verdict], Experiment]:
    """Fly what `budgets` names with the FMUs in the folder `fmus`, each in a process of its own.

    The reference is the reference fidelity's FMU there, the FMU `reference`, or the CSV files TRIAL_HF.csv in the folder
    `stored` (which `ema run` writes; of a linear actuator, whose `output` is given, in m and N). `trials`: by name,
    those that are not built in. Returns a verdict for each
    budget, and the runs for a page. A fidelity that fails is a verdict; HarnessError if the reference cannot be flown or
    read.
    """
    verdicts: list[Verdict] = []
    experiment = Experiment({}, (), "reference" if reference or stored else REFERENCE.name)
    with ExitStack() as stack:
        opened: dict[Path, Isolated] = {}

        def flown(path: Path, name: str, settings: Mapping[str, float], fidelity: str) -> xr.Dataset:
            if path not in opened:
                opened[path] = stack.enter_context(Isolated(path, time_limit=time_limit))
            own = (trials or {}).get(name) or trial(name)
            return opened[path].run(own, settings).assign_attrs(fidelity=fidelity)

        for name, fidelities in budgets.items():
            if stored:
                expected = _stored(stored, name, output).assign_attrs(fidelity=experiment.reference)
            elif reference:
                expected = flown(reference, name, parameters or {}, experiment.reference)
            else:
                expected = flown(fmus / REFERENCE.fmu, name, merged(REFERENCE, parameters), experiment.reference)
            experiment = experiment.with_run(expected)
            for fidelity, allowed in fidelities.items():
                chosen = FIDELITIES[fidelity]
                try:
                    run = flown(fmus / chosen.fmu, name, merged(chosen, parameters), fidelity)
                    experiment = experiment.with_run(run)
                except HarnessError as error:
                    verdicts += [
                        Verdict(name, fidelity, each, budget, failure=str(error)) for each, budget in allowed.items()
                    ]
                else:
                    verdicts += _verdicts(run, expected, experiment.errors_of(name, fidelity), allowed)
    return verdicts, experiment


def _stored(folder: Path, name: str, output: Output) -> xr.Dataset:
    """The run of the trial `name` in a folder that `ema run` wrote, with the attributes that a page needs."""
    stem = f"{name}_{REFERENCE.name}"
    path = next((path for suffix in FORMATS if (path := folder / f"{stem}.{suffix}").exists()), folder / f"{stem}.csv")
    try:
        table = read_table(path)
    except HarnessError as error:
        raise HarnessError(f"{path}: no stored results of {name}: {error}; ema run writes them") from None
    found = {each.name: Found(table, each, ColumnSpec(each.name, each.name)) for each in table.columns}
    outputs = [port for port in ports.OUTPUTS if port.name in found]
    if not outputs or "time" not in found:
        raise HarnessError(f"{path}: columns time and outputs are needed, found: {', '.join(found) or 'none'}")
    time = axis_of(found["time"]).time
    data: dict[str, Any] = {
        port.name: ("time", inside(found[port.name], output, ratio=1.0), {"units": port.unit}) for port in outputs
    }
    command = inside(found["command"], output, ratio=1.0) if "command" in found else np.full(len(time), np.nan)
    data["command"] = ("time", command)
    attributes = {
        "trial": name,
        "fmu": path.name,
        "fmu_sha256": file_hash(path),
        "wall_s": float("nan"),
        "simulated_s": float(time[-1] - time[0]),
    }
    return xr.Dataset(data, {"time": ("time", time)}, attributes)


def _verdicts(
    run: xr.Dataset, expected: xr.Dataset, found: Mapping[str, Comparison], allowed: Mapping[str, float]
) -> list[Verdict]:
    name, fidelity = run.attrs["trial"], run.attrs["fidelity"]
    verdicts = []
    for variable, budget in allowed.items():
        if variable not in found:
            verdicts.append(Verdict(name, fidelity, variable, budget, failure=f"the reference has no {variable}"))
            continue
        series = np.interp(expected.time.values, run.time.values, run[variable].values.astype(float))
        truth = expected[variable].values.astype(float)
        outside = np.flatnonzero(np.abs(series - truth) > PEAK_FACTOR * budget * np.ptp(truth))
        left = float(expected.time.values[outside[0]]) if outside.size else None
        verdicts.append(Verdict(name, fidelity, variable, budget, found[variable].nrmse, left, wall=run.attrs["wall_s"]))
    return verdicts

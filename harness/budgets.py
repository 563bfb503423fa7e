"""Cross-fidelity check: does every fidelity stay within its budget of the reference?"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import xarray as xr

from ema_fmu_src import ports
from harness.comparison import Comparison, compare
from harness.errors import HarnessError
from harness.fidelity import FIDELITIES
from harness.flight import fmufile
from harness.flight.experiment import Experiment
from harness.flight.isolate import TIME_LIMIT, Isolated
from harness.trials import BUILT_IN, trial

DEFAULT = Path(__file__).with_name("budgets.toml")
TUBE = 5.0
"""Half width of the tube, in budgets times the reference's range: an rms budget allows its peaks that much."""

Budgets = dict[str, dict[str, dict[str, float]]]
"""Trial -> fidelity -> variable -> NRMSE."""


@dataclass(frozen=True)
class Verdict:
    """One variable of one fidelity in one trial: NRMSE found and allowed; when it left the tube [s], None if it did not;
    or why it could not be flown."""

    trial: str
    fidelity: str
    variable: str
    budget: float
    found: float | None = None
    left: float | None = None
    failure: str = ""

    @property
    def passed(self) -> bool:
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
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise HarnessError(f"{path}: is no TOML: {error}") from None
    outputs = {port.name for port in ports.OUTPUTS}
    problems = [] if content else ["no budgets; a table [TRIAL.FIDELITY] with lines VARIABLE = NRMSE is needed"]
    for name, fidelities in content.items():
        if name not in BUILT_IN:
            problems.append(f"[{name}]: no such trial: {', '.join(BUILT_IN)}")
        for fidelity, variables in fidelities.items() if isinstance(fidelities, dict) else ():
            if fidelity not in FIDELITIES:
                problems.append(f"[{name}.{fidelity}]: no such fidelity: {', '.join(FIDELITIES)}")
            for variable, budget in variables.items() if isinstance(variables, dict) else ():
                if variable not in outputs:
                    problems.append(f"[{name}.{fidelity}] {variable}: no such output: see ema ports")
                if not isinstance(budget, int | float) or isinstance(budget, bool) or not 0.0 <= budget < float("inf"):
                    problems.append(f"[{name}.{fidelity}] {variable} = {budget}: a number from 0 on is needed")
            if not isinstance(variables, dict):
                problems.append(f"[{name}] {fidelity}: a table of variables is needed")
        if not isinstance(fidelities, dict):
            problems.append(f"{name}: a table of fidelities is needed")
    if problems:
        raise HarnessError("; ".join(f"{path}: {problem}" for problem in problems))
    return content


def check(
    budgets: Budgets,
    *,
    fmus: Path,
    reference: Path | None = None,
    stored: Path | None = None,
    parameters: Mapping[str, float] | None = None,
    time_limit: float = TIME_LIMIT,
    on_run: Callable[[str], None] = lambda text: None,
) -> tuple[list[Verdict], Experiment]:
    """Fly what `budgets` names with the FMUs in the folder `fmus`, each in a process of its own; a verdict for each budget,
    and the runs for a page.

    The reference is EMA_HF.fmu there, the FMU `reference`, or the CSV files TRIAL_HF.csv in the folder `stored` (which
    `ema run` writes). A fidelity that fails is a verdict; HarnessError if the reference cannot be had.
    """
    verdicts: list[Verdict] = []
    name_of_it = "reference" if reference or stored else "HF"
    flown = Experiment({}, [], name_of_it)
    with ExitStack() as stack:
        opened: dict[Path, Isolated] = {}

        def fly(path: Path, name: str, settings: Mapping[str, float]) -> xr.Dataset:
            if path not in opened:
                opened[path] = stack.enter_context(Isolated(path, time_limit=time_limit))
            on_run(f"{name} {path.name}")
            return opened[path].run(trial(name), settings)

        given = dict(parameters or {})
        for name, fidelities in budgets.items():
            if stored:
                expected = _stored(stored / f"{name}_HF.csv", name)
            else:
                expected = fly(reference or fmus / FIDELITIES["HF"].fmu, name, given)
            flown.runs[name, name_of_it] = expected
            for fidelity, allowed in fidelities.items():
                chosen = FIDELITIES[fidelity]
                try:
                    run = fly(fmus / chosen.fmu, name, {**given, **chosen.parameters})
                    found = compare(run, expected, names=(fidelity, name_of_it))
                    verdicts += _verdicts(run, expected, found, fidelity, allowed)
                    flown.runs[name, fidelity] = run
                    flown.comparisons.extend(found)
                except HarnessError as error:
                    verdicts += [
                        Verdict(name, fidelity, variable, budget, failure=str(error)) for variable, budget in allowed.items()
                    ]
    return verdicts, flown


def _stored(path: Path, name: str) -> xr.Dataset:
    try:
        table = np.genfromtxt(path, delimiter=",", names=True)
    except (OSError, ValueError) as error:
        raise HarnessError(f"{path}: no stored results of {name}: {error}; ema run writes them") from None
    names = [port.name for port in ports.OUTPUTS if port.name in (table.dtype.names or ())]
    if not names or "time" not in (table.dtype.names or ()):
        raise HarnessError(f"{path}: columns time and outputs are needed, found: {', '.join(table.dtype.names or ['none'])}")
    units = {port.name: port.unit for port in ports.OUTPUTS}
    data = {column: ("time", table[column], {"units": units[column]}) for column in names}
    data["command"] = (
        "time",
        table["command"] if "command" in (table.dtype.names or ()) else np.full(len(table), np.nan),
        {},
    )
    attributes = {"trial": name, "fmu": path.name, "fmu_sha256": fmufile.content_hash(path)}
    lasts = float(table["time"][-1] - table["time"][0])
    return xr.Dataset(data, {"time": ("time", table["time"])}, attributes | {"wall_s": float("nan"), "simulated_s": lasts})


def _verdicts(
    run: xr.Dataset, expected: xr.Dataset, comparisons: Sequence[Comparison], fidelity: str, allowed: Mapping[str, float]
) -> list[Verdict]:
    found = {item.variable: item for item in comparisons}
    name = expected.attrs["trial"]
    verdicts = []
    for variable, budget in allowed.items():
        item = found.get(variable)
        if item is None:
            verdicts.append(Verdict(name, fidelity, variable, budget, failure=f"the reference has no {variable}"))
            continue
        series = np.interp(expected.time.values, run.time.values, run[variable].values.astype(float))
        truth = expected[variable].values.astype(float)
        outside = np.flatnonzero(np.abs(series - truth) > TUBE * budget * np.ptp(truth))
        left = float(expected.time.values[outside[0]]) if outside.size else None
        verdicts.append(Verdict(name, fidelity, variable, budget, item.nrmse, left))
    return verdicts


def junit(verdicts: Sequence[Verdict]) -> str:
    """JUnit XML: a test case for each verdict, for a CI server."""
    failed = [verdict for verdict in verdicts if not verdict.passed]
    suite = Element("testsuite", name="ema check", tests=str(len(verdicts)), failures=str(len(failed)))
    for verdict in verdicts:
        case = SubElement(suite, "testcase", classname=f"{verdict.trial}.{verdict.fidelity}", name=verdict.variable)
        if not verdict.passed:
            SubElement(case, "failure", message=verdict.line)
    indent(suite)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(suite).decode() + "\n"


def markdown(verdicts: Sequence[Verdict]) -> str:
    """A summary for a CI server's page."""
    failed = [verdict for verdict in verdicts if not verdict.passed]
    head = f"**{len(failed)} of {len(verdicts)} budgets exceeded**" if failed else f"**All {len(verdicts)} budgets kept**"
    lines = [
        "## Fidelities against the reference",
        "",
        head,
        "",
        "| | trial | fidelity | variable | NRMSE | budget | left the tube |",
    ]
    lines.append("| --- | --- | --- | --- | --- | --- | --- |")
    for verdict in sorted(verdicts, key=lambda verdict: verdict.passed):
        found = verdict.failure or ("-" if verdict.found is None else f"{100.0 * verdict.found:.4f} %")
        left = "" if verdict.left is None else f"{verdict.left:.4f} s"
        mark = "ok" if verdict.passed else "**outside**"
        cells = (mark, verdict.trial, verdict.fidelity, verdict.variable, found, f"{100.0 * verdict.budget:.4f} %", left)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"

"""A plan from a TOML file and from options: every value is checked, and an error names the place of what cannot be flown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ema_fmu_src import ports
from harness.actuators.actuator import DEFAULT, Actuator, Output
from harness.campaigns.plan import OUTPUTS, RATE, SAMPLINGS, Noise, Plan
from harness.errors import HarnessError, unknown
from harness.faults import FAULTS
from harness.fidelity import parse_fidelities
from harness.files.columns import read_numbers
from harness.files.toml import flat, read_toml
from harness.parameters import PAIR, check_drive, check_value, settable
from harness.trials import Trial, trial

KEYS = ("trials", "fidelities", "samples", "sampling", "seed", "ranges", "grid", "cases", "set", "noise", "outputs", "rate")
OPTIONS = {"trial_file": "--trial-file FILE", "actuator": "--actuator NAME_OR_FILE", "columns": "--column PORT=COLUMN"} | {
    "column": "--column PORT=COLUMN", "scheduler": "--scheduler ADDRESS", "workers": "--workers N", "out": "--out DIR"
}  # fmt: skip
"""What a plan does not hold, and the option for it."""
MOST_CASES = 10_000_000
OUTPUT_PORTS = {port.name: port for port in ports.OUTPUTS}


def read_plan(path: Path | None, options: Mapping[str, Any], own: Trial | None = None, actuator: Actuator = DEFAULT) -> Plan:
    """A plan from a TOML file with the keys KEYS, and from `options` of the same names, which take precedence.

    `own`: a trial that is flown too. `actuator`: its parameters are fixed where the plan does not give them; noise on a
    linear one's position is in m. HarnessError, with file and key or option, for whatever cannot be flown.
    """
    given = _toml(path) if path else {}
    where = {key: f"{path}, {key}" for key in given}
    for key, value in options.items():
        given[key], where[key] = value, "--range" if key == "ranges" else f"--{key}"
    if path and isinstance(given.get("cases"), str) and where["cases"] != "--cases":
        given["cases"] = path.parent / given["cases"]
    at = where.get
    trials = _trials(given.get("trials", [] if own else ["SIN"]), str(at("trials")))
    plan = Plan(
        trials=(*trials, *([own] if own else [])),
        fidelities=tuple(parse_fidelities(",".join(_texts(given.get("fidelities", ["ELF+"]), str(at("fidelities")))))),
        ranges={n: _pair(n, v, f"{at('ranges')}, {n}") for n, v in _mapping(given, "ranges", at("ranges")).items()},
        grid={n: _values(n, v, f"{at('grid')}, {n}") for n, v in _mapping(given, "grid", at("grid")).items()},
        listed=_listed(given["cases"], str(at("cases"))) if "cases" in given else {},
        fixed={n: _values(n, [v], f"{at('set')}, {n}")[0] for n, v in _mapping(given, "set", at("set")).items()},
        noise={
            n: _noise(n, v, f"{at('noise')}, {n}", actuator.output) for n, v in _mapping(given, "noise", at("noise")).items()
        },
        outputs=_outputs(given.get("outputs", list(OUTPUTS)), str(at("outputs"))),
        samples=_whole(given.get("samples", 1), at("samples"), least=1),
        sampling=_choice(given.get("sampling", "lhs"), str(at("sampling"))),
        seed=_whole(given.get("seed", 0), at("seed"), least=0),
        rate=_number(given.get("rate", RATE), str(at("rate"))),
        actuator=actuator,
    )
    _check(plan, where)
    named = {*plan.ranges, *plan.grid, *plan.listed, *plan.fixed}
    own_values = {name: value for name, value in actuator.parameters.items() if name not in named}
    plan = replace(plan, fixed={**plan.fixed, **own_values})
    _check_effects(plan, where)
    if not {*plan.ranges, *plan.grid, *plan.listed}.intersection(PAIR):
        check_drive(plan.fixed, where.get("set", "--set"))
    return plan


def _check_effects(plan: Plan, where: Mapping[str, str]) -> None:
    """HarnessError for a fault that is varied, but does nothing: what it scales is 0, and is not varied."""
    varied: dict[str, Mapping[str, object]] = {"ranges": plan.ranges, "grid": plan.grid, "cases": plan.listed}
    names = {name for each in varied.values() for name in each}
    for fault in FAULTS.values():
        reason = fault.without_effect(plan.fixed)
        for key, each in varied.items():
            if reason and fault.port in each and not names & set(fault.scales):
                raise HarnessError(f"{where.get(key, key)}, {fault.port}: it has {reason}; leave it out")


def _check(plan: Plan, where: Mapping[str, str]) -> None:
    names = [*plan.ranges, *plan.grid, *plan.listed, *plan.fixed]
    for name in names:
        if names.count(name) > 1:
            raise HarnessError(f"{name} is given twice, by ranges, grid, cases or set; once is enough")
    if plan.listed and (plan.ranges or plan.samples > 1):
        raise HarnessError(f"{where['cases']}: the file lists the cases; ranges and samples cannot be given beside it")
    if plan.samples > 1 and not plan.ranges and not plan.noise:
        raise HarnessError(f"{where.get('samples')}: {plan.samples} samples of no range would all be the same; give ranges")
    first = plan.trials[0]
    for other in plan.trials[1:]:
        if other.start != first.start or other.step != first.step or len(other.time) != len(first.time):
            raise HarnessError(
                f"the trials {first.name} and {other.name} have different times; one campaign needs the same for all"
            )
    steps = 1.0 / (plan.rate * first.step)
    if steps < 1.0 - 1e-9 or abs(steps - round(steps)) > 1e-6:
        raise HarnessError(
            f"{where.get('rate')}: {plan.rate:g} Hz does not divide {1.0 / first.step:g} Hz, the rate of the runs"
        )
    rows = len(next(iter(plan.listed.values()))) if plan.listed else plan.samples
    points = math.prod(len(values) for values in plan.grid.values())
    count = rows * len(plan.trials) * len(plan.fidelities) * points
    if count > MOST_CASES:
        raise HarnessError(f"{count:,} cases are more than {MOST_CASES:,}; split the campaign")


def _toml(path: Path) -> dict[str, Any]:
    given = read_toml(path)
    for key in given:
        if key in OPTIONS:
            raise HarnessError(f"{path}, {key}: is no key of a plan; it goes beside it, as {OPTIONS[key]}")
        if key not in KEYS:
            raise unknown(f"key in {path}:", key, KEYS)
    return given


def _mapping(given: Mapping[str, Any], key: str, where: str | None) -> dict[str, Any]:
    value = given.get(key, {})
    if not isinstance(value, dict):
        raise HarnessError(f"{where}: a table of names is needed, such as [{key}]")
    return flat(value, where or key)


def _texts(value: Any, where: str) -> list[str]:
    texts = [value] if isinstance(value, str) else value
    if not isinstance(texts, list) or not texts or not all(isinstance(text, str) for text in texts):
        raise HarnessError(f"{where}: a list of names is needed")
    return texts


def _trials(value: Any, where: str) -> tuple[Trial, ...]:
    return tuple(trial(name) for name in dict.fromkeys(_texts(value, where))) if value else ()


def _outputs(value: Any, where: str) -> tuple[str, ...]:
    names = _texts(value, where)
    for name in names:
        if name not in OUTPUT_PORTS:
            raise HarnessError(f"{where}: {unknown('output', name, OUTPUT_PORTS)}")
    return tuple(sorted(dict.fromkeys(names), key=list(OUTPUT_PORTS).index))


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise HarnessError(f"{where}: a number above 0 is needed, not {value!r}")
    return float(value)


def _whole(value: Any, where: str | None, *, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise HarnessError(f"{where}: a whole number of {least} or more is needed, not {value!r}")
    return value


def _choice(value: Any, where: str) -> str:
    if value not in SAMPLINGS:
        raise HarnessError(f"{where}: {' or '.join(SAMPLINGS)} is needed, not {value!r}")
    return str(value)


def _values(name: str, values: Any, where: str) -> tuple[float, ...]:
    variable = settable(name, where)
    if not isinstance(values, list | tuple) or not values:
        raise HarnessError(f"{where}: a list of values is needed, such as [1.0, 0.9]")
    numbers = [variable.items.get(value, value) if isinstance(value, str) else value for value in values]
    for value in numbers:
        if not isinstance(value, int | float):
            raise HarnessError(f"{where}: {value!r} is not {' or '.join(['a number', *variable.items])}")
        check_value(variable, float(value), where)
    return tuple(float(value) for value in numbers)


def _pair(name: str, values: Any, where: str) -> tuple[float, float]:
    if not isinstance(values, list | tuple) or len(values) != 2:
        raise HarnessError(f"{where}: a range [low, high] is needed")
    low, high = _values(name, values, where)
    if settable(name, where).kind != "Real":
        raise HarnessError(f"{where}: {name} has whole values only; list them under grid")
    if low >= high:
        raise HarnessError(f"{where}: the range {low:g} to {high:g} is empty; the lower end comes first")
    return low, high


def _noise(name: str, value: Any, where: str, output: Output) -> Noise:
    if name not in OUTPUT_PORTS or OUTPUT_PORTS[name].kind != "Real":
        known = [port.name for port in OUTPUT_PORTS.values() if port.kind == "Real"]
        raise HarnessError(f"{where}: {unknown('output', name, known)}")
    relative = isinstance(value, str) and value.strip().endswith("%")
    try:
        sigma = float(value.strip().removesuffix("%")) / 100.0 if isinstance(value, str) and relative else float(value)
    except (TypeError, ValueError):
        sigma = -1.0
    if not 0.0 <= sigma < float("inf"):
        raise HarnessError(f"{where}: a standard deviation is needed, in {output.unit(name)}, or '1 %' of the range")
    return Noise(sigma, relative)


def _listed(path: Any, where: str) -> dict[str, tuple[float, ...]]:
    columns = read_numbers(Path(path))
    for name, series in columns.items():
        variable = settable(name, f"{path}, line 1")
        for line, value in enumerate(series, start=2):
            check_value(variable, float(value), f"{path}, row {line - 1}")
    return {name: tuple(series.tolist()) for name, series in columns.items()}


def parse_assignments(texts: Sequence[str], option: str) -> dict[str, str]:
    """Name -> text, from texts NAME=TEXT; HarnessError, beginning with `option`, for one without a name or text."""
    parts = [(text, *map(str.strip, text.partition("="))) for text in texts]
    for text, name, equals, value in parts:
        if not (name and equals and value):
            raise HarnessError(f"{option} {text}: NAME=... is needed")
    return {name: value for _, name, _, value in parts}


def parse_numbers(text: str, separator: str, where: str) -> list[float]:
    """The numbers between the separators; HarnessError, beginning with `where`, if one is no number."""
    try:
        return [float(part) for part in text.split(separator)]
    except ValueError:
        raise HarnessError(f"{where}: numbers between '{separator}' are needed, not '{text}'") from None

"""What a campaign flies: from a TOML file or options to the table of its cases, which the plan alone decides."""

import hashlib
import itertools
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from ema_fmu_src import ports
from harness.csvfile import read_numbers
from harness.errors import HarnessError, unknown
from harness.fidelity import Fidelity, check_value, parse_fidelities, settable
from harness.trials import Trial, trial

SAMPLINGS = ("lhs", "sobol")
KEYS = ("trials", "fidelities", "samples", "sampling", "seed", "ranges", "grid", "cases", "set", "noise", "outputs", "rate")
OUTPUTS = ("position", "motor_speed", "equivalent_current_filtered")
RATE = 500.0
MOST_CASES = 10_000_000
RECORDED = {port.name: port for port in ports.OUTPUTS}


@dataclass(frozen=True)
class Noise:
    """White noise on an output: its standard deviation in the output's unit, or as a part of the output's range in a run."""

    sigma: float
    relative: bool


@dataclass(frozen=True)
class Table:
    """The cases: `values`, shape (n_cases, len(names)), and the places of each case's trial and fidelity in the plan."""

    names: tuple[str, ...]
    values: NDArray[np.float64]
    trial: NDArray[np.intp]
    fidelity: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True)
class Plan:
    """A campaign: each trial is flown with each fidelity, grid point and sample (or row of a file).

    `ranges`: parameter -> low, high, sampled; `grid`: parameter -> values, all combinations; `listed`: the columns of a
    file of cases; `rate` [Hz] of what is kept.
    """

    trials: tuple[Trial, ...]
    fidelities: tuple[Fidelity, ...]
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    grid: dict[str, tuple[float, ...]] = field(default_factory=dict)
    listed: dict[str, tuple[float, ...]] = field(default_factory=dict)
    fixed: dict[str, float] = field(default_factory=dict)
    noise: dict[str, Noise] = field(default_factory=dict)
    outputs: tuple[str, ...] = OUTPUTS
    samples: int = 1
    sampling: str = "lhs"
    seed: int = 0
    rate: float = RATE

    @property
    def every(self) -> int:
        """Communication steps between two that are kept."""
        return round(1.0 / (self.rate * self.trials[0].step))

    @property
    def time(self) -> NDArray[np.float64]:
        """Times that are kept [s], shape (n_times,)."""
        return self.trials[0].time[:: self.every]

    def table(self) -> Table:
        """All cases, fidelity by fidelity, trial by trial; the same table for the same plan, wherever it is made."""
        blocks = [self._samples()] if not self.listed else [np.array(list(self.listed.values())).T]
        names = [*(self.listed or self.ranges), *self.grid, *self.fixed]
        fixed = list(self.fixed.values())
        rows = [
            np.hstack([block, np.tile([*point, *fixed], (len(block), 1))])
            for block in blocks
            for point in itertools.product(*self.grid.values())
        ]
        values = np.vstack(rows)
        runs = len(self.trials) * len(self.fidelities)
        which = np.repeat(np.arange(runs), len(values))
        return Table(tuple(names), np.tile(values, (runs, 1)), which % len(self.trials), which // len(self.trials))

    def _samples(self) -> NDArray[np.float64]:
        """Points of the ranges, shape (samples, n_ranges)."""
        if not self.ranges:
            return np.empty((self.samples, 0))
        kinds = {"lhs": qmc.LatinHypercube, "sobol": qmc.Sobol}
        with np.errstate(all="ignore"):
            points = kinds[self.sampling](len(self.ranges), rng=np.random.default_rng(self.seed)).random(self.samples)
        low, high = np.array(list(self.ranges.values())).T
        return low + np.asarray(points) * (high - low)

    def digest(self, fmus: Mapping[str, str]) -> str:
        """SHA-256 of all that decides the data: the cases, the trials' inputs, noise, what is kept, the FMUs' hashes."""
        table = self.table()
        told = json.dumps([
            table.names, [(f.name, f.parameters, fmus[f.fmu]) for f in self.fidelities],
            [(t.name, t.start, t.step, sorted(t.continuous)) for t in self.trials],
            [(name, noise.sigma, noise.relative) for name, noise in self.noise.items()],
            self.outputs, self.every, self.seed,
        ])  # fmt: skip
        whole = hashlib.sha256(told.encode())
        for flown in self.trials:
            for name, series in flown.inputs.items():
                whole.update(name.encode() + np.ascontiguousarray(series).tobytes())
        for part in (table.values, table.trial.astype("<i8"), table.fidelity.astype("<i8")):
            whole.update(np.ascontiguousarray(part).tobytes())
        return whole.hexdigest()


def read_plan(path: Path | None, options: Mapping[str, Any], own: Trial | None = None) -> Plan:
    """A plan from a TOML file (keys KEYS) and `options` of the same names, which take precedence; `own` is flown too.

    HarnessError that names file and key for whatever cannot be flown.
    """
    given = _toml(path) if path else {}
    where = {key: f"{path}, {key}" for key in given}
    for key, value in options.items():
        given[key], where[key] = value, f"--{key}"
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
        noise={n: _noise(n, v, f"{at('noise')}, {n}") for n, v in _mapping(given, "noise", at("noise")).items()},
        outputs=_outputs(given.get("outputs", list(OUTPUTS)), str(at("outputs"))),
        samples=_whole(given.get("samples", 1), at("samples"), least=1),
        sampling=_choice(given.get("sampling", "lhs"), str(at("sampling"))),
        seed=_whole(given.get("seed", 0), at("seed"), least=0),
        rate=_number(given.get("rate", RATE), str(at("rate"))),
    )
    _check(plan, where)
    return plan


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
    for flown in plan.trials[1:]:
        if flown.start != first.start or flown.step != first.step or len(flown.time) != len(first.time):
            raise HarnessError(
                f"the trials {first.name} and {flown.name} have other times; one campaign needs the same for all"
            )
    steps = 1.0 / (plan.rate * first.step)
    if steps < 1.0 - 1e-9 or abs(steps - round(steps)) > 1e-6:
        raise HarnessError(
            f"{where.get('rate')}: {plan.rate:g} Hz does not divide {1.0 / first.step:g} Hz, the rate of the runs"
        )
    rows = len(next(iter(plan.listed.values()))) if plan.listed else plan.samples
    count = rows * len(plan.trials) * len(plan.fidelities) * int(np.prod([len(v) for v in plan.grid.values()]))
    if count > MOST_CASES:
        raise HarnessError(f"{count} cases are more than {MOST_CASES}; split the campaign")


def _toml(path: Path) -> dict[str, Any]:
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise HarnessError(f"{path}: is not TOML: {error}") from None
    for key in given:
        if key not in KEYS:
            raise unknown(f"key in {path}:", key, KEYS)
    return given


def _mapping(given: Mapping[str, Any], key: str, where: str | None) -> dict[str, Any]:
    value = given.get(key, {})
    if not isinstance(value, dict):
        raise HarnessError(f"{where}: a table of names is needed, such as [{key}]")
    return _flat(value)


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """TOML reads `fault.N_a = 1` as a table in a table: names with dots again."""
    flat: dict[str, Any] = {}
    for name, value in table.items():
        flat |= _flat(value, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value}
    return flat


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
        if name not in RECORDED:
            raise unknown("output", name, RECORDED)
    return tuple(sorted(dict.fromkeys(names), key=list(RECORDED).index))


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
    for value in values:
        if not isinstance(value, int | float):
            raise HarnessError(f"{where}: {value!r} is not a number")
        check_value(variable, float(value), where)
    return tuple(float(value) for value in values)


def _pair(name: str, values: Any, where: str) -> tuple[float, float]:
    if not isinstance(values, list | tuple) or len(values) != 2:
        raise HarnessError(f"{where}: a range [low, high] is needed")
    low, high = _values(name, values, where)
    if settable(name, where).kind != "Real":
        raise HarnessError(f"{where}: {name} has whole values only; list them under grid")
    if low >= high:
        raise HarnessError(f"{where}: the range {low:g} to {high:g} is empty; the lower end comes first")
    return low, high


def _noise(name: str, value: Any, where: str) -> Noise:
    if name not in RECORDED or RECORDED[name].kind != "Real":
        raise unknown("output", name, [port.name for port in RECORDED.values() if port.kind == "Real"])
    relative = isinstance(value, str) and value.strip().endswith("%")
    try:
        sigma = float(value.strip().removesuffix("%")) / 100.0 if isinstance(value, str) and relative else float(value)
    except (TypeError, ValueError):
        sigma = -1.0
    if not 0.0 <= sigma < float("inf"):
        raise HarnessError(f"{where}: a standard deviation is needed, in {RECORDED[name].unit}, or '1 %' of the range")
    return Noise(sigma, relative)


def _listed(path: Any, where: str) -> dict[str, tuple[float, ...]]:
    columns = read_numbers(Path(path))
    for name, series in columns.items():
        variable = settable(name, f"{path}, line 1")
        for line, value in enumerate(series, start=2):
            check_value(variable, float(value), f"{path}, row {line - 1}")
    return {name: tuple(series.tolist()) for name, series in columns.items()}


def parse_assignments(texts: Sequence[str], option: str) -> dict[str, str]:
    """NAME=TEXT by name; HarnessError for one without a name or value."""
    parts = [(text, *map(str.strip, text.partition("="))) for text in texts]
    for text, name, equals, value in parts:
        if not (name and equals and value):
            raise HarnessError(f"{option} {text}: NAME=... is needed")
    return {name: value for _, name, _, value in parts}


def parse_numbers(text: str, separator: str, where: str) -> list[float]:
    """Numbers between separators."""
    try:
        return [float(part) for part in text.split(separator)]
    except ValueError:
        raise HarnessError(f"{where}: numbers between '{separator}' are needed, not '{text}'") from None

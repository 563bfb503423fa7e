"""Measured runs: faults identified, commands flown again, parameters calibrated."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import xarray as xr

from ema_fmu_src.fidelities import FIDELITIES, REFERENCE
from harness.actuators.actuator import Actuator
from harness.errors import HarnessError
from harness.faults import ESTIMATED, THRESHOLD, parse_limits
from harness.fidelity import parse_fidelity
from harness.files import results
from harness.identification import asked
from harness.identification import diagnosis as identification
from harness.identification.diagnosis import Diagnosis
from harness.identification.page import HEADS as FAULT_HEADS
from harness.identification.page import rows as fault_rows
from harness.inference.measured import read_measured
from harness.library import shown
from harness.library.inputs import Given, Settings, actuator_of, columns_of, log_file, parameters_of, stated
from harness.logs.log import Log
from harness.ready import fmu_folder
from harness.replays.page import HEADS as CHANNEL_HEADS
from harness.replays.page import rows as channel_rows
from harness.replays.replay import Replay


@dataclass(frozen=True)
class Identified:
    """What a measured run says: a Diagnosis, which holds everything, and the short way to what is asked for most."""

    diagnosis: Diagnosis = field(repr=False)
    actuator: Actuator = field(repr=False)

    @property
    def explained(self) -> bool:
        """Whether the model explains the run; if not, the estimates mean nothing."""
        return not self.diagnosis.complaints

    @property
    def health(self) -> float | None:
        """The least of the faults'; None if the run is not explained."""
        return self.diagnosis.health

    @property
    def verdict(self) -> str:
        """In a sentence."""
        return self.diagnosis.verdict

    @property
    def faults(self) -> dict[str, Any]:
        """The Estimates by fault; none if the run is not explained."""
        return {item.fault: item for item in self.diagnosis.estimates} if self.explained else {}

    def as_dict(self) -> dict[str, Any]:
        """What `ema identify --json` writes."""
        return {"actuator": self.actuator.identity, **self.diagnosis.as_dict()}

    def to_dataset(self) -> xr.Dataset:
        """Measured, healthy and identified curves: NAME, NAME_healthy, NAME_identified over time [s]."""
        run, curves = self.diagnosis.measured, self.diagnosis.curves
        data: dict[str, Any] = {}
        for place, (name, series) in enumerate(run.channels.items()):
            scale, attributes = run.shown[name].scale, {"units": run.shown[name].unit}
            data[name] = ("time", scale * series, attributes)
            data[f"{name}_healthy"] = ("time", scale * curves.healthy[:, place], attributes)
            data[f"{name}_identified"] = ("time", scale * curves.predicted[:, place], attributes)
        about = {"run": self.diagnosis.name, "fidelity": self.diagnosis.fidelity, "verdict": self.verdict}
        return xr.Dataset(data, {"time": ("time", run.time, {"units": "s"})}, about)

    def __repr__(self) -> str:
        listed = [f"  {row[0]}: {row[1]}, {row[2]}, health {row[3]}" for row in fault_rows(self.diagnosis)]
        return "\n".join(
            [f"{self.diagnosis.name}: {self.verdict}", *(listed if self.explained else self.diagnosis.complaints)]
        )

    def _repr_html_(self) -> str:
        data, units = self.to_dataset(), self.diagnosis.measured.shown
        rows = []
        for name in self.diagnosis.measured.channels:
            kinds = (
                ("measured", "", shown.GREY),
                ("healthy", "_healthy", "#16935b"),
                ("identified", "_identified", "#1f6fd6"),
            )
            curves = [shown.Curve(label, data.time.values, data[name + end].values, ink) for label, end, ink in kinds]
            rows.append((f"{units[name].name} [{units[name].unit}]", curves))
        told = shown.table(FAULT_HEADS, fault_rows(self.diagnosis)) if self.explained else ""
        notes = (f"{self.diagnosis.name}: {self.verdict}", *self.diagnosis.remarks)
        return shown.lines(notes) + told + shown.drawing(rows)


def identify(
    measured: Given,
    *,
    actuator: str | Path | Actuator | None = None,
    model: str = "ELF+",
    set: Settings | None = None,
    columns: Mapping[str, str] | None = None,
    with_files: Sequence[str | Path] = (),
    limits: Mapping[str, float] | None = None,
    threshold: float = THRESHOLD,
    tolerance: float = 0.003,
    fmus: str | Path | None = None,
) -> Identified:
    """Identify the faults of a measured run, a file or a dataset; the other arguments are as for `ema identify`.

    HarnessError for what cannot be read or fitted. A run that cannot be explained is a result: its `explained` is False.
    """
    chosen = actuator_of(actuator)
    fidelity = parse_fidelity(model, "model")
    estimated = {item.port for item in ESTIMATED.values()}
    asked.check_healthy(chosen, stated(set), estimated, setting="set, ", given="actuator ")
    given = {port: value for port, value in parameters_of(chosen, set).items() if port not in estimated}
    asked.check_threshold(threshold, "threshold=")
    asked.check_tolerance(tolerance, "tolerance=", 0.003)
    at_zero = {**chosen.limits, **parse_limits([f"{name}={value}" for name, value in (limits or {}).items()])}
    more = [Path(path) for path in with_files]
    with log_file(measured) as path:
        run = read_measured(path, given, chosen.output, columns_of(columns, chosen), with_files=more)
    folder = fmu_folder(identification.models_for(fidelity), Path(fmus) if fmus else None, chosen)
    found = identification.identify(
        run,
        fmus=folder,
        fidelity=fidelity,
        parameters=given,
        actuator=chosen,
        limits=at_zero,
        threshold=threshold,
        tolerance=tolerance,
    )
    return Identified(found, chosen)


@dataclass(frozen=True)
class Replayed(Sequence[Replay]):
    """The runs of a log, each flown again: a sequence of Replays, mostly of one."""

    runs: tuple[Replay, ...]

    def __getitem__(self, place: Any) -> Any:
        return self.runs[place]

    def __len__(self) -> int:
        return len(self.runs)

    def to_dataset(self, place: int = 0) -> xr.Dataset:
        """The curves of a run at the log's rows: NAME as measured, NAME_twin as flown, and command, over time [s]."""
        run = self.runs[place]
        unit = run.log.output.unit("command")
        data: dict[str, Any] = {"command": ("time", run.command, {"units": unit})}
        for item in run.channels:
            data[item.name] = ("time", item.measured, {"units": item.unit})
            data[f"{item.name}_twin"] = ("time", item.twin, {"units": item.unit})
        about = {"run": run.log.name, "fidelity": run.fidelity}
        return xr.Dataset(data, {"time": ("time", run.log.time, {"units": "s"})}, about)

    def __repr__(self) -> str:
        told = []
        for run in self.runs:
            channels = ", ".join(f"{row[0]} {row[3]}" for row in channel_rows(run))
            told.append(f"{run.log.name}, {run.fidelity}: NRMSE {channels}")
        return "\n".join(told)

    def _repr_html_(self) -> str:
        parts = []
        for run in self.runs:
            rows = []
            for item in run.channels:
                own = FIDELITIES[run.fidelity]
                curves = [
                    shown.Curve("measured", run.log.time, item.measured, shown.GREY),
                    shown.Curve(run.fidelity, run.log.time, item.twin, own.colour, own.dash),
                ]
                rows.append((f"{item.name} [{item.unit}]", curves))
            told = shown.table(CHANNEL_HEADS, channel_rows(run))
            parts.append(shown.lines([f"{run.log.name}, {run.fidelity}", *run.remarks]) + told + shown.drawing(rows))
        return "".join(parts)


def replay(
    log: Given,
    *,
    fidelity: str = "ELF+",
    actuator: str | Path | Actuator | None = None,
    set: Settings | None = None,
    columns: Mapping[str, str] | None = None,
    with_files: Sequence[str | Path] = (),
    fmus: str | Path | None = None,
) -> Replayed:
    """Fly the command of a log, a file or a dataset, again; the other arguments are as for `ema replay`.

    HarnessError for what cannot be read or flown.
    """
    from harness.flight.twin import Twin
    from harness.logs.read import read_log
    from harness.replays.replay import replay as fly

    chosen = actuator_of(actuator)
    flown = parse_fidelity(fidelity, "fidelity")
    given = parameters_of(chosen, set)
    more = [Path(path) for path in with_files]
    with log_file(log) as path:
        logs = read_log(path, columns_of(columns, chosen), chosen.output, given, with_files=more)
    folder = fmu_folder([flown], Path(fmus) if fmus else None, chosen)
    with Twin(folder / flown.fmu) as twin:
        return Replayed(tuple(fly(each, twin, flown, given) for each in logs))


@dataclass(frozen=True)
class Calibrated:
    """What a calibration has found: a Calibration, and its `actuator`, which every other function takes."""

    calibration: Any = field(repr=False)
    actuator: Actuator = field(repr=False)
    start: str | None = field(repr=False)

    @property
    def explained(self) -> bool:
        """Whether every log is explained."""
        return not self.calibration.complaints

    def as_dict(self) -> dict[str, Any]:
        """What `ema calibrate --json` writes."""
        return {"actuator": self.actuator.identity, **self.calibration.as_dict()}

    def save(self, path: str | Path) -> Path:
        """Write the actuator file, as `ema calibrate --out` does."""
        from harness.calibration.table import file_text

        target = Path(path)
        if target.suffix.lower() != ".toml":
            raise HarnessError(f"{target}: an actuator file is written, its name has to end with .toml")
        results.prepare_file(target)
        results.write(target, file_text(self.actuator, self.start, {}, {}))
        return target

    def _rows(self) -> list[tuple[str, ...]]:
        from harness.calibration.page import parameter_rows

        return [tuple(row) for row in parameter_rows(self.calibration)]

    def __repr__(self) -> str:
        told = [f"  {'  '.join(row)}" for row in self._rows()]
        return "\n".join([f"{self.actuator.name}, {self.calibration.fidelity}:", *told, *self.calibration.complaints])

    def _repr_html_(self) -> str:
        from harness.calibration.page import HEADS

        flown = Replayed(self.calibration.replays)._repr_html_()
        told = (*self.calibration.complaints, *self.calibration.remarks)
        return shown.table(HEADS, self._rows()) + shown.lines(told) + flown


def calibrate(
    logs: Given | Sequence[Given],
    *,
    actuator: str | Path | Actuator | None = None,
    check: Sequence[Given] = (),
    columns: Mapping[str, str] | None = None,
    model: str = "ELF+",
    tolerance: float = 0.01,
    fmus: str | Path | None = None,
) -> Calibrated:
    """Fit the parameters that have a tolerance in `actuator` to runs of a healthy one, files or datasets.

    `check`: runs to predict, not fitted; the other arguments are as for `ema calibrate`. HarnessError for what cannot be
    read or fitted.
    """
    from harness.calibration.bench import Bench
    from harness.calibration.calibrate import calibrate as fit
    from harness.calibration.logs import flown_again, named, runs_of
    from harness.calibration.table import with_files

    chosen = actuator_of(actuator)
    fidelity = parse_fidelity(model, "model")
    asked.check_tolerance(tolerance, "tolerance=", 0.01)
    for item in ESTIMATED.values():
        if chosen.value(item.port) != item.healthy:
            raise HarnessError(f"actuator {chosen.name}: {item.port}: a calibration takes a healthy actuator")
    wanted = [logs] if isinstance(logs, str | Path | xr.Dataset) else list(logs)
    stated_columns = columns_of(columns, chosen)
    with ExitStack() as stack:
        paths, others = ([stack.enter_context(log_file(each)) for each in group] for group in (wanted, check))
        read = [run for path in paths for run in runs_of(path, chosen.parameters, chosen, stated_columns)]
        checks: list[tuple[Log, dict[str, float]]] = [
            (log, {}) for path in others for log, _ in runs_of(path, chosen.parameters, chosen, stated_columns)
        ]
        flown = [fidelity, *([REFERENCE] if fidelity is not REFERENCE else [])]
        bench = Bench(fmu_folder(flown, Path(fmus) if fmus else None, chosen), fidelity, {}, {})
        found = fit(named([run for _, run in read]), chosen, bench, tolerance=tolerance)
        found = flown_again(found, bench, [log for log, _ in read], checks)
        fitted = with_files(found.actuator, paths)
    start = str(actuator) if isinstance(actuator, str | Path) else None
    return Calibrated(replace(found, actuator=fitted), fitted, start)

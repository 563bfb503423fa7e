"""Trials flown, and runs compared."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import xarray as xr

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES, REFERENCE
from harness.actuators.actuator import Actuator
from harness.comparison import FIGURES, TUBE, Comparison, percent
from harness.comparison import compare as compare_runs
from harness.errors import HarnessError
from harness.fidelity import parse_fidelity
from harness.flight.twin import Twin
from harness.library import shown
from harness.library.inputs import Settings, actuator_of, parameters_of, plain, trial_of
from harness.parameters import merged
from harness.ready import fmu_folder
from harness.show.outside import run_of
from harness.trials import Trial


class Flight(xr.Dataset):
    """A run: an xarray.Dataset over time [s], with every output and the inputs, their units and what they are.

    Attributes: trial, fidelity, fmu, fmu_sha256, parameters (JSON), actuator, actuator_sha256. `to_netcdf` writes it as it
    is, and two flights of the same are the same.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        figures = [f"  {name}: {low} to {high} {unit}" for name, (unit, low, high, _) in _told(self).items()]
        variables = f"variables over time: {', '.join(map(str, self.data_vars))}"
        return "\n".join([f"{_title(self)}: {self.sizes.get('time', 0)} points", *figures, variables])

    def _repr_html_(self) -> str:
        rows = [(name, *figures) for name, figures in _told(self).items()]
        heads = ("", "unit", "least", "largest", "at the end")
        return (
            shown.lines([_title(self)])
            + shown.table(heads, rows)
            + shown.drawing(_rows([self]))
            + f"<details><summary>dataset</summary>{super()._repr_html_()}</details>"
        )


def _title(run: xr.Dataset) -> str:
    return f"{run.attrs.get('trial', 'run')}, {run.attrs.get('fidelity', run.attrs.get('fmu', 'dataset'))}"


def _told(run: xr.Dataset) -> dict[str, tuple[str, str, str, str]]:
    """Unit, least, largest and last value of those of FIGURES that the run has, over time alone, as texts."""
    told = {}
    for name, _ in FIGURES:
        if name in run and run[name].dims == ("time",) and run[name].size:
            values = run[name].values.astype(float)
            low, high, last = (f"{value:.5g}" for value in (values.min(), values.max(), values[-1]))
            told[name] = (str(run[name].attrs.get("units", "")), low, high, last)
    return told


def _rows(runs: list[xr.Dataset]) -> list[tuple[str, list[shown.Curve]]]:
    """FIGURES of the runs, as they are drawn, with the command beside the position."""
    out = []
    for name, title in FIGURES:
        held = [run for run in runs if name in run and run[name].dims == ("time",) and run[name].size]
        if not held:
            continue
        curves = [_curve(run, name, place) for place, run in enumerate(held)]
        if name == "position" and "command" in held[0]:
            values = held[0].command.values
            curves.insert(0, shown.Curve("command", held[0].time.values, values, shown.GREY, "dot"))
        out.append((f"{title.partition(' [')[0]} [{held[0][name].attrs.get('units', '')}]", curves))
    return out


def _curve(run: xr.Dataset, name: str, place: int) -> shown.Curve:
    label = str(run.attrs.get("fidelity", run.attrs.get("fmu", f"run {place + 1}")))
    own = FIDELITIES.get(label)
    colours = (own.colour, own.dash) if own else (("#1f6fd6", "#d6961f")[place % 2], "dash" if place else "solid")
    return shown.Curve(label, run.time.values, run[name].values, *colours)


def fly(
    trial: str | Path | xr.Dataset | Trial = "SIN",
    fidelity: str | Path = "HF",
    *,
    set: Settings | None = None,
    actuator: str | Path | Actuator | None = None,
    columns: Mapping[str, str] | None = None,
    fmus: str | Path | None = None,
) -> Flight:
    """Fly a trial.

    `trial`: the name of a built-in one, a file or a dataset with time [s] and command [rad; m of a linear actuator], or a
    Trial. `fidelity`: HF, ELF, ELF+, LF, or the path of an FMU with the twins' ports. `set`: parameters, faults, load_torque
    and supply_voltage by port name, as numbers in the port's unit or texts with one. `actuator`: a name, a file, or an
    Actuator. `columns`: port -> column of the file, as `--column` has it. `fmus`: folder of the FMUs; ours if not given, in
    which what is missing is built. HarnessError for whatever cannot be flown.
    """
    chosen = actuator_of(actuator)
    given = parameters_of(chosen, set)
    flown = trial_of(trial, chosen, columns)
    if str(fidelity).lower().endswith(".fmu"):
        path, settings, name = Path(fidelity), given, Path(fidelity).stem
    else:
        own = parse_fidelity(str(fidelity), "fidelity")
        path = fmu_folder([own], Path(fmus) if fmus else None, chosen) / own.fmu
        settings, name = merged(own, given), own.name
    with Twin(path) as twin:
        run = twin.run(flown, settings)
    run = run_of(run, chosen).assign_attrs(fidelity=name)
    return Flight(run.data_vars, run.coords, plain(run, given))


@dataclass(frozen=True)
class Compared:
    """A run against a reference: a Comparison for each variable, by name: `compared["position"].nrmse`."""

    candidate: xr.Dataset = field(repr=False)
    reference: xr.Dataset = field(repr=False)
    comparisons: tuple[Comparison, ...]

    def __getitem__(self, variable: str) -> Comparison:
        for item in self.comparisons:
            if item.variable == variable:
                return item
        raise KeyError(variable)

    def __iter__(self) -> Iterator[Comparison]:
        return iter(self.comparisons)

    def __len__(self) -> int:
        return len(self.comparisons)

    @property
    def table(self) -> pd.DataFrame:
        """A row for each variable: unit, nrmse, max_abs, t_max_abs [s], outside."""
        keys = ("unit", "nrmse", "max_abs", "t_max_abs", "outside")
        rows = [[getattr(item, key) for key in keys] for item in self.comparisons]
        index = pd.Index([item.variable for item in self.comparisons], name="variable")
        return pd.DataFrame(rows, index=index, columns=list(keys))

    def __repr__(self) -> str:
        rows = [f"  {item.variable}: {percent(item)}, at most {item.max_abs:.4g} {item.unit}" for item in self.comparisons]
        return "\n".join([f"{_title(self.candidate)} against {_title(self.reference)} (NRMSE)", *rows])

    def _repr_html_(self) -> str:
        rows = [
            (item.variable, percent(item), f"{item.max_abs:.4g} {item.unit}", f"{item.t_max_abs:.4f} s")
            for item in self.comparisons
        ]
        return (
            shown.lines([f"{_title(self.candidate)} against {_title(self.reference)}"])
            + shown.drawing(_rows([self.reference, self.candidate]))
            + shown.table(("variable", "NRMSE", "largest error", "at"), rows)
        )


def compare(
    candidate: str | Path | xr.Dataset,
    reference: str | Path | xr.Dataset = REFERENCE.name,
    *,
    trial: str | Path | xr.Dataset | Trial = "SIN",
    set: Settings | None = None,
    actuator: str | Path | Actuator | None = None,
    fmus: str | Path | None = None,
    tube: float = TUBE,
) -> Compared:
    """Compare a run with a reference, variable by variable.

    Each is a dataset that has been flown, or what flies `trial` as in `fly`: a fidelity or the path of an FMU. `tube`: half
    width of the tolerance tube, as a fraction of the reference's range. HarnessError as from `fly`, or if the two have no
    variable or no time in common, or differ in units.
    """
    if not 0.0 <= tube <= 1.0:
        raise HarnessError(f"tube={tube:g}: a fraction of the range from 0 to 1 is needed")
    runs = [
        _described(each) if isinstance(each, xr.Dataset) else fly(trial, each, set=set, actuator=actuator, fmus=fmus)
        for each in (candidate, reference)
    ]
    for name in runs[1].data_vars:
        units = [run[name].attrs["units"] for run in runs if name in run]
        if len({*units}) > 1:
            raise HarnessError(f"{name}: {units[0]} in the candidate, {units[1]} in the reference; one unit is needed")
    found = compare_runs(runs[0], runs[1], names=(_title(runs[0]), _title(runs[1])), tube=tube)
    return Compared(runs[0], runs[1], tuple(found))


def _described(run: xr.Dataset) -> xr.Dataset:
    """A dataset with the units and the name that a comparison needs: the ports' own, where it does not say."""
    if "time" not in run.coords:
        raise HarnessError(
            f"a dataset over time is needed; this one has {', '.join(map(str, run.coords)) or 'no coordinate'}"
        )
    units = {
        name: run[name].attrs.get("units", ports.VARIABLES[ports.INDEX[str(name)]].unit if name in ports.INDEX else "1")
        for name in run.data_vars
    }
    described = run.assign({name: run[name].assign_attrs(units=unit) for name, unit in units.items()})
    return described.assign_attrs(trial=run.attrs.get("trial", "run"))

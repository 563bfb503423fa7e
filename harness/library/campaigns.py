"""Campaigns, flown or found."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from harness.actuators.actuator import Actuator
from harness.errors import HarnessError, required_extra
from harness.files import results
from harness.library import shown
from harness.library.inputs import Settings, actuator_of, names, stated, trial_of
from harness.ready import fmu_folder
from harness.trials import BUILT_IN


@dataclass(frozen=True)
class Campaign:
    """A campaign on disk: the `folder`, how many `cases` it has, and number and reason of each that failed."""

    folder: Path
    cases: int
    failures: tuple[tuple[int, str], ...]

    @property
    def dataset(self) -> xr.Dataset:
        """campaign.zarr, read as it is needed."""
        return xr.open_zarr(self.folder / "campaign.zarr")

    @property
    def features(self) -> pd.DataFrame:
        """features.parquet: a row for each case, its parameters and features."""
        return pd.read_parquet(self.folder / "features.parquet")

    def __repr__(self) -> str:
        return f"{self.folder}: {self.cases} cases, {len(self.failures)} failed; .dataset and .features hold them"

    def _repr_html_(self) -> str:
        rows = self.features.describe().T.reset_index().rename(columns={"index": ""})
        failed = [f"case {case} failed: {reason}" for case, reason in self.failures[:10]]
        return shown.lines([repr(self), *failed]) + rows.to_html(index=False, float_format=lambda value: f"{value:.4g}")


def campaign(
    plan: str | Path | None = None,
    out: str | Path = "campaign",
    *,
    trials: str | Path | Sequence[str] | None = None,
    fidelities: str | Sequence[str] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    grid: Mapping[str, Sequence[float | str]] | None = None,
    cases: str | Path | None = None,
    set: Settings | None = None,
    samples: int | None = None,
    sampling: str | None = None,
    seed: int | None = None,
    noise: Mapping[str, float | str] | None = None,
    outputs: str | Sequence[str] | None = None,
    rate: float | None = None,
    actuator: str | Path | Actuator | None = None,
    scheduler: str | None = None,
    workers: int = 0,
    fmus: str | Path | None = None,
) -> Campaign:
    """Fly many cases into one dataset in the folder `out`; what is there already is not flown again.

    `plan`: a campaign file, over which the other arguments, which are named and meant as its keys, take precedence.
    `trials`: names, or one file. `workers`: processes on this machine, 0 for one a core; `scheduler`: a Dask scheduler
    instead. In a script, call it under `if __name__ == "__main__":`, for the workers import the script again. HarnessError
    for whatever cannot be flown; a case that fails is in `failures`.
    """
    with required_extra("campaign", "a campaign"):
        from harness.campaigns.planfile import read_plan
        from harness.campaigns.run import cluster, run

    chosen = actuator_of(actuator)
    if workers < 0:
        raise HarnessError(f"workers={workers}: 0 or more is needed")
    own = None
    options: dict[str, Any] = {}
    if isinstance(trials, str | Path) and Path(trials).suffix and str(trials).upper() not in BUILT_IN:
        own = trial_of(trials, chosen, None)
    elif trials is not None:
        options["trials"] = names(str(trials) if isinstance(trials, Path) else trials)
    for key, texts in (("fidelities", fidelities), ("outputs", outputs)):
        if texts is not None:
            options[key] = names(texts)
    for key, table in (("ranges", ranges), ("grid", grid)):
        if table is not None:
            options[key] = {name: list(values) for name, values in table.items()}
    if set is not None:
        options["set"] = stated(set)
    if noise is not None:
        options["noise"] = dict(noise)
    single = {"samples": samples, "sampling": sampling, "seed": seed, "rate": rate, "cases": cases}
    options |= {key: value for key, value in single.items() if value is not None}
    planned = read_plan(Path(plan) if plan else None, options, own, chosen)
    folder = Path(out)
    results.prepare(folder)
    held = fmu_folder(planned.fidelities, Path(fmus) if fmus else None, chosen)
    with cluster(scheduler, workers or os.cpu_count() or 1) as client:
        summary = run(planned, client, fmus=held, out=folder)
    return Campaign(folder, summary.cases + summary.before, tuple(summary.failures))

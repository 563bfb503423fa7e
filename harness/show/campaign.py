"""The page of a campaign: its cases in parallel coordinates, features against what was varied, and what failed."""

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import xarray as xr
from plotly.subplots import make_subplots

from ema_fmu_src import ports
from harness.actuators.actuator import DEFAULT, Actuator
from harness.provenance import Provenance
from harness.show.curves import lines_of
from harness.show.page import LAYOUT, document, drawn, flown_actuator, table

MOST_READ = 20_000
"""Cases whose features are read."""
MOST_CASES = 2000
"""Cases drawn; more cannot be told apart and make the page heavy."""
MOST_PANELS = 6
"""Parameters that have a panel of their own."""
MOST_FAILURES = 50
"""Failed cases that are listed."""
COLOURED = "tracking_error_rms"
"""The feature by which lines are coloured: every campaign has it."""
SCALE = "Viridis"
SIDE_BY_SIDE = 2
"""Panels in a row, so that they can be read on a telephone."""
SYMBOLS = ("circle", "x", "diamond", "triangle-up", "square", "cross")
"""Markers of the trials."""
WIDTH = 9.5
"""Of an axis of the parallel coordinates [rem], at least."""


def page(held: xr.Dataset, failures: Sequence[tuple[int, str]], record: Provenance, actuator: Actuator = DEFAULT) -> str:
    """The page as HTML text; `held` is the campaign's dataset, `failures` number and reason of each case that has failed,
    `record` how it was made."""
    cases, names = held.sizes["case"], varied(held)
    verdict = f"{len(failures)} of {cases} cases have failed" if failures else f"{cases} cases flown, none has failed"
    kinds = ", ".join(_counted(name, len(set(held[name].values))) for name in ("trial", "fidelity"))
    kept = (
        f"{kinds}; what is kept: {', '.join(_outputs(held))}. The data: campaign.zarr and features.parquet beside this page."
    )
    return document(
        "EMA twins: campaign",
        f'<h1>Campaign</h1><p class="verdict {"over" if failures else "ok"}">{verdict}.</p>{flown_actuator(actuator)}'
        f"<p>{kept}</p>{_table_of_varied(held, names)}{_failures(held, failures, names)}"
        f"{_sections(held.isel(case=slice(None, None, _stride(cases, MOST_READ))), names)}",
        record,
    )


def varied(held: xr.Dataset) -> list[str]:
    """The parameters that are not the same in all cases of a fidelity."""
    of_fidelity = [held["fidelity"].values == name for name in np.unique(held["fidelity"].values)]
    found = []
    for name in (port.name for port in ports.VARIABLES if port.name in held.coords):
        values = held[name].values
        if any(len(np.unique(values[rows])) > 1 for rows in of_fidelity):
            found.append(name)
    return found


def unit_of(held: xr.Dataset, feature: str) -> str:
    """Unit of a feature: an output's own, or that of what it is made of."""
    for name in _outputs(held):
        if feature in (f"{name}_rms", f"{name}_range"):
            return str(held[name].attrs["units"])
    if feature.startswith("tracking_error"):
        return str(held["mechanics.end_stop"].attrs["units"])
    return "A" if feature.startswith("current_harmonic") else "J" if feature.startswith("energy") else "1"


def _counted(name: str, count: int) -> str:
    return f"{count} {name if count == 1 else {'trial': 'trials', 'fidelity': 'fidelities'}[name]}"


def _outputs(held: xr.Dataset) -> list[str]:
    return [str(name) for name in held.data_vars if held[name].dims == ("case", "time")]


def _frame(held: xr.Dataset) -> pd.DataFrame:
    """Features of the cases that were flown, over their places in `held`."""
    frame = pd.DataFrame(held["features"].values, columns=[str(name) for name in held["feature"].values])
    return frame[frame.notna().all(axis=1)]


def _label(held: xr.Dataset, name: str) -> str:
    unit = held[name].attrs.get("units", "1") if name in held.coords else unit_of(held, name)
    return name if unit == "1" else f"{name} [{unit}]"


def _stride(count: int, most: int) -> int:
    return max(1, -(-count // most))


def _table_of_varied(held: xr.Dataset, names: Sequence[str]) -> str:
    if not names:
        return "<p>No parameter is varied.</p>"
    rows = []
    for name in names:
        values = held[name].values.astype(float)
        found = np.unique(values)
        shown = ", ".join(f"{value:.4g}" for value in found) if len(found) <= 5 else f"{len(found)} values"
        meaning, unit = str(held[name].attrs["long_name"]), str(held[name].attrs["units"])
        rows.append((name, meaning, unit, f"{found[0]:.4g}", f"{found[-1]:.4g}", shown))
    return table("What is varied", ("Parameter", "Meaning", "Unit", "Least", "Greatest", "Values"), rows)


def _failures(held: xr.Dataset, failures: Sequence[tuple[int, str]], names: Sequence[str]) -> str:
    """The failed cases as a table, as HTML; empty if there are none."""
    if not failures:
        return ""
    columns = [held[name].values for name in ("trial", "fidelity", *names)]
    rows = [
        (
            str(case),
            reason,
            *(f"{column[case]:.4g}" if column.dtype.kind == "f" else str(column[case]) for column in columns),
        )
        for case, reason in failures[:MOST_FAILURES]
    ]
    rest = f", the first {MOST_FAILURES} of {len(failures)}" if len(failures) > MOST_FAILURES else ""
    heads = ("Case", "Reason", "Trial", "Fidelity", *(_label(held, name) for name in names))
    return f"<section><h2>Failures</h2>{table(f'Cases that have failed{rest}', heads, rows)}</section>"


def _sections(held: xr.Dataset, names: Sequence[str]) -> str:
    """The figures as HTML; none where too few cases are flown to compare."""
    frame = _frame(held)
    if len(frame) < 2 or not names:
        return '<p class="note">With fewer than two cases that differ there is nothing to draw.</p>'
    related = relations(held, frame, names)
    shown = frame.iloc[:: _stride(len(frame), MOST_CASES)]
    part = "" if len(shown) == len(frame) else f" Every {_stride(len(frame), MOST_CASES)}th case is drawn."
    panels = panel_pairs(related)
    less = "" if len(panels) == len(names) else f" {len(panels)} of the {len(names)} parameters, those that show most."
    lines = parallel(held, shown, names, panels)
    pictures = "".join(
        drawn(against(held, shown, pair), "; ".join(f"{feature} over {name}" for name, feature in pair), "low")
        for pair in (panels[first : first + SIDE_BY_SIDE] for first in range(0, len(panels), SIDE_BY_SIDE))
    )
    return (
        f"<section><h2>Cases in parallel coordinates</h2><p>A line is a case, coloured by {COLOURED}. Drag along an axis to "
        f"select, drag an axis to move it.{part}</p>"
        f'<div class="scroll" tabindex="0"><div style="min-width:{WIDTH * len(lines.data[0].dimensions):g}rem">'
        f"{drawn(lines, 'Each case as a line over what was varied and its features.', 'low')}</div></div></section>"
        "<section><h2>Features against faults</h2><p>Each parameter with the feature that follows it most closely, by rank "
        f"correlation within a trial and fidelity.{less}</p>{pictures}"
        "<p>Rank correlation of every feature with what was varied: 1 rises, -1 falls with it, 0 no monotone relation.</p>"
        f"{drawn(correlations(related), 'Rank correlations of features and parameters.', 'low')}</section>"
    )


def relations(held: xr.Dataset, frame: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Rank correlation of each feature (row) with each parameter (column), within a trial and fidelity, their mean.

    NaN where a feature or a parameter does not vary.
    """
    given = pd.DataFrame({name: held[name].values.astype(float) for name in names}).loc[frame.index]
    groups = [held[name].values[frame.index] for name in ("trial", "fidelity")]
    found = []
    for _, members in frame.groupby(groups):
        ranks, causes = members.rank(), given.loc[members.index].rank()
        found.append(pd.DataFrame({name: ranks.corrwith(causes[name]) for name in names}))
    return pd.concat(found).groupby(level=0, sort=False).mean()


def panel_pairs(related: pd.DataFrame) -> list[tuple[str, str]]:
    """Parameter and the feature that follows it most, for the parameters that show most, in their order."""
    best = related.abs().max().fillna(0.0)
    chosen = set(best.sort_values(ascending=False, kind="stable").index[:MOST_PANELS])
    strongest = related.abs().fillna(-1.0).idxmax()
    return [(str(name), str(strongest[name])) for name in related.columns if name in chosen]


def parallel(held: xr.Dataset, frame: pd.DataFrame, names: Sequence[str], panels: Sequence[tuple[str, str]]) -> go.Figure:
    """The cases as lines over what was varied, then the features that follow it, and COLOURED last."""
    rows = frame.index.to_numpy()
    dimensions = []
    for name in ("trial", "fidelity"):
        kinds = list(dict.fromkeys(held[name].values.tolist()))
        if len(kinds) > 1:
            places = [kinds.index(kind) for kind in held[name].values[rows]]
            dimensions.append({"label": name, "values": places, "tickvals": list(range(len(kinds))), "ticktext": kinds})
    dimensions += [
        {"label": _label(held, name), "values": _rounded(held[name].values[rows].astype(float))} for name in names
    ]
    features = [name for name in dict.fromkeys(feature for _, feature in panels) if name != COLOURED]
    dimensions += [
        {"label": _label(held, name), "values": _rounded(frame[name].to_numpy())} for name in (*features, COLOURED)
    ]
    drawing = go.Figure(
        go.Parcoords(
            dimensions=dimensions,
            line={
                "color": _rounded(frame[COLOURED].to_numpy()),
                "colorscale": SCALE,
                "showscale": True,
                "colorbar": {"title": {"text": _label(held, COLOURED), "side": "right"}, "thickness": 12},
            },
            labelfont={"size": 11},
        )
    )
    drawing.update_layout(**LAYOUT | {"margin": {"l": 70, "r": 20, "t": 60, "b": 30}})
    return drawing


def against(held: xr.Dataset, frame: pd.DataFrame, panels: Sequence[tuple[str, str]]) -> go.Figure:
    """A panel for each parameter and its feature, side by side: a fidelity has its colour, a trial its marker."""
    drawing = make_subplots(rows=1, cols=SIDE_BY_SIDE, horizontal_spacing=0.14)
    kinds, trials = (held[name].values[frame.index] for name in ("fidelity", "trial"))
    for column, (name, feature) in enumerate(panels, start=1):
        for fidelity, line in lines_of(kinds.tolist()).items():
            for trial, symbol in zip(dict.fromkeys(trials.tolist()), itertools.cycle(SYMBOLS), strict=False):
                rows = frame.index[(kinds == fidelity) & (trials == trial)].to_numpy()
                drawing.add_scatter(
                    x=_rounded(held[name].values[rows].astype(float)), y=_rounded(frame.loc[rows, feature].to_numpy()),
                    text=[f"case {case}" for case in held["case"].values[rows]], mode="markers", name=f"{fidelity}, {trial}",
                    legendgroup=f"{fidelity}, {trial}", showlegend=column == 1,
                    marker={"size": 6, "color": line.colour, "opacity": 0.65, "symbol": symbol}, row=1, col=column,
                )  # fmt: skip
        drawing.update_xaxes(title={"text": _label(held, name), "font": {"size": 12}}, row=1, col=column)
        drawing.update_yaxes(title={"text": _label(held, feature), "font": {"size": 12}}, row=1, col=column)
    drawing.update_layout(**LAYOUT)
    return drawing


def correlations(related: pd.DataFrame) -> go.Figure:
    """Rank correlations, features over parameters, blue where a feature falls and red where it rises."""
    drawing = go.Figure(
        go.Heatmap(
            z=[[None if np.isnan(value) else round(float(value), 3) for value in row] for row in related.to_numpy()],
            x=list(related.columns), y=list(related.index), zmin=-1, zmax=1, colorscale="RdBu", reversescale=True,
            colorbar={"title": {"text": "rank correlation [1]", "side": "right"}, "thickness": 12},
            hovertemplate="%{y} with %{x}: %{z}<extra></extra>",
        )
    )  # fmt: skip
    drawing.update_yaxes(autorange="reversed", automargin=True, tickfont={"size": 11}, dtick=1)
    drawing.update_layout(**LAYOUT | {"margin": {"l": 70, "r": 20, "t": 30, "b": 50}})
    return drawing


def _rounded(series: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in series]

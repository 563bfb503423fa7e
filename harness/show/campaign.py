"""The page of a campaign: its cases in parallel coordinates, features against what was varied, and what failed."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import xarray as xr
from plotly.subplots import make_subplots

from harness.actuators.actuator import DEFAULT, Actuator
from harness.provenance import Provenance
from harness.show.curves import lines_of
from harness.show.page import LAYOUT, document, drawn, flown_actuator, table

MOST_CASES = 2000
"""Cases drawn; more cannot be told apart and make the page heavy."""
MOST_PANELS = 6
"""Parameters that have a panel of their own."""
MOST_FAILURES = 50
"""Failed cases that are listed."""
COLOURED = "tracking_error_rms"
"""The feature by which lines are coloured: every campaign has it."""
SCALE = "Viridis"


def page(held: xr.Dataset, record: Provenance, actuator: Actuator = DEFAULT) -> str:
    """The page as HTML text; `held` is the campaign's dataset, `record` how it was made."""
    cases, failed = held.sizes["case"], np.flatnonzero(held["failure"].values != "")
    verdict = f"{len(failed)} of {cases} cases have failed" if len(failed) else f"{cases} cases flown, none has failed"
    frame, names = _frame(held), varied(held)
    kinds = ", ".join(_counted(name, len(set(held[name].values))) for name in ("trial", "fidelity"))
    kept = (
        f"{kinds}; what is kept: {', '.join(_outputs(held))}. The data: campaign.zarr and features.parquet beside this page."
    )
    return document(
        "EMA twins: campaign",
        f'<h1>Campaign</h1><p class="verdict {"over" if len(failed) else "ok"}">{verdict}.</p>{flown_actuator(actuator)}'
        f"<p>{kept}</p>{_table_of_varied(held, names)}{_failures(held, failed, names)}{_sections(held, frame, names)}",
        record,
    )


def varied(held: xr.Dataset) -> list[str]:
    """The parameters that are not the same in all cases and that were chosen, not set by a fidelity."""
    per_fidelity = held["fidelity"].values
    found = []
    for name in held.coords:
        if held[name].dims != ("case",) or name in ("case", "trial", "fidelity") or held[name].dtype.kind not in "fiub":
            continue
        values = held[name].values
        if any(len(np.unique(values[per_fidelity == fidelity])) > 1 for fidelity in np.unique(per_fidelity)):
            found.append(str(name))
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
    """Features of the cases that were flown, over the case's number."""
    features = [str(name) for name in held["feature"].values]
    frame = pd.DataFrame(held["features"].values, index=held["case"].values, columns=features)
    return frame[held["failure"].values == ""]


def _label(held: xr.Dataset, name: str) -> str:
    unit = held[name].attrs.get("units", "1") if name in held.coords else unit_of(held, name)
    return name if unit == "1" else f"{name} [{unit}]"


def _thinned(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.iloc[:: max(1, -(-len(frame) // MOST_CASES))]


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


def _failures(held: xr.Dataset, failed: np.ndarray, names: Sequence[str]) -> str:
    """The failed cases as a table, as HTML; empty if there are none."""
    if not len(failed):
        return ""
    said = [held[name].values for name in ("failure", "trial", "fidelity")]
    rows = [
        (str(case), *(str(each[case]) for each in said), *(f"{float(held[name].values[case]):.4g}" for name in names))
        for case in failed[:MOST_FAILURES]
    ]
    rest = f", the first {MOST_FAILURES} of {len(failed)}" if len(failed) > MOST_FAILURES else ""
    heads = ("Case", "Reason", "Trial", "Fidelity", *(_label(held, name) for name in names))
    return f"<section><h2>Failures</h2>{table(f'Cases that have failed{rest}', heads, rows)}</section>"


def _sections(held: xr.Dataset, frame: pd.DataFrame, names: Sequence[str]) -> str:
    """The figures as HTML; none where too few cases are flown to compare."""
    if len(frame) < 2 or not names:
        return '<p class="note">With fewer than two cases that differ there is nothing to draw.</p>'
    related = relations(held, frame, names)
    drawn_cases = _thinned(frame)
    part = "" if len(drawn_cases) == len(frame) else f" {len(drawn_cases)} of the {len(frame)} cases are drawn."
    panels = panel_pairs(related)
    less = "" if len(panels) == len(names) else f" {len(panels)} of the {len(names)} parameters, those that show most."
    lines = drawn(
        parallel(held, drawn_cases, names, panels), "Each case as a line over what was varied and its features.", "low"
    )
    return (
        f"<section><h2>Cases in parallel coordinates</h2><p>A line is a case, coloured by {COLOURED}. Drag along an axis to "
        f"select, drag an axis to move it.{part}</p>"
        f'<div class="scroll" tabindex="0"><div style="min-width:{9 * (len(names) + 5)}rem">'
        f"{lines}</div></div></section>"
        "<section><h2>Features against faults</h2><p>Each parameter with the feature that follows it most closely, by rank "
        f"correlation.{less}</p>{drawn(against(held, drawn_cases, panels), 'Features over the parameters varied.', 'low')}"
        "<p>Rank correlation of every feature with what was varied: 1 rises, -1 falls with it, 0 no monotone relation.</p>"
        f"{drawn(correlations(held, related), 'Rank correlations of features and parameters.', 'low')}</section>"
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
            labelfont={"size": 12},
        )
    )
    drawing.update_layout(**LAYOUT | {"margin": {"l": 70, "r": 20, "t": 60, "b": 30}})
    return drawing


def against(held: xr.Dataset, frame: pd.DataFrame, panels: Sequence[tuple[str, str]]) -> go.Figure:
    """A panel for each parameter and its feature, coloured by fidelity."""
    columns = min(3, len(panels))
    drawing = make_subplots(rows=-(-len(panels) // columns), cols=columns, horizontal_spacing=0.11, vertical_spacing=0.24)
    kinds = held["fidelity"].values[frame.index]
    for place, (name, feature) in enumerate(panels):
        where = {"row": 1 + place // columns, "col": 1 + place % columns}
        for fidelity, line in lines_of(kinds.tolist()).items():
            rows = frame.index[kinds == fidelity].to_numpy()
            drawing.add_scatter(
                x=_rounded(held[name].values[rows].astype(float)), y=_rounded(frame.loc[rows, feature].to_numpy()),
                text=[f"case {case}, {held['trial'].values[case]}" for case in rows], mode="markers", name=fidelity,
                legendgroup=fidelity, showlegend=place == 0, marker={"size": 5, "color": line.colour, "opacity": 0.6},
                **where,
            )  # fmt: skip
        drawing.update_xaxes(title={"text": _label(held, name), "font": {"size": 12}}, **where)
        drawing.update_yaxes(title={"text": _label(held, feature), "font": {"size": 12}}, **where)
    drawing.update_layout(**LAYOUT)
    return drawing


def correlations(held: xr.Dataset, related: pd.DataFrame) -> go.Figure:
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

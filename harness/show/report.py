"""One self-contained HTML page: errors, wall times and the paper's Figures 5 to 7 from our own runs."""

import html
from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go
import xarray as xr
from plotly.subplots import make_subplots

from harness.comparison import FIGURES, Comparison, percent
from harness.flight.experiment import Experiment
from harness.show.page import LAYOUT, document, drawn, origin

INSTANTANEOUS = "equivalent_current"
"""Drawn under the filtered current, hidden until its name in the legend is pressed."""
COLOURS = {"command": "#888888", "HF": "#1f6fd6", "ELF": "#d65a1f", "ELF+": "#16935b", "LF": "#9a4fc2"}
DASHES = {"command": "dot", "HF": "solid", "ELF": "dash", "ELF+": "dash", "LF": "dashdot"}
MOST_POINTS = 2501
"""Points drawn of each curve; more cannot be told apart and make the page heavy."""

Budgets = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Trial -> fidelity -> variable -> NRMSE allowed (harness/check.py)."""


def page(experiment: Experiment, *, parameters: Mapping[str, float], command: str, budgets: Budgets | None = None) -> str:
    """The page as HTML text, with everything it needs inside it; errors are held against `budgets` where there are any.

    `parameters` are those that were set for all runs; `command` is the command line that makes the page again.
    """
    trials = list(dict.fromkeys(trial for trial, _ in experiment.runs))
    sections = "".join(
        f"<section><h2>{html.escape(trial)}</h2>{drawn(_figure(trial, experiment), _spoken(trial, experiment))}</section>"
        for trial in trials
    )
    settings = ", ".join(f"{name} = {value:g}" for name, value in parameters.items()) or "all at their defaults"
    cost = "Error of position against wall time per simulated second, by fidelity; the table has the figures."
    return document(
        f"EMA twins: {', '.join(trials)}",
        f"<h1>EMA twins side by side</h1>{_verdict(experiment, budgets or {})}"
        f"<p>Every fidelity flown as an FMU and compared with {experiment.reference}. "
        "NRMSE is the rms difference over the range of the reference.</p>"
        f'<div class="scroll" tabindex="0">{_table(experiment, trials, budgets or {})}</div>'
        f"<section><h2>Error against cost</h2>{drawn(_cost(experiment), cost, 'low')}</section>"
        f"{sections}{origin(command, f'; FMUs: {html.escape(_hashes(experiment))}; parameters: {html.escape(settings)}')}",
    )


def _hashes(experiment: Experiment) -> str:
    found = {run.attrs["fmu"]: run.attrs["fmu_sha256"][:12] for run in experiment.runs.values()}
    return ", ".join(f"{name} (SHA-256 {digest}...)" for name, digest in found.items())


def _budget(budgets: Budgets, item: Comparison) -> float | None:
    return budgets.get(item.trial, {}).get(item.candidate, {}).get(item.variable)


def _verdict(experiment: Experiment, budgets: Budgets) -> str:
    """One sentence on how the errors stand against their budgets."""
    held = [(item, _budget(budgets, item)) for item in experiment.comparisons]
    judged = [(item, budget) for item, budget in held if budget is not None]
    outside = [item for item, budget in judged if item.nrmse is None or item.nrmse > budget]
    failed = "".join(f'<p class="verdict over">{html.escape(line)}</p>' for line in experiment.failures)
    if not judged:
        return failed
    if not outside:
        return f'{failed}<p class="verdict ok">All {len(judged)} errors with a budget are within it.</p>'
    names = html.escape(", ".join(f"{item.trial} {item.candidate} {item.variable}" for item in outside))
    told = f"{len(outside)} of {len(judged)} errors exceed their budget: {names}."
    return f'{failed}<p class="verdict over">{told}</p>'


def _cell(item: Comparison | None, budgets: Budgets) -> str:
    """An error, coloured and marked by how much of its budget it takes."""
    budget = None if item is None else _budget(budgets, item)
    if item is None or item.nrmse is None or budget is None:
        return f"<td>{percent(item)}</td>"
    kind, mark = ("over", "!") if item.nrmse > budget else ("near", "") if item.nrmse > 0.7 * budget else ("ok", "")
    told = f"budget {100.0 * budget:.4f} %"
    return f'<td class="{kind}" title="{told}">{mark} {percent(item)} <small>of {100.0 * budget:.3g} %</small></td>'


def _table(experiment: Experiment, trials: list[str], budgets: Budgets) -> str:
    rows = []
    for (trial, fidelity), run in sorted(experiment.runs.items(), key=lambda entry: trials.index(entry[0][0])):
        errors = experiment.errors_of(trial, fidelity)
        cells = "".join(_cell(errors.get(name), budgets) for name, _ in FIGURES)
        wall = run.attrs["wall_s"] / run.attrs["simulated_s"]
        head = f'<th scope="row">{html.escape(trial)}</th><td>{html.escape(fidelity)}</td>'
        rows.append(f"<tr>{head}{cells}<td>{wall:.4f}</td></tr>")
    heads = ("Trial", "Fidelity", "Position", "Motor speed", "Current, filtered", "Wall s / s")
    return (
        "<table><caption>Errors (NRMSE, of their budget where there is one) and wall seconds per simulated second"
        f"</caption><thead><tr>{''.join(f'<th scope=col>{head}</th>' for head in heads)}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _cost(experiment: Experiment) -> go.Figure:
    figure = go.Figure()
    names = dict.fromkeys(fidelity for _, fidelity in experiment.runs if fidelity != experiment.reference)
    for name in names:
        runs = [(trial, run) for (trial, fidelity), run in experiment.runs.items() if fidelity == name]
        items = [experiment.errors_of(trial, name).get("position") for trial, _ in runs]
        figure.add_scatter(
            x=[run.attrs["wall_s"] / run.attrs["simulated_s"] for _, run in runs],
            y=[100.0 * item.nrmse if item and item.nrmse else None for item in items],
            text=[trial for trial, _ in runs],
            mode="markers+text",
            textposition="middle right",
            name=name,
            marker={"size": 11, "color": COLOURS.get(name)},
        )
    figure.update_xaxes(type="log", title="wall s / simulated s")
    figure.update_yaxes(type="log", title="error of position [%]")
    figure.update_layout(**LAYOUT)
    return figure


def _spoken(trial: str, experiment: Experiment) -> str:
    told = [
        f"{item.candidate} {percent(item)}"
        for item in experiment.comparisons
        if item.trial == trial and item.variable == "position"
    ]
    return f"{trial}: position, motor speed and current over time. Position error: {', '.join(told) or 'none'}."


def _saturated(run: xr.DataArray) -> list[tuple[float, float]]:
    """Intervals of time [s] in which the flag is up."""
    up = np.concatenate([[False], run.values.astype(bool), [False]])
    edges = np.flatnonzero(np.diff(up.astype(int)))
    times = run.time.values
    return [(float(times[first]), float(times[last - 1])) for first, last in edges.reshape(-1, 2)]


def _figure(trial: str, experiment: Experiment) -> go.Figure:
    """Each quantity, with the residuals against the reference under it; the reference's saturated intervals shaded."""
    heights = [0.72, 0.28] * len(FIGURES)
    figure = make_subplots(
        rows=2 * len(FIGURES), cols=1, shared_xaxes=True, vertical_spacing=0.025, row_heights=[h / 3.0 for h in heights]
    )
    flown = [(fidelity, run) for (name, fidelity), run in experiment.runs.items() if name == trial]
    reference = experiment.runs[trial, experiment.reference]
    for place, (variable, title) in enumerate(FIGURES):
        row = 2 * place + 1
        curves = [("command", reference["command"])] if place == 0 else []
        curves += [(fidelity, run[variable]) for fidelity, run in flown]
        for name, values in curves:
            figure.add_trace(_curve(name, values, showlegend=place == 0), row=row, col=1)
        for fidelity, run in flown:
            if fidelity != experiment.reference:
                figure.add_trace(_curve(fidelity, run[variable] - reference[variable], showlegend=False), row=row + 1, col=1)
        figure.update_yaxes(title_text=title, row=row, col=1)
        figure.update_yaxes(title_text="residual", row=row + 1, col=1)
    for fidelity, run in flown:
        curve = _curve(fidelity, run[INSTANTANEOUS])
        curve.update(name=f"{fidelity} instantaneous", legendgroup=None, visible="legendonly", opacity=0.5)
        figure.add_trace(curve, row=2 * len(FIGURES) - 1, col=1)
    shade = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1, "layer": "below", "line": {"width": 0}}
    spans = _saturated(reference["voltage_saturated"])
    figure.update_layout(shapes=[shade | {"x0": x0, "x1": x1, "fillcolor": "rgba(214,150,31,.16)"} for x0, x1 in spans])
    figure.update_xaxes(title_text="Time [s] (shaded: voltage-limited)", row=2 * len(FIGURES), col=1)
    figure.update_layout(**LAYOUT, hovermode="x unified")
    return figure


def _curve(name: str, values: xr.DataArray, *, showlegend: bool = True) -> go.Scatter:
    stride = max(1, -(-values.size // MOST_POINTS))
    return go.Scatter(
        x=np.round(values.time.values[::stride], 6).tolist(),
        y=[float(f"{value:.6g}") for value in values.values[::stride]],
        name=name,
        legendgroup=name,
        showlegend=showlegend,
        mode="lines",
        line={"width": 1.6, "color": COLOURS.get(name), "dash": DASHES.get(name, "dash")},
    )

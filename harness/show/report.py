"""One self-contained HTML page: errors, wall times and the paper's Figures 5 to 7 from our own runs."""

import html
import math
from collections.abc import Callable, Mapping
from typing import Any

import plotly.graph_objects as go

from ema_fmu_src.fidelities import FIDELITIES
from harness.actuators.actuator import DEFAULT, Actuator
from harness.budgets import Budgets
from harness.comparison import FIGURES, Comparison, percent, titles
from harness.flight.experiment import Experiment
from harness.provenance import Provenance
from harness.show import cost
from harness.show.curves import COMMAND, RESIDUAL, Line, curve, intervals, lines_of, rows, shade, thinned
from harness.show.page import LAYOUT, document, drawn, flown_actuator

Points = Callable[[Any, Any], tuple[Any, Any]]
COST = "error against cost"
INSTANTANEOUS = "equivalent_current"
"""Drawn in the row of the filtered current, hidden until its name in the legend is pressed."""


def page(
    experiment: Experiment,
    *,
    parameters: Mapping[str, float],
    record: Provenance,
    budgets: Budgets | None = None,
    actuator: Actuator = DEFAULT,
) -> str:
    """The page as HTML text, with everything it needs inside it; errors are judged by `budgets` where there are any.

    `parameters` are those that were set for all runs; `record` says where the page comes from; `actuator` is the one that
    was flown, in whose units outside `experiment` is.
    """
    trials = list(dict.fromkeys(trial for trial, _ in experiment.runs))
    pictures = figures(experiment)
    below_curves = f"Shaded: {experiment.reference} is limited by its voltage; {RESIDUAL} {experiment.reference}."
    sections = "".join(
        f"<section><h2>{html.escape(trial)}</h2>"
        f"{drawn(pictures[trial], spoken(trial, experiment), note=below_curves)}</section>"
        for trial in trials
    )
    settings = ", ".join(f"{name} = {value:g}" for name, value in parameters.items()) or "all at their defaults"
    told = "Error of position against wall time per simulated second, by fidelity; the table has the figures."
    below = cost.note(_points(experiment), experiment.reference)
    return document(
        f"EMA twins: {', '.join(trials)}",
        f"<h1>EMA twins side by side</h1>{verdict(experiment, budgets or {})}{flown_actuator(actuator)}"
        f"<p>Every fidelity flown as an FMU and compared with {experiment.reference}. "
        "NRMSE is the rms difference over the range of the reference.</p>"
        f'<div class="scroll" tabindex="0">{table(experiment, trials, budgets or {})}</div>'
        f"<section><h2>Error against cost</h2>{drawn(pictures[COST], told, 'low', below)}"
        "</section>"
        f"{sections}",
        record,
        f"Parameters: {html.escape(settings)}",
    )


def figures(experiment: Experiment) -> dict[str, go.Figure]:
    """The figures of the page by name: error against cost, and each trial."""
    lines = lines_of(fidelity for _, fidelity in experiment.runs)
    trials = dict.fromkeys(trial for trial, _ in experiment.runs)
    return {
        COST: cost.figure(_points(experiment), experiment.reference),
        **{trial: figure_of(trial, experiment, lines) for trial in trials},
    }


def _budget(budgets: Budgets, item: Comparison) -> float | None:
    budget = budgets.get(item.trial, {}).get(item.candidate, {}).get(item.variable)
    return None if budget is None or math.isinf(budget) else budget


def verdict(experiment: Experiment, budgets: Budgets) -> str:
    """One sentence on how the errors stand against their budgets."""
    known = [(item, _budget(budgets, item)) for item in experiment.comparisons]
    judged = [(item, budget) for item, budget in known if budget is not None]
    outside = [item for item, budget in judged if item.nrmse is None or item.nrmse > budget]
    failed = "".join(f'<p class="verdict over">{html.escape(line)}</p>' for line in experiment.failures)
    if not judged:
        return failed
    if not outside:
        return f'{failed}<p class="verdict ok">All {len(judged)} errors with a budget are within it.</p>'
    names = html.escape(", ".join(f"{item.trial} {item.candidate} {item.variable}" for item in outside))
    outcome = f"{len(outside)} of {len(judged)} errors exceed their budget: {names}."
    return f'{failed}<p class="verdict over">{outcome}</p>'


def _cell(item: Comparison | None, budgets: Budgets) -> str:
    """An error, coloured and marked by how much of its budget it takes."""
    budget = None if item is None else _budget(budgets, item)
    if item is None or item.nrmse is None or budget is None:
        return f"<td>{percent(item)}</td>"
    kind, mark = ("over", "!") if item.nrmse > budget else ("near", "") if item.nrmse > 0.7 * budget else ("ok", "")
    title = f"budget {100.0 * budget:.4f} %"
    return f'<td class="{kind}" title="{title}">{mark} {percent(item)} <small>of {100.0 * budget:.3g} %</small></td>'


def table(experiment: Experiment, trials: list[str], budgets: Budgets) -> str:
    """Errors and wall times of `trials`, a row for each run, as HTML."""
    body = []
    for (trial, fidelity), run in sorted(experiment.runs.items(), key=lambda entry: trials.index(entry[0][0])):
        errors = experiment.errors_of(trial, fidelity)
        cells = "".join(_cell(errors.get(name), budgets) for name, _ in FIGURES)
        wall = run.attrs["wall_s"] / run.attrs["simulated_s"]
        title = html.escape(FIDELITIES[fidelity].title) if fidelity in FIDELITIES else ""
        head = f'<th scope="row">{html.escape(trial)}</th><td title="{title}">{html.escape(fidelity)}</td>'
        body.append(f"<tr>{head}{cells}<td>{wall:.4f}</td></tr>")
    heads = ("Trial", "Fidelity", "Position", "Motor speed", "Current, filtered", "Wall s / s")
    return (
        "<table><caption>Errors (NRMSE, of their budget where there is one) and wall seconds per simulated second"
        f"</caption><thead><tr>{''.join(f'<th scope=col>{head}</th>' for head in heads)}</tr></thead>"
        f"<tbody>{''.join(body)}</tbody></table>"
    )


def _points(experiment: Experiment) -> list[cost.Point]:
    points = []
    for (trial, fidelity), run in experiment.runs.items():
        found = experiment.errors_of(trial, fidelity).get("position")
        wall = run.attrs["wall_s"] / run.attrs["simulated_s"]
        points.append(cost.Point(fidelity, trial, wall, found.nrmse if found else None))
    return points


def spoken(trial: str, experiment: Experiment) -> str:
    """What the figure of a trial shows, in words."""
    errors = [
        f"{item.candidate} {percent(item)}"
        for item in experiment.comparisons
        if item.trial == trial and item.variable == "position"
    ]
    return f"{trial}: position, motor speed and current over time. Position error: {', '.join(errors) or 'none'}."


def figure_of(
    trial: str, experiment: Experiment, lines: Mapping[str, Line], *, residuals: bool = True, points: Points = thinned
) -> go.Figure:
    """Each quantity, with the residuals against the reference under it; the reference's saturated intervals shaded.

    `points` chooses what is drawn of times [s] and values.
    """
    flown = [(fidelity, run) for (name, fidelity), run in experiment.runs.items() if name == trial]
    reference = experiment.runs[trial, experiment.reference]
    each = 2 if residuals else 1
    figure = rows(
        [title.replace(", ", ",<br>").replace(" [", "<br>[") for title in titles(reference)],
        residuals=0.28 if residuals else 0.0,
        size=11,
    )
    time = reference.time.values
    command = curve("command", COMMAND, points(time, reference["command"].values))
    figure.add_trace(command, row=1, col=1)
    for place, (variable, _) in enumerate(FIGURES):
        for fidelity, run in flown:
            drawing = curve(fidelity, lines[fidelity], points(run.time.values, run[variable].values), legend=place == 0)
            figure.add_trace(drawing, row=each * place + 1, col=1)
        for fidelity, run in flown if residuals else ():
            if fidelity != experiment.reference:
                residual = run[variable] - reference[variable]
                drawing = curve(fidelity, lines[fidelity], points(residual.time.values, residual.values), legend=False)
                figure.add_trace(drawing, row=each * place + 2, col=1)
    for fidelity, run in flown:
        instantaneous = curve(fidelity, lines[fidelity], points(run.time.values, run[INSTANTANEOUS].values))
        instantaneous.update(name=f"{fidelity} instantaneous", legendgroup=None, visible="legendonly", opacity=0.5)
        figure.add_trace(instantaneous, row=each * (len(FIGURES) - 1) + 1, col=1)
    shade(figure, intervals(time, reference["voltage_saturated"].values), "rgba(214,150,31,.16)")
    figure.update_xaxes(title_text="Time [s]", row=each * len(FIGURES), col=1)
    figure.update_layout(**LAYOUT, hovermode="x unified")
    return figure

"""What was flown, as the page shows it: banner, figure, table and command line, in the look of the report."""

import html
from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go
import xarray as xr
from numpy.typing import NDArray

from ema_fmu_src import ports
from ema_fmu_src.fidelities import REFERENCE
from harness.actuators.actuator import Actuator
from harness.budgets import Budgets, budgets_for, read_budgets
from harness.flight.experiment import Experiment
from harness.flight.twin import CONSTANT_INPUTS
from harness.show import report
from harness.show.curves import RESIDUAL, lines_of, stride
from harness.show.live.wish import Flight, Wish

CONSTANTS = [port for port in ports.INPUTS if port.name in CONSTANT_INPUTS]


def view(wish: Wish, flight: Flight, runs: Mapping[str, xr.Dataset]) -> dict[str, Any]:
    """What the page shows, as data for JSON.

    `banner`, `table`, `about`: HTML. `figure`: Plotly's; `spoken`: what it shows, and `note`: what its shades are, in words.
    `command`: the command line that flies the same. `query`: what asks for it. `starts`: port -> value of the actuator's own
    faults, load and supply.
    """
    name = flight.trial.name
    experiment = Experiment({(name, flight.reference): runs[flight.reference]}, (), flight.reference)
    for fidelity, run in runs.items():
        if fidelity != flight.reference:
            experiment = experiment.with_run(run)
    budgets = _budgets(flight)
    residuals = wish.residuals and len(runs) > 1
    figure = report.figure_of(name, experiment, lines_of(runs), residuals=residuals, points=points)
    figure.update_xaxes(title_text="Time [s]", selector=lambda axis: axis.title.text)
    below = f"; {RESIDUAL} {flight.reference}" if residuals else ""
    return {
        "banner": banner(flight, experiment, budgets),
        "table": report.table(experiment, [name], budgets),
        "figure": figure_data(figure),
        "spoken": report.spoken(name, experiment),
        "note": f"Shaded: {flight.reference} is limited by its voltage{below}.",
        "command": flight.command,
        "query": wish.query,
        "about": described(flight.actuator),
        "starts": {port.name: flight.actuator.value(port.name) for port in (*ports.FAULTS, *CONSTANTS)},
    }


def points(time: NDArray[Any], values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """The points that are drawn, in single precision: Plotly's JSON has them in binary, and a pixel is coarser."""
    every = stride(len(time))
    return time[::every].astype(np.float32), values[::every].astype(np.float32)


def figure_data(figure: go.Figure) -> dict[str, Any]:
    """A figure as data for JSON, without Plotly's default template, which the page's own colours replace."""
    figure.update_layout(template="none", uirevision="kept")
    return dict(figure.to_plotly_json())


def banner(flight: Flight, experiment: Experiment, budgets: Budgets) -> str:
    """The verdict as in the report, or why there is none; and a line for each remark, as HTML."""
    said = report.verdict(experiment, budgets) or f'<p class="verdict none">{html.escape(_unjudged(flight))}</p>'
    return said + "".join(f'<p class="verdict near">{html.escape(line)}</p>' for line in flight.remarks)


def described(actuator: Actuator) -> str:
    """Which actuator is flown, as HTML."""
    told = f": {html.escape(actuator.description)}" if actuator.description else ""
    return f"Actuator <b>{html.escape(actuator.name)}</b>{told} (SHA-256 {actuator.sha256[:12]}...)"


def _budgets(flight: Flight) -> Budgets:
    """The budgets of what is flown: of a healthy actuator against the reference; empty if there are none."""
    if flight.settings or flight.reference != REFERENCE.name:
        return {}
    file = budgets_for(flight.actuator, flight.parameters)
    return read_budgets(file) if file else {}


def _unjudged(flight: Flight) -> str:
    if flight.reference != REFERENCE.name:
        return (
            f"Errors are against {flight.reference}, the highest fidelity shown; with {REFERENCE.name} they can be judged."
        )
    if flight.settings:
        return f"Errors are against {REFERENCE.name}; with parameters set, there are no budgets to judge them by."
    return f"Errors are against {REFERENCE.name}; there are no budgets for this trial and actuator to judge them by."

"""The page of an identification: verdict, estimates, and measured, healthy and identified curves with residuals."""

import html

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from ema_fmu_src import ports
from harness.identification.diagnosis import Diagnosis
from harness.identification.estimates import Estimate
from harness.identification.measured import Measured
from harness.show.page import LAYOUT, document, drawn, origin, table

MOST_POINTS = 2501
"""Most points drawn of each curve; more cannot be seen and make the page heavy."""
COLOURS = {"measured": "#888888", "healthy": "#16935b", "identified": "#1f6fd6"}
HEADS = ("Fault", "Estimate", "95 % interval", "Health", "")


def page(diagnosis: Diagnosis, measured: Measured, command: str) -> str:
    """The page as HTML text; `command` is the command line that makes it again."""
    kind = "near" if diagnosis.complaints else "over" if any(item.alarm for item in diagnosis.estimates) else "ok"
    notes = "".join(f"<p>{html.escape(line)}.</p>" for line in diagnosis.remarks)
    if diagnosis.complaints:
        notes += "<p>The estimates below are what comes nearest; they explain the run badly and mean nothing.</p>"
    health = "" if diagnosis.health is None else f" Health of the worst fault: {diagnosis.health:.2f}."
    description = f"Measured, healthy and identified curves of {', '.join(measured.channels)} over time, with residuals."
    return document(
        f"EMA twins: {diagnosis.name} identified",
        f"<h1>{html.escape(diagnosis.name)}, identified with {html.escape(diagnosis.fidelity)}</h1>"
        f'<p class="verdict {kind}">{html.escape(diagnosis.verdict)}.{health}</p>{notes}'
        f"{table(_caption(diagnosis), HEADS, rows(diagnosis))}"
        f"<section><h2>Measured and identified</h2>{drawn(figure(diagnosis, measured), description)}</section>"
        f"{origin(command)}",
    )


def _caption(diagnosis: Diagnosis) -> str:
    return f"Faults, after {diagnosis.evaluations} runs of FMUs in {diagnosis.seconds:.1f} s"


def rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """A row of texts for each estimate, under HEADS."""
    return [_row(item) for item in diagnosis.estimates]


def _row(item: Estimate) -> tuple[str, ...]:
    unit = "" if item.unit == "1" else f" {item.unit}"
    health = "-" if item.health is None else f"{'' if item.identifiable else '<= '}{item.health:.2f}"
    remark = "" if item.identifiable else f"not identifiable: {item.reason}"
    if item.alarm:
        remark = f"ALARM; {remark}" if remark else "ALARM"
    return item.fault, f"{item.value:.4g}{unit}", f"{item.low:.4g} to {item.high:.4g}{unit}", health, remark


def figure(diagnosis: Diagnosis, measured: Measured) -> go.Figure:
    """Each channel with the residuals of the healthy and the identified model under it; rows without weight are shaded."""
    names = list(measured.channels)
    heights = [0.68, 0.32] * len(names)
    drawing = make_subplots(
        rows=2 * len(names),
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.025,
        row_heights=[height / len(names) for height in heights],
    )
    stride = max(1, -(-len(measured.time) // MOST_POINTS))
    time = np.round(measured.time[::stride], 6).tolist()
    for place, name in enumerate(names):
        data, row = measured.values[:, place], 2 * place + 1
        unit = ports.VARIABLES[ports.INDEX[name]].unit
        models = {"healthy": diagnosis.fit.healthy[:, place], "identified": diagnosis.fit.predicted[:, place]}
        for label, values in {"measured": data, **models}.items():
            drawing.add_trace(_curve(label, time, values[::stride], legend=place == 0), row=row, col=1)
        for label, values in models.items():
            drawing.add_trace(_curve(label, time, (data - values)[::stride], legend=False), row=row + 1, col=1)
        drawing.update_yaxes(title_text=f"{name}<br>[{unit}]", title_font_size=11, row=row, col=1)
        drawing.update_yaxes(title_text="residual", title_font_size=11, row=row + 1, col=1)
    edges = np.flatnonzero(np.diff(np.r_[False, ~measured.informative, False].astype(int))).reshape(-1, 2)
    shade = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1, "layer": "below", "line": {"width": 0}}
    spans = [(float(measured.time[first]), float(measured.time[last - 1])) for first, last in edges]
    drawing.update_layout(shapes=[shade | {"x0": x0, "x1": x1, "fillcolor": "rgba(128,128,128,.16)"} for x0, x1 in spans])
    drawing.update_xaxes(title_text="Time [s] (shaded: at rest or settling, carries no weight)", row=2 * len(names), col=1)
    drawing.update_layout(**LAYOUT, hovermode="x unified")
    return drawing


def _curve(name: str, time: list[float], values: NDArray[np.float64], *, legend: bool) -> go.Scatter:
    return go.Scatter(
        x=time,
        y=[float(f"{value:.6g}") for value in values],
        name=name,
        legendgroup=name,
        showlegend=legend,
        mode="lines",
        opacity=0.7 if name == "measured" else 1.0,
        line={"width": 1.0 if name == "measured" else 1.6, "color": COLOURS[name]},
    )

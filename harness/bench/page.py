"""The bench's page: error against cost, and the tables."""

import plotly.graph_objects as go

from harness.actuators.actuator import DEFAULT, Actuator
from harness.bench.speed import REFERENCE, VARIABLES, Speed
from harness.provenance import Provenance
from harness.show.page import LAYOUT, document, drawn, flown_actuator, table

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Caption, headings, rows."""


def figure(speed: Speed) -> go.Figure:
    """Error of position against wall time, a trace for each mode, a point for each trial."""
    drawing = go.Figure()
    for mode in dict.fromkeys(row.mode for row in speed.rows if row.mode != REFERENCE):
        rows = [row for row in speed.rows if row.mode == mode]
        drawing.add_scatter(
            x=[row.wall for row in rows],
            y=[100.0 * (row.errors[VARIABLES[0]] or 0.0) for row in rows],
            text=[row.trial for row in rows],
            mode="markers",
            name=mode,
            marker={"size": 11},
        )
    drawing.update_xaxes(type="log", title="wall s per simulated s")
    drawing.update_yaxes(type="log", title="error of position, NRMSE in %")
    drawing.update_layout(**LAYOUT)
    return drawing


def page(tables: list[Table], speed: Speed, record: Provenance, actuator: Actuator = DEFAULT) -> str:
    """One self-contained page with the figure and the tables that the terminal shows, of `actuator`."""
    shown = drawn(
        figure(speed), "Error of position against wall time, by fidelity and trial; the tables have the figures.", "low"
    )
    return document(
        "EMA twins: speed and accuracy",
        f"<h1>Speed and accuracy</h1>{flown_actuator(actuator)}<p>Errors are NRMSE against HF at a fixed step of 1e-7 s; "
        f"wall time per simulated second on one core, median of several.</p>{shown}"
        f"{''.join(table(*each) for each in tables)}",
        record,
    )

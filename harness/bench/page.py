"""The bench's page: error against cost, and the tables."""

import plotly.graph_objects as go

from harness.actuators.actuator import DEFAULT, Actuator
from harness.bench.speed import REFERENCE, VARIABLES, Speed
from harness.provenance import Provenance
from harness.show import cost
from harness.show.page import document, drawn, flown_actuator, table

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Caption, headings, rows."""


def points(speed: Speed) -> list[cost.Point]:
    """A point for each row: all modes, the reference too."""
    return [cost.Point(row.mode, row.trial, row.wall, row.errors.get(VARIABLES[0])) for row in speed.rows]


def figures(speed: Speed) -> dict[str, go.Figure]:
    """The figure of the page, by name."""
    return {"error against cost": figure(speed)}


def figure(speed: Speed) -> go.Figure:
    """Error of position against wall time: a colour for each mode, a symbol for each trial."""
    return cost.figure(points(speed), REFERENCE)


def page(tables: list[Table], speed: Speed, record: Provenance, actuator: Actuator = DEFAULT) -> str:
    """One self-contained page with the figure and the tables that the terminal shows, of `actuator`."""
    spoken = "Error of position against wall time, by fidelity and trial; the tables have the figures."
    shown = drawn(figure(speed), spoken, "low", cost.note(points(speed), REFERENCE))
    return document(
        "EMA twins: speed and accuracy",
        f"<h1>Speed and accuracy</h1>{flown_actuator(actuator)}<p>Errors are NRMSE against HF at a fixed step of 1e-7 s; "
        f"wall time per simulated second on one core, median of several.</p>{shown}"
        f"{''.join(table(*each) for each in tables)}",
        record,
    )

"""The bench's page: error against cost, and the tables."""

from html import escape

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from harness.bench.speed import REFERENCE, VARIABLES, Speed

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>EMA twins: speed and accuracy</title><script>{script}</script><style>
:root {{ color-scheme: light dark; }}
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: auto; padding: 1rem; }}
table {{ border-collapse: collapse; }} th, td {{ padding: .25rem .7rem; border-bottom: 1px solid #8884; text-align: left; }}
.table {{ overflow-x: auto; }} figure {{ margin: 1rem 0; }}
</style></head><body><main><h1>Speed and accuracy</h1>
<p>Errors are NRMSE against HF at a fixed step of 1e-7 s; wall time per simulated second on one core, median of several.</p>
<figure aria-label="Error of position against wall time, by fidelity and trial">{figure}</figure>
{tables}</main></body></html>
"""


def figure(speed: Speed) -> go.Figure:
    """Error of position against wall time, a trace for each mode, a point for each trial."""
    drawn = go.Figure()
    for mode in dict.fromkeys(row.mode for row in speed.rows if row.mode != REFERENCE):
        rows = [row for row in speed.rows if row.mode == mode]
        drawn.add_scatter(
            x=[row.wall for row in rows],
            y=[100.0 * (row.errors[VARIABLES[0]] or 0.0) for row in rows],
            text=[row.trial for row in rows],
            mode="markers",
            name=mode,
            marker={"size": 11},
        )
    drawn.update_xaxes(type="log", title="wall s per simulated s")
    drawn.update_yaxes(type="log", title="error of position, NRMSE in %")
    drawn.update_layout(height=520, margin={"t": 20}, legend={"orientation": "h"}, template="plotly_white")
    return drawn


Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Caption, headings, rows."""


def _table(caption: str, heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<h2>{escape(caption)}</h2><div class="table"><table><tr>{head}</tr>{body}</table></div>'


def page(tables: list[Table], speed: Speed) -> str:
    """One self-contained page with the figure and the tables that the terminal shows."""
    shown = figure(speed).to_html(full_html=False, include_plotlyjs=False)
    return PAGE.format(script=get_plotlyjs(), figure=shown, tables="".join(_table(*table) for table in tables))

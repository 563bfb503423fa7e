"""Curves over time as every page draws them: their lines, rows with residuals under them, shaded intervals.

A page that is stored takes its points from `thinned`; one that is drawn at once may give arrays as they are.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from ema_fmu_src.fidelities import FIDELITIES

USUAL_ROWS = 6
MOST_POINTS = 2501
"""Points drawn of each curve; more cannot be told apart and make the page heavy."""
SPARE = ("#b8860b", "#0e8f9c", "#c2417c", "#66752a", "#8a5a44", "#4b5fa8")
"""Colours of names that are no fidelity."""


@dataclass(frozen=True)
class Line:
    """How a curve is drawn; `dash` is Plotly's name, `width` in pixels."""

    colour: str
    dash: str = "solid"
    width: float = 1.6
    opacity: float = 1.0


RESIDUAL = "residual: model minus"
"""What residuals are on every page, up to what they are compared with."""
COMMAND = Line("#888888", "dot")
MEASURED = Line("#888888", width=5.0, opacity=0.45)
"""Wide and pale: drawn first, it stays in sight under whatever lies on it."""
HEALTHY = Line("#b8860b", "dot")
"""A model without faults, beside the same one with them, which has its fidelity's own line."""


def lines_of(names: Iterable[str]) -> dict[str, Line]:
    """The line of each name: a fidelity's own; for any other, such as a schedule of several, a spare colour, dashed."""
    taken = {fidelity.colour for fidelity in FIDELITIES.values()}
    spare = itertools.cycle([colour for colour in SPARE if colour not in taken] or SPARE)
    own = {fidelity.name: Line(fidelity.colour, fidelity.dash) for fidelity in FIDELITIES.values()}
    return {name: own.get(name) or Line(next(spare), "dash") for name in dict.fromkeys(names)}


def stride(n_points: int) -> int:
    """Every so many-th point is drawn, so that there are no more than MOST_POINTS."""
    return max(1, -(-n_points // MOST_POINTS))


def thinned(time: NDArray[Any], values: NDArray[Any]) -> tuple[list[float], list[float]]:
    """Times [s] to 1 us and values to 6 digits, of the points that are drawn: a stored page stays light."""
    every = stride(len(time))
    return np.round(time[::every], 6).tolist(), [float(f"{value:.6g}") for value in values[::every]]


def curve(name: str, line: Line, points: tuple[Any, Any], *, legend: bool = True) -> go.Scatter:
    """A curve through `points`, times [s] and values; one press on its name in the legend hides all that have it."""
    return go.Scatter(
        x=points[0],
        y=points[1],
        name=name,
        legendgroup=name,
        showlegend=legend,
        mode="lines",
        opacity=line.opacity,
        line={"width": line.width, "color": line.colour, "dash": line.dash},
    )


def rows(titles: Sequence[str], *, residuals: float = 0.0, spacing: float = 0.025, size: int | None = None) -> go.Figure:
    """An empty figure: a row for each of `titles` over one axis of time; its row is 1 + its place.

    With `residuals`, a share of a row's height, another row for residuals is under each: then a title's row is
    1 + 2*place, and that of its residuals the next.
    `spacing` is a share of the figure, less where rows are many; `size` that of the titles' letters [pixel].
    """
    shares = [1.0 - residuals, residuals] if residuals else [1.0]
    n_rows = len(shares) * len(titles)
    figure = make_subplots(
        rows=n_rows,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=spacing * min(1.0, USUAL_ROWS / n_rows),
        row_heights=[share / len(titles) for share in shares * len(titles)],
    )
    units = [title[title.rfind("[") :] if "[" in title else "" for title in titles]
    pairs = [(title, f"residual<br>{unit}") if residuals else (title,) for title, unit in zip(titles, units, strict=True)]
    shown = [text for pair in pairs for text in pair]
    for row, text in enumerate(shown, start=1):
        figure.update_yaxes(title={"text": text, "font": {"size": size}}, row=row, col=1)
    return figure


def intervals(time: NDArray[Any], flag: NDArray[Any]) -> list[tuple[float, float]]:
    """First and last time [s] of each interval in which the flag is up."""
    edges = np.flatnonzero(np.diff(np.r_[False, flag.astype(bool), False].astype(int))).reshape(-1, 2)
    return [(float(time[first]), float(time[last - 1])) for first, last in edges]


def shade(figure: go.Figure, spans: Iterable[tuple[float, float]], colour: str) -> None:
    """Shade the intervals [s] over all rows."""
    shape = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1, "layer": "below", "line": {"width": 0}}
    figure.update_layout(shapes=[shape | {"x0": first, "x1": last, "fillcolor": colour} for first, last in spans])

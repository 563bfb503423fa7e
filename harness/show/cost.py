"""Error against cost: a colour for each fidelity, a symbol for each trial, and the reference as a line at its cost."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go

from harness.show.curves import lines_of
from harness.show.page import LAYOUT

SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "star", "x", "hexagon")
LEAST, MOST = 1e-6, 1.0
"""NRMSE between which it means something: below it is rounding; above, the reference hardly moves."""
ROOM = 0.08
"""From the outermost points to the ends of the axes, of the distance between them: no mark is cut."""
STEPS = ((0.7, (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)), (2.5, (1.0, 2.0, 5.0)), (math.inf, (1.0,)))
"""Most decades of an axis, and where it then has ticks in each."""
NOTE = "A colour for each fidelity, a symbol for each trial. Dashed: what {} costs, the reference."


@dataclass(frozen=True)
class Point:
    """A run: name of its fidelity, or of a mode of one, and of its trial; wall time per simulated second [s]; NRMSE of the
    position, None where there is none."""

    name: str
    trial: str
    wall: float
    error: float | None

    @property
    def means_something(self) -> bool:
        """Whether its error can be read as one."""
        return self.error is not None and LEAST <= self.error < MOST


def figure(points: Sequence[Point], reference: str) -> go.Figure:
    """The points whose errors mean something, and a line at the median cost of those that are the `reference`."""
    shown = [point for point in points if point.means_something and point.name != reference]
    lines = lines_of([reference, *(point.name for point in points)])
    symbols = {trial: SYMBOLS[place % len(SYMBOLS)] for place, trial in enumerate(dict.fromkeys(p.trial for p in points))}
    drawing = go.Figure()
    for name in dict.fromkeys(point.name for point in shown):
        own = [point for point in shown if point.name == name]
        drawing.add_scatter(
            x=[point.wall for point in own],
            y=[100.0 * (point.error or 0.0) for point in own],
            text=[point.trial for point in own],
            hovertemplate="%{text}: %{y:.3g} % at %{x:.3g} s / s",
            mode="markers",
            cliponaxis=False,
            name=name,
            legendgroup=name,
            marker={"size": 11, "color": lines[name].colour, "symbol": [symbols[point.trial] for point in own]},
        )
    for trial in symbols if len(symbols) > 1 else ():  # what a symbol is
        marker = {"size": 9, "color": "#888888", "symbol": symbols[trial]}
        drawing.add_scatter(x=[None], y=[None], mode="markers", name=trial, marker=marker, hoverinfo="skip")
    costs = [point.wall for point in points if point.name == reference and math.isfinite(point.wall)]
    errors = [100.0 * (point.error or 0.0) for point in shown]
    if costs:
        line = {"color": lines[reference].colour, "dash": "dash", "width": 1.6}
        ends = [1e-9, 1e9]  # beyond the axis at both ends
        cost = statistics.median(costs)
        drawing.add_scatter(
            x=[cost, cost], y=ends, mode="lines", line=line, name=f"{reference} (reference)",
            hovertemplate=f"{reference}: {cost:.3g} s / s<extra></extra>",
        )  # fmt: skip
    walls = [*costs, *(point.wall for point in shown)]
    drawing.update_xaxes(type="log", title="wall time per simulated second [s/s]", **_axis(walls))
    drawing.update_yaxes(type="log", title="error of position, NRMSE [%]", **_axis(errors or [1.0]))
    drawing.update_layout(**LAYOUT)
    return drawing


def note(points: Sequence[Point], reference: str) -> str:
    """What stands under the figure: its symbols, and which runs are left out of it."""
    out = [p for p in points if p.name != reference and not p.means_something]
    names = ", ".join(f"{point.trial} {point.name}" for point in out)
    left = f" Left out, for their errors are below {100.0 * LEAST:g} % or say nothing: {names}." if out else ""
    return NOTE.format(reference) + left


def _axis(values: Sequence[float]) -> dict[str, object]:
    """A logarithmic axis with room at both ends, and few ticks, all labelled; nothing of no values."""
    if not values:
        return {}
    low, high = math.log10(min(values)), math.log10(max(values))
    room = ROOM * (high - low) + 0.05
    low, high = low - room, high + room
    steps = next(steps for most, steps in STEPS if high - low < most)
    ticks = [step * 10.0**decade for decade in range(math.floor(low), math.ceil(high)) for step in steps]
    return {"range": [low, high], "tickvals": ticks, "ticktext": [f"{tick:.6g}" for tick in ticks]}

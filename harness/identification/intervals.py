"""The faults of a diagnosis at a glance: estimates, their intervals, limits and health, on one axis for all of them."""

from collections.abc import Mapping

import plotly.graph_objects as go

from harness.faults import FAULTS, Fault
from harness.identification.diagnosis import Diagnosis
from harness.identification.estimates import Estimate
from harness.show.page import LAYOUT

REACH = 1.6
"""Ends of the axis; an interval that goes on beyond ends in an arrow."""
COLOURS = {"alarm": "#d6321f", "no alarm": "#16939b", "not identifiable": "#888888"}
NOTE = (
    "0 is healthy and 1 the limit, in the direction of the limit; where a fault has a limit on the other side too, it is at "
    "-1. Bars are 95 % intervals; an arrow is one that goes on. Values with units stand under the pointer and in the table."
)
LIMIT = "limit (health 0)"


def figure(diagnosis: Diagnosis, limits: Mapping[str, float]) -> go.Figure:
    """A row for each fault that has an effect, in the order of the table; `limits` by short name, where not its own."""
    own = [item for item in diagnosis.estimates if item.fault in FAULTS and item.effect]
    drawing = go.Figure()
    for label, colour in COLOURS.items():
        items = [item for item in own if _kind(item) == label]
        if not items:
            continue
        spans = [_scaled(item, limits) for item in items]
        for (low, _, high), item in zip(spans, items, strict=True):
            drawing.add_scatter(
                x=[max(low, -REACH), min(high, REACH)], y=[item.fault] * 2, mode="lines+markers", showlegend=False,
                line={"color": colour, "width": 3}, hoverinfo="skip", legendgroup=label, cliponaxis=False,
                marker={"size": 9, "color": colour,
                        "symbol": _ends(low, high),
                        "line": {"width": 2, "color": colour}},
            )  # fmt: skip
        inside = [(item, min(max(value, -REACH), REACH)) for (_, value, _), item in zip(spans, items, strict=True)]
        drawing.add_scatter(
            x=[value for _, value in inside], y=[item.fault for item, _ in inside], mode="markers+text", name=label,
            legendgroup=label, text=[_health(item) for item, _ in inside], textposition="top center", cliponaxis=False,
            marker={"size": 10, "color": colour, "symbol": "circle-open" if label == "not identifiable" else "circle",
                    "line": {"width": 2, "color": colour}},
            customdata=[_told(item, limits) for item, _ in inside], hovertemplate="%{y}: %{customdata}<extra></extra>",
        )  # fmt: skip
    marks = [(item.fault, end) for item in own for end in _limits(FAULTS[item.fault], limits)]
    drawing.add_scatter(
        x=[end for _, end in marks], y=[name for name, _ in marks], mode="markers", name=LIMIT, hoverinfo="skip",
        marker={"symbol": "line-ns", "size": 16, "line": {"width": 2, "color": "#d6321f"}},
    )  # fmt: skip
    drawing.update_xaxes(title="distance from healthy, over that of the limit [1]", range=[-REACH - 0.1, REACH + 0.1])
    names = [item.fault for item in reversed(own)]
    drawing.update_yaxes(categoryorder="array", categoryarray=names, range=[-0.7, len(names) - 0.3], automargin=True)
    drawing.update_layout(**LAYOUT)
    return drawing


def _ends(low: float, high: float) -> list[str]:
    """Symbols of an interval's ends: arrows where it goes on beyond the axis."""
    return ["triangle-left" if low < -REACH else "line-ns", "triangle-right" if high > REACH else "line-ns"]


def _kind(item: Estimate) -> str:
    return "alarm" if item.alarm else "no alarm" if item.identifiable else "not identifiable"


def _scaled(item: Estimate, limits: Mapping[str, float]) -> tuple[float, float, float]:
    """Low end, value and high end: 0 healthy, 1 at the limit."""
    fault = FAULTS[item.fault]
    end = limits.get(item.fault, fault.limit)
    low, value, high = ((each - fault.healthy) / (end - fault.healthy) for each in (item.low, item.value, item.high))
    return min(low, high), value, max(low, high)


def _limits(fault: Fault, limits: Mapping[str, float]) -> list[float]:
    """Where its limits are on the axis."""
    own = fault.limits(limits.get(fault.name))
    return [1.0, -1.0][: len(own)]


def _health(item: Estimate) -> str:
    return f"health {item.health:.2f}" if item.alarm and item.health is not None else ""


def _told(item: Estimate, limits: Mapping[str, float]) -> str:
    unit = "" if item.unit == "1" else f" {item.unit}"
    ends = " and ".join(f"{end:g}" for end in FAULTS[item.fault].limits(limits.get(item.fault)))
    health = "" if item.health is None else f", health {item.health:.2f}"
    why = "" if item.identifiable else f"; not identifiable: {item.reason}"
    return f"{item.value:.4g}{unit} ({item.low:.4g} to {item.high:.4g}), limit {ends}{unit}{health}{why}"

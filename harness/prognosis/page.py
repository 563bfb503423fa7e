"""The page of a series of flights: each fault over time with its intervals, trend and limit, and when it is reached."""

import html
import math
from collections.abc import Sequence
from itertools import cycle

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from harness.actuators.actuator import DEFAULT, Actuator
from harness.prognosis.growth import Trend
from harness.prognosis.history import IdentifiedFlight
from harness.prognosis.outlook import Outlook, life_in_words
from harness.provenance import Provenance
from harness.show.curves import SPARE
from harness.show.page import LAYOUT, document, drawn, flown_actuator, sentence, table

FORECAST, BAND, LIMIT = "#0e8f9c", "rgba(14,143,156,.3)", "#d6321f"
"""Colours, none of which is a fidelity's."""
HEADS = ("Fault", "Now", "Limit", "Event state (health)", "Rate", "Remaining useful life")


HISTORY, EVENT = "history and prediction", "time of the event"
NOTE = "Bars: 95 % intervals of the runs. Dashed: limits, on both sides where a fault has two."


def rows(outlook: Outlook) -> list[tuple[str, ...]]:
    """A row of texts for each fault, under HEADS."""
    return [
        (
            name,
            f"{trend.level:.4g}",
            f"{trend.limit:g}",
            f"{trend.health:.2f}",
            f"{trend.rate:.3g} ± {math.sqrt(trend.covariance[1, 1]):.2g} / {outlook.unit.removesuffix('s')}",
            life_in_words(trend, outlook.unit) if trend.grows or trend.health <= 0.0 else "does not grow",
        )
        for name, trend in outlook.trends.items()
    ]


def page(outlook: Outlook, history: Sequence[IdentifiedFlight], record: Provenance, actuator: Actuator = DEFAULT) -> str:
    """The page as HTML text; `record` says where it comes from, `actuator` the one that was followed."""
    growing = [trend for trend in outlook.trends.values() if trend.grows]
    kind = "over" if any(trend.health <= 0.0 for trend in outlook.trends.values()) else "near" if growing else "ok"
    problems = "".join(f"<li>{html.escape(line)}</li>" for line in outlook.problems)
    left_out = f"<h2>Runs left out</h2><ul>{problems}</ul>" if problems else ""
    open_ = "".join(f"<li>{html.escape(line)}</li>" for line in outlook.not_followed)
    left_out += f"<h2>Faults not followed</h2><ul>{open_}</ul>" if open_ else ""
    frequency = "How often the samples of the prediction reach the limit, over time, for each fault that grows."
    pictures = figures(outlook)
    histogram = drawn(pictures[EVENT], frequency, "low") if growing else ""
    events = f"<section><h2>Time of the event</h2>{histogram}</section>" if growing else ""
    description = "Each fault's estimates over time with their intervals, the trend, its forecast and its limit."
    first, last = history[0].flight.label, history[-1].flight.label
    return document(
        "EMA twins: faults over time",
        f'<h1>Faults over time</h1><p class="verdict {kind}">{sentence(outlook.verdict)}</p>'
        f"{flown_actuator(actuator)}"
        f"<p>{outlook.runs} runs, {html.escape(first)} to {html.escape(last)}; times in {outlook.unit} from the first. "
        "The event is a fault at its limit; the event state is the health index, 1 healthy and 0 at the limit.</p>"
        f"{table('Faults now, and the time of the event', HEADS, rows(outlook))}"
        f"<section><h2>History and prediction</h2>{drawn(pictures[HISTORY], description, note=NOTE)}</section>"
        f"{events}{left_out}",
        record,
    )


def figures(outlook: Outlook) -> dict[str, go.Figure]:
    """The figures of the page by name; the times of the event where a fault grows."""
    growing = any(trend.grows for trend in outlook.trends.values())
    return {HISTORY: figure(outlook), **({EVENT: times_of_event(outlook)} if growing else {})}


def figure(outlook: Outlook) -> go.Figure:
    """A row for each fault, those that grow first, all over the same times."""
    trends = sorted(outlook.trends.values(), key=lambda trend: not trend.grows)
    begin, end = min(float(trend.at[0]) for trend in trends), max(_end(trend) for trend in trends)
    begin -= 0.02 * (end - begin)  # room for the first marker
    drawing = make_subplots(rows=len(trends), cols=1, vertical_spacing=0.45 / (len(trends) + 3))
    for row, trend in enumerate(trends, start=1):
        first = row == 1
        grid, (low, middle, high) = trend.forecast
        if trend.grows:
            band = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
            drawing.add_scatter(x=_rounded(grid), y=_rounded(high), showlegend=False, **band, row=row, col=1)
            drawing.add_scatter(
                x=_rounded(grid), y=_rounded(low), fill="tonexty", fillcolor=BAND,
                name="90 % of the forecast", legendgroup="band", showlegend=first, **band, row=row, col=1,
            )  # fmt: skip
            line = {"color": FORECAST, "width": 1.8}
            drawing.add_scatter(
                x=_rounded(grid), y=_rounded(middle), mode="lines", line=line, name="forecast", legendgroup="forecast",
                showlegend=first, row=row, col=1,
            )  # fmt: skip
        drawing.add_scatter(
            x=_rounded(trend.at), y=_rounded(trend.values), mode="markers", name="identified", legendgroup="identified",
            showlegend=first, marker={"color": "#888888", "size": 6},
            error_y={"array": _rounded(2.0 * trend.sigmas), "thickness": 1}, row=row, col=1,
        )  # fmt: skip
        for place, limit in enumerate(trend.fault.limits(trend.limit)):
            drawing.add_scatter(
                x=[begin, end], y=[limit] * 2, mode="lines", line={"color": LIMIT, "dash": "dash", "width": 1.4},
                name="limit (health 0)", legendgroup="limit", showlegend=first and place == 0, row=row, col=1,
            )  # fmt: skip
        title = f"{trend.fault.name}<br>[{trend.fault.unit}]"
        drawing.update_yaxes(title={"text": title, "font": {"size": 11}}, range=_reach(trend), row=row, col=1)
        drawing.update_xaxes(range=[begin, end], row=row, col=1)
    drawing.update_xaxes(title_text=f"Time from the first run [{outlook.unit}]", row=len(trends), col=1)
    drawing.update_layout(**LAYOUT)
    return drawing


def times_of_event(outlook: Outlook) -> go.Figure:
    """The distribution of each growing fault's time of event."""
    drawing = go.Figure()
    growing = {name: trend for name, trend in outlook.trends.items() if trend.grows and trend.reached}
    for (name, trend), colour in zip(growing.items(), cycle(SPARE)):
        drawing.add_histogram(
            x=_rounded(trend.times_of_event),
            name=name,
            opacity=0.6,
            nbinsx=40,
            histnorm="probability",
            marker={"color": colour},
        )
    drawing.update_layout(**LAYOUT, barmode="overlay", showlegend=True)
    drawing.update_xaxes(title_text=f"Time of the event, from the first run [{outlook.unit}]")
    drawing.update_yaxes(title_text="part of the samples [1]")
    return drawing


def _end(trend: Trend) -> float:
    """End of the time axis: when nearly all samples have reached the limit, or else where the prediction ends; but half the
    history later at least."""
    life = (trend.life(0.95)[0] or trend.horizon) if trend.grows else 0.0
    return float(trend.at[-1]) + max(0.5 * float(trend.at[-1] - trend.at[0]), 1.05 * life)


def _reach(trend: Trend) -> list[float]:
    """Ends of the axis of values: all that is drawn, and room, so that no mark or limit lies on the edge."""
    ends = [*(trend.values - 2.0 * trend.sigmas), *(trend.values + 2.0 * trend.sigmas), *trend.fault.limits(trend.limit)]
    if trend.grows:
        ends += np.ravel(trend.forecast[1]).tolist()
    low, high = float(min(ends)), float(max(ends))
    room = 0.08 * (high - low)
    return [low - room, high + room]


def _rounded(series: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in series]

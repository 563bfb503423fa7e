"""The page of a replay: figures, and measured and twin on one axis, with what is left under them."""

import html
from collections.abc import Sequence

import plotly.graph_objects as go

from harness.actuators.actuator import DEFAULT, Actuator
from harness.logs.hints import percent
from harness.provenance import Provenance
from harness.replays.replay import Replay
from harness.show.curves import COMMAND, MEASURED, RESIDUAL, curve, lines_of, thinned
from harness.show.curves import rows as rows_of
from harness.show.page import LAYOUT, document, drawn, flown_actuator, sentence, table

HEADS = ("Channel", "Unit", "Rms", "NRMSE", "at 20 Hz", "unshifted", "Shift", "Lag")
EXPLAINED = (
    ("rms, NRMSE", "of twin minus measured, at the shift that fits best; NRMSE over the measured range"),
    ("at 20 Hz", "the NRMSE of both low-passed at 20 Hz, forth and back; - below 50 rows a second"),
    (
        "shift",
        "positive: the log shows what happens so much earlier than the twin; negative: later. Taken off before comparing, "
        "where rows are more than 2 ms apart and do not show when things happened; a row's distance and 10 ms at most",
    ),
    ("unshifted", "without that shift, which also hides a part of what a wrong loop does"),
    ("lag", "the same, sought up to 50 ms either way and not taken off: positive, the twin is late; negative, it is early"),
    ("ratio", "rms of twin minus measured position over the rms of the measured tracking error"),
)
"""What the heads mean."""
TRACKING = ("Tracking error", "Unit", "measured", "twin", "difference", "ratio", "unshifted")


NOTE = f"Wide and grey: measured; {RESIDUAL} measured."


def page(replays: Sequence[Replay], record: Provenance, actuator: Actuator = DEFAULT) -> str:
    """The page as HTML text; `record` says where it comes from, `actuator` the one that was flown."""
    title = f"{replays[0].log.source.name}, flown by {replays[0].fidelity}"
    return document(
        f"EMA twins: {title}",
        f"<h1>{html.escape(title)}</h1>{flown_actuator(actuator)}{''.join(map(_section, replays))}{_explained()}",
        record,
    )


def _explained() -> str:
    lines = "".join(f"<dt>{html.escape(head)}</dt><dd>{html.escape(text)}</dd>" for head, text in EXPLAINED)
    return f"<section><h2>What the figures mean</h2><dl>{lines}</dl></section>"


def rows(replay: Replay) -> list[tuple[str, ...]]:
    """A row of texts for each channel, under HEADS."""
    return [
        (
            item.name,
            item.unit,
            f"{item.rms:.4g}",
            percent(item.nrmse),
            percent(item.nrmse_20hz),
            percent(item.nrmse_unshifted),
            f"{1e3 * item.shift:.2f} ms",
            f"{1e3 * item.lag:.2f} ms",
        )
        for item in replay.channels
    ]


def tracking_rows(replay: Replay) -> list[tuple[str, ...]]:
    """The row of texts of the tracking error, under TRACKING; none without a position."""
    item = replay.tracking_error
    if item is None:
        return []
    numbers = (f"{value:.4g}" for value in (item.measured, item.twin, item.difference))
    return [("rms", item.unit, *numbers, percent(item.ratio), percent(item.ratio_unshifted))]


def figures(replays: Sequence[Replay]) -> dict[str, go.Figure]:
    """The figures of the page by name: one for each run."""
    return {item.log.name: figure(item) for item in replays}


def _section(replay: Replay) -> str:
    log = replay.log
    notes = "".join(f'<p class="note">{sentence(line)}</p>' for line in replay.remarks)
    caption = f"{len(log.time)} rows, {log.rate:.4g} a second; command {replay.between.value} between rows"
    tracking = table("Position minus command", TRACKING, tracking_rows(replay)) if replay.tracking_error else ""
    names = ", ".join(channel.name for channel in replay.channels)
    return (
        f"<section><h2>{html.escape(log.name)}</h2>{table(caption, HEADS, rows(replay))}{tracking}{notes}"
        f"{drawn(figure(replay), f'Measured and twin: {names} over time, with residuals.', note=NOTE)}</section>"
    )


def figure(replay: Replay) -> go.Figure:
    """Each channel measured and flown, the command with the position, and twin minus measured under it."""
    time, own = replay.log.time, lines_of([replay.fidelity])[replay.fidelity]
    drawing = rows_of([f"{item.name}<br>[{item.unit}]" for item in replay.channels], residuals=0.32, size=11)
    for place, item in enumerate(replay.channels):
        curves = {"measured": (MEASURED, item.measured), replay.fidelity: (own, item.twin)}
        if item.name == "position":
            curves["command"] = (COMMAND, replay.command)
        for label, (line, values) in curves.items():
            shown = curve(label, line, thinned(time, values), legend=place == 0 or label == "command")
            drawing.add_trace(shown, row=2 * place + 1, col=1)
        left = curve(replay.fidelity, own, thinned(time, item.twin - item.measured), legend=False)
        drawing.add_trace(left, row=2 * place + 2, col=1)
    drawing.update_xaxes(title_text="Time [s]", row=2 * len(replay.channels), col=1)
    drawing.update_layout(**LAYOUT, hovermode="x unified")
    return drawing

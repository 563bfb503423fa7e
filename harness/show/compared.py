"""The page of `ema compare`: every variable of a candidate against a reference, and the curves of what differs most."""

import html
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import plotly.graph_objects as go
import xarray as xr

from ema_fmu_src.fidelities import FIDELITIES
from harness.comparison import Comparison, percent
from harness.provenance import Provenance
from harness.show.curves import HEALTHY, RESIDUAL, SPARE, Line, curve, rows, thinned
from harness.show.page import LAYOUT, document, drawn, table

Pair = tuple[xr.Dataset, xr.Dataset]
"""A trial flown by the candidate and by the reference."""
MOST_ROWS = 6
"""Variables whose curves are drawn, of each trial."""
OTHERS = (Line(SPARE[1], "dash"), Line(HEALTHY.colour))
"""Of candidate and reference where they are not the FMUs of our fidelities."""


def heads(tube: float) -> tuple[str, ...]:
    """Headings of the table; `tube`: half its width, a fraction of the range."""
    return ("Trial", "Variable", "NRMSE", "Largest error", "at", f"Outside {100 * tube:g} %")


def table_rows(comparisons: Sequence[Comparison]) -> list[tuple[str, ...]]:
    """A row of texts for each variable, under `heads`."""
    return [
        (
            item.trial,
            item.variable,
            percent(item),
            f"{item.max_abs:.4g}{'' if item.unit == '1' else f' {item.unit}'}",
            f"{item.t_max_abs:.4f} s",
            f"{100 * item.outside:.2f} %",
        )
        for item in comparisons
    ]


def page(
    comparisons: Sequence[Comparison], pairs: Sequence[Pair], names: tuple[str, str], tube: float, record: Provenance
) -> str:
    """The page as HTML text; `names` of candidate and reference; `record` says where it comes from."""
    candidate, reference = (html.escape(name) for name in names)
    left = sum(item.outside > 0.0 for item in comparisons)
    verdict = f"{left} of {len(comparisons)} variables leave the tube of {100 * tube:g} % of the reference's range"
    pictures = figures(comparisons, pairs, names)
    spoken = "The variables that differ most, over time, with residuals."
    sections = "".join(
        f"<section><h2>{html.escape(trial)}</h2>{drawn(picture, spoken, note=_note(names))}</section>"
        for trial, picture in pictures.items()
    )
    shown = table("Errors, variable by variable", heads(tube), table_rows(comparisons))
    return document(
        f"EMA twins: {names[0]} against {names[1]}",
        f'<h1>{candidate} against {reference}</h1><p class="verdict {"near" if left else "ok"}">{verdict}.</p>'
        f"{shown}{sections}",
        record,
    )


def _note(names: tuple[str, str]) -> str:
    return f"At most {MOST_ROWS} variables, those that differ most in NRMSE first; {RESIDUAL} {names[1]}."


def figures(comparisons: Sequence[Comparison], pairs: Sequence[Pair], names: tuple[str, str]) -> Mapping[str, go.Figure]:
    """A figure for each trial, by its name."""
    drawings = {}
    for candidate, reference in pairs:
        trial = str(reference.attrs["trial"])
        own = [item for item in comparisons if item.trial == trial]
        own.sort(key=lambda item: -(math.inf if item.nrmse is None else item.nrmse))
        drawings[trial] = _figure(own[:MOST_ROWS], candidate, reference, names)
    return drawings


def _lines(names: tuple[str, str]) -> tuple[Line, Line]:
    """A fidelity's own line for an FMU of its name; of two alike the candidate has another."""
    own = {Path(fidelity.fmu).stem: Line(fidelity.colour, fidelity.dash) for fidelity in reversed(FIDELITIES.values())}
    candidate = OTHERS[0] if names[0] == names[1] else own.get(names[0], OTHERS[0])
    return candidate, own.get(names[1], OTHERS[1])


def _figure(items: Sequence[Comparison], candidate: xr.Dataset, reference: xr.Dataset, names: tuple[str, str]) -> go.Figure:
    labels, lines = (names[0], f"{names[1]} (reference)"), _lines(names)
    drawing = rows([f"{item.variable}<br>[{item.unit}]" for item in items], residuals=0.28, size=10)
    for place, item in enumerate(items):
        series = [run[item.variable].astype(float) for run in (candidate, reference)]
        for name, line, values in zip(labels[::-1], lines[::-1], series[::-1], strict=True):
            points = thinned(values.time.values, values.values)
            drawing.add_trace(curve(name, line, points, legend=place == 0), row=2 * place + 1, col=1)
        left = series[0].interp(time=reference.time) - series[1]
        residual = curve(labels[0], lines[0], thinned(left.time.values, left.values), legend=False)
        drawing.add_trace(residual, row=2 * place + 2, col=1)
    drawing.update_xaxes(title_text="Time [s]", row=2 * len(items), col=1)
    drawing.update_layout(**LAYOUT, hovermode="x unified")
    return drawing

"""Results as a notebook shows them: a table, and curves as SVG, which need neither scripts nor a network."""

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, LEFT, GAP = 720, 110, 74, 14
"""Of a drawing and of each of its rows, room for its figures, and between rows [pixel]."""
MOST_POINTS = 720
"""Drawn of a curve, as pairs of least and largest value: no peak is lost."""
GREY = "#888888"
DASHES = {"solid": "", "dash": "6 4", "dot": "2 3", "dashdot": "6 3 2 3", "longdash": "10 4"}
"""Plotly's names of dashes in SVG's."""


@dataclass(frozen=True)
class Curve:
    """A curve: its name, values over `time` [s], and how it is drawn."""

    name: str
    time: NDArray[Any]
    values: NDArray[Any]
    colour: str = "#1f6fd6"
    dash: str = "solid"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of plain texts as HTML."""
    head = "".join(f"<th>{html.escape(text)}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def lines(texts: Iterable[str]) -> str:
    """A paragraph for each text, as HTML."""
    return "".join(f"<p>{html.escape(text)}</p>" for text in texts if text)


def drawing(rows: Sequence[tuple[str, Sequence[Curve]]]) -> str:
    """Rows of curves over one axis of time, each with its title and unit, as SVG."""
    times = [curve.time for _, curves in rows for curve in curves if len(curve.time)]
    if not times:
        return ""
    span = (float(min(time[0] for time in times)), float(max(time[-1] for time in times)))
    height = len(rows) * (HEIGHT + GAP) + 44
    names = {curve.name: curve for _, curves in rows for curve in curves}
    parts = [_legend(list(names.values()))]
    parts += [_row(place, title, curves, span) for place, (title, curves) in enumerate(rows)]
    foot = height - 6
    parts.append(f'<text x="{LEFT}" y="{foot}">{span[0]:g} s</text>')
    parts.append(f'<text x="{WIDTH - 4}" y="{foot}" text-anchor="end">{span[1]:g} s</text>')
    spoken = html.escape("; ".join(title for title, _ in rows), quote=True)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" role="img" '
        f'aria-label="{spoken}" style="max-width:100%" font-family="sans-serif" font-size="11" fill="currentColor">'
        f"{''.join(parts)}</svg>"
    )


def _legend(curves: Sequence[Curve]) -> str:
    step = (WIDTH - LEFT) // max(1, len(curves))
    return "".join(
        f'<line x1="{LEFT + n * step}" x2="{LEFT + n * step + 22}" y1="9" y2="9" {_stroke(curve)}/>'
        f'<text x="{LEFT + n * step + 28}" y="13">{html.escape(curve.name)}</text>'
        for n, curve in enumerate(curves)
    )


def _stroke(curve: Curve) -> str:
    return f'fill="none" stroke="{curve.colour}" stroke-width="1.5" stroke-dasharray="{DASHES.get(curve.dash, "")}"'


def _row(place: int, title: str, curves: Sequence[Curve], span: tuple[float, float]) -> str:
    top = 24 + place * (HEIGHT + GAP)
    finite = [each[np.isfinite(each)] for each in (curve.values.astype(float) for curve in curves)]
    held = [each for each in finite if each.size]
    low, high = (min(float(each.min()) for each in held), max(float(each.max()) for each in held)) if held else (0.0, 1.0)
    reach = (high - low) or 1.0

    def points(curve: Curve) -> str:
        time, values = _thinned(curve.time, curve.values.astype(float))
        x = LEFT + (WIDTH - LEFT) * (time - span[0]) / ((span[1] - span[0]) or 1.0)
        y = top + HEIGHT - HEIGHT * (values - low) / reach
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    frame = f'<rect x="{LEFT}" y="{top}" width="{WIDTH - LEFT}" height="{HEIGHT}" fill="none" stroke="{GREY}" opacity=".5"/>'
    figures = (
        f'<text x="{LEFT - 4}" y="{top + 10}" text-anchor="end">{high:.3g}</text>'
        f'<text x="{LEFT - 4}" y="{top + HEIGHT}" text-anchor="end">{low:.3g}</text>'
        f'<text x="{LEFT + 5}" y="{top + 13}" font-weight="bold">{html.escape(title)}</text>'
    )
    return frame + "".join(f'<polyline points="{points(curve)}" {_stroke(curve)}/>' for curve in curves) + figures


def _thinned(time: NDArray[Any], values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """The least and the largest value of each stretch, without what is no number; all, where there are few."""
    there = np.isfinite(values)
    time, values = np.asarray(time)[there], values[there]
    if len(values) <= MOST_POINTS:
        return time, values
    kept = [
        stretch[0] + np.sort([np.argmin(values[stretch]), np.argmax(values[stretch])])
        for stretch in np.array_split(np.arange(len(values)), MOST_POINTS // 2)
    ]
    places = np.concatenate(kept)
    return time[places], values[places]

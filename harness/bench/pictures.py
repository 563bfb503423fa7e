"""The page of the bench on random actuators: coverage, error against distance from nominal, alarms there and told."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from scipy.stats import beta

from harness.bench.jobs import CALIBRATED, Found
from harness.bench.table import COVERED, ERRORS, Table, confusion, labels, of_actuators, of_part, present
from harness.provenance import Provenance
from harness.show.curves import SPARE
from harness.show.page import LAYOUT, document, drawn, table


def coverage_figure(found: Sequence[Found]) -> go.Figure:
    """Part of the 95 % intervals that cover the truth, by fault, calibrated and exact, with the interval of Clopper and
    Pearson (Biometrika 26 (1934) 404)."""
    drawing = go.Figure()
    known = ((CALIBRATED, of_actuators(found, CALIBRATED, faulted=True)), ("exact", of_part(found, "exact")))
    for (name, own), colour in zip(known, SPARE, strict=False):
        outcomes = {kind: present(own, kind) for kind in ERRORS}
        kinds = [kind for kind in ERRORS if outcomes[kind]]
        hits, sizes = [sum(out.covered for out in outcomes[kind]) for kind in kinds], [len(outcomes[k]) for k in kinds]
        parts = [100.0 * hit / size for hit, size in zip(hits, sizes, strict=True)]
        ends = [_interval(hit, size) for hit, size in zip(hits, sizes, strict=True)]
        drawing.add_scatter(
            x=kinds,
            y=parts,
            error_y={
                "array": [high - part for part, (_, high) in zip(parts, ends, strict=True)],
                "arrayminus": [part - low for part, (low, _) in zip(parts, ends, strict=True)],
            },
            text=[f"{hit} of {size}" for hit, size in zip(hits, sizes, strict=True)],
            mode="markers",
            cliponaxis=False,
            name=name,
            marker={"size": 11, "color": colour},
        )
    drawing.add_hrect(*COVERED, line_width=0, fillcolor="#888888", opacity=0.25)
    drawing.update_yaxes(title="95 % intervals that cover the truth [%]", range=[0, 104])
    drawing.update_layout(**LAYOUT, scattermode="group")
    return drawing


def _interval(hits: int, size: int) -> tuple[float, float]:
    """The 95 % interval [%] of a part."""
    low = float(beta.ppf(0.025, hits, size - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, size - hits)) if hits < size else 1.0
    return 100.0 * low, 100.0 * high


def distance_figure(found: Sequence[Found]) -> go.Figure:
    """Error of each fault that is there against the distance of its actuator from nominal."""
    drawing = go.Figure()
    own = of_actuators(found, CALIBRATED, faulted=True)
    for kind, colour in zip(ERRORS, SPARE, strict=False):
        points = [(item, out) for item in own for out in present([item], kind)]
        drawing.add_scatter(
            x=[item.distance for item, _ in points],
            y=[100.0 * out.error for _, out in points],
            text=[item.job.name for item, _ in points],
            mode="markers",
            cliponaxis=False,
            name=kind,
            marker={"size": 9, "color": colour},
        )
    drawing.update_xaxes(title="distance from nominal, rms over the parameters [standard deviations]")
    drawing.update_yaxes(type="log", title="error, of the fault's range [%]")
    drawing.update_layout(**LAYOUT)
    return drawing


def confusion_figure(found: Sequence[Found]) -> go.Figure:
    """What is there against what is told; the shade is the part of a row."""
    counts = confusion(found)
    there, said = labels(counts)
    numbers = np.array([[counts.get((true, name), 0) for name in said] for true in there])
    shades = numbers / numbers.sum(axis=1, keepdims=True)
    drawing = go.Figure(
        go.Heatmap(x=said, y=there, z=shades, text=numbers, texttemplate="%{text}", colorscale="Blues", zmin=0.0, zmax=1.0,
                   showscale=False, hovertemplate="%{y} told as %{x}: %{text}<extra></extra>")
    )  # fmt: skip
    drawing.update_xaxes(title="told [number of runs]")
    drawing.update_yaxes(title="there", autorange="reversed")
    drawing.update_layout(**LAYOUT)
    return drawing


def figures(found: Sequence[Found]) -> dict[str, go.Figure]:
    """The figures of the page by name: those for which there are cases."""
    calibrated, exact = of_actuators(found, CALIBRATED, faulted=True), of_part(found, "exact")
    own = {"coverage": coverage_figure(found)} if calibrated or exact else {}
    own |= {"error against distance": distance_figure(found)} if calibrated else {}
    return own | ({"alarms": confusion_figure(found)} if confusion(found) else {})


def page(found: Sequence[Found], tables: Sequence[Table], record: Provenance, kept: Mapping[str, Any]) -> str:
    """One self-contained page with the figures and the tables that the terminal shows; `kept`: seed and rate."""
    shown = ""
    if of_actuators(found, CALIBRATED, faulted=True) or of_part(found, "exact"):
        spoken = "Part of the 95 % intervals that cover the truth, by fault; the tables have the figures."
        shown += f"<h2>Coverage</h2>{drawn(coverage_figure(found), spoken, 'low')}"
    if of_actuators(found, CALIBRATED, faulted=True):
        spoken = "Error of each fault against the distance of its actuator from nominal."
        shown += f"<h2>Error against distance from nominal</h2>{drawn(distance_figure(found), spoken, 'low')}"
    if confusion(found):
        spoken = "Faults that are there against faults that are told; the last table has the figures."
        shown += f"<h2>Alarms</h2>{drawn(confusion_figure(found), spoken, 'low')}"
    return document(
        "EMA twins: actuators that nobody knows exactly",
        "<h1>Actuators that nobody knows exactly</h1><p>The plant is HF with hidden parameters, drawn around the default "
        f"actuator's; {len(found)} cases at {kept['rate']:g} rows a second, seed {kept['seed']}. "
        "Times are those of one core.</p>"
        f"{shown}{''.join(table(*each) for each in tables)}",
        record,
    )

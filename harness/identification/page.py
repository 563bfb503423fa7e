"""The page of an identification: verdict, estimates, and measured, healthy and identified curves with residuals."""

import html
import math
from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

from harness.actuators.actuator import DEFAULT, Actuator
from harness.identification.diagnosis import Diagnosis
from harness.identification.estimates import Estimate
from harness.identification.intervals import NOTE as MEANT
from harness.identification.intervals import figure as intervals_of
from harness.inference.measured import Measured
from harness.provenance import Provenance
from harness.show.curves import HEALTHY, MEASURED, RESIDUAL, curve, intervals, lines_of, shade, thinned
from harness.show.curves import rows as rows_of
from harness.show.page import LAYOUT, document, drawn, flown_actuator, sentence, table

HEADS = ("Fault", "Estimate", "95 % interval", "Health", "")
SHOWN = ("Fault", "", "Health", "Estimate", "95 % interval", "Remark")
"""Heads of the page's table: what is alarmed comes where a narrow screen shows it."""
NOTE = f"Wide and grey: measured. Shaded: at rest or settling, carries no weight; {RESIDUAL} measured."
INTERVALS, CURVES = "faults", "measured and identified"


def page(
    diagnosis: Diagnosis, record: Provenance, actuator: Actuator = DEFAULT, limits: Mapping[str, float] | None = None
) -> str:
    """The page as HTML text; `record` says where it comes from, `actuator` the one that was measured.

    `limits`: values at which health is 0, by short name, where not the faults' own. Of a run that is not explained no
    estimate is told, for it would mean nothing.
    """
    measured = diagnosis.measured
    kind = "near" if diagnosis.complaints else "over" if any(item.alarm for item in diagnosis.estimates) else "ok"
    notes = "".join(f"<p>{sentence(line)}</p>" for line in diagnosis.remarks)
    pictures = figures(diagnosis, limits)
    heading = "Measured and nearest" if diagnosis.complaints else "Measured and identified"
    found = "" if diagnosis.complaints else _found(diagnosis, pictures)
    if diagnosis.complaints:
        notes += (
            "<p>No estimates are given: they would explain the run badly and mean nothing. The curves show what comes "
            "nearest, and where it parts from what was measured.</p>"
        )
    health = "" if diagnosis.health is None else f" Health of the worst fault: {diagnosis.health:.2f}."
    names = ", ".join(item.name for item in measured.shown.values())
    description = f"Measured, healthy and identified curves of {names} over time, with residuals."
    curves = drawn(pictures[CURVES], description, note=NOTE)
    return document(
        f"EMA twins: {diagnosis.name} identified",
        f"<h1>{html.escape(diagnosis.name)}, identified with {html.escape(diagnosis.fidelity)}</h1>"
        f'<p class="verdict {kind}">{sentence(diagnosis.verdict)}{health}</p>{flown_actuator(actuator)}{notes}{found}'
        f"<section><h2>{heading}</h2>{curves}</section>",
        record,
    )


def figures(diagnosis: Diagnosis, limits: Mapping[str, float] | None = None) -> dict[str, go.Figure]:
    """The figures of the page by name; of a run that is not explained the curves alone."""
    curves = {CURVES: figure(diagnosis, diagnosis.measured)}
    return curves if diagnosis.complaints else {INTERVALS: intervals_of(diagnosis, limits or {}), **curves}


def _found(diagnosis: Diagnosis, pictures: Mapping[str, go.Figure]) -> str:
    """What was found, as HTML: the faults as a picture and as a table, and what was estimated beside them."""
    spoken = "Each fault's estimate with its interval and its limits; the table has the figures."
    faults = [
        (item.fault, "ALARM" if item.alarm else "", health, value, interval, remark.removeprefix("ALARM").removeprefix("; "))
        for item, (_, value, interval, health, remark) in zip(diagnosis.estimates, rows(diagnosis), strict=True)
    ]
    return (
        f"<section><h2>Faults</h2>{drawn(pictures[INTERVALS], spoken, 'middle', MEANT)}"
        f"{table(_caption(diagnosis), SHOWN, faults)}</section>"
        f"{_alternatives(diagnosis)}{_parameters(diagnosis)}{_nuisances(diagnosis)}"
    )


def _caption(diagnosis: Diagnosis) -> str:
    return f"Faults, after {diagnosis.evaluations} runs of FMUs in {diagnosis.seconds:.1f} s"


def _nuisances(diagnosis: Diagnosis) -> str:
    """A table of what was estimated beside the faults, as HTML; empty if that is nothing."""
    if not diagnosis.nuisances:
        return ""
    cells = [(name, *_with_sigma(item)) for name, item in diagnosis.nuisances.items()]
    return table("What sensors and loggers have done", ("Nuisance", "Value", "Standard deviation"), cells)


def _parameters(diagnosis: Diagnosis) -> str:
    """A table of the parameters that were not exact, as HTML; empty if there are none."""
    cells = [
        (name, *_with_sigma(item), f"{item['prior']:.4g} +- {item['prior_sigma']:.2g} {item['unit']}")
        for name, item in diagnosis.parameters.items()
    ]
    heads = ("Parameter", "Value", "Standard deviation", "Before the run")
    return table("Parameters that are not known exactly", heads, cells) if cells else ""


def _with_sigma(item: dict[str, Any]) -> tuple[str, str]:
    """Value and standard deviation with their unit: times in ms, factors in per cent."""
    scale, unit = {"s": (1e3, "ms"), "1": (100.0, "%")}.get(item["unit"], (1.0, item["unit"]))
    return f"{scale * item['value']:.4g} {unit}", f"{scale * item['sigma']:.2g} {unit}"


def _alternatives(diagnosis: Diagnosis) -> str:
    """A table of other explanations, and one of what the run cannot tell apart, as HTML; empty if there are none."""
    others = [(_explained_by(item), f"{item['worse']:.1f}") for item in diagnosis.alternatives]
    groups = [
        (
            ", ".join(f"{name} {change:+.2g}" for name, change in group.members.items()),
            "not at all" if math.isinf(group.sigma) else f"to {group.sigma:.2g} %",
            group.experiment,
        )
        for group in diagnosis.groups
    ]
    shown = table("Other explanations", ("Faults", "Worse by, in -2 log likelihood"), others) if others else ""
    heads = ("Together, in % of each", "Told by the data", "What would tell them")
    return shown + (table("What this run cannot tell apart", heads, groups) if groups else "")


def _explained_by(item: dict[str, Any]) -> str:
    """The faults of an alternative, or the sensors that would do without."""
    faults = ", ".join(f"{name} = {value:.4g}" for name, value in item["faults"].items()) or "no fault"
    gains = ", ".join(f"{name} reads {100.0 * value:+.2g} %" for name, value in item.get("gains", {}).items())
    return f"{faults}, if {gains}" if gains else faults


def rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """A row of texts for each estimate, under HEADS."""
    return [_row(item) for item in diagnosis.estimates]


def _row(item: Estimate) -> tuple[str, ...]:
    unit = "" if item.unit == "1" else f" {item.unit}"
    health = "-" if item.health is None else f"{'' if item.identifiable else '<= '}{item.health:.2f}"
    remark = "" if item.identifiable else f"not identifiable: {item.reason}" if item.effect else item.reason
    if item.alarm:
        remark = f"ALARM; {remark}" if remark else "ALARM"
    return item.fault, f"{item.value:.4g}{unit}", f"{item.low:.4g} to {item.high:.4g}{unit}", health, remark


def figure(diagnosis: Diagnosis, measured: Measured) -> go.Figure:
    """Each channel with the residuals of the healthy and the identified model under it; rows without weight are shaded."""
    names = list(measured.channels)
    fitted = f"{'nearest' if diagnosis.complaints else 'identified'} ({diagnosis.fidelity})"
    lines = {"measured": MEASURED, "healthy": HEALTHY, fitted: lines_of([diagnosis.fidelity])[diagnosis.fidelity]}
    titles = [f"{item.name}<br>[{item.unit}]" for item in (measured.shown[name] for name in names)]
    drawing = rows_of(titles, residuals=0.32, size=11)
    for place in range(len(names)):
        scale, row = measured.shown[names[place]].scale, 2 * place + 1
        data = scale * measured.channels[names[place]]
        fits = {"healthy": diagnosis.curves.healthy, fitted: diagnosis.curves.predicted}
        models = {label: scale * fit[:, place] for label, fit in fits.items()}
        for label, values in {"measured": data, **models}.items():
            points = thinned(measured.time, values)
            drawing.add_trace(curve(label, lines[label], points, legend=place == 0), row=row, col=1)
        for label, values in models.items():
            points = thinned(measured.time, values - data)
            drawing.add_trace(curve(label, lines[label], points, legend=False), row=row + 1, col=1)
    shade(drawing, intervals(measured.time, ~measured.informative), "rgba(128,128,128,.16)")
    drawing.update_xaxes(title_text="Time [s]", row=2 * len(names), col=1)
    drawing.update_layout(**LAYOUT, hovermode="x unified")
    return drawing

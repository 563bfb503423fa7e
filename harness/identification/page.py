"""The page of an identification: verdict, estimates, and measured, healthy and identified curves with residuals."""

import html
import math
from typing import Any

import plotly.graph_objects as go

from harness.actuators.actuator import DEFAULT, Actuator
from harness.identification.diagnosis import Diagnosis
from harness.identification.estimates import Estimate
from harness.inference.measured import Measured
from harness.provenance import Provenance
from harness.show.curves import RESIDUAL, Line, curve, intervals, shade, thinned
from harness.show.curves import rows as rows_of
from harness.show.page import LAYOUT, document, drawn, flown_actuator, table

LINES = {"measured": Line("#888888", width=1.0, opacity=0.7), "healthy": Line("#16935b"), "identified": Line("#1f6fd6")}
HEADS = ("Fault", "Estimate", "95 % interval", "Health", "")


def page(diagnosis: Diagnosis, record: Provenance, actuator: Actuator = DEFAULT) -> str:
    """The page as HTML text; `record` says where it comes from, `actuator` the one that was measured."""
    measured = diagnosis.measured
    kind = "near" if diagnosis.complaints else "over" if any(item.alarm for item in diagnosis.estimates) else "ok"
    notes = "".join(f"<p>{html.escape(line)}.</p>" for line in diagnosis.remarks)
    if diagnosis.complaints:
        notes += "<p>The estimates below are what comes nearest; they explain the run badly and mean nothing.</p>"
    health = "" if diagnosis.health is None else f" Health of the worst fault: {diagnosis.health:.2f}."
    names = ", ".join(item.name for item in measured.shown.values())
    description = f"Measured, healthy and identified curves of {names} over time, with residuals."
    curves = drawn(figure(diagnosis, measured), description)
    return document(
        f"EMA twins: {diagnosis.name} identified",
        f"<h1>{html.escape(diagnosis.name)}, identified with {html.escape(diagnosis.fidelity)}</h1>"
        f'<p class="verdict {kind}">{html.escape(diagnosis.verdict)}.{health}</p>{flown_actuator(actuator)}{notes}'
        f"{table(_caption(diagnosis), HEADS, rows(diagnosis))}"
        f"{_alternatives(diagnosis)}{_parameters(diagnosis)}{_nuisances(diagnosis)}"
        f"<section><h2>Measured and identified</h2>{curves}</section>",
        record,
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
    others = [
        (", ".join(f"{name} = {value:.4g}" for name, value in item["faults"].items()) or "no fault", f"{item['worse']:.1f}")
        for item in diagnosis.alternatives
    ]
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
    titles = [f"{item.name}<br>[{item.unit}]" for item in (measured.shown[name] for name in names)]
    drawing = rows_of(titles, residuals=0.32, size=11)
    for place in range(len(names)):
        scale, row = measured.shown[names[place]].scale, 2 * place + 1
        data = scale * measured.channels[names[place]]
        fits = {"healthy": diagnosis.curves.healthy, "identified": diagnosis.curves.predicted}
        models = {label: scale * fit[:, place] for label, fit in fits.items()}
        for label, values in {"measured": data, **models}.items():
            points = thinned(measured.time, values)
            drawing.add_trace(curve(label, LINES[label], points, legend=place == 0), row=row, col=1)
        for label, values in models.items():
            points = thinned(measured.time, values - data)
            drawing.add_trace(curve(label, LINES[label], points, legend=False), row=row + 1, col=1)
    shade(drawing, intervals(measured.time, ~measured.informative), "rgba(128,128,128,.16)")
    drawing.update_xaxes(
        title_text=f"Time [s] (shaded: at rest or settling, carries no weight; {RESIDUAL} measured)",
        row=2 * len(names),
        col=1,
    )
    drawing.update_layout(**LAYOUT, hovermode="x unified")
    return drawing

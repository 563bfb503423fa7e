"""The page of a calibration, and the rows of its tables: parameters, nuisances, rests, curves, spectra, predictions."""

import html

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from scipy.signal import welch

from harness.calibration.result import Calibration, Curves, Nuisance
from harness.logs.hints import percent
from harness.provenance import Provenance
from harness.replays.page import NOTE as REPLAYED
from harness.replays.page import figure as replayed
from harness.replays.replay import Replay
from harness.show.curves import MEASURED, RESIDUAL, Line, curve, lines_of, thinned
from harness.show.curves import rows as rows_of
from harness.show.page import LAYOUT, document, drawn, flown_actuator, sentence, table

Array = NDArray[np.float64]

HEADS = ("Parameter", "Unit", "Start", "Sigma before", "Value", "Sigma", "of before", "")
NUISANCES = ("Run", "Channel", "Offset", "Gain [%]", "Shift [ms]", "Low-pass [ms]")
RESTS = ("Run", "Channel", "Rms [% of range]", "unexplained", "Noise", "order")
FIGURES = ("Run", "Channel", "NRMSE", "at 20 Hz", "unshifted", "Shift", "Tracking error")
NOTE = f"Wide and grey: measured; {RESIDUAL} measured, without rows that carry no weight."
SEGMENT = 256
"""Rows of a segment of a spectrum (Welch 1967)."""


def page(found: Calibration, record: Provenance) -> str:
    """The page as HTML text; `record` says where it comes from."""
    names = ", ".join(item.run.name for item in found.curves)
    verdict = "not all is explained" if found.complaints else "every log is explained"
    lines = (*found.complaints, *found.remarks)
    notes = "".join(f'<p class="note">{sentence(line)}</p>' for line in lines)
    title = f"{found.actuator.name} calibrated"
    return document(
        f"EMA twins: {title}",
        f"<h1>{html.escape(title)} with {html.escape(found.fidelity)}</h1>"
        f'<p class="verdict {"near" if found.complaints else "ok"}">{html.escape(names)}: {verdict}.</p>'
        f"{flown_actuator(found.actuator)}{notes}"
        f"{table(_caption(found), HEADS, parameter_rows(found))}{_correlation(found)}"
        f"{table('What the bench adds: value +- sigma', NUISANCES, nuisance_rows(found))}"
        f"{table('What is left, beside what the bench adds', RESTS, rest_rows(found))}"
        f"{table('The logs flown again with the calibrated values alone', FIGURES, figure_rows(found))}"
        f"{''.join(_fitted(curves, found.fidelity) for curves in found.curves)}{''.join(map(_checked, found.checks))}",
        record,
    )


def _caption(found: Calibration) -> str:
    return f"Parameters, after {found.flights} runs of FMUs in {found.seconds:.1f} s; sigmas are standard deviations"


def parameter_rows(found: Calibration) -> list[tuple[str, ...]]:
    """A row of texts for each parameter with a tolerance, under HEADS."""
    return [
        (
            item.name,
            item.unit,
            f"{item.start:.5g}",
            f"{item.before:.2g}",
            f"{item.value:.5g}",
            f"{item.sigma:.2g}",
            f"{100.0 * item.sigma / item.before:.0f} %",
            item.reason or "freed",
        )
        for item in found.parameters
    ]


def nuisance_rows(found: Calibration) -> list[tuple[str, ...]]:
    """A row of texts for each channel of each run, under NUISANCES."""
    rows = []
    for curves in found.curves:
        for channel, shown in curves.run.shown.items():
            own = {item.kind: item for item in found.nuisances if (item.run, item.channel) == (curves.run.name, channel)}
            cells = [_with_sigma(own[kind], scale) for kind, scale in
                     (("offset", shown.scale), ("gain", 100.0), ("shift", 1e3), ("lag", 1e3))]  # fmt: skip
            rows.append((curves.run.name, f"{shown.name} [{shown.unit}]", *cells))
    return rows


def _with_sigma(item: Nuisance, scale: float) -> str:
    return f"{scale * item.value:.3g} +- {scale * item.sigma:.2g}"


def rest_rows(found: Calibration) -> list[tuple[str, ...]]:
    """A row of texts for each channel of each run, under RESTS."""
    shown = {(item.run.name, port): own for item in found.curves for port, own in item.run.shown.items()}
    return [
        (
            item.run,
            shown[item.run, item.channel].name,
            f"{100.0 * item.rms:.3g}",
            percent(item.unexplained),
            f"{shown[item.run, item.channel].scale * item.noise:.3g} {shown[item.run, item.channel].unit}",
            str(item.order),
        )
        for item in found.rests
    ]


def figure_rows(found: Calibration) -> list[tuple[str, ...]]:
    """A row of texts for each channel that was fitted of each log that was flown again, fitted logs first."""
    fitted = {own.name for curves in found.curves for own in curves.channels}
    return [
        (
            f"{item.log.name}{note}",
            channel.name,
            percent(channel.nrmse),
            percent(channel.nrmse_20hz),
            percent(channel.nrmse_unshifted),
            f"{1e3 * channel.shift:.2f} ms",
            percent(item.tracking_error.ratio) if item.tracking_error and channel.name == "position" else "",
        )
        for group, note in ((found.replays, ""), (found.checks, " (not fitted)"))
        for item in group
        for channel in item.channels
        if channel.name in fitted
    ]


def _correlation(found: Calibration) -> str:
    """A picture of the correlations; none of fewer than two parameters."""
    if len(found.linked) < 2:
        return ""
    spoken = f"Correlations of {', '.join(found.linked)}."
    return f"<section><h2>Correlations</h2>{drawn(correlation(found), spoken, 'low')}</section>"


def correlation(found: Calibration) -> go.Figure:
    """The correlations of the parameters that were fitted, -1 to 1."""
    names = list(found.linked)
    values = np.round(found.correlation, 2)
    picture = go.Heatmap(
        x=names,
        y=names,
        z=values.tolist(),
        zmin=-1,
        zmax=1,
        colorscale="RdBu",
        texttemplate="%{z}",
        colorbar={"title": "correlation [1]"},
    )
    drawing = go.Figure(picture)
    drawing.update_yaxes(autorange="reversed")
    drawing.update_layout(**{**LAYOUT, "margin": {"l": 200, "r": 20, "t": 30, "b": 120}})
    return drawing


def _fitted(curves: Curves, fidelity: str) -> str:
    names = ", ".join(item.name for item in curves.channels)
    title = html.escape(curves.run.name)
    over_time = f"Measured and fitted {names} over time."
    of_rest = f"Spectral densities of measured {names} and of what is left."
    return (
        f"<section><h2>{title}, fitted</h2>{drawn(figure(curves, fidelity), over_time, note=NOTE)}"
        f"<h2>{title}, spectra of the residuals</h2>"
        f"{drawn(spectra(curves, fidelity), of_rest)}</section>"
    )


def figures(found: Calibration) -> dict[str, go.Figure]:
    """The figures of the page by name: correlations; curves and spectra of each run; each log that was predicted."""
    own = {"correlations": correlation(found)} if len(found.linked) > 1 else {}
    for curves in found.curves:
        own[curves.run.name] = figure(curves, found.fidelity)
        own[f"{curves.run.name} spectra"] = spectra(curves, found.fidelity)
    return own | {f"{item.log.name} predicted": replayed(item) for item in found.checks}


def figure(curves: Curves, fidelity: str) -> go.Figure:
    """Each channel measured and fitted by a `fidelity`, with the residual under it."""
    run, lines = curves.run, _lines(fidelity)
    drawing = rows_of([f"{item.name}<br>[{item.unit}]" for item in curves.channels], residuals=0.32, size=11)
    for place, shown in enumerate(curves.channels):
        data, fit = (shown.scale * each[:, place] for each in (run.values, curves.fitted))
        for label, values in {"measured": data, "fitted": fit}.items():
            drawing.add_trace(
                curve(label, lines[label], thinned(run.time, values), legend=place == 0), row=2 * place + 1, col=1
            )
        rest = np.where(curves.weight[:, place] > 0.0, fit - data, np.nan)
        left = curve("fitted", lines["fitted"], thinned(run.time, rest), legend=False)  # a gap where it is no number
        drawing.add_trace(left, row=2 * place + 2, col=1)
    drawing.update_xaxes(title_text="Time [s]", row=2 * len(curves.channels), col=1)
    drawing.update_layout(**LAYOUT, hovermode="x unified")
    return drawing


def _lines(fidelity: str) -> dict[str, Line]:
    """The lines of what was measured, of what the `fidelity` fits, and of what it leaves."""
    own = lines_of([fidelity])[fidelity]
    return {"measured": MEASURED, "fitted": own, "left": own}


def spectra(curves: Curves, fidelity: str) -> go.Figure:
    """Of each channel the spectral densities of what was measured and of what is left, on logarithmic axes."""
    drawing = rows_of([f"{item.name}<br>[({item.unit})<sup>2</sup>/Hz]" for item in curves.channels], spacing=0.05, size=11)
    for place, shown in enumerate(curves.channels):
        for label, (rate, density) in _densities(curves, place, shown.scale).items():
            points = ([float(f"{x:.5g}") for x in rate], [float(f"{x:.4g}") for x in density])
            drawing.add_trace(curve(label, _lines(fidelity)[label], points, legend=place == 0), row=place + 1, col=1)
    drawing.update_xaxes(type="log")
    drawing.update_xaxes(title_text="Frequency [Hz]", row=len(curves.channels), col=1)
    drawing.update_yaxes(type="log", exponentformat="power")
    drawing.update_layout(**LAYOUT)
    return drawing


def _densities(curves: Curves, place: int, scale: float) -> dict[str, tuple[Array, Array]]:
    """Frequency [Hz] and density by what it is of: what was measured, and what is left of it."""
    run = curves.run
    data = run.values[:, place]
    rest = np.where(curves.weight[:, place] > 0.0, curves.fitted[:, place] - data, 0.0)
    rate = 1.0 / float(np.median(np.diff(run.time)))
    out = {}
    for label, series in {"measured": data, "left": rest}.items():
        frequency, density = welch(scale * series, rate, nperseg=min(SEGMENT, len(series)))
        out[label] = frequency[1:], density[1:]
    return out


def _checked(item: Replay) -> str:
    spoken = f"Measured and predicted {', '.join(channel.name for channel in item.channels)} over time."
    notes = "".join(f'<p class="note">{sentence(line)}</p>' for line in item.remarks)
    return (
        f"<section><h2>{html.escape(item.log.name)}, predicted: nothing of it was fitted</h2>{notes}"
        f"{drawn(replayed(item), spoken, note=REPLAYED)}</section>"
    )

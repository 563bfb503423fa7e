"""One self-contained HTML page: errors, wall times and the paper's Figures 5 to 7 from our own runs."""

import html
import platform
from collections.abc import Mapping
from importlib.metadata import version

import numpy as np
import plotly.graph_objects as go
import xarray as xr
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from ema_fmu_src import __version__
from harness.compare import Comparison
from harness.experiment import Experiment

FIGURES = (
    ("position", "Position [rad]"),
    ("motor_speed", "Motor speed [rad/s]"),
    ("equivalent_current_filtered", "Equivalent current, filtered [A]"),
)
"""The quantities of the paper's Figures 5 to 7."""
INSTANTANEOUS = "equivalent_current"
"""Drawn under the filtered current, hidden until its name in the legend is pressed."""
COLOURS = {"command": "#888888", "HF": "#1f6fd6", "ELF": "#d65a1f", "ELF+": "#16935b", "LF": "#9a4fc2"}
DASHES = {"command": "dot", "HF": "solid", "ELF": "dash", "ELF+": "dash", "LF": "dashdot"}
MOST_POINTS = 2501
"""Points drawn of each curve; more cannot be told apart and make the page heavy."""

STYLE = """
:root{--text:#1b1f24;--soft:#5b6570;--line:#d9dee4;--back:#ffffff;--panel:#f6f8fa}
@media (prefers-color-scheme:dark){:root{--text:#e6e9ec;--soft:#9aa4ae;--line:#39424c;--back:#14181c;--panel:#1d2329}}
body{font:16px/1.5 system-ui,sans-serif;color:var(--text);background:var(--back);margin:0 auto;max-width:76rem;
padding:1rem}
h1{font-size:1.5rem}h2{font-size:1.2rem;margin-top:2rem}
.scroll{overflow-x:auto}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:.3rem .7rem;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
th:nth-child(-n+2),td:nth-child(-n+2){text-align:left}thead th{color:var(--soft);font-weight:600}
caption{text-align:left;color:var(--soft);padding-bottom:.4rem}
code,pre{background:var(--panel);border-radius:4px;padding:.1rem .3rem;overflow-x:auto}pre{padding:.7rem}
.figure{height:46rem}.figure>div{height:100%}.note{color:var(--soft)}
"""

CONFIG = {"responsive": True, "displaylogo": False}

THEME = """
const dark=window.matchMedia('(prefers-color-scheme: dark)');
function paint(){const ink=dark.matches?'#e6e9ec':'#1b1f24',line=dark.matches?'#39424c':'#d9dee4',
panel=dark.matches?'#1d2329':'#f6f8fa',change={'font.color':ink,'hoverlabel.bgcolor':panel};
for(const axis of ['xaxis','xaxis2','xaxis3','yaxis','yaxis2','yaxis3'])
{change[axis+'.gridcolor']=line;change[axis+'.zerolinecolor']=line;}
document.querySelectorAll('.figure .plotly-graph-div').forEach(graph=>Plotly.relayout(graph,change));}
dark.addEventListener('change',paint);paint();
"""


def page(experiment: Experiment, *, parameters: Mapping[str, float], command: str) -> str:
    """The page as HTML text, with everything it needs inside it.

    `parameters` are those that were set for all runs; `command` is the command line that makes the page again.
    """
    trials = list(dict.fromkeys(trial for trial, _ in experiment.runs))
    sections = "".join(
        f"<section><h2>{html.escape(trial)}</h2>"
        f'<div class="figure" role="img" aria-label="{html.escape(_spoken(trial, experiment))}">'
        f"{_figure(trial, experiment).to_html(full_html=False, include_plotlyjs=False, config=CONFIG)}"
        "</div></section>"
        for trial in trials
    )
    settings = ", ".join(f"{name} = {value:g}" for name, value in parameters.items()) or "all at their defaults"
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>EMA twins: {html.escape(', '.join(trials))}</title><style>{STYLE}</style>"
        f"<script>{get_plotlyjs()}</script></head><body><main>"
        f"<h1>EMA twins side by side</h1><p>Every fidelity flown as an FMU and compared with {experiment.reference}. "
        "NRMSE is the rms difference over the range of the reference.</p>"
        f'<div class="scroll">{_table(experiment, trials)}</div>'
        f"{sections}<h2>How this page was made</h2><p>Parameters: {html.escape(settings)}.</p>"
        f"<pre>{html.escape(command)}</pre>"
        f'<p class="note">EMA twins {__version__}, {html.escape(_versions())}; '
        f"FMUs: {html.escape(_hashes(experiment))}.</p>"
        f"</main><script>{THEME}</script></body></html>"
    )


def _versions() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in ("fmpy", "numpy", "plotly"))
    return f"Python {platform.python_version()}, {packages}, {platform.system()} {platform.machine()}"


def _hashes(experiment: Experiment) -> str:
    found = {run.attrs["fmu"]: run.attrs["fmu_sha256"][:12] for run in experiment.runs.values()}
    return ", ".join(f"{name} (SHA-256 {digest}...)" for name, digest in found.items())


def errors_of(experiment: Experiment, trial: str, fidelity: str) -> dict[str, Comparison]:
    """The comparisons of one run with the reference, by variable; empty for the reference itself."""
    return {item.variable: item for item in experiment.comparisons if item.trial == trial and item.candidate == fidelity}


def percent(item: Comparison | None) -> str:
    """An NRMSE as text for a table."""
    if item is None:
        return "reference"
    return "-" if item.nrmse is None else f"{100.0 * item.nrmse:.4f} %"


def _table(experiment: Experiment, trials: list[str]) -> str:
    rows = []
    for (trial, fidelity), run in sorted(experiment.runs.items(), key=lambda entry: trials.index(entry[0][0])):
        errors = errors_of(experiment, trial, fidelity)
        cells = "".join(f"<td>{percent(errors.get(name))}</td>" for name, _ in FIGURES)
        wall = run.attrs["wall_s"] / run.attrs["simulated_s"]
        rows.append(f"<tr><td>{html.escape(trial)}</td><td>{html.escape(fidelity)}</td>{cells}<td>{wall:.4f}</td></tr>")
    return (
        "<table><caption>Errors (NRMSE) and wall seconds per simulated second</caption><thead><tr><th>Trial</th>"
        "<th>Fidelity</th><th>Position</th><th>Motor speed</th><th>Current, filtered</th><th>Wall s / s</th></tr>"
        "</thead>"
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _spoken(trial: str, experiment: Experiment) -> str:
    told = [
        f"{item.candidate} {percent(item)}"
        for item in experiment.comparisons
        if item.trial == trial and item.variable == "position"
    ]
    return f"{trial}: position, motor speed and current over time. Position error: {', '.join(told) or 'none'}."


def _figure(trial: str, experiment: Experiment) -> go.Figure:
    figure = make_subplots(rows=len(FIGURES), cols=1, shared_xaxes=True, vertical_spacing=0.06)
    flown = [(fidelity, run) for (name, fidelity), run in experiment.runs.items() if name == trial]
    for row, (variable, title) in enumerate(FIGURES, start=1):
        curves = [("command", flown[0][1]["command"])] if row == 1 else []
        curves += [(fidelity, run[variable]) for fidelity, run in flown]
        for name, values in curves:
            figure.add_trace(_curve(name, values, showlegend=row == 1), row=row, col=1)
        figure.update_yaxes(title_text=title, row=row, col=1)
    for fidelity, run in flown:
        curve = _curve(fidelity, run[INSTANTANEOUS])
        curve.update(name=f"{fidelity} instantaneous", legendgroup=None, visible="legendonly", opacity=0.5)
        figure.add_trace(curve, row=len(FIGURES), col=1)
    figure.update_xaxes(title_text="Time [s]", row=len(FIGURES), col=1)
    figure.update_layout(
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        margin={"l": 70, "r": 20, "t": 90, "b": 50},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.02},
        modebar={"bgcolor": "rgba(0,0,0,0)"},
        hovermode="x unified",
    )
    return figure


def _curve(name: str, values: xr.DataArray, *, showlegend: bool = True) -> go.Scatter:
    stride = max(1, -(-values.size // MOST_POINTS))
    return go.Scatter(
        x=np.round(values.time.values[::stride], 6).tolist(),
        y=[float(f"{value:.6g}") for value in values.values[::stride]],
        name=name,
        legendgroup=name,
        showlegend=showlegend,
        mode="lines",
        line={"width": 1.6, "color": COLOURS.get(name), "dash": DASHES.get(name, "dash")},
    )

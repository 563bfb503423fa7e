"""The live page: trial, fidelities and faults by sliders, drawn at once; a Dash app on this machine."""

import shlex
import socket
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
import xarray as xr
from dash import ALL, Dash, Input, Output, State, ctx, dcc, html, no_update
from plotly.subplots import make_subplots
from werkzeug.serving import make_server

from ema_fmu_src import ports
from harness.comparison import FIGURES, compare, percent
from harness.errors import HarnessError
from harness.faults import ESTIMATED
from harness.fidelity import FIDELITIES
from harness.files import results
from harness.flight.twin import Twin
from harness.show.page import LAYOUT
from harness.show.report import COLOURS
from harness.trials import BUILT_IN, trial

SLIDERS = {parameter.port: parameter.slider for parameter in ESTIMATED.values()}
"""Port of each fault -> lowest and highest value, and step, of its slider."""
STRIDE = 10
"""Every so many points are drawn."""


class Fleet:
    """The open FMUs of a folder, one instance each, flown by one request at a time."""

    def __init__(self, fmus: Path) -> None:
        self.fmus = fmus
        self._twins: dict[str, Twin] = {}
        self._lock = threading.Lock()

    def fly(self, name: str, fidelities: Sequence[str], faults: Mapping[str, float]) -> dict[str, xr.Dataset]:
        """A run of the trial `name` with each of `fidelities`."""
        runs = {}
        with self._lock:
            for fidelity in fidelities:
                chosen = FIDELITIES[fidelity]
                if chosen.fmu not in self._twins:
                    self._twins[chosen.fmu] = Twin(self.fmus / chosen.fmu)
                run = self._twins[chosen.fmu].run(trial(name), {**chosen.parameters, **faults})
                run.attrs["fidelity"] = fidelity
                runs[fidelity] = run
        return runs

    def close(self) -> None:
        """Close the FMUs."""
        with self._lock:
            for twin in self._twins.values():
                twin.close()
            self._twins.clear()


def command(name: str, fidelities: Sequence[str], faults: Mapping[str, float]) -> str:
    """The command line that flies what is shown."""
    reference = _reference(fidelities)
    settings = [part for fault, value in faults.items() for part in ("--set", f"{fault}={value:g}")]
    return shlex.join(["ema", "run", name, "--fidelity", ",".join(fidelities), "--reference", reference, *settings])


def _reference(fidelities: Sequence[str]) -> str:
    """What the others are compared with: the highest fidelity shown."""
    return next(fidelity for fidelity in ("HF", "ELF+", "ELF", "LF") if fidelity in fidelities)


def figure(runs: Mapping[str, xr.Dataset]) -> go.Figure:
    """Position, speed and current of each fidelity over time."""
    drawn = make_subplots(rows=len(FIGURES), cols=1, shared_xaxes=True, vertical_spacing=0.04)
    first = next(iter(runs.values()))
    time = first.time.values[::STRIDE]
    drawn.add_scatter(
        x=time, y=first.command.values[::STRIDE], name="command", line={"color": "#888", "dash": "dot"}, row=1, col=1
    )
    for row, (variable, title) in enumerate(FIGURES, start=1):
        for fidelity, run in runs.items():
            drawn.add_scatter(
                x=time, y=run[variable].values[::STRIDE], name=fidelity, legendgroup=fidelity, showlegend=row == 1,
                line={"color": COLOURS[fidelity]}, row=row, col=1,
            )  # fmt: skip
        drawn.update_yaxes(title_text=title, row=row, col=1)
    drawn.update_xaxes(title_text="Time [s]", row=len(FIGURES), col=1)
    drawn.update_layout(**LAYOUT, height=760, uirevision="kept", template="plotly_white")
    return drawn


def errors(runs: Mapping[str, xr.Dataset]) -> list[Any]:
    """A table of errors against the highest fidelity shown."""
    reference = _reference(list(runs))
    head = html.Tr([html.Th(text) for text in ("Fidelity", *(title for _, title in FIGURES), "ms")])
    rows = []
    for fidelity, run in runs.items():
        found = compare(run, runs[reference], names=(fidelity, reference)) if fidelity != reference else []
        items = {item.variable: item for item in found}
        cells = [html.Td(percent(items.get(variable))) for variable, _ in FIGURES]
        rows.append(html.Tr([html.Td(fidelity), *cells, html.Td(f"{1e3 * run.attrs['wall_s']:.1f}")]))
    style = {"borderSpacing": "1.2rem .3rem", "textAlign": "left"}
    return [
        html.Table([html.Caption(f"Errors (NRMSE) against {reference}, and wall time of the run"), head, *rows], style=style)
    ]


def app(fleet: Fleet) -> Dash:
    """The Dash app on the FMUs of `fleet`."""
    made = Dash(__name__, title="EMA twins, live", update_title="")
    made.layout = _layout()

    def chosen(fidelities: Sequence[str], hf: Sequence[str]) -> list[str]:
        return [*hf, *(fidelity for fidelity in FIDELITIES if fidelity in fidelities)] or ["ELF+"]

    def healthy(values: Sequence[float]) -> dict[str, float]:
        starts = {variable.name: variable.start for variable in ports.FAULTS}
        return {name: value for name, value in zip(SLIDERS, values, strict=True) if value != starts[name]}

    shown = (Input("trial", "value"), Input("fidelities", "value"), Input("hf", "value"), Input({"fault": ALL}, "value"))

    @made.callback(Output("figure", "figure"), Output("errors", "children"), Output("command", "children"), *shown)
    def draw(name: str, fidelities: list[str], hf: list[str], values: list[float]) -> Any:
        names, faults = chosen(fidelities, hf), healthy(values)
        try:
            runs = fleet.fly(name, names, faults)
        except HarnessError as error:
            return no_update, [html.P(str(error), role="alert")], ""
        return figure(runs), errors(runs), command(name, names, faults)

    states = tuple(State(item.component_id, item.component_property) for item in shown)

    @made.callback(
        Output("download", "data"), Input("csv", "n_clicks"), Input("fmu", "n_clicks"), *states, prevent_initial_call=True
    )
    def download(_csv: int, _fmu: int, name: str, fidelities: list[str], hf: list[str], values: list[float]) -> Any:
        fidelity = _reference(chosen(fidelities, hf))
        if ctx.triggered_id == "fmu":
            return dcc.send_file(str(fleet.fmus / FIDELITIES[fidelity].fmu))
        run = fleet.fly(name, [fidelity], healthy(values))[fidelity]
        return {"content": results.trajectory_csv(run), "filename": f"{name}_{fidelity.replace('+', 'plus')}.csv"}

    return made


def _layout() -> Any:
    starts = {variable.name: variable for variable in ports.FAULTS}
    sliders = [
        html.Div(
            [
                html.Label(name, htmlFor=f"fault-{name}", title=starts[name].description),
                dcc.Slider(low, high, step, value=starts[name].start, id={"fault": name}, marks=None, updatemode="drag"),
            ]
        )
        for name, (low, high, step) in SLIDERS.items()
    ]
    controls = html.Section(
        [
            html.Label("Trial", htmlFor="trial"),
            dcc.Dropdown(list(BUILT_IN), "SIN4", id="trial", clearable=False),
            html.Label("Fidelities"),
            dcc.Checklist(["ELF", "ELF+", "LF"], ["ELF+", "LF"], id="fidelities", inline=True),
            dcc.Checklist([{"label": "HF too (30 ms)", "value": "HF"}], [], id="hf"),
            *sliders,
            html.Button("Download CSV", id="csv"),
            html.Button("Download FMU", id="fmu"),
            dcc.Download(id="download"),
        ],
        style={"flex": "1 1 18rem", "minWidth": "0"},
    )
    drawn = html.Section(
        [
            dcc.Graph(id="figure"),
            html.Div(id="errors", style={"overflowX": "auto"}),
            html.Pre(id="command", style={"whiteSpace": "pre-wrap"}),
        ],
        style={"flex": "3 1 36rem", "minWidth": "0"},
    )
    style = {"font": "16px/1.5 system-ui, sans-serif", "maxWidth": "90rem", "margin": "auto", "padding": "1rem"}
    body = html.Div([controls, drawn], style={"display": "flex", "flexWrap": "wrap", "gap": "1.5rem"})
    return html.Main([html.H1("EMA twins, live"), body], style=style)


class Server:
    """The app on a host and port; a context manager. HarnessError if the port cannot be had; port 0 takes a free one."""

    def __init__(self, fmus: Path, *, host: str, port: int) -> None:
        self.fleet = Fleet(fmus)
        try:
            self._socket = socket.create_server((host, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise HarnessError(f"--host {host} --port {port}: cannot be had: {reason}; another --port may be free") from None
        self.url = f"http://{host}:{self._socket.getsockname()[1]}/"
        self._server = make_server(
            host, self._socket.getsockname()[1], app(self.fleet).server, threaded=True, fd=self._socket.fileno()
        )

    def run(self) -> None:
        """Serve until `stop` or an interrupt."""
        try:
            self._server.serve_forever()
        finally:
            self.close()

    def stop(self) -> None:
        """End `run`, from another thread."""
        self._server.shutdown()

    def close(self) -> None:
        """Give up the port and the FMUs."""
        self._server.server_close()
        self._socket.close()
        self.fleet.close()

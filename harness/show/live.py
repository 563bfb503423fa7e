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
from werkzeug.serving import make_server

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES, MODELS, REFERENCE, SURROGATE, highest
from harness.actuators.actuator import DEFAULT, Actuator
from harness.comparison import FIGURES, compare, percent, titles
from harness.errors import HarnessError
from harness.faults import ESTIMATED
from harness.fidelity import file_stem
from harness.files import results
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.show.curves import COMMAND, curve, lines_of, rows, stride
from harness.show.outside import run_of
from harness.show.page import LAYOUT
from harness.trials import BUILT_IN, trial

LOWER = [name for name in FIDELITIES if name != REFERENCE.name]
"""Fidelities that are flown at every movement of a slider; the reference, which takes longer, only on demand."""
SHOWN_FIRST = [highest(name for name in LOWER if FIDELITIES[name].model == model) for model in MODELS
               if model != REFERENCE.model]  # fmt: skip
"""Of these, the highest of each model."""

SLIDERS = {parameter.port: parameter.slider for parameter in ESTIMATED.values()}
"""Port of each fault -> lowest and highest value, and step, of its slider."""


class Fleet:
    """The open FMUs of a folder, one instance each, flown as `actuator` by one request at a time.

    `named`: how the command line names that actuator, None if it need not.
    """

    def __init__(self, fmus: Path, actuator: Actuator = DEFAULT, named: str | None = None) -> None:
        self.fmus = fmus
        self.actuator = actuator
        self.named = named
        self._twins: dict[str, Twin] = {}
        self._lock = threading.Lock()

    def fly(self, name: str, fidelities: Sequence[str], faults: Mapping[str, float]) -> dict[str, xr.Dataset]:
        """A run of the trial `name` with each of `fidelities`, in the actuator's units outside."""
        parameters = {**self.actuator.parameters, **faults}
        runs = {}
        with self._lock:
            for fidelity in fidelities:
                chosen = FIDELITIES[fidelity]
                if chosen.fmu not in self._twins:
                    self._twins[chosen.fmu] = Twin(self.fmus / chosen.fmu)
                run = self._twins[chosen.fmu].run(trial(name), merged(chosen, parameters))
                run.attrs["fidelity"] = fidelity
                runs[fidelity] = run_of(run, self.actuator)
        return runs

    def close(self) -> None:
        """Close the FMUs."""
        with self._lock:
            for twin in self._twins.values():
                twin.close()
            self._twins.clear()


def command(name: str, fidelities: Sequence[str], faults: Mapping[str, float], actuator: str | None = None) -> str:
    """The command line that flies what is shown; `actuator` is what follows --actuator."""
    reference = highest(fidelities)
    settings = [part for fault, value in faults.items() for part in ("--set", f"{fault}={value:g}")]
    return shlex.join(["ema", "run", name, "--fidelity", ",".join(fidelities), "--reference", reference,
                       *(["--actuator", actuator] if actuator else []), *settings])  # fmt: skip


def figure(runs: Mapping[str, xr.Dataset]) -> go.Figure:
    """Position, speed and current of each fidelity over time."""
    lines = lines_of(runs)
    first = next(iter(runs.values()))
    drawn = rows(titles(first), spacing=0.04)
    every = stride(first.sizes["time"])
    time = first.time.values[::every]
    drawn.add_trace(curve("command", COMMAND, (time, first.command.values[::every])), row=1, col=1)
    for row, (variable, _) in enumerate(FIGURES, start=1):
        for fidelity, run in runs.items():
            points = (time, run[variable].values[::every])
            drawn.add_trace(curve(fidelity, lines[fidelity], points, legend=row == 1), row=row, col=1)
    drawn.update_xaxes(title_text="Time [s]", row=len(FIGURES), col=1)
    drawn.update_layout(**LAYOUT, height=760, uirevision="kept", template="plotly_white")
    return drawn


def errors(runs: Mapping[str, xr.Dataset]) -> list[Any]:
    """A table of errors against the highest fidelity shown."""
    reference = highest(runs)
    head = html.Tr([html.Th(text) for text in ("Fidelity", *titles(runs[reference]), "ms")])
    body = []
    for fidelity, run in runs.items():
        found = compare(run, runs[reference], names=(fidelity, reference)) if fidelity != reference else []
        items = {item.variable: item for item in found}
        cells = [html.Td(percent(items.get(variable))) for variable, _ in FIGURES]
        body.append(html.Tr([html.Td(fidelity), *cells, html.Td(f"{1e3 * run.attrs['wall_s']:.1f}")]))
    style = {"borderSpacing": "1.2rem .3rem", "textAlign": "left"}
    return [
        html.Table([html.Caption(f"Errors (NRMSE) against {reference}, and wall time of the run"), head, *body], style=style)
    ]


def app(fleet: Fleet) -> Dash:
    """The Dash app on the FMUs of `fleet`."""
    made = Dash(__name__, title="EMA twins, live", update_title="")
    made.layout = _layout(fleet.actuator)

    def chosen(lower: Sequence[str], reference: Sequence[str]) -> list[str]:
        return [name for name in FIDELITIES if name in (*reference, *lower)] or [SURROGATE.name]

    def moved(values: Sequence[float]) -> dict[str, float]:
        starts = {variable.name: fleet.actuator.value(variable.name) for variable in ports.FAULTS}
        return {name: value for name, value in zip(SLIDERS, values, strict=True) if value != starts[name]}

    shown = (
        Input("trial", "value"), Input("lower", "value"), Input("reference", "value"), Input({"fault": ALL}, "value")
    )  # fmt: skip

    @made.callback(Output("figure", "figure"), Output("errors", "children"), Output("command", "children"), *shown)
    def draw(name: str, lower: list[str], reference: list[str], values: list[float]) -> Any:
        names, faults = chosen(lower, reference), moved(values)
        try:
            runs = fleet.fly(name, names, faults)
        except HarnessError as error:
            return no_update, [html.P(str(error), role="alert")], ""
        return figure(runs), errors(runs), command(name, names, faults, fleet.named)

    states = tuple(State(item.component_id, item.component_property) for item in shown)

    @made.callback(
        Output("download", "data"), Input("csv", "n_clicks"), Input("fmu", "n_clicks"), *states, prevent_initial_call=True
    )
    def download(_csv: int, _fmu: int, name: str, lower: list[str], reference: list[str], values: list[float]) -> Any:
        fidelity = highest(chosen(lower, reference))
        if ctx.triggered_id == "fmu":
            return dcc.send_file(str(fleet.fmus / FIDELITIES[fidelity].fmu))
        run = fleet.fly(name, [fidelity], moved(values))[fidelity]
        return {"content": results.trajectory_csv(run), "filename": f"{name}_{file_stem(fidelity)}.csv"}

    return made


def _layout(actuator: Actuator) -> Any:
    starts = {variable.name: variable for variable in ports.FAULTS}
    sliders = [
        html.Div(
            [
                html.Label(name, htmlFor=f"fault-{name}", title=starts[name].description),
                dcc.Slider(low, high, step, value=actuator.value(name), id={"fault": name}, marks=None, updatemode="drag"),
            ]
        )
        for name, (low, high, step) in SLIDERS.items()
    ]
    controls = html.Section(
        [
            html.Label("Trial", htmlFor="trial"),
            dcc.Dropdown(list(BUILT_IN), "SIN4", id="trial", clearable=False),
            html.Label("Fidelities"),
            dcc.Checklist(LOWER, SHOWN_FIRST, id="lower", inline=True),
            dcc.Checklist([{"label": f"{REFERENCE.name} too (slower)", "value": REFERENCE.name}], [], id="reference"),
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
    return html.Main([html.H1("EMA twins, live"), html.P(_about(actuator)), body], style=style)


def _about(actuator: Actuator) -> str:
    about = f": {actuator.description}" if actuator.description else ""
    return f"Actuator {actuator.name}{about}"


class Server:
    """The app on a host and port, flying `actuator`, which the command line calls `named`; a context manager.

    HarnessError if the port cannot be had; port 0 takes a free one.
    """

    def __init__(self, fmus: Path, *, host: str, port: int, actuator: Actuator = DEFAULT, named: str | None = None) -> None:
        self.fleet = Fleet(fmus, actuator, named)
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

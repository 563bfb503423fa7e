"""The page's HTML: a form of native controls, so that every key and every reader of screens knows it, filled from a wish."""

import html
from collections.abc import Iterable, Mapping

from ema_fmu_src import __version__, ports
from ema_fmu_src.fidelities import FIDELITIES, REFERENCE
from harness.actuators.actuator import Actuator
from harness.faults import ESTIMATED
from harness.flight.twin import CONSTANT_INPUTS
from harness.show.live.view import described
from harness.show.live.wish import Hangar, Wish

SLIDERS = {parameter.port: parameter.slider for parameter in ESTIMATED.values()}
"""Port of each fault -> lowest and highest value, and step, of its slider."""


def page(hangar: Hangar, wish: Wish, actuator: Actuator, problem: str = "") -> str:
    """The page, its form filled with `wish`; `problem` is why the address could not be followed."""
    values = {name.strip(): text.strip() for name, _, text in (setting.partition("=") for setting in wish.settings)}
    sliders = "".join(_slider(port, actuator.value(port), values) for port in SLIDERS)
    constants = "".join(_constant(port, actuator.value(port), values) for port in CONSTANT_INPUTS)
    own = html.escape("\n".join(f"{name}={text}" for name, text in values.items()))
    failed = ' data-problem="1"' if problem else ""
    told = _alert(problem) if problem else '<p class="verdict none">Starting the FMUs ...</p>'
    return f"""<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width,initial-scale=1"><link rel="icon" href="data:,">
<title>EMA twins, live</title><link rel="stylesheet" href="live.css">
<script src="plotly.js" defer></script><script src="live.js" defer></script></head><body><main>
<h1>EMA twins, live</h1><p id="about">{described(actuator)}</p>
<div id="banner" role="status"{failed}>{told}</div>
<form id="wish" autocomplete="off"><section class="choice" aria-label="What is flown">
<div>{_choice("trial", "Trial", hangar.trials(), wish.trial)}{_file("trial", "Own trial", ".csv,.txt,.tsv,.dat,.log")}</div>
<div>{_choice("actuator", "Actuator", hangar.actuators(), wish.actuator)}{_file("actuator", "Own actuator", ".toml")}</div>
<fieldset><legend>Fidelities</legend>{_fidelities(wish)}</fieldset>
<label><input type="checkbox" id="residuals"{" checked" if wish.residuals else ""}> Residuals under each curve</label>
<p class="row"><a class="button" id="reset" href="./">Reset</a>
<a class="button" id="link" href="./">Link to this view</a></p>
</section><section class="more" aria-label="Loads, faults and parameters">
<details open><summary>Load and supply</summary>{constants}</details>
<details open id="faults"><summary>Faults</summary><div class="sliders">{sliders}</div></details>
<details{" open" if own else ""}><summary>Other parameters</summary>
<label for="parameters">One NAME=VALUE a line, a unit if you like: motor.R=1.2 Ohm</label>
<textarea id="parameters" rows="4" spellcheck="false">{own}</textarea>
<label for="port">Add</label> <input id="port" list="ports" placeholder="motor.R" spellcheck="false">
<datalist id="ports">{_ports()}</datalist></details></section></form>
<section class="plot" aria-label="Curves"><div class="figure" id="figure" role="img" aria-label="Nothing flown yet">
</div><p class="note" id="note"></p></section><section class="result" aria-label="Results"><p class="row">
<button type="button" data-picture="png">Figure as PNG</button>
<button type="button" data-picture="svg">Figure as SVG</button> <button type="button" id="csv">Trajectories as CSV</button>
<button type="button" id="fmu">FMU</button></p><div class="scroll" tabindex="0" id="table"></div>
<h2>The same on the command line</h2><pre id="command" tabindex="0"></pre>
<p class="note">EMA twins {__version__}. The trajectories and the FMU are those of the highest fidelity shown;
the FMU starts with the values that it was built with, not with what is set here.</p>
</section></main></body></html>"""


def _alert(problem: str) -> str:
    return f'<p class="verdict over" role="alert">{html.escape(problem)}</p>'


def _choice(name: str, label: str, choices: Mapping[str, str], chosen: str) -> str:
    options = "".join(
        f'<option value="{html.escape(value)}"{" selected" if value == chosen else ""}>{html.escape(text)}</option>'
        for value, text in choices.items()
    )
    return f'<label for="{name}">{label}</label><select id="{name}">{options}</select>'


def _file(kind: str, label: str, accepted: str) -> str:
    return f'<label class="file">{label} <input type="file" data-kind="{kind}" accept="{accepted}"></label>'


def _fidelities(wish: Wish) -> str:
    boxes = []
    for name, fidelity in FIDELITIES.items():
        slower = " (slower)" if name == REFERENCE.name else ""
        checked = " checked" if name in wish.fidelities else ""
        box = f'<input type="checkbox" name="fidelity" value="{name}"{checked}> {name}{slower}'
        boxes.append(f'<label title="{html.escape(fidelity.title)}">{box}</label>')
    return "".join(boxes)


def _slider(port: str, start: float, values: dict[str, str]) -> str:
    """The slider of a fault; it takes its value out of `values` if that is a number that it can show."""
    low, high, step = SLIDERS[port]
    variable = ports.VARIABLES[ports.INDEX[port]]
    value = _taken(port, values, low, high, step)
    moved = ' data-moved="1"' if value else ""
    unit = "" if variable.unit == "1" else f" {html.escape(variable.unit)}"
    name, about = port.removeprefix("fault."), html.escape(variable.description)
    return (
        f'<div><label for="{port}" title="{about}">{name}</label>'
        f'<input type="range" id="{port}" min="{low:g}" max="{high:g}" step="{step:g}" value="{value or f"{start:g}"}" '
        f'data-start="{start!r}"{moved} title="{about}"><output for="{port}" data-unit="{unit}"></output></div>'
    )


def _constant(port: str, start: float, values: dict[str, str]) -> str:
    """The field of an input that is constant where the trial gives none; empty for what the actuator has."""
    variable = ports.VARIABLES[ports.INDEX[port]]
    value = _taken(port, values, variable.minimum or 0.0, variable.maximum or 0.0)
    label, about = f"{port.replace('_', ' ').capitalize()} [{variable.unit}]", html.escape(variable.description)
    return (
        f'<div class="constant"><label for="{port}" title="{about}">{html.escape(label)}</label>'
        f'<input type="text" inputmode="decimal" id="{port}" value="{html.escape(value)}" '
        f'placeholder="{start:g}"></div>'
    )


def _taken(port: str, values: dict[str, str], low: float, high: float, step: float | None = None) -> str:
    """The text of `port`, taken out of `values`, if it is a number from `low` to `high` in whole steps; else ""."""
    text = values.get(port, "")
    try:
        value = float(text)
    except ValueError:
        return ""
    if not low <= value <= high or (step and abs((value - low) / step - round((value - low) / step)) > 1e-6):
        return ""
    return values.pop(port)


def _ports() -> str:
    listed: Iterable[ports.Variable] = (port for port in ports.PARAMETERS if port.name not in SLIDERS)
    return "".join(
        f'<option value="{port.name}" data-start="{port.text(port.start)}" data-unit="{html.escape(port.unit)}">'
        f"{html.escape(port.description)}</option>"
        for port in listed
    )

"""documentation/index.html of an FMU, made from `ports` and from the module docstrings of the twins."""

import sys
from collections.abc import Iterable
from html import escape

from .. import __version__, ports
from ..twins import TWINS
from .description import DEFAULT_TOLERANCE
from .variant import DEFAULT, Variant

STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8881; }
body { font: 16px/1.55 system-ui, sans-serif; max-width: 64rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
h1 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid var(--line); padding-bottom: .2rem; }
pre { background: var(--soft); padding: 1rem; white-space: pre-wrap; border-radius: .4rem; line-height: 1.45; }
.table { overflow-x: auto; } table { border-collapse: collapse; font-size: .9rem; width: 100%; }
caption { text-align: left; font-weight: 600; padding: .4rem 0; }
th, td { text-align: left; padding: .3rem .6rem; border-bottom: 1px solid var(--line); vertical-align: top; }
td.number { white-space: nowrap; font-variant-numeric: tabular-nums; }
"""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{name}</title>
<style>{style}</style>
</head>
<body>
<main>
<h1>{name}</h1>
<p>{title}. One of three digital twins of an electromechanical actuator (EMA) for flight controls, all with the same ports;
EMA twins {version}. After Quattrocchi, Dalla Vedova, Berri, <i>Lumped parameters multi-fidelity digital twins for
prognostics of electromechanical actuators</i>, J. Phys. Conf. Ser. 2526 (2023) 012076,
<a href="https://doi.org/10.1088/1742-6596/2526/1/012076">doi 10.1088/1742-6596/2526/1/012076</a>.</p>

<h2 id="model">Model</h2>
<p>Angles: theta is the motor's mechanical angle, theta_e = p*theta; phase j = a, b, c: theta_j = theta_e - 2*pi*j/3.
Back-EMF coefficient of a phase: k_j = -N_j*K_e*sin(theta_j)*[1 + p*zeta*cos(theta_j - phi)]. The paper gives the structure
of the models, ELF's limit (Eq. 1), the back-EMF with shorts and eccentricity (Eq. 2) and the trials. The parameter values,
the equations of HF and LF, and what is marked <i>ours</i> come from this project: nothing here reproduces the authors' own
curves.</p>
<pre>{equations}</pre>

<h2 id="use">Use</h2>
<ul>
<li>FMI 2.0 co-simulation. A communication step may have any length above 0; the default is 1e-4 s. The twin keeps its own
time grid: with constant inputs the results do not depend on the communication steps.</li>
<li>A relative tolerance is that with which HF finds the inverter's switchings, as a fraction of the hysteresis band; without
one it is {tolerance:g}. ELF and LF have a fixed step.</li>
<li>The parameters <code>fault.*</code> are tunable: set them before a run, or let a fault grow during it. The other
parameters are fixed after initialization. <code>initial.*</code> start the twin in motion.</li>
<li><code>voltage_saturated</code> is true if some phase was voltage-limited in the last communication step: plain ELF has
left its range of validity there; ELF+ (<code>driver.coupled_saturation</code>) has not.</li>
<li>A value out of its range or a NaN (<code>fmi2Discard</code> in the native runtime), a step that cannot be taken or a call
that is not allowed at that time (<code>fmi2Error</code>) is refused with a message in the log, and changes nothing.</li>
</ul>

<h2 id="variables">Variables</h2>
{tables}
</main>
</body>
</html>
"""

SECTIONS = (
    ("Inputs", ports.INPUTS),
    ("Outputs", ports.OUTPUTS),
    ("Local variables", tuple(v for v in ports.VARIABLES if v.causality == "local")),
    ("Parameters", tuple(v for v in ports.PARAMETERS if v.variability == "fixed")),
    ("Faults (tunable)", ports.FAULTS),
)


def _span(variable: ports.Variable) -> str:
    """What values the variable may have, as text; empty if any."""
    if variable.kind == "Enumeration":
        return ", ".join(f"{value} {item}" for item, value in variable.items.items())
    limits = (variable.minimum, variable.maximum)
    if variable.kind == "Boolean" or limits == (None, None):
        return ""
    return " .. ".join("" if limit is None else variable.text(limit) for limit in limits)


def _table(title: str, variables: Iterable[ports.Variable], model: str, variant: Variant) -> str:
    heads = ("Value reference", "Name", "Type", "Unit", "Start", "Range", "Meaning")
    rows = []
    for variable in variables:
        settable = variable.causality in ("input", "parameter")
        start = variable.text(variant.start(variable, model)) if settable else ""
        cells = (ports.INDEX[variable.name], variable.name, variable.kind, variable.unit, start, _span(variable))
        texts = "".join(f'<td class="number">{escape(str(cell))}</td>' for cell in cells)
        rows.append(f"<tr>{texts}<td>{escape(variable.description_for(model))}</td></tr>")
    head = "".join(f'<th scope="col">{name}</th>' for name in heads)
    body = "\n".join(rows)
    return f'<div class="table"><table><caption>{title}</caption><tr>{head}</tr>\n{body}\n</table></div>'


def page(model: str, variant: Variant = DEFAULT) -> str:
    """The HTML page of the twin `model` ("HF", "ELF" or "LF"): its equations, what it covers and what not, its variables.

    The variables start as `variant` says.
    """
    equations = (sys.modules[TWINS[model].advance.__module__].__doc__ or "").strip()
    return PAGE.format(
        name=escape(variant.model_name(model)),
        title=escape(variant.title(TWINS[model].title)),
        version=__version__,
        style=STYLE,
        equations=escape(equations),
        tolerance=DEFAULT_TOLERANCE,
        tables="\n".join(_table(title, variables, model, variant) for title, variables in SECTIONS),
    )

"""What every page has in common: one self-contained HTML document, light and dark, with figures and tables."""

import html
import platform
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from typing import Any

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from ema_fmu_src import __version__
from harness.actuators.actuator import Actuator

STYLE = """
:root{--text:#1b1f24;--soft:#5b6570;--line:#d9dee4;--back:#ffffff;--panel:#f6f8fa}
@media (prefers-color-scheme:dark){:root{--text:#e6e9ec;--soft:#9aa4ae;--line:#39424c;--back:#14181c;--panel:#1d2329}}
body{font:16px/1.5 system-ui,sans-serif;color:var(--text);background:var(--back);margin:0 auto;max-width:76rem;
padding:1rem}
h1{font-size:1.5rem}h2{font-size:1.2rem;margin-top:2rem}
.scroll{overflow-x:auto;margin-bottom:1.6rem}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:.3rem .7rem;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
th:nth-child(-n+2),td:nth-child(-n+2){text-align:left}thead th{color:var(--soft);font-weight:600}
caption{text-align:left;color:var(--soft);padding-bottom:.4rem}
code,pre{background:var(--panel);border-radius:4px;padding:.1rem .3rem;overflow-x:auto}pre{padding:.7rem}
.figure{height:62rem}.figure.low{height:26rem}.figure>div{height:100%}.note{color:var(--soft)}
.verdict{padding:.6rem .9rem;border-radius:6px;font-weight:600}
.ok{background:rgba(22,147,91,.18)}.near{background:rgba(214,150,31,.25)}.over{background:rgba(214,50,31,.25)}
td small{color:var(--soft)}
"""

LAYOUT: dict[str, Any] = {
    "paper_bgcolor": "rgba(0,0,0,0)",
    "plot_bgcolor": "rgba(0,0,0,0)",
    "margin": {"l": 70, "r": 20, "t": 90, "b": 50},
    "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.02},
    "modebar": {"bgcolor": "rgba(0,0,0,0)"},
}
CONFIG = {"responsive": True, "displaylogo": False}

THEME = """
const dark=window.matchMedia('(prefers-color-scheme: dark)');
function paint(){const ink=dark.matches?'#e6e9ec':'#1b1f24',line=dark.matches?'#39424c':'#d9dee4',
panel=dark.matches?'#1d2329':'#f6f8fa',change={'font.color':ink,'hoverlabel.bgcolor':panel};
for(const axis of ['x','y'].flatMap(a=>['',2,3,4,5,6].map(n=>a+'axis'+n)))
{change[axis+'.gridcolor']=line;change[axis+'.zerolinecolor']=line;}
document.querySelectorAll('.figure .plotly-graph-div').forEach(graph=>Plotly.relayout(graph,change));}
dark.addEventListener('change',paint);paint();
"""


def document(title: str, body: str) -> str:
    """The page as HTML text, with everything it needs inside it; `body` is HTML."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{html.escape(title)}</title><style>{STYLE}</style>"
        f"<script>{get_plotlyjs()}</script></head><body><main>{body}</main><script>{THEME}</script></body></html>"
    )


def drawn(figure: go.Figure, spoken: str, kind: str = "") -> str:
    """A figure as HTML; `spoken` says in words what it shows, `kind` is "low" for one of a single row."""
    graph = figure.to_html(full_html=False, include_plotlyjs=False, config=CONFIG)
    classes = " ".join(["figure", *([kind] if kind else [])])
    return f'<div class="{classes}" role="img" aria-label="{html.escape(spoken)}">{graph}</div>'


def table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table as HTML that scrolls where the screen is narrow; cells are plain text."""
    head = "".join(f'<th scope="col">{html.escape(text)}</th>' for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    shown = f"<table><caption>{html.escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="scroll" tabindex="0">{shown}</div>'


def flown_actuator(actuator: Actuator) -> str:
    """Which actuator a page is about, as HTML: name, description, the beginning of its hash."""
    about = f": {html.escape(actuator.description)}" if actuator.description else ""
    return f"<p>Actuator <b>{html.escape(actuator.name)}</b>{about} (SHA-256 {actuator.sha256[:12]}...).</p>"


def origin(command: str, note: str = "") -> str:
    """How the page was made: the command line, versions, and a note (HTML)."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("fmpy", "numpy", "plotly"))
    versions = f"Python {platform.python_version()}, {packages}, {platform.system()} {platform.machine()}"
    return (
        f"<h2>How this page was made</h2><pre>{html.escape(command)}</pre>"
        f'<p class="note">EMA twins {__version__}, {html.escape(versions)}{note}.</p>'
    )

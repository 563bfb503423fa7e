"""What every page has in common: one self-contained HTML document, light and dark, with figures and tables."""

import html
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from harness.actuators.actuator import Actuator
from harness.files import results
from harness.provenance import Provenance
from harness.show.symbols import legend, meaning

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
.figure{height:calc(var(--rows)*10.3rem)}.figure.low{height:26rem}.figure.middle{height:40rem}.figure>div{height:100%}.note{color:var(--soft)}
.verdict{padding:.6rem .9rem;border-radius:6px;font-weight:600}
.ok{background:rgba(22,147,91,.18)}.near{background:rgba(214,150,31,.25)}.over{background:rgba(214,50,31,.25)}
td small{color:var(--soft)}[title]{text-decoration:underline dotted var(--soft);text-underline-offset:.2em}
details{margin:-1rem 0 1.6rem;color:var(--soft)}summary{cursor:pointer}dt{font-weight:600}dd{margin:0 0 .3rem 1.2rem}
figcaption{color:var(--soft);margin:.2rem 0 1rem}figure{margin:0}td .mark{padding:.05rem .4rem;border-radius:4px}
@media (max-width:40rem){.figure{height:calc(var(--rows)*11.5rem)}
th,td{padding:.3rem .45rem}}
.words{white-space:normal;min-width:9rem}
.origin{color:var(--soft);font-size:.9rem}
.origin th,.origin td{text-align:left;vertical-align:top}.origin td{white-space:normal;overflow-wrap:anywhere}
"""

LAYOUT: dict[str, Any] = {
    "paper_bgcolor": "rgba(0,0,0,0)",
    "plot_bgcolor": "rgba(0,0,0,0)",
    "margin": {"l": 70, "r": 20, "t": 60, "b": 50},
    "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.02},
    "modebar": {"bgcolor": "rgba(0,0,0,0)"},
}
NAMES = 2
"""Columns of a table, from the left, that hold names."""
LEAST_ROWS = 4
"""Rows for which a figure has room, though it has fewer."""
WORDY = 28
"""Characters from which a cell may be folded."""
DIGEST, HEAD = "ema-provenance", 512
"""Name of the element that tells pages apart, and the first characters of a page, among which it is."""
CONFIG = {"responsive": True, "displaylogo": False}

THEME = """
const dark=window.matchMedia('(prefers-color-scheme: dark)');
function paint(){const ink=dark.matches?'#e6e9ec':'#1b1f24',line=dark.matches?'#39424c':'#d9dee4',
panel=dark.matches?'#1d2329':'#f6f8fa',change={'font.color':ink,'hoverlabel.bgcolor':panel};
document.querySelectorAll('.figure .plotly-graph-div').forEach(graph=>{const own={...change};
for(const axis of Object.keys(graph._fullLayout).filter(name=>/^[xy]axis[0-9]*$/.test(name)))
{own[axis+'.gridcolor']=line;own[axis+'.zerolinecolor']=line;}Plotly.relayout(graph,own);});}
dark.addEventListener('change',paint);paint();
"""


def document(title: str, body: str, record: Provenance, note: str = "") -> str:
    """The page as HTML text, with everything it needs inside it, and how it was made; `body` and `note` are HTML."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta name="{DIGEST}" content="{record.digest}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{html.escape(title)}</title><style>{STYLE}</style>"
        f"<script>{get_plotlyjs()}</script></head><body><main>{body}{origin(record, note)}</main>"
        f"<script>{THEME}</script></body></html>"
    )


def write_page(path: Path, content: str) -> Path:
    """Write a page to `path`, or, where something else than this page lies, beside it with its digest in the name.

    The same command on the same files takes the place of its own page. Returns the path; HarnessError as from
    `results.write`.
    """
    own = _digest(content[:HEAD])
    target = path if not path.exists() or _held(path) == own else path.with_stem(f"{path.stem}-{own}")
    results.write(target, content)
    return target


def _held(path: Path) -> str:
    """The digest of the page at `path`; empty if it is none, or cannot be read."""
    try:
        with path.open("rb") as file:
            return _digest(file.read(HEAD).decode(errors="replace"))
    except OSError:
        return ""


def _digest(head: str) -> str:
    found = re.search(f'<meta name="{DIGEST}" content="([0-9a-f]+)">', head)
    return found.group(1) if found else ""


def sentence(text: str) -> str:
    """A line of text as HTML, with a full stop if it has no end."""
    return html.escape(text if text.endswith((".", "?", "!")) else f"{text}.")


def drawn(figure: go.Figure, spoken: str, kind: str = "", note: str = "") -> str:
    """A figure as HTML; `spoken` says in words what it shows, `kind` is "low" for one of a single row.

    `note` stands under it, where a narrow screen folds it.
    """
    graph = figure.to_html(full_html=False, include_plotlyjs=False, config=CONFIG)
    classes = " ".join(["figure", *([kind] if kind else [])])
    n_rows = max(LEAST_ROWS, sum(1 for _ in figure.select_yaxes()))
    caption = f"<figcaption>{html.escape(note)}</figcaption>" if note else ""
    spoken_as = f'role="img" aria-label="{html.escape(spoken)}"'
    return f'<figure><div class="{classes}" style="--rows:{n_rows}" {spoken_as}>{graph}</div>{caption}</figure>'


def table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table as HTML that scrolls where the screen is narrow; cells are plain text.

    What a heading or a name in the first two columns means is told under the pointer and in a legend below; outcomes have
    their colours.
    """
    listed = [tuple(row) for row in rows]
    head = "".join(f'<th scope="col"{_title(text)}>{html.escape(text)}</th>' for text in heads)
    body = "".join("<tr>" + "".join(_cell(place, cell) for place, cell in enumerate(row)) + "</tr>" for row in listed)
    shown = f"<table><caption>{html.escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    names = [*heads, *(cell for row in listed for cell in row[:NAMES])]
    return f'<div class="scroll" tabindex="0">{shown}</div>{legend(names)}'


def _cell(place: int, text: str) -> str:
    kind = outcome(text)
    shown = html.escape(text)
    if kind:
        shown = f'<span class="mark {kind}">{shown}</span>'
    wordy = ' class="words"' if len(text) > WORDY else ""
    return f"<td{_title(text) if place < NAMES else ''}{wordy}>{shown}</td>"


def outcome(text: str) -> str:
    """The class of a cell that is an outcome: "over" for what is not well, "ok" for what is; empty for any other."""
    if text == "NO" or text.startswith(("NOT ", "ALARM", "outside")):
        return "over"
    return "ok" if text in ("met", "within") else ""


def _title(text: str) -> str:
    """The attribute that tells what `text` means; empty if that is known of no such name."""
    told = meaning(text)
    return f' title="{html.escape(told)}"' if told else ""


def flown_actuator(actuator: Actuator) -> str:
    """Which actuator a page is about, as HTML: name, description, the beginning of its hash."""
    about = f": {html.escape(actuator.description)}" if actuator.description else ""
    return f"<p>Actuator <b>{html.escape(actuator.name)}</b>{about} (SHA-256 {actuator.sha256[:12]}...).</p>"


def origin(record: Provenance, note: str = "") -> str:
    """How the page was made, as HTML: the command line, and all of its provenance, also as JSON; `note` is HTML."""
    versions = ", ".join(f"{name} {version}" for name, version in record.versions.items())
    machine = record.machine
    lines = [
        ("Time", html.escape(record.time)),
        ("Versions", html.escape(versions)),
        ("FMUs", _hashes(record.fmus)),
        ("Inputs", _hashes(record.inputs)),
        ("Actuator", _hashes({record.actuator["name"]: record.actuator["sha256"]} if record.actuator else {})),
        (
            "Machine",
            html.escape(f"{machine['system']}, {machine['architecture']}, {machine['processor']}, {machine['cores']} cores"),
        ),
        ("Note", note),
    ]
    shown = "".join(f'<tr><th scope="row">{head}</th><td>{text}</td></tr>' for head, text in lines if text)
    held = record.as_text().replace("<", "\\u003c")
    return (
        f"<h2>How this page was made</h2><pre>{html.escape(record.command)}</pre>"
        f'<table class="origin"><tbody>{shown}</tbody></table>'
        f'<script type="application/json" id="provenance">{held}</script>'
    )


def _hashes(files: Mapping[str, str]) -> str:
    """Names with the beginnings of their hashes, the whole ones to be seen under the pointer, as HTML."""
    return ", ".join(
        f'{html.escape(Path(name).name)} <small title="SHA-256 {digest}">(SHA-256 {digest[:12]}...)</small>'
        for name, digest in files.items()
    )

"""The figures of a page as files for papers: SVG and PNG, drawn by Kaleido in a browser that is installed."""

import re
from collections.abc import Mapping
from pathlib import Path

import plotly.graph_objects as go

from harness import scratch
from harness.errors import HarnessError, required_extra
from harness.files import results

WIDTH, ROW, LEAST_HEIGHT = 900, 130, 420
"""Pixels of a figure: its width, what a row adds to its height, and the least height."""
SCALE = 3
"""Pixels of a PNG over those of the figure: 300 a inch at 7.6 cm."""
INK, GRID, BACK = "#1b1f24", "#d9dee4", "#ffffff"


def prepare(folder: Path) -> None:
    """Make `folder`, before the flights; HarnessError if it cannot be written, or if Kaleido or a browser is missing."""
    with required_extra("figures", "--figures"):
        import kaleido  # noqa: F401 (Plotly draws by it)
        from choreographer.browsers import Chromium
    if Chromium.find_browser(skip_local=False) is None:
        raise HarnessError(
            "--figures: no browser is there to draw with; install chromium, or set BROWSER_PATH to a Chrome or Chromium"
        )
    results.prepare(folder)


def save(folder: Path, figures: Mapping[str, go.Figure], stem: str) -> list[Path]:
    """Write each figure as STEM_NAME.svg and .png into `folder`; returns the paths. HarnessError if the browser fails."""
    import plotly.io as pio

    names = [f"{_plain(stem)}_{_plain(name)}" for name in figures]
    drawn = [on_paper(figure) for figure in figures.values()]
    written = []
    with scratch.folder("figures") as made:
        files = [made / f"{name}.{kind}" for name in names for kind in ("svg", "png")]
        twice = [figure for figure in drawn for _ in ("svg", "png")]
        try:
            pio.write_images(twice, files, scale=[1, SCALE] * len(drawn))
        except Exception as error:  # noqa: BLE001 - Kaleido and the browser raise whatever they meet
            reason = str(error).strip().splitlines()
            raise HarnessError(
                f"--figures {folder}: the browser could not draw: {reason[0] if reason else type(error).__name__}"
            ) from None
        for file in files:
            results.write(folder / file.name, file.read_bytes())
            written.append(folder / file.name)
    return written


def on_paper(figure: go.Figure) -> go.Figure:
    """A copy on white, in ink, as high as its rows need, with nothing that is hidden until its name is pressed."""
    shown = [trace for trace in figure.data if trace.visible != "legendonly"]
    paper = go.Figure(shown, figure.layout)
    rows = sum(1 for axis in paper.select_yaxes())
    paper.update_layout(
        width=WIDTH,
        height=max(LEAST_HEIGHT, ROW * rows),
        paper_bgcolor=BACK,
        plot_bgcolor=BACK,
        font={"color": INK},
        margin={"r": 40},
    )
    paper.update_xaxes(gridcolor=GRID, zerolinecolor=GRID, linecolor=INK)
    paper.update_yaxes(gridcolor=GRID, zerolinecolor=GRID, linecolor=INK)
    return paper


def _plain(name: str) -> str:
    """A name for a file: letters, digits, and + - _ for the rest."""
    return re.sub(r"[^\w+.-]+", "_", name).strip("._") or "figure"

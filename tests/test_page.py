"""The report page in a real browser: headless Chromium, where it is installed."""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ema_fmu_src.fidelities import FIDELITIES
from harness.cli import main

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")


@pytest.fixture(scope="module")
def page_file(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of `ema run SIN4 STEP-RAMP`."""
    out = tmp_path_factory.mktemp("page")
    before = sys.argv
    sys.argv = ["ema", "run", "SIN4", "STEP-RAMP", "--fmus", str(fmus["HF"].parent), "--out", str(out)]
    try:
        with pytest.raises(SystemExit):
            main()
    finally:
        sys.argv = before
    return out / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


def visit(browser: Any, file: Path, **options: Any) -> tuple[Any, list[str]]:
    """The page, drawn, and what the console complained of; a request to the network is a complaint."""
    page = browser.new_page(**options)
    page.set_default_timeout(120_000)  # ms: a busy machine draws slowly, and nothing here is about speed
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: complaints.append(request.url) if request.url.startswith("http") else None)
    page.goto(file.as_uri())
    page.wait_for_function("document.querySelectorAll('.js-plotly-plot .main-svg').length > 0")
    return page, complaints


def test_it_opens_without_a_complaint_and_draws_every_fidelity(browser: Any, page_file: Path) -> None:
    page, complaints = visit(browser, page_file)
    assert complaints == []
    names = page.evaluate("[...document.querySelectorAll('.js-plotly-plot')].map(g => g.data.map(t => t.name))")
    assert len(names) == 3  # cost, SIN4, STEP-RAMP
    for figure in names[1:]:
        assert {"command", *FIDELITIES} <= set(figure)
    assert "errors with a budget are within it" in page.inner_text(".verdict")
    shaded = page.evaluate("[...document.querySelectorAll('.js-plotly-plot')].map(g => (g.layout.shapes || []).length)")
    assert shaded[1] > 5 and shaded[2] < shaded[1]  # SIN4 saturates again and again
    page.close()


def test_a_drag_zooms_all_rows_in_time(browser: Any, page_file: Path) -> None:
    page, _ = visit(browser, page_file, viewport={"width": 1300, "height": 1400})
    plot = page.locator(".figure:not(.low) .nsewdrag").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] * 0.4, y)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.6, y, steps=5)
    page.mouse.up()
    page.wait_for_function("document.querySelectorAll('.js-plotly-plot')[1].layout.xaxis.range[0] > 0.5")
    first, last = page.evaluate("document.querySelectorAll('.js-plotly-plot')[1].layout.xaxis.range")
    assert 0.8 < first < 1.1 and 1.4 < last < 1.7
    page.close()


@pytest.mark.parametrize("width", [375, 1920])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_phone_and_a_wide_screen_in_light_and_dark(browser: Any, page_file: Path, width: int, scheme: str) -> None:
    page, complaints = visit(browser, page_file, viewport={"width": width, "height": 900}, color_scheme=scheme)
    assert complaints == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    back = page.evaluate("getComputedStyle(document.body).backgroundColor")
    ink = page.evaluate("document.querySelector('.js-plotly-plot').layout.font.color")
    assert (back == "rgb(255, 255, 255)") == (scheme == "light")
    assert ink == ("#1b1f24" if scheme == "light" else "#e6e9ec")
    page.close()


def test_a_reader_without_eyes_finds_headings_captions_and_figures(browser: Any, page_file: Path) -> None:
    page, _ = visit(browser, page_file)
    assert page.evaluate("document.documentElement.lang") == "en"
    assert page.locator("main h1").count() == 1 and page.locator("main h2").count() >= 4
    assert page.locator("table caption").count() == 1
    assert page.locator("table th[scope=col]").count() == 6
    assert page.locator("table:not(.origin) th[scope=row]").count() == 2 * len(FIDELITIES)
    labels = page.evaluate("[...document.querySelectorAll('[role=img]')].map(f => f.getAttribute('aria-label'))")
    assert len(labels) == 3 and all(labels) and "ELF+ 0.09" in labels[1]
    page.close()

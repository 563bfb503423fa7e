"""The live page in a real browser, and what it refuses."""

import shutil
import socket
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

from harness.cli import main
from harness.errors import HarnessError
from harness.show.live import Server, command

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")


@pytest.fixture(scope="module")
def server(fmus: dict[str, Path]) -> Iterator[Server]:
    made = Server(fmus["HF"].parent, host="127.0.0.1", port=0)
    thread = threading.Thread(target=made.run)
    thread.start()
    yield made
    made.stop()
    thread.join(timeout=10)
    assert not thread.is_alive()


@pytest.fixture
def page(server: Server) -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        opened = browser.new_page(viewport={"width": 1400, "height": 1200})
        opened.goto(server.url)
        opened.wait_for_selector("#command:has-text('ema run SIN4')")
        opened.wait_for_function("(document.querySelector('#figure .js-plotly-plot')?.calcdata?.[1] ?? []).length > 105")
        yield opened
        browser.close()


def test_it_answers_on_the_loopback_address(server: Server) -> None:
    assert server.url.startswith("http://127.0.0.1:")
    with urlopen(server.url) as answer:
        assert answer.status == 200 and b"EMA twins, live" in answer.read()


@needs_browser
def test_a_slider_redraws_at_once(page: Any) -> None:
    before = page.evaluate("document.querySelector('#figure .js-plotly-plot').calcdata[1][105].y")
    assert page.inner_text("#errors caption").startswith("Errors (NRMSE) against ELF+")
    handle = page.locator("[role=slider]").first  # fault.friction
    handle.focus()
    for _ in range(5):
        handle.press("ArrowRight")
    page.wait_for_selector("#command:has-text('fault.friction=1.5')")
    page.wait_for_function(
        "before => document.querySelector('#figure .js-plotly-plot').calcdata[1][105].y !== before", arg=before
    )


@needs_browser
def test_hf_on_demand_becomes_the_reference(page: Any) -> None:
    page.locator("#reference input").check()
    page.wait_for_selector("#errors caption:has-text('against HF')")
    assert "--reference HF" in page.inner_text("#command")


@needs_browser
def test_what_is_shown_can_be_downloaded(page: Any, fmus: dict[str, Path], tmp_path: Path) -> None:
    with page.expect_download() as found:
        page.click("#csv")
    found.value.save_as(tmp_path / found.value.suggested_filename)
    rows = (tmp_path / "SIN4_ELFplus.csv").read_text().splitlines()
    assert rows[0].startswith("time,command,position") and len(rows) == 25002
    with page.expect_download() as found:
        page.click("#fmu")
    found.value.save_as(tmp_path / "got.fmu")
    assert (tmp_path / "got.fmu").read_bytes() == fmus["ELF"].read_bytes()


def test_the_command_line_flies_what_is_shown() -> None:
    told = command("SIN", ["HF", "ELF+"], {"fault.N_a": 0.9})
    assert told == "ema run SIN --fidelity HF,ELF+ --reference HF --set fault.N_a=0.9"


def test_a_port_that_is_taken_is_one_line(fmus: dict[str, Path], capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(HarnessError, match="cannot be had"):
            Server(fmus["HF"].parent, host="127.0.0.1", port=port)
        monkeypatch.setattr(sys, "argv", ["ema", "serve", "--port", str(port), "--fmus", str(fmus["HF"].parent)])
        with pytest.raises(SystemExit) as ended:
            main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1

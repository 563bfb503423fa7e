"""What pages show: lines and symbols that mean one thing, errors that mean something, limits, outcomes, figures for papers.

Truth: the table of fidelities and the faults as they are declared; marks are counted against the runs that were given.
"""

import re
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES
from harness.bench.pictures import coverage_figure
from harness.cli import main
from harness.errors import HarnessError
from harness.faults import ESTIMATED, FAULTS
from harness.identification import intervals
from harness.identification import page as identified
from harness.identification.estimates import Estimate
from harness.prognosis import page as history
from harness.prognosis.growth import follow
from harness.prognosis.outlook import Outlook
from harness.prognosis.page import BAND, FORECAST
from harness.provenance import provenance
from harness.show import cost, figures, symbols
from harness.show.curves import COMMAND, HEALTHY, MEASURED, SPARE, rows
from harness.show.page import drawn, outcome, table

POINTS = [
    cost.Point("HF", "SIN", 0.1, None),
    cost.Point("HF", "STEP-RAMP", 0.2, None),
    cost.Point("ELF+", "SIN", 0.01, 2e-3),
    cost.Point("ELF+", "STEP-RAMP", 0.012, 3e-3),
    cost.Point("LF", "SIN", 0.008, 0.0),  # no error at all
    cost.Point("LF", "STEP-RAMP", 0.009, 7.5),  # the reference hardly moves
]


def _estimate(fault: str, value: float, low: float, high: float, **other: Any) -> Estimate:
    given: dict[str, Any] = {"identifiable": True, "reason": "", "health": 1.0, "alarm": False} | other
    return Estimate(fault, ESTIMATED[fault].unit, value, low, high, **given)


def _diagnosis(complaints: list[str]) -> Any:
    """One with an alarm, a fault of two sides, and one that nothing shows, as `page` reads it."""
    time = np.linspace(0.0, 1.0, 50)
    curve = np.sin(time)[:, None]
    shown = {"position": SimpleNamespace(name="position", unit="rad", scale=1.0)}
    measured = SimpleNamespace(
        time=time, channels={"position": curve[:, 0]}, shown=shown, informative=time > 0.1, name="run"
    )
    return SimpleNamespace(
        name="run", fidelity="ELF+", complaints=complaints, remarks=["a remark"], health=None if complaints else 0.5,
        verdict="not explained" if complaints else "faulty: friction = 2", evaluations=1, seconds=1.0, parameters={},
        nuisances={"offset.position": {"value": 0.1, "sigma": 0.01, "unit": "rad"}}, groups=[], alternatives=[],
        measured=measured, curves=SimpleNamespace(healthy=curve, predicted=curve),
        estimates=[
            _estimate("friction", 2.0, 1.9, 2.1, health=0.5, alarm=True),
            _estimate("current_offset_a", -0.25, -0.5, 0.0),
            _estimate("resistance", 1.0, -50.0, 50.0, identifiable=False, reason="nothing shows it", health=None),
        ],
    )  # fmt: skip


def test_no_line_of_anything_else_has_the_colour_of_a_fidelity() -> None:
    own = {fidelity.colour for fidelity in FIDELITIES.values()}
    others = {line.colour for line in (COMMAND, MEASURED, HEALTHY)} | {*SPARE, FORECAST, *intervals.COLOURS.values()}
    assert len(own) == len(FIDELITIES) and not own & others
    shades = {f"rgba({int(colour[1:3], 16)},{int(colour[3:5], 16)},{int(colour[5:], 16)}," for colour in own}
    assert not any(BAND.startswith(shade) for shade in shades)


def test_the_cost_shows_the_reference_and_the_errors_that_mean_something() -> None:
    drawing = cost.figure(POINTS, "HF")
    marks = {trace.name: trace for trace in drawing.data}
    assert list(marks["ELF+"].x) == [0.01, 0.012] and list(marks["ELF+"].y) == pytest.approx([0.2, 0.3])
    assert "LF" not in marks and "Left out" in cost.note(POINTS, "HF") and "SIN LF, STEP-RAMP LF" in cost.note(POINTS, "HF")
    line = marks["HF (reference)"]
    assert list(line.x) == pytest.approx([0.15, 0.15]) and line.line.color == FIDELITIES["HF"].colour
    assert marks["ELF+"].marker.color == FIDELITIES["ELF+"].colour
    assert list(marks["ELF+"].marker.symbol) == [marks["SIN"].marker.symbol, marks["STEP-RAMP"].marker.symbol]


def test_no_mark_of_the_cost_is_cut() -> None:
    drawing = cost.figure(POINTS, "HF")
    for axis, values in ((drawing.layout.xaxis, (0.01, 0.15)), (drawing.layout.yaxis, (0.2, 0.3))):
        low, high = axis.range
        assert low < np.log10(min(values)) and np.log10(max(values)) < high
        assert axis.title.text.endswith("]")


def test_residuals_have_the_unit_of_their_channel() -> None:
    drawing = rows(["position<br>[rad]", "motor_speed<br>[rad/s]"], residuals=0.3)
    texts = [axis.title.text for axis in drawing.select_yaxes()]
    assert texts == ["position<br>[rad]", "residual<br>[rad]", "motor_speed<br>[rad/s]", "residual<br>[rad/s]"]


@pytest.mark.parametrize("name", [*ESTIMATED, *(port.name for port in ports.PARAMETERS)])
def test_every_symbol_is_explained(name: str) -> None:
    own = ESTIMATED[name].port if name in ESTIMATED else name
    assert ports.VARIABLES[ports.INDEX[own]].description in symbols.meaning(name)


def test_a_table_explains_its_names_and_colours_its_outcomes() -> None:
    shown = table("Limits", ("Fault", "found", ""), [("N_a", "0.9", "NOT met"), ("zeta", "<0>", "met")])
    told = ports.VARIABLES[ports.INDEX["fault.N_a"]].description
    assert f'title="{told}' in shown.replace("&#x27;", "'") and "<dt>zeta</dt>" in shown and "&lt;0&gt;" in shown
    assert '<span class="mark over">NOT met</span>' in shown and '<span class="mark ok">met</span>' in shown
    assert [outcome(text) for text in ("ALARM", "NO", "no effect", "0.5", "nothing")] == ["over", "over", "", "", ""]


def test_limits_stand_on_the_sides_to_which_a_fault_goes() -> None:
    assert FAULTS["current_offset_a"].limits() == (1.0, -1.0)
    assert FAULTS["current_gain_a"].limits() == pytest.approx((0.7, 1.3))
    assert FAULTS["N_a"].limits() == (0.7,) and FAULTS["friction"].limits(2.5) == (2.5,)
    assert all(fault.health(limit) == 0.0 for fault in FAULTS.values() for limit in fault.limits())


def test_the_intervals_show_estimate_interval_limit_and_health() -> None:
    drawing = intervals.figure(_diagnosis([]), {"friction": 3.0})
    named = {trace.name: trace for trace in drawing.data if trace.name}
    assert list(named["alarm"].y) == ["friction"] and list(named["alarm"].x) == [0.5]  # (2 - 1)/(3 - 1)
    assert list(named["alarm"].text) == ["health 0.50"] and "limit 3" in named["alarm"].customdata[0]
    assert list(named["no alarm"].x) == [-0.25]
    limits = named[intervals.LIMIT]
    assert [x for x, name in zip(limits.x, limits.y, strict=True) if name == "current_offset_a"] == [1.0, -1.0]
    bars = {trace.y[0]: trace for trace in drawing.data if trace.mode == "lines+markers"}
    assert list(bars["friction"].x) == pytest.approx([0.45, 0.55])
    low, high = drawing.layout.xaxis.range
    assert all(low < x < high for x in bars["resistance"].x)  # it goes on: an arrow says so
    assert list(bars["resistance"].marker.symbol) == ["triangle-left", "triangle-right"]


def test_what_is_alarmed_stands_second_and_what_is_not_explained_has_no_numbers() -> None:
    record = provenance(command="ema identify run.csv")
    good = identified.page(_diagnosis([]), record)
    assert re.search(r'<td title="[^"]*">friction</td><td><span class="mark over">ALARM</span></td><td>0.50</td>', good)
    bad = identified.page(_diagnosis(["position: 5 % of its range"]), record)
    body = re.sub(r"<script.*?</script>|<style.*?</style>", "", bad, flags=re.DOTALL)
    assert "95 % interval" not in body and "Standard deviation" not in body and "ALARM" not in body
    assert "No estimates are given" in body and "a remark" in body
    assert list(identified.figures(_diagnosis(["x"]))) == [identified.CURVES]


def test_measured_lies_under_the_models_and_stays_in_sight() -> None:
    drawing = identified.figure(_diagnosis([]), _diagnosis([]).measured)
    names = [trace.name for trace in drawing.data if trace.xaxis == "x"]
    assert names == ["measured", "healthy", "identified (ELF+)"]
    measured, healthy, fitted = (trace.line for trace in drawing.data if trace.xaxis == "x")
    assert measured.width >= 2.5 * max(healthy.width, fitted.width)
    assert (fitted.color, fitted.dash) == (FIDELITIES["ELF+"].colour, FIDELITIES["ELF+"].dash)


def test_of_many_runs_both_limits_are_drawn_and_nothing_lies_on_the_edge() -> None:
    at, sigmas = np.arange(8.0), np.full(8, 0.02)
    values = {"friction": 1.0 + 0.1 * at, "gain": 1.0 + 0.01 * np.cos(at)}
    trends = {name: follow(FAULTS[name], FAULTS[name].limit, at, series, sigmas) for name, series in values.items()}
    drawing = history.figure(Outlook(trends, "days", 8, [], "", []))
    limits = {axis: sorted({trace.y[0] for trace in drawing.data if "limit" in (trace.name or "") and trace.yaxis == axis})
              for axis in ("y", "y2")}  # fmt: skip
    assert limits == {"y": [3.0], "y2": sorted(FAULTS["gain"].limits())}
    for trace in drawing.data:
        low, high = drawing.layout[trace.yaxis.replace("y", "yaxis")].range
        assert low < min(trace.y) and max(trace.y) < high
    assert [axis.title.text for axis in drawing.select_yaxes()] == ["friction<br>[1]", "gain<br>[1]"]


def test_a_figure_of_many_rows_is_higher() -> None:
    heights = [re.findall(r"--rows:(\d+)", drawn(rows([f"{n} [rad]" for n in range(count)], residuals=0.3), ""))
               for count in (1, 9)]  # fmt: skip
    assert heights == [["4"], ["18"]]


def test_coverage_is_drawn_of_nothing_without_a_failure() -> None:
    assert all(not trace.x for trace in coverage_figure([]).data)


def test_compare_writes_a_page_and_leaves_another_alone(
    fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.csv").write_text("time,command\n0,0\n0.05,0.01\n")
    told = []
    for words in ((), ("--tube", "0.05")):
        common = ["compare", str(fmus["ELF"]), "--reference", str(fmus["LF"]), "--trial-file", "own.csv"]
        monkeypatch.setattr(sys, "argv", ["ema", *common, *words])
        with pytest.raises(SystemExit) as end:
            main()
        assert not end.value.code
        told.append(re.findall(r"page: (\S+)", capsys.readouterr().out)[0])
    assert told[0] == "results/EMA_ELF_against_EMA_LF.html" and told[1] != told[0]
    page = Path(told[0]).read_text()
    assert "variables leave the tube of 1 %" in page and "tube of 5 %" in Path(told[1]).read_text()
    assert all("<td" in page and port.name in page for port in ports.OUTPUTS)
    colours = FIDELITIES["ELF"].colour, FIDELITIES["LF"].colour
    assert all(f'"color":"{colour}"' in page for colour in colours)


def test_without_kaleido_or_a_browser_one_line_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "kaleido", None)
    with pytest.raises(HarnessError, match=r"--figures needs kaleido: pip install -e '.\[figures\]'"):
        figures.prepare(tmp_path / "out")
    browsers = SimpleNamespace(Chromium=SimpleNamespace(find_browser=lambda *, skip_local: None))
    monkeypatch.setitem(sys.modules, "kaleido", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "choreographer", SimpleNamespace(browsers=browsers))
    monkeypatch.setitem(sys.modules, "choreographer.browsers", browsers)
    with pytest.raises(HarnessError, match="no browser is there to draw with; install chromium"):
        figures.prepare(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_figures_are_written_as_svg_and_png(tmp_path: Path) -> None:
    pytest.importorskip("kaleido")
    if not (shutil.which("chromium") or shutil.which("chromium-browser")):
        pytest.skip("Chromium is not installed")
    figures.prepare(tmp_path)
    written = figures.save(tmp_path, {"error against cost": cost.figure(POINTS, "HF")}, "report")
    assert [path.name for path in written] == ["report_error_against_cost.svg", "report_error_against_cost.png"]
    text = written[0].read_text()
    assert text.startswith("<svg") and "error of position" in text and FIDELITIES["ELF+"].colour in _hex(text)
    assert written[1].read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def _hex(svg: str) -> set[str]:
    """The colours of an SVG, which has them as rgb(...)."""
    found = re.findall(r"rgb\((\d+), (\d+), (\d+)\)", svg)
    return {f"#{int(red):02x}{int(green):02x}{int(blue):02x}" for red, green, blue in found}


def test_on_paper_nothing_hidden_is_left_and_the_page_keeps_its_own() -> None:
    shown = go.Figure([go.Scatter(name="a", y=[1]), go.Scatter(name="b", y=[1], visible="legendonly")])
    paper = figures.on_paper(shown)
    assert [trace.name for trace in paper.data] == ["a"] and paper.layout.paper_bgcolor == "#ffffff"
    assert len(shown.data) == 2 and shown.layout.paper_bgcolor is None

"""Faults over many runs: trends against known growth, and the time of the event against the analytic one."""

import json
from pathlib import Path

import numpy as np
import pytest
from plant import columns, write
from typer.testing import CliRunner

from harness.cli import app
from harness.errors import HarnessError
from harness.faults import FAULTS
from harness.identification.estimates import Estimate
from harness.prognosis.growth import follow
from harness.prognosis.history import Flight, IdentifiedFlight, read_flights
from harness.prognosis.outlook import outlook
from harness.prognosis.page import figure, page
from harness.provenance import provenance


def grown(rate: float, *, n: int = 20, sigma: float = 0.02, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    at = np.arange(float(n))
    noise = np.random.default_rng(seed).standard_normal(n) * sigma
    return at, 1.0 + rate * at + noise, np.full(n, sigma)


def test_linear_growth_is_the_least_squares_line_and_its_event_where_the_line_meets_the_limit():
    at, values, sigmas = grown(0.05)
    trend = follow(FAULTS["friction"], 3.0, at, values, sigmas)
    slope, intercept = np.polyfit(at, values, 1)
    assert trend.grows and trend.rate == pytest.approx(slope, rel=0.02)
    low, median, high = trend.life(0.05, 0.5, 0.95)
    expected = (3.0 - intercept) / slope - at[-1]
    assert median == pytest.approx(expected, rel=0.01) and low < expected < high
    assert len(set(trend.times_of_event)) > 300  # not the steps of the prediction
    assert trend.health == pytest.approx(1.0 - (slope * at[-1] + intercept - 1.0) / 2.0, abs=0.01)


def test_intervals_of_the_time_of_event_cover_the_truth():
    """Ten histories of known growth: the 90 % interval holds the true time in 7 or more (binomial: 1 % chance of less)."""
    inside = 0
    for seed in range(10):
        low, high = follow(FAULTS["friction"], 3.0, *grown(0.05, n=12, seed=seed)).life(0.05, 0.95)
        inside += low is not None and low <= 29.0 and (high is None or high >= 29.0)
    assert inside >= 7


def test_no_growth_is_no_event_and_two_runs_say_the_same():
    trends = [follow(FAULTS["friction"], 3.0, *grown(0.0)) for _ in range(2)]
    assert not trends[0].grows and trends[0].life(0.5) == [None]
    assert trends[0].rate == trends[1].rate
    again = [follow(FAULTS["friction"], 3.0, *grown(0.05)).times_of_event for _ in range(2)]
    assert np.array_equal(*again)


def test_a_fault_that_shrinks_towards_its_limit():
    at, values, sigmas = grown(0.005, sigma=0.002)
    trend = follow(FAULTS["N_b"], 0.7, at, 2.0 - values, sigmas)
    assert trend.grows and trend.life(0.5)[0] == pytest.approx(60.0 - 19.0, rel=0.1)


def test_more_scatter_than_the_intervals_say_widens_the_trend():
    at, values, sigmas = grown(0.05, sigma=0.1)
    assert (
        follow(FAULTS["friction"], 3.0, at, values, 0.01 * sigmas).covariance[1, 1]
        > 0.3 * (follow(FAULTS["friction"], 3.0, at, values, sigmas).covariance[1, 1])
    )


def test_dates_come_from_names_or_a_list_and_else_flights_are_counted(tmp_path):
    for name in ("2026-01-05.csv", "2026-01-01.csv", "2026-01-05_b.csv"):
        (tmp_path / name).write_text("")
    flights, unit = read_flights(tmp_path)
    assert unit == "days" and [flight.at for flight in flights] == [0.0, 4.0, 4.5]
    (tmp_path / "list.csv").write_text("date,file\n2026-01-03,2026-01-05.csv\n2026-01-01,2026-01-01.csv\n")
    flights, unit = read_flights(tmp_path / "list.csv")
    assert unit == "days" and [flight.path.name for flight in flights] == ["2026-01-01.csv", "2026-01-05.csv"]
    flights, unit = read_flights(tmp_path)
    assert unit == "flights" and [flight.at for flight in flights] == [0.0, 1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    "text, message",
    [
        ("day,file\n1,a.csv\n", "columns date and file"),
        ("date,file\n2026-13-01,run.csv\n", "line 2: '2026-13-01' is not a date"),
        ("date,file\n2026-01-01,none.csv\n", "line 2: there is no file"),
    ],
)
def test_bad_lists_get_one_line(text, message, tmp_path):
    (tmp_path / "run.csv").write_text("")
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises(HarnessError, match=message):
        read_flights(tmp_path / "list.csv")


def test_command_follows_a_growing_fault_and_leaves_out_what_it_cannot_read(fmus, tmp_path):
    runs = tmp_path / "runs"
    runs.mkdir()
    for week in range(6):
        table = columns(fmus["HF"], "CHIRP", {"friction": 1.0 + 0.15 * week}, seed=week, rate=500.0)
        write(runs / f"2026-01-{1 + 5 * week:02d}.csv", table)
    (runs / "2026-01-28.csv").write_text("time,command\n0,0\n1,0\n")
    common = ["--fmus", str(fmus["HF"].parent), "--out", str(tmp_path), "--json", str(tmp_path / "outlook.json")]
    result = CliRunner().invoke(app, ["monitor", str(runs), *common, "--limit", "friction=2.5"])
    assert result.exit_code == 1 and "left out" in result.output and "friction reaches its limit" in result.output
    written = json.loads((tmp_path / "outlook.json").read_text())
    friction = written["faults"]["friction"]
    assert written["unit"] == "days" and friction["rate"] == pytest.approx(0.03, rel=0.05)
    assert friction["remaining_useful_life"]["50 %"] == pytest.approx((2.5 - 1.75) / 0.03, rel=0.1)
    assert not any(fault["grows"] for name, fault in written["faults"].items() if name != "friction")
    page = (tmp_path / "monitor.html").read_text()
    assert "Time of the event" in page and "2026-01-28" in page


def test_an_empty_folder_gets_one_line(tmp_path):
    result = CliRunner().invoke(app, ["monitor", str(tmp_path)])
    assert isinstance(result.exception, HarnessError) and "holds no .csv" in str(result.exception)


def history(*frictions: float, bad: int = 0) -> list[IdentifiedFlight]:
    """Flights every 30 days that identify friction, and zeta of noise around 0, but no backlash; then `bad` ones."""
    flights = []
    for n, friction in enumerate(frictions):
        known = {"friction": (friction, True, ""), "zeta": (1e-3 * (n % 2) - 1e-3 * n / 5, True, "")}
        known["backlash"] = (1.0, False, "no effect, for gear.backlash is 0")
        estimates = {
            name: Estimate(name, "1", value, value - 0.01, value + 0.01, clear, reason, 1.0, False, not reason)
            for name, (value, clear, reason) in known.items()
        }
        others = set(FAULTS) - set(known)
        estimates |= {name: Estimate(name, "1", 1.0, 0.5, 1.0, False, "open", None, False) for name in others}
        flights.append(IdentifiedFlight(Flight(Path(f"{n}.csv"), str(n), 30.0 * n), estimates, ""))
    return flights + [IdentifiedFlight(Flight(Path("e.csv"), "e", 999.0), {}, f"e{n}.csv: is empty") for n in range(bad)]


def test_faults_without_a_trend_are_named_with_the_reason_and_none_is_below_its_range():
    found = outlook(history(1.1, 1.2, 1.3, 1.4, 1.5, 1.6), {}, "days")
    assert found.trends["zeta"].level >= 0.0
    assert "backlash: no effect, for gear.backlash is 0" in found.not_followed == found.as_dict()["not_followed"]
    assert "N_a: identifiable in 0 of 6 runs, 3 are needed" in found.not_followed
    assert "Faults not followed" in page(found, history(1.1, 1.2), provenance(command="ema monitor"))


def test_the_forecast_is_drawn_to_the_limit_over_one_time_axis():
    """0.1 in 30 days from 1.6 at day 150: friction is at its limit of 3 on day 570."""
    found = outlook(history(1.1, 1.2, 1.3, 1.4, 1.5, 1.6), {}, "days")
    axes = [axis.range for axis in figure(found).select_xaxes()]
    assert len(set(axes)) == 1 and axes[0][0] < 0.0 and axes[0][1] > 570.0


def test_too_few_runs_are_counted_and_the_ones_left_out_named():
    with pytest.raises(HarnessError, match=r"2 run\(s\) can be used, 3 are the least.* left out: e0.csv: is empty"):
        outlook(history(1.1, 1.2, bad=1), {}, "days")

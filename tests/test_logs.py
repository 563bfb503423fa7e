"""Logs: one run of HF with known faults in every dialect and container gives the same log, and so the same diagnosis.

The truth is the run itself, as plain CSV in SI units; the faults are those that HF was given.
"""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from dialects import DIALECTS, KEPT, Columns, lines
from plant import columns
from typer.testing import CliRunner

from harness.actuators.actuator import Output
from harness.cli import app
from harness.errors import HarnessError
from harness.logs.log import Between, Log, Logger
from harness.logs.mapping import parse_columns
from harness.logs.read import read_log, read_one
from harness.logs.spikes import spikes

FAULTS = {"N_a": 0.85, "friction": 1.4}
TIGHT = 1e-12
"""Relative: a value goes through two units and back."""


@pytest.fixture(scope="module")
def table(fmus: dict[str, Path]) -> Columns:
    """The run, rounded to the 9 digits that a CSV holds."""
    whole = columns(fmus["HF"], "CHIRP", FAULTS, rate=500.0)
    return {name: np.array([float(f"{value:.9g}") for value in whole[name]]) for name in KEPT}


@pytest.fixture(scope="module")
def plain(table: Columns, tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = tmp_path_factory.mktemp("plain") / "run.csv"
    path.write_text(lines(table))
    return read_one(path)


def _made(name: str, table: Columns, folder: Path) -> tuple[Path, dict[str, str]]:
    dialect = DIALECTS[name]
    path = folder / f"run{dialect.suffix}"
    path.write_bytes(dialect.content(table))
    return path, dict(dialect.columns)


def test_plain_csv_is_read_as_it_is_written(plain: Log, table: Columns) -> None:
    assert plain.name == "run" and plain.rate == pytest.approx(500.0) and plain.between is None and not plain.remarks
    assert np.array_equal(plain.time, table["time"]) and np.array_equal(plain.inputs["command"], table["command"])
    assert list(plain.channels) == list(KEPT[2:])
    assert all(np.array_equal(plain.channels[name], table[name]) for name in KEPT[2:])


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_and_container_gives_the_same_log(name: str, table: Columns, plain: Log, tmp_path: Path) -> None:
    path, stated = _made(name, table, tmp_path)
    log = read_one(path, stated)
    assert log.name == "run" and list(log.channels) == list(plain.channels) and list(log.inputs) == ["command"]
    np.testing.assert_allclose(log.time, plain.time, rtol=TIGHT, atol=3e-7 if "epoch in s" in name else 1e-9)
    for found, expected in ((log.inputs, plain.inputs), (log.channels, plain.channels)):
        for key, series in expected.items():
            np.testing.assert_allclose(found[key], series, rtol=TIGHT, atol=TIGHT * np.ptp(series), err_msg=key)


@pytest.mark.parametrize("name", ["semicolons and decimal commas", "no header", "MDF 4"])
def test_the_same_diagnosis(name: str, table: Columns, fmus: dict[str, Path], tmp_path: Path) -> None:
    found = []
    for kind in ("commas", name):
        path, stated = _made(kind, table, tmp_path)
        flags = [word for key, text in stated.items() for word in ("--column", f"{key}={text}")]
        common = ["--fmus", str(fmus["HF"].parent), "--out", str(tmp_path), "--json", str(tmp_path / "d.json")]
        result = CliRunner().invoke(app, ["identify", str(path), *flags, *common])
        assert result.exit_code == 0, result.output
        found.append(json.loads((tmp_path / "d.json").read_text()))
    alarms = [{fault for fault, item in each["faults"].items() if item["alarm"]} for each in found]
    assert alarms == [set(FAULTS), set(FAULTS)]
    for fault in FAULTS:
        assert found[0]["faults"][fault]["value"] == pytest.approx(found[1]["faults"][fault]["value"], rel=1e-3)


def _log(tmp_path: Path, text: str, stated: dict[str, str] | None = None, **options: object) -> Log:
    path = tmp_path / "own.csv"
    path.write_text(text)
    return read_one(path, stated, **options)  # type: ignore[arg-type]


def _rows(count: int = 60, step: float = 0.01) -> dict[str, np.ndarray]:
    t = np.round(np.arange(count) * step, 6)
    return {"time": t, "command": 0.1 * np.sin(t), "position": 0.1 * np.sin(t - 0.02)}


def test_words_say_side_steps_and_filters(tmp_path: Path) -> None:
    stated = {"command": "command [mm] held", "position": "position [mm] motor averaged", "time": "1 [ms]"}
    rows = _rows() | {"motor_speed": np.cos(_rows()["time"])}
    table = lines(rows | {"time": 1e3 * rows["time"]})
    stated["motor_speed"] = "motor_speed [mm/s] filtered 2 ms"
    log = _log(tmp_path, table, stated, output=Output(lead=0.005), parameters={"gear.ratio": 30.0})
    assert log.between is Between.HELD
    assert log.loggers == {"motor_position": Logger("averaged"), "motor_speed": Logger("filtered", 0.002)}
    turn = 2.0 * np.pi / 5.0  # rad a mm
    np.testing.assert_allclose(log.inputs["command"], rows["command"] * turn)
    np.testing.assert_allclose(log.channels["motor_position"], 30.0 * rows["position"] * turn)
    np.testing.assert_allclose(log.channels["motor_speed"], 30.0 * rows["motor_speed"] * turn)
    assert "position" not in log.channels


def test_without_a_unit_a_rod_is_in_metres_and_newtons(tmp_path: Path) -> None:
    log = _log(tmp_path, lines(_rows() | {"load_torque": np.full(60, 100.0)}), output=Output(lead=0.005))
    np.testing.assert_allclose(log.inputs["command"], _rows()["command"] * 2.0 * np.pi / 0.005)
    np.testing.assert_allclose(log.inputs["load_torque"], 100.0 * 0.005 / (2.0 * np.pi))


def test_position_error_and_demand(tmp_path: Path) -> None:
    rows = _rows()
    error = {"time": rows["time"], "command": rows["command"], "position_error": rows["command"] - rows["position"]}
    np.testing.assert_allclose(_log(tmp_path, lines(error)).channels["position"], rows["position"], atol=1e-15)
    demand = rows | {"command": np.sign(rows["command"]), "position_demand": rows["command"]}
    log = _log(tmp_path, lines(demand))
    np.testing.assert_array_equal(log.inputs["command"], rows["command"])
    np.testing.assert_array_equal(log.others["target"], np.sign(rows["command"]))


@pytest.mark.parametrize("label", ["{:g}", "stroke {:g}"])
def test_several_runs_whose_times_restart(label: str, tmp_path: Path) -> None:
    rows = lines(_rows(), head="").splitlines()
    text = ["time,command,position,test,stroke"]
    for test, stroke in ((1, 1), (1, 2), (2, 1)):
        text += [f"{row},{test},{label.format(stroke)}" for row in rows]
    path = tmp_path / "own.csv"
    path.write_text("\n".join(text))
    logs = read_log(path, {"run": "stroke", "group": "test"})
    assert [(log.group, len(log.time)) for log in logs] == [("1", 60), ("1", 60), ("2", 60)]
    assert [log.name for log in logs] == [f"own {test}-{label.format(stroke)}" for test, stroke in ((1, 1), (1, 2), (2, 1))]
    with pytest.raises(HarnessError, match=r"line 62: time 0 s does not come after .*--column run="):
        read_log(path)
    with pytest.raises(HarnessError, match="holds 3 runs"):
        read_one(path, {"run": "stroke", "group": "test"})


def test_a_second_file_of_another_rate_is_joined_by_time(tmp_path: Path) -> None:
    rows = _rows(301, 0.01)
    (tmp_path / "a.csv").write_text(lines({name: rows[name] for name in ("time", "command", "position")}))
    slow = {"t_ms": 1e3 * rows["time"][::4], "current [mA]": 1e3 * np.cos(rows["time"][::4])}
    (tmp_path / "b.csv").write_text(lines(slow, ";", decimal=","))
    log = read_one(tmp_path / "a.csv", {"equivalent_current": "current"}, with_files=[tmp_path / "b.csv"])
    assert np.array_equal(log.time, rows["time"]) and np.array_equal(log.channels["position"], rows["position"])
    current = log.channels["equivalent_current"]
    np.testing.assert_allclose(current[::4], np.cos(rows["time"][::4]))
    assert np.isnan(np.delete(current, np.s_[::4])).all() and any("joined" in line for line in log.remarks)


def test_a_slower_command_needs_a_word(tmp_path: Path) -> None:
    rows = _rows(301, 0.01)
    fast = {"time": rows["time"], "position": rows["position"]}
    (tmp_path / "a.csv").write_text(lines(fast))
    (tmp_path / "b.csv").write_text(lines({"time": rows["time"][::10], "command": rows["command"][::10]}))
    with pytest.raises(HarnessError, match=r"held or ramped: --column 'command=command \[rad\] held'"):
        read_one(tmp_path / "a.csv", with_files=[tmp_path / "b.csv"])
    for word, expected in (("held", np.repeat(rows["command"][::10], 10)[:301]), ("ramped", None)):
        log = read_one(tmp_path / "a.csv", {"command": f"command [rad] {word}"}, with_files=[tmp_path / "b.csv"])
        straight = np.interp(rows["time"], rows["time"][::10], rows["command"][::10])
        np.testing.assert_allclose(log.inputs["command"], straight if expected is None else expected)


def test_dates_in_two_files_are_joined_on_the_clock(tmp_path: Path) -> None:
    for name, second, column in (("a", 0, "command,position"), ("b", 1, "equivalent_current,motor_speed")):
        rows = [f"2026-03-01T10:00:{second + k // 50:02d}.{20 * (k % 50):03d},{k % 7},{k}" for k in range(200)]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"time,{column}", *rows]))
    log = read_one(tmp_path / "a.csv", {"command": "command ramped"}, with_files=[tmp_path / "b.csv"])
    assert log.time[0] == 0.0 and log.time[-1] == pytest.approx(3.98)  # the command ends there
    first = int(np.argmax(np.isfinite(log.channels["motor_speed"])))
    assert log.time[first] == pytest.approx(1.0)


def test_gaps_missing_cells_and_spikes_are_said(tmp_path: Path) -> None:
    rows = _rows(200)
    current = np.sin(20.0 * rows["time"])
    current[70] = 65.535
    position = rows["position"].copy()
    position[[20, 21]] = np.nan
    kept = np.r_[0:100, 130:200]
    table = {name: series[kept] for name, series in (rows | {"position": position, "equivalent_current": current}).items()}
    log = _log(tmp_path, lines(table))
    assert np.flatnonzero(np.isnan(log.channels["equivalent_current"])).tolist() == [70]
    assert np.flatnonzero(np.isnan(log.channels["position"])).tolist() == [20, 21]
    told = "; ".join(log.remarks)
    assert "1 isolated spike(s) are masked, the first in" in told and "line 72" in told
    assert "no number in 2 of 170 rows" in told and "1 gap(s) without rows, the longest 0.31 s at 0.99 s" in told


def test_inrush_peaks_and_noise_are_no_spikes() -> None:
    """A square wave's inrush lasts one row at 100 Hz; it is none, for other rows show it too."""
    rng = np.random.default_rng(0)
    assert not spikes(rng.standard_normal(2000)).any() and not spikes(np.where(np.arange(500) < 250, 0.0, 1.0)).any()
    current = np.zeros(1000)
    current[::50], current[1::50] = 10.8, 0.6
    assert not spikes(current).any()
    current[333] = -40.0
    assert np.flatnonzero(spikes(current)).tolist() == [333]


def test_what_is_missing_comes_with_the_flags_that_accept_the_guess(tmp_path: Path) -> None:
    rows = _rows(100)
    text = lines({"t": 1e3 * rows["time"], "Sollposition": rows["command"], "actual pos": rows["position"]})
    with pytest.raises(
        HarnessError, match="no column 'time', found: t, Sollposition, actual pos; what looks like it"
    ) as caught:
        _log(tmp_path, text)
    flags = [flag.strip("'") for flag in str(caught.value).split("--column ")[1:]]
    stated = parse_columns([flag.partition("'")[0] for flag in flags])
    assert stated == {"time": "t [ms]", "command": "Sollposition", "position": "actual pos"}
    assert np.array_equal(_log(tmp_path, text, stated).channels["position"], rows["position"])


def test_no_speed_and_no_current_are_remarked(tmp_path: Path) -> None:
    told = _log(tmp_path, lines(_rows())).remarks
    assert any("no motor_speed" in line for line in told) and any("no current" in line for line in told)


def test_options_win_over_the_actuators_log_and_are_checked() -> None:
    log = {"time": "1 [ms]", "position": "4 [mm] motor"}
    assert parse_columns(["position = 3 [mm]"], log) == {"time": "1 [ms]", "position": "3 [mm]"}


def test_a_loggers_layout_does_not_hold_for_our_own_runs(fmus: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("time,command\n0,0\n0.05,0.01\n")
    words = ["--fidelity", "LF", "--reference", "LF", "--fmus", str(fmus["LF"].parent), "--out", str(tmp_path)]
    assert CliRunner().invoke(app, ["run", "--trial-file", str(tmp_path / "own.csv"), *words]).exit_code == 0
    stated = {"time": "1 [ms]", "command": "2 [mm] held", "position": "4 [mm] motor"}
    log = read_one(tmp_path / "own_LF.csv", stated)
    assert log.time[-1] == pytest.approx(0.05) and "position" in log.channels
    assert any("a file of ema run" in line for line in log.remarks)


BAD_COLUMNS = {
    "position": "PORT=COLUMN",
    "positon=3": "did you mean position",
    "position=3 [mm] held": "'held' says nothing of position",
    "command=2 [mm] motor": "'motor' says nothing of command",
    "motor_speed=5 [rpm] filtered 0 ms": "more than 0",
    "motor_speed=5 [rpm] filtered 2 kg": "does not measure",
    "position=9": "there is no column 9",
    "position=weg": "unknown column for position",
    "position=position [counts]": "is no angle",
    "position=position [mm]": "state .output. lead",
    "position=position [furl]": "not a known unit",
    "motor_speed=n [Hz]": "counts periods",
    "time=time [m]": "does not measure",
}


@pytest.mark.parametrize("flag", BAD_COLUMNS)
def test_bad_columns_get_one_line(flag: str, tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(lines(_rows() | {"n": _rows()["position"]}))
    result = CliRunner().invoke(app, ["identify", str(path), "--column", flag])
    assert isinstance(result.exception, HarnessError) and "\n" not in str(result.exception)
    with pytest.raises(HarnessError, match=BAD_COLUMNS[flag]):
        raise result.exception


def test_columns_are_shown_with_ranges_and_guesses(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(lines({"t_ms": 10.0 * np.arange(100), "command": np.arange(100.0), "i_q [mA]": np.full(100, np.nan)}))
    result = CliRunner().invoke(app, ["columns", str(path), "--json", str(tmp_path / "c.json")])
    assert result.exit_code == 0 and "▁" in result.output and "--column 'time=t [ms]'" in result.output
    written = json.loads((tmp_path / "c.json").read_text())
    assert [each["port"] or each["guess"] for each in written["columns"]] == ["time", "command", "equivalent_current"]
    assert written["columns"][2]["missing"] == 100 and written["columns"][1]["high"] == 99.0
    result = CliRunner().invoke(app, ["columns", str(path), "--column", "time=t"])
    assert "100 rows a second, 0 gap(s)" in result.output


LOGS = os.environ.get("EMA_BENCH_LOGS", "")
bench = pytest.mark.skipif(not LOGS, reason="EMA_BENCH_LOGS names no folder of bench logs")
BENCH = {"time": "1 [ms]", "command": "2 [mm] held", "position": "4 [mm] motor", "equivalent_current": "6 [mA]"}


@bench
@pytest.mark.parametrize("name", ["a-10mm", "a-1mm", "b-sweep"])
def test_bench_logs_of_two_linear_emas(name: str) -> None:
    log = read_one(Path(LOGS) / f"{name}.txt", BENCH, Output(lead=0.005), {"gear.ratio": 5.307})
    assert log.rate == pytest.approx(100.0) and list(log.channels) == ["motor_position", "equivalent_current"]
    assert np.isfinite(log.channels["equivalent_current"]).mean() > 0.99 and log.between is Between.HELD


@bench
def test_bench_logs_of_a_ball_screw() -> None:
    stated = {"command": "set_point [mm]", "position_error": "position_error [mm]", "equivalent_current": "current [A]",
              "run": "stroke", "group": "test"}  # fmt: skip
    logs = read_log(Path(LOGS) / "c-normal.csv.gz", stated, Output(lead=0.005))
    assert len(logs) == 50 and {log.group for log in logs} == {str(n) for n in range(1, 11)}
    assert all(log.rate == pytest.approx(25.0) for log in logs)

"""Logs flown again: HF made the log, so the twin that flies it is known to be right, and by how much it is early or late."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import slow
from plant import CURRENT, NOISE, columns
from typer.testing import CliRunner

from harness.actuators.actuator import Output
from harness.cli import app
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.logs.log import Between, Log
from harness.logs.read import read_log
from harness.replays.figures import nrmse_20hz, tracking_error
from harness.replays.replay import Replay, replay


@pytest.fixture(scope="module")
def log(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = slow.write(tmp_path_factory.mktemp("logs") / "drive.txt", slow.plant(fmus["HF"], {}))
    return read_log(path, slow.COLUMNS, Output(slow.LEAD), slow.ACTUATOR)[0]


def fly(log: Log, fmus: dict[str, Path], fidelity: str = "ELF+", **other: float) -> Replay:
    with Twin(fmus["HF"].parent / FIDELITIES[fidelity].fmu) as twin:
        return replay(log, twin, FIDELITIES[fidelity], {**slow.ACTUATOR, **other})


def test_a_right_twin_lies_on_the_log_within_its_sensors(log, fmus):
    """Hall counts leave a step over the root of 12, the current its 1 % of noise and HF's ripple; shifts as made."""
    found = {item.name: item for item in fly(log, fmus).channels}
    step = slow.LEAD / 20.0 / slow.COUNTS
    assert found["position"].unit == "m" and found["position"].rms == pytest.approx(step / np.sqrt(12.0), rel=0.2)
    assert 0.009 < found["equivalent_current"].nrmse < 0.015
    for port, shift in slow.SHIFTS.items():
        name = "position" if port == "motor_position" else port
        assert found[name].shift == pytest.approx(shift, abs=5e-4) and found[name].lag == pytest.approx(shift, abs=5e-4)
        assert found[name].nrmse_unshifted > 1.5 * found[name].nrmse


def test_the_tracking_error_is_that_of_the_user_side_in_metres(log, fmus):
    item = fly(log, fmus).tracking_error
    error = log.output.outside("position", log.channels["motor_position"] / 20.0 - log.inputs["command"])
    assert item.unit == "m" and item.measured == pytest.approx(np.sqrt(np.mean(error**2)))
    assert item.ratio == pytest.approx(item.difference / item.measured) and item.ratio < 0.03
    wrong = fly(log, fmus, **{"controller.K_pos": 30.0}).tracking_error
    assert wrong.ratio_unshifted > 1.5 * wrong.ratio > 0.15


def test_what_fits_best_between_rows_is_found_and_said(log, fmus):
    open_ = fly(replace(log, between=None), fmus)
    assert open_.between is Between.HELD and any("held fits best" in line for line in open_.remarks)


def test_a_lag_beyond_a_row_is_no_shift(log, fmus):
    late = replace(log, channels={**log.channels, "motor_position": np.roll(log.channels["motor_position"], 3)})
    item = fly(late, fmus).channels[0]
    assert abs(item.shift) <= 0.01 + 1e-12 and item.lag == pytest.approx(slow.SHIFTS["motor_position"] - 0.03, abs=2e-3)


def changed(log: Log, **channels: np.ndarray) -> Log:
    return replace(log, channels={**log.channels, **channels})


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda c: {"equivalent_current": 1e3 * c["equivalent_current"]}, "mA instead of A?"),
        (lambda c: {"motor_position": -c["motor_position"]}, "times the command: the other sign?"),
        (lambda c: {"motor_position": 1e3 * c["motor_position"]}, "mm instead of m?"),
    ],
    ids=["mA", "sign of the position", "mm"],
)
def test_wrong_units_and_signs_are_remarked(change, says, log, fmus):
    """The log is right, so the factor that was put on it is the truth."""
    assert not any("?" in line for line in fly(log, fmus).remarks)
    assert any(says in line for line in fly(changed(log, **change(log.channels)), fmus).remarks)


@pytest.mark.parametrize(
    "name, factor, says",
    [
        ("motor_speed", 30.0 / np.pi, "motor_speed: it is 9.55 times what the twin makes: rpm instead of rad/s?"),
        (CURRENT, -1.0, "times what the twin makes: the other sign?"),
        ("position", 180.0 / np.pi, "times the command: degrees instead of rad?"),
    ],
)
def test_the_same_of_a_dense_log(name, factor, says, fmus):
    table = columns(fmus["HF"], "SIN", {}, rate=1000.0)
    channels = {port: table[port] for port in NOISE}
    dense = Log("run", Path("run.csv"), table["time"], {"command": table["command"]}, channels)
    with Twin(fmus["ELF"]) as twin:
        right = replay(dense, twin, FIDELITIES["ELF+"])
        wrong = replay(changed(dense, **{name: factor * channels[name]}), twin, FIDELITIES["ELF+"])
    assert not right.remarks and any(says in line for line in wrong.remarks)


def test_a_log_beyond_the_twins_stops_is_remarked(log, fmus):
    """+-1 rad of the screw, with the stops at 0.3 rad: 0.477 mm of 10 mm a turn."""
    remarks = fly(log, fmus, **{"mechanics.end_stop": 0.3}).remarks
    beyond = [line for line in remarks if "beyond the end stops at 0.000477 m" in line]
    assert [line.partition(":")[0] for line in beyond] == ["command", "position"] and "rpm" not in "".join(remarks)


def test_shifts_far_apart_are_remarked_in_words(log, fmus):
    """A position that is shown 8 ms later, at rows of 10 ms: channels of one log, 9 ms apart instead of 3."""
    assert not any("ms apart" in line for line in fly(log, fmus).remarks)
    late = np.interp(log.time - 0.012, log.time, log.channels["motor_position"])
    (line,) = (line for line in fly(changed(log, motor_position=late), fmus).remarks if "ms apart" in line)
    assert "position" in line and "later than the twin" in line and "equivalent_current" in line and "earlier" in line


def test_shifts_and_lags_at_their_bounds_are_remarked(log, fmus):
    remarks = fly(changed(log, motor_position=np.roll(log.channels["motor_position"], 8)), fmus).remarks
    assert any("position is shifted in time by -10 ms, as far as is allowed" in line for line in remarks)
    assert any("position: the twin's lag is at the bound of what is looked for, -50 ms" in line for line in remarks)


def test_a_position_on_the_motor_of_a_rotary_actuator_is_shown_in_rad_of_the_users_shaft(log, fmus):
    rotary = fly(replace(log, output=Output()), fmus)
    item = rotary.channels[0]
    assert (item.name, item.unit) == ("position", "rad") and any("measured on the motor" in line for line in rotary.remarks)
    np.testing.assert_allclose(item.measured, log.channels["motor_position"] / 20.0)


def test_masked_rows_are_left_out(log, fmus):
    spoiled = log.channels["equivalent_current"].copy()
    spoiled[50:60] = np.nan
    one = fly(replace(log, channels={**log.channels, "equivalent_current": spoiled}), fmus).channels[1]
    assert one.nrmse == pytest.approx(fly(log, fmus).channels[1].nrmse, rel=0.1) and one.nrmse_20hz is not None


def test_the_low_pass_takes_off_what_is_fast_and_nothing_else():
    """A second-order Butterworth forth and back: 1 Hz passes, 100 Hz does not; below 50 rows a second there is no figure."""
    time = np.arange(0.0, 2.0, 1e-3)
    slow_one = np.sin(2.0 * np.pi * time)
    assert nrmse_20hz(time, slow_one, slow_one + 0.1 * np.sin(200.0 * np.pi * time)) < 1e-3
    assert nrmse_20hz(time, slow_one, 1.1 * slow_one) == pytest.approx(0.05 / np.sqrt(2.0), rel=0.02)
    assert nrmse_20hz(time[::25], slow_one[::25], slow_one[::25]) is None


def test_no_tracking_error_has_no_ratio():
    assert tracking_error(np.ones(5), np.ones(5), np.zeros(5), np.zeros(5), "m").ratio is None


def test_command_writes_page_and_json(log, fmus, tmp_path):
    common = ["--fmus", str(fmus["HF"].parent), "--out", str(tmp_path), "--json", str(tmp_path / "r.json")]
    result = CliRunner().invoke(
        app, ["replay", str(log.source), "--actuator", str(slow.actuator(tmp_path / "own.toml")), *common]
    )
    assert result.exit_code == 0, result.output
    written = json.loads((tmp_path / "r.json").read_text())
    assert set(written["channels"]) == {"position", "equivalent_current"} and written["command"] == "held"
    assert {"rms", "nrmse", "nrmse_20hz", "lag"} <= set(written["channels"]["position"])
    assert set(written["tracking_error"]) == {"unit", "measured", "twin", "difference", "ratio", "ratio_unshifted"}
    page = (tmp_path / "drive_replayed.html").read_text()
    assert "residual: model minus measured" in page and '"name":"command"' in page and "What the figures mean" in page
    assert "residual" in page and "ELF+" in page and "http-equiv" not in page


def test_several_runs_are_listed(log, fmus, tmp_path):
    rows = log.source.read_text().splitlines()
    path = tmp_path / "two.txt"
    path.write_text("".join(f"{row}\t{run}\n" for run in "AB" for row in rows[:200]))
    common = ["--fmus", str(fmus["HF"].parent), "--out", str(tmp_path), "--json", str(tmp_path / "r.json")]
    words = ["replay", str(path), "--actuator", str(slow.actuator(tmp_path / "own.toml")), "--column", "run=5", *common]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.exception
    runs = json.loads((tmp_path / "r.json").read_text())["runs"]
    assert len(runs) == 2 and runs[0]["channels"] == runs[1]["channels"]


LOGS = os.environ.get("EMA_BENCH_LOGS", "")


@pytest.mark.skipif(not LOGS, reason="EMA_BENCH_LOGS names no folder of bench logs")
@pytest.mark.parametrize("name, stroke", [("a-10mm", 0.01), ("a-1mm", 0.002)])
def test_a_real_log_flown_with_data_sheet_values(name: str, stroke: float, fmus: dict[str, Path], tmp_path: Path) -> None:
    """A bench log of the library's actuator, with nothing fitted: its strokes come out, in m, within a hundredth."""
    columns = ["time=1 [ms]", "command=2 [mm] held", "position=4 [mm] motor", "equivalent_current=6 [mA]"]
    given = [part for column in columns for part in ("--column", column)]
    log, out = Path(LOGS) / f"{name}.txt", tmp_path / "replay.json"
    call = ["replay", str(log), "--actuator", "maxon-linear-a", *given, "--fmus", str(fmus["HF"].parent)]
    result = CliRunner().invoke(app, [*call, "--out", str(tmp_path), "--json", str(out)])
    assert result.exit_code == 0, result.output
    found = json.loads(out.read_text())
    assert found["channels"]["position"]["unit"] == "m" and found["channels"]["position"]["nrmse"] < 0.01
    assert 0.1 * stroke < found["tracking_error"]["measured"] < stroke


FITTED = """
name = "fitted"
[parameters]
"motor.R" = 0.08
"motor.L" = 0.1285e-3
"motor.K_e" = 0.0470666667
"motor.p" = 8
"mechanics.J" = 1.776e-5
"mechanics.C" = 1.29e-4
"mechanics.T_coulomb" = 0.01523
"mechanics.T_static" = 0.0431
"mechanics.T_asymmetry" = -0.009125
"mechanics.end_stop" = "50 mm"
"gear.ratio" = 5.307
"gear.eta_opposing" = 1
"gear.eta_aiding" = 1
"gear.backlash" = 0
"controller.structure" = "pid"
"controller.pid.K_p" = 5
"controller.pid.K_i" = 100
"controller.pid.K_d" = 0.08
"controller.pid.T_f" = 0.0025806
"controller.pid.b" = 1
"controller.pid.c" = 1
"controller.period" = "0.4 ms"
"controller.current_limit" = 19.34
"controller.current_control" = "field_oriented"
"controller.current.bandwidth" = "374 Hz"
"controller.current.decoupling" = 1
"controller.current.emf_forward" = 0
"inverter.modulation" = "space_vector"
"inverter.carrier_frequency" = "12.5 kHz"
"inverter.utilisation" = 0.985
"inverter.R_on" = 0
"inverter.dead_time" = 0
"sensor.counts" = "48 counts/turn"
[output]
lead = "5 mm"
[log]
time = "1 [ms]"
command = "2 [mm] held"
position = "4 [mm] motor"
equivalent_current = "6 [mA]"
"""
"""Values fitted to both logs by a prototype in three phases, with the gains that the bench states."""


@pytest.mark.skipif(not LOGS, reason="EMA_BENCH_LOGS names no folder of bench logs")
@pytest.mark.parametrize("name, position, tracking", [("a-10mm", 0.003, 0.012), ("a-1mm", 0.008, 0.05)])
def test_a_real_log_flown_with_its_own_drive(
    name: str, position: float, tracking: float, fmus: dict[str, Path], tmp_path: Path
) -> None:
    """Truth: the bench. NRMSE of position, tracking error over the measured one, current; ELF+."""
    own, out = tmp_path / "fitted.toml", tmp_path / "replay.json"
    own.write_text(FITTED)
    call = ["replay", str(Path(LOGS) / f"{name}.txt"), "--actuator", str(own), "--fmus", str(fmus["HF"].parent)]
    result = CliRunner().invoke(app, [*call, "--out", str(tmp_path), "--json", str(out)])
    assert result.exit_code == 0, result.output
    found = json.loads(out.read_text())
    assert found["channels"]["position"]["nrmse"] <= position
    assert found["tracking_error"]["ratio"] <= tracking
    assert found["channels"]["equivalent_current"]["nrmse"] <= 0.03

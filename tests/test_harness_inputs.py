"""What users give the harness: trials, CSV files, fidelities, settings. Each mistake gets one line that names it."""

from pathlib import Path

import numpy as np
import pytest

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.fidelity import FIDELITIES, file_stem, parse_fidelities
from harness.logs.trialfile import read_trial
from harness.parameters import parse_settings
from harness.trials import BUILT_IN, PAPER, STEP, trial


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_trials_last_two_and_a_half_seconds(name: str) -> None:
    flown = trial(name)
    assert flown.time[0] == 0.0
    assert flown.time[-1] == pytest.approx(2.5, abs=1e-12)
    assert all(len(values) == 25001 and np.isfinite(values).all() for values in flown.inputs.values())
    assert np.abs(flown.inputs["command"]).max() <= ports.VARIABLES[ports.INDEX["mechanics.end_stop"]].start


def test_paper_trials_follow_table_1() -> None:
    assert PAPER == ("SIN", "SIN4", "STEP-RAMP")
    t = trial("SIN").time
    np.testing.assert_allclose(trial("SIN").inputs["command"], 0.1 * np.sin(2 * np.pi * t), atol=1e-15)
    np.testing.assert_allclose(trial("SIN4").inputs["command"], 0.5 * np.sin(10 * np.pi * t), atol=1e-15)
    command = trial("step-ramp").inputs["command"]
    assert [command[round(at / STEP)] for at in (0.0, 0.0099, 0.01, 1.2499)] == [0.0, 0.0, 0.1, 0.1]
    assert command[-1] == pytest.approx(0.1 - 0.1 * 1.25)


def test_load_step_comes_at_one_second() -> None:
    load = trial("LOAD-STEP").inputs["load_torque"]
    assert (load[9999], load[10000]) == (0.0, 6.0)


def test_chirp_ends_at_three_hertz() -> None:
    command = trial("CHIRP").inputs["command"]
    crossings = np.flatnonzero(np.diff(np.sign(command)))
    assert 0.5 / (STEP * (crossings[-1] - crossings[-2])) == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(("name", "nearest"), [("SIN5", "SIN4"), ("STEPRAMP", "STEP-RAMP"), ("trapezoidal", "TRAPEZOID")])
def test_unknown_trial_names_the_nearest(name: str, nearest: str) -> None:
    with pytest.raises(HarnessError, match=f"unknown trial '{name}'.*{nearest}"):
        trial(name)


def _file(folder: Path, text: str, name: str = "own.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def test_csv_trial_is_interpolated_onto_the_communication_grid(tmp_path: Path) -> None:
    text = "\ufefftime, command,load_torque\r\n1.0,0,5\r\n1.005,0.1,5\r\n1.01,0.1,7\r\n\r\n"
    flown = read_trial(_file(tmp_path, text))
    assert flown.name == "own"
    assert flown.start == 1.0
    np.testing.assert_allclose(flown.time, 1.0 + np.arange(101) * STEP)
    np.testing.assert_allclose(flown.inputs["command"], np.interp(flown.time, [1.0, 1.005], [0.0, 0.1]))
    np.testing.assert_allclose(flown.inputs["load_torque"], np.interp(flown.time, [1.005, 1.01], [5.0, 7.0]))
    assert "supply_voltage" not in flown.inputs


@pytest.mark.parametrize("between", ["linear", "held"])
def test_two_rows_of_one_time_are_a_jump(tmp_path: Path, between: str) -> None:
    """A square wave over a ramp of the load: the command jumps at 0.3, 0.6 and at the end, from that point on."""
    text = "time,command,load_torque\n0,0,0\n0.3,0,3\n0.3,0.1,3\n0.6,0.1,6\n0.6,-0.1,6\n0.7,-0.1,7\n0.7,0.2,7\n"
    columns = None if between == "linear" else {"command": "command held", "time": "time", "load_torque": "load_torque"}
    flown = read_trial(_file(tmp_path, text), columns=columns)
    assert len(flown.time) == 7001
    n = np.arange(7001)
    expected = np.where(n < 3000, 0.0, np.where(n < 6000, 0.1, np.where(n < 7000, -0.1, 0.2)))
    np.testing.assert_array_equal(flown.inputs["command"], expected)
    np.testing.assert_allclose(flown.inputs["load_torque"], 10.0 * flown.time, atol=1e-12)
    assert "command" not in flown.continuous  # held from point to point, so that the jump is one


def test_a_ramp_between_jumps_is_straight(tmp_path: Path) -> None:
    flown = read_trial(_file(tmp_path, "time,command\n0,0\n0.1,0.1\n0.1,-0.1\n0.2,0\n"))
    t = flown.time
    np.testing.assert_allclose(flown.inputs["command"], np.where(t < 0.1 - 1e-9, t, t - 0.2), atol=1e-12)


BAD_CSV = {
    "empty": ("", "empty"),
    "no command": ("time,load_torque\n0,0\n1,0\n", "line 1: no column 'command'"),
    "no time": ("t,command\n0,0\n1,0\n", "line 1: no column 'time'"),
    "unknown column": ("time,command,load_torqe\n0,0,0\n1,0,0\n", "load_torqe.*did you mean load_torque"),
    "column twice": ("time,command,command\n0,0,0\n1,0,0\n", "'command' is there twice"),
    "text": ("time,command\n0,0\n1,high\n", "line 3, column command: 'high' is not a number"),
    "nothing in a cell": ("time,command\n0,\n1,0\n", "line 2, column command: holds no number"),
    "not a number": ("time,command\n0,0\n1,nan\n", "line 3, column command: holds no number"),
    "infinite": ("time,command\n0,0\ninf,1\n", "line 3, column time: inf is not a finite number"),
    "a time three times": (
        "time,command\n0,0\n1,0\n1,1\n1,2\n2,0\n",
        "line 5: time 1 s does not .*; two rows of one time are",
    ),
    "one time only": ("time,command\n1,0\n1,0\n", "lasts 0 s"),
    "decreasing time": ("time,command\n0,0\n1,0\n0.5,0\n", "line 4: time 0.5 s does not come after 1 s"),
    "header only": ("time,command\n", "0 row.*at least two"),
    "one row": ("time,command\n0,0\n", "1 row.*at least two"),
    "short row": ("time,command\n0,0\n1\n", "line 3: 1 values.*2 columns"),
    "shorter than a step": ("time,command\n0,0\n1e-5,0\n", "lasts 1e-05 s"),
    "much too long": ("time,command\n0,0\n1e9,0\n", "lasts 1e[+]09 s"),
    "negative supply": ("time,command,supply_voltage\n0,0,48\n1,0,-1\n", "supply_voltage: -1 is out of range"),
    "a command without end": ("time,command\n0,0\n1,1001\n", "command: 1001 is out of range, -1000 to 1000 rad"),
    "too high a supply": ("time,command,supply_voltage\n0,0,48\n1,0,9999\n", "supply_voltage: 9999 is out of range"),
}


@pytest.mark.parametrize(("text", "message"), BAD_CSV.values(), ids=BAD_CSV.keys())
def test_bad_csv_is_one_line_that_says_where(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(HarnessError, match=message) as caught:
        read_trial(_file(tmp_path, text))
    assert "own.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unreadable_csv(tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match="cannot be read: No such file"):
        read_trial(tmp_path / "none.csv")
    with pytest.raises(HarnessError, match="cannot be read: Is a directory"):
        read_trial(tmp_path)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(HarnessError, match="no column 'time'"):
        read_trial(tmp_path / "binary.csv")


def test_fidelities_keep_their_order_and_appear_once() -> None:
    assert [item.name for item in parse_fidelities("LF, HF,ELF+,LF")] == ["LF", "HF", "ELF+"]
    assert FIDELITIES["ELF+"].fmu == FIDELITIES["ELF"].fmu
    assert file_stem("ELF+") == "ELFplus" and file_stem("ELF+:HF@1.2") == "ELFplus_HF_at_1.2"


@pytest.mark.parametrize(("text", "message"), [("HF,EFL", "'EFL': did you mean ELF"), ("", "no fidelity"), (",", "no")])
def test_bad_fidelities(text: str, message: str) -> None:
    with pytest.raises(HarnessError, match=message):
        parse_fidelities(text)


def test_settings_become_numbers() -> None:
    given = ["fault.N_a=0.9", "motor.p = 3", "solver.event_located=False", "supply_voltage=36", "load_torque=-2e0"]
    for text in ("b_upper", "B_upper", "3", "3.0"):
        assert parse_settings([f"fault.open_switch={text}"]) == {"fault.open_switch": 3.0}
    assert parse_settings(given) == {
        "fault.N_a": 0.9,
        "motor.p": 3.0,
        "solver.event_located": 0.0,
        "supply_voltage": 36.0,
        "load_torque": -2.0,
    }


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("fault.Na=0.9", "unknown parameter 'fault.Na': did you mean fault.N_a"),
        ("fault.N_a", "NAME=VALUE is needed"),
        ("fault.N_a=", "'' is not a number"),
        ("fault.N_a=lots", "'lots' is not a number"),
        ("fault.N_a=nan", "out of range, 0.3 to 1"),
        ("fault.N_a=1.1", "fault.N_a = 1.1 is out of range, 0.3 to 1"),
        ("initial.motor_speed=inf", "out of range"),
        ("motor.p=2.5", "whole number"),
        ("motor.p=nan", "whole number"),
        ("fault.open_switch=upper", "'upper' is not a number or none or a_upper or .* or c_lower"),
        ("fault.open_switch=2.5", "whole number"),
        ("fault.open_switch=7", "out of range, 0 to 6"),
        ("load_torque=2e6", "out of range, -1e[+]06 to 1e[+]06 N.m"),
        ("driver.coupled_saturation=2", "'2' is not true or false"),
        ("position=1", "position is not a parameter"),
        ("command=1", "command is not a parameter"),
        ("supply_voltage=-1", "out of range, 0 to 2000 V"),
        ("fault.zeta=0.5", "motor.p [*] fault.zeta = 1 is out of range"),
    ],
)
def test_bad_settings(setting: str, message: str) -> None:
    with pytest.raises(HarnessError, match=message):
        parse_settings([setting])

"""Logs that can be misread: each is read as what it says, or refused in a line; never as something else.

Truth: the run that the file was made of, 0.1*sin(6 t) commanded and 0.09*sin(6 t - 0.1) measured at 100 Hz.
"""

import datetime
import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from dialects import lines
from typer.testing import CliRunner

from harness.cli import app
from harness.errors import HarnessError
from harness.files.reader import read_table
from harness.logs.log import Log
from harness.logs.read import read_log, read_one
from harness.logs.trialfile import read_trial

T = np.round(np.arange(200) * 0.01, 6)
C, X = 0.1 * np.sin(6.0 * T), 0.09 * np.sin(6.0 * T - 0.1)
RUN = {"time": T, "command": C, "position": X}
DEGREES = {"time": T, "command": np.degrees(C), "position": np.degrees(X)}
NUMBERS = {"time": "1", "command": "2", "position": "3"}


def _read(folder: Path, content: str | bytes, stated: dict[str, str] | None = None, name: str = "own.csv") -> Log:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return read_one(folder / name, stated)


def _is_the_run(log: Log) -> None:
    np.testing.assert_allclose(log.inputs["command"], C, atol=1e-12)
    np.testing.assert_allclose(log.channels["position"], X, atol=1e-12)


def _sheet(*rows: list[object]) -> bytes:
    import openpyxl

    book, buffer = openpyxl.Workbook(), io.BytesIO()
    for row in rows:
        book.active.append(row)
    book.save(buffer)
    return buffer.getvalue()


def _tdms(*channels: tuple[str, str, np.ndarray, dict[str, object]]) -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    buffer = io.BytesIO()
    with TdmsWriter(buffer) as writer:
        writer.write_segment(
            [ChannelObject(group, name, values, properties=about) for group, name, values, about in channels]
        )
    return buffer.getvalue()


@pytest.mark.parametrize("units", ["s,deg,deg,Arms", "[s],[deg],[deg],[bool]", "s,deg,deg,xyzzy"])
def test_a_unit_row_with_an_unknown_unit_is_one(units: str, tmp_path: Path) -> None:
    text = lines(DEGREES | {"current": X}, head=f"time,command,position,current\n{units}")
    _is_the_run(_read(tmp_path, text, NUMBERS))
    _is_the_run(_read(tmp_path, text))
    with pytest.raises(HarnessError, match=r"column current: .* is not a known unit"):
        _read(tmp_path, text, {"equivalent_current": "current"})


@pytest.mark.parametrize("unit", ["Grad", "Mrad"])
def test_a_unit_of_two_meanings_is_refused(unit: str, tmp_path: Path) -> None:
    """Giga- and megaradians by the SI; degrees and milliradians to those who write them."""
    rows = [["time", "command", "position"], ["s", "deg", unit], *np.column_stack(list(DEGREES.values())).tolist()]
    for content in (_sheet(*rows), lines(DEGREES, head=f"time,command [deg],position ({unit})")):
        with pytest.raises(HarnessError, match=r"two ways|no column 'position'|not a known|no unit"):
            _read(tmp_path, content, name="own.xlsx")


def test_a_header_of_column_numbers_is_no_row(tmp_path: Path) -> None:
    frame = pd.DataFrame({0: T, 1: C, 2: X})
    for text in (frame.to_csv(index=False), frame.to_csv(index=False).replace("0,1,2", "1,2,3", 1)):
        _is_the_run(_read(tmp_path, text, NUMBERS))
    _is_the_run(_read(tmp_path, frame.to_csv(), {"time": "2", "command": "3", "position": "4"}))
    rows = np.column_stack([T, C, X]).tolist()
    for content in (_sheet([0, 1, 2], *rows), "0,1,2\n1,3,4\n2,5,7\n"):
        with pytest.raises(HarnessError, match="line 1: '0, 1, 2' may number the columns"):
            _read(tmp_path, content, NUMBERS, "own.xlsx")


def test_rows_that_begin_like_numbers_of_columns_stay_rows(tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("0,1\n1,0\n2,1\n")
    assert [column.values.tolist() for column in read_table(tmp_path / "own.csv").columns] == [[0, 1, 2], [1, 0, 1]]
    (tmp_path / "own.csv").write_text("0,1\n0.5,0.25\n")
    with pytest.raises(HarnessError, match="may number the columns"):
        read_table(tmp_path / "own.csv")


def _groups(layout: dict[str, np.ndarray], kind: str) -> bytes:
    buffer = io.BytesIO()
    if kind == "h5":
        import h5py

        with h5py.File(buffer, "w") as file:
            for name, values in layout.items():
                file[name] = values
        return buffer.getvalue()
    from scipy.io import savemat

    content: dict[str, object] = {}
    for name, values in layout.items():
        group, _, leaf = name.rpartition("/")
        (content.setdefault(group, {}) if group else content)[leaf] = values  # type: ignore[index]
    savemat(buffer, content)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", ["h5", "mat"])
@pytest.mark.parametrize("fast", ["", "fast/"])
def test_columns_of_equal_length_have_the_times_of_their_group(kind: str, fast: str, tmp_path: Path) -> None:
    late = {f"{fast}time": T, f"{fast}command": C, "enc/t": T + 0.255, "enc/position": X}
    log = _read(tmp_path, _groups(late, kind), {"command": "command ramped"}, f"own.{kind}")
    known = np.isfinite(log.channels["position"])
    np.testing.assert_allclose(np.interp(log.time[known] - 0.255, T, X), log.channels["position"][known], atol=1e-9)


def test_times_that_are_open_are_asked_for(tmp_path: Path) -> None:
    content = _groups({"a/time": T, "a/command": C, "b/time": T + 0.5, "position": X}, "h5")
    with pytest.raises(HarnessError, match=r"column position: which times its 200 rows have is open; .*--column time="):
        _read(tmp_path, content, name="own.h5")


def test_channels_of_tdms_have_their_own_track(tmp_path: Path) -> None:
    noon = datetime.datetime(2026, 1, 1, 12)

    def wave(step: float, **more: object) -> dict[str, object]:
        return {"wf_increment": step, "wf_start_offset": 0.0, **{f"wf_{name}": value for name, value in more.items()}}

    later = wave(0.01, start_time=noon + datetime.timedelta(seconds=0.07))
    shifted = {
        "start times": (_tdms(("A", "command", C, wave(0.01, start_time=noon)), ("B", "position", X, later)), 1.0, 0.07),
        "offsets": (
            _tdms(("A", "command", C, wave(0.01)), ("A", "position", X, wave(0.01, start_offset=0.305))),
            1.0,
            0.305,
        ),
        "steps": (_tdms(("A", "command", C, wave(0.01)), ("A", "position", X, wave(0.02))), 2.0, 0.0),
        "lengths": (_tdms(("A", "command", C, wave(0.01)), ("A", "position", X[:150], wave(0.01))), 1.0, 0.0),
    }
    for what, (content, stretch, shift) in shifted.items():
        log = _read(tmp_path, content, {"command": "command ramped"}, name="own.tdms")
        assert len(log.time) < 250 or what in ("offsets", "steps")  # rows of the same instant are one
        known = np.isfinite(log.channels["position"])
        truth = np.interp((log.time[known] - shift) / stretch, T, X)
        np.testing.assert_allclose(log.channels["position"][known], truth, atol=1e-6, err_msg=what)
    with pytest.raises(HarnessError, match=r"column position: which times its 150 rows have is open"):
        _read(
            tmp_path, _tdms(("A", "time", T, {}), ("A", "command", C, {}), ("A", "position", X[:150], {})), name="own.tdms"
        )


def test_thousands_and_decimals_in_one_file_are_refused(tmp_path: Path) -> None:
    rows = "\n".join(f"{k};1.5;1.234;1.234,5" for k in range(4))
    with pytest.raises(HarnessError, match=r"as in '1.234,5' and as in '1.5'; only one can be"):
        _read(tmp_path, f"time;command;position;current\n{rows}\n")


@pytest.mark.parametrize("labels", [(1234561, 1234562), (20240101, 20240102), (0.1234567, 0.1234568)])
def test_runs_with_long_numbers_are_told_apart(labels: tuple[float, float], tmp_path: Path) -> None:
    rows = lines(RUN, head="").splitlines()
    text = [f"{row},{label}" for label in labels for row in rows]
    (tmp_path / "own.csv").write_text("\n".join(["time,command,position,run", *text]))
    assert [log.name for log in read_log(tmp_path / "own.csv")] == [f"own {label}" for label in labels]


@pytest.mark.parametrize("words", ["command °,position°", "command (º),position (°)", "command [˚],position (deg)"])
def test_signs_of_degrees_count(words: str, tmp_path: Path) -> None:
    _is_the_run(_read(tmp_path, lines(DEGREES, head=f"time,{words}")))


@pytest.mark.parametrize(
    "words",
    [
        b"command%,position%", b"command \xf8,position", b"command (\xa1),position", b"command (\xf8),position",
        b"command \xef\xbf\xbd,position", b"command,position \xf8", b"command,position,supply_voltage \xc2\xb0",
        b"command,position,motor_speed %",
    ],
)  # fmt: skip
def test_other_signs_are_refused(words: bytes, tmp_path: Path) -> None:
    """What is left of a degree sign of another code page is no word to be left out."""
    table = RUN | ({"more": np.full(200, 48.0)} if words.count(b",") > 1 else {})
    with pytest.raises(HarnessError, match=r"no column|no angle|not a known unit|does not measure"):
        _read(tmp_path, b"time," + words + b"\n" + lines(table, head="").encode())


def test_times_that_are_in_seconds_by_their_format_stay_so(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(C, T, name="command"), Signal(X, T, name="position")])
        file.save(tmp_path / "own.mf4", overwrite=True)
    _is_the_run(read_one(tmp_path / "own.mf4", {"time": "time [s]"}))
    for stated in ({"time": "time [ms]"}, {"time": "1 [ms]", "command": "2", "position": "3"}):
        with pytest.raises(HarnessError, match=r"column time: \[ms\] is stated, but the times of this format are in s"):
            read_one(tmp_path / "own.mf4", stated)


MEANT = ["load_torque_kgcm", "LoadTorque_kgcm", "motor_speed_RPMs"]
EFFECTIVE = ["supply_voltage (Vrms)", "equivalent_current (Arms)"]
PERHAPS = {"brake_torque": "load_torque", "torque": "load_torque", "U_bat": "supply_voltage", "load_torque_b": "load_torque"}


@pytest.mark.parametrize("word", MEANT)
def test_what_begins_like_a_port_and_goes_on_like_a_unit_is_refused(word: str, tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match=rf"column '{word.replace('(', '.').replace(')', '.')}' begins like .*\[UNIT\]'"):
        _read(tmp_path, lines(RUN | {word: X}))


@pytest.mark.parametrize("word", EFFECTIVE)
def test_effective_values_are_refused_with_what_to_write(word: str, tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match=r"column (supply_voltage|equivalent_current): .*rms.* write the amplitude"):
        _read(tmp_path, lines(RUN | {word: X}))


@pytest.mark.parametrize("word", PERHAPS)
def test_what_may_be_an_input_is_remarked(word: str, tmp_path: Path) -> None:
    told = _read(tmp_path, lines(RUN | {word: X})).remarks
    assert any(f"column {word} is left out; if it is the {PERHAPS[word]}:" in line for line in told)


def test_what_is_no_input_is_not_remarked(tmp_path: Path) -> None:
    told = _read(tmp_path, lines(RUN | {"motor_torque": X, "position_min": X, "status": X, "voltage_phase": X})).remarks
    assert not any("left out" in line for line in told)


@pytest.mark.parametrize("origin", [45_000.0, 739_000.0, 0.0])
def test_times_in_days_are_refused_or_stated(origin: float, tmp_path: Path) -> None:
    days = lines(RUN | {"time": origin + np.arange(200) / 86400.0 / 100.0})
    (tmp_path / "own.csv").write_text(days)
    for read in (read_one, read_trial):
        with pytest.raises(HarnessError, match=r"another unit\?.*\[day\]|can be flown"):
            read(tmp_path / "own.csv")
    assert _read(tmp_path, days, {"time": "time [day]"}).rate == pytest.approx(100.0, rel=0.01)


def test_an_index_that_pandas_kept_is_a_column(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    pd.DataFrame(RUN).set_index("time").to_parquet(buffer)
    _is_the_run(_read(tmp_path, buffer.getvalue(), name="own.parquet"))


@pytest.mark.parametrize("encoding", ["utf-32", "utf-32-le", "utf-32-be", "utf-16-be"])
def test_utf_32_is_read(encoding: str, tmp_path: Path) -> None:
    _is_the_run(_read(tmp_path, lines(RUN).encode(encoding)))


@pytest.mark.parametrize("name", ["units", "UNITS", "Unit"])
@pytest.mark.parametrize("form", [np.array([b"deg"]), "deg", np.bytes_("deg"), np.array(["deg"], dtype=object)])
def test_units_of_hdf5_in_any_form(name: str, form: object, tmp_path: Path) -> None:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["time"] = T
        for key in ("command", "position"):
            file[key] = np.r_[DEGREES[key]] / 0.5 - 3.0
            file[key].attrs[name] = form
            file[key].attrs["scale_factor"], file[key].attrs["add_offset"] = 0.5, 1.5
    _is_the_run(_read(tmp_path, buffer.getvalue(), name="own.h5"))


def test_a_targets_position_is_not_measured(tmp_path: Path) -> None:
    text = lines({"time": T, "command": C, "target.position": C, "meas.angle": X})
    with pytest.raises(HarnessError, match="no column 'position'"):
        _read(tmp_path, text)
    _is_the_run(_read(tmp_path, text.replace("meas.angle", "meas.position")))


def test_one_column_is_one_thing(tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match="column command: is taken as position and as command"):
        _read(tmp_path, lines(RUN), {"position": "2"})
    with pytest.raises(HarnessError, match="column time: is taken as time and as position"):
        _read(tmp_path, lines(RUN), {"position": "1"})
    with pytest.raises(HarnessError, match="'position' is there twice, as 'Position'"):
        _read(tmp_path, lines(RUN | {"Position": 2.0 * X}))
    _is_the_run(_read(tmp_path, lines(RUN | {"Position": X})))


def test_a_command_that_cannot_be_is_not_flown(tmp_path: Path) -> None:
    command = C.copy()
    command[50] = 999.0
    with pytest.raises(HarnessError, match="line 52, column command: 999 is far outside"):
        _read(tmp_path, lines(RUN | {"command": command}))
    command[:] = 0.0
    command[50] = 0.5
    assert _read(tmp_path, lines(RUN | {"command": command})).inputs["command"][50] == 0.5  # an impulse is one
    supply = 48.0 + 0.1 * C
    supply[50] = 655.35
    log = _read(tmp_path, lines(RUN | {"supply_voltage": supply}))
    assert log.inputs["supply_voltage"].max() < 49.0 and any("spike" in line for line in log.remarks)


def _described(folder: Path, content: bytes | str, name: str = "own.csv", *more: str) -> tuple[str, list[dict[str, str]]]:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    result = CliRunner().invoke(app, ["columns", str(folder / name), "--json", str(folder / "c.json"), *more])
    assert result.exit_code == 0, result.exception
    return " ".join(result.output.split()), json.loads((folder / "c.json").read_text())["columns"]


def test_columns_offers_what_the_reader_takes(tmp_path: Path) -> None:
    table = DEGREES | {"n": 100.0 * X, "i": X}
    head = "t,Sollwinkel [°],Istwinkel [°],{n},Strom gefiltert [mA]"
    for unit, offered in (("U/min", "U/min"), ("1/min", "rpm"), ("min-1", "rpm")):
        told, columns = _described(tmp_path, lines(table, ";", head=head.format(n=f"n [{unit}]").replace(",", ";")))
        assert [each["guess"] for each in columns] == [
            "time", "command", "position", "motor_speed", "equivalent_current_filtered"
        ]  # fmt: skip
        assert f"--column 'motor_speed=n [{offered}]'" in told
        stated = dict(flag["flag"].removeprefix("--column '").removesuffix("'").split("=") for flag in columns)
        log = read_one(tmp_path / "own.csv", stated)
        _is_the_run(log)
        np.testing.assert_allclose(log.channels["motor_speed"], 100.0 * X * np.pi / 30.0, atol=1e-9)


def test_columns_hints_at_what_the_numbers_do_not_tell(tmp_path: Path) -> None:
    told, _ = _described(tmp_path, lines({**RUN, "equivalent_current": X}))
    assert "10 ms lie between rows" in told and "held or ramped" in told and "filtered 2 ms" in told
    told, _ = _described(tmp_path, lines({**RUN, "time": 0.1 * T}))
    assert "held or ramped" not in told


def test_columns_of_a_matrix_are_told_by_their_numbers(tmp_path: Path) -> None:
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, {"log": np.column_stack([T, np.degrees(C), np.degrees(X), 3000.0 * X])})
    _, columns = _described(tmp_path, buffer.getvalue(), "own.mat")
    assert [each["flag"] for each in columns][:3] == [
        "--column 'time=log.1'", "--column 'command=log.2 [UNIT]'", "--column 'position=log.3 [UNIT]'"
    ]  # fmt: skip
    buffer = io.BytesIO()
    savemat(buffer, {"t": T, "cmd": 10.0 * np.degrees(C), "angle": np.degrees(X), "speed": 30000.0 * X})
    _, columns = _described(tmp_path, buffer.getvalue(), "own.mat")
    assert {each["flag"] for each in columns} >= {"--column 'motor_speed=speed [rpm]'", "--column 'position=angle [deg]'"}


def test_columns_shows_our_own_runs_by_their_own_names(fmus: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("time,command\n0,0\n0.05,0.01\n")
    words = ["--fidelity", "LF", "--reference", "LF", "--fmus", str(fmus["LF"].parent), "--out", str(tmp_path)]
    assert CliRunner().invoke(app, ["run", "--trial-file", str(tmp_path / "own.csv"), *words]).exit_code == 0
    (tmp_path / "mine.toml").write_text('[log]\ntime = "1 [ms]"\nposition = "4 [deg]"\n')
    result = CliRunner().invoke(app, ["columns", str(tmp_path / "own_LF.csv"), "--actuator", str(tmp_path / "mine.toml")])
    assert (
        result.exit_code == 0
        and "a file of ema run" in result.output
        and "e+" not in result.output.split("rows a sec")[0][-9:]
    )

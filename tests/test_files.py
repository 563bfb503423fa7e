"""Files of columns: their content tells what they are; what is bad or open gets one line; numbers come back as written."""

import gzip
import io
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from dialects import DIALECTS, KEPT, lines
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from ema_fmu_src import ports
from harness.actuators.actuator import Output
from harness.cli import app
from harness.errors import HarnessError
from harness.files import writers
from harness.files.header import parse_words
from harness.files.reader import read_table
from harness.logs.read import read_one
from harness.logs.trialfile import read_trial

SOUND = {name: np.linspace(0.0, 1.0, 60) + k for k, name in enumerate(KEPT)}
SOUND["time"] = np.round(np.arange(60) * 0.01, 4)


def _read(folder: Path, content: str | bytes, name: str = "own.csv") -> dict[str, np.ndarray]:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return {column.called: column.values for column in read_table(path).columns}


def _cut(name: str, part: float = 0.6) -> bytes:
    whole = DIALECTS[name].content(SOUND)
    return whole[: int(part * len(whole))]


def _zip() -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("run.csv", "time,command\n0,0\n")
    return buffer.getvalue()


ROWS = lines(SOUND)
BAD: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", "empty"),
    "blank lines": ("\n\n  \n", "empty"),
    "comments only": ("# a\n# b\n", "empty"),
    "header only": ("time,command,position\n", "0 row"),
    "one row": ("time,command,position\n0,0,0\n", "1 row"),
    "prose": ("Dear all,\nthe log is attached to this mail.\n", "no column 'time'"),
    "no command": (ROWS.replace("command", "cmnd"), "no column 'command'"),
    "nothing measured": ("time,command\n0,0\n0.01,1\n0.02,1\n", "no column 'position'"),
    "column twice": (ROWS.replace("motor_speed", "position"), "'position' is there twice"),
    "a word in a cell": (ROWS.replace("0.02,", "high,", 1), "line 4, column time: 'high' is not a number"),
    "a word among the commands": (
        "time,command,position\n0,0,0\n0.01,x,0\n0.02,1,1\n",
        "line 3, column command: 'x' is not",
    ),
    "infinite": ("time,command,position\n0,0,0\n0.01,inf,0\n0.02,1,1\n", "line 3, column command: inf is not a finite"),
    "a time is missing": ("time,command,position\n0,0,0\n,0,0\n0.02,1,1\n", "line 3, column time: is empty"),
    "a time twice": ("time,command,position\n0,0,0\n0.01,0,0\n0.01,1,1\n", "line 4: time 0.01 s does not come after 0.01 s"),
    "a time falls": ("time,command,position\n0,0,0\n0.02,0,0\n0.01,1,1\n", "line 4: time 0.01 s does not come after 0.02 s"),
    "the header again": (ROWS + ROWS, "line 62, column time: 'time' is not a number"),
    "a short row": ("time,command,position\n0,0,0\n0.01,0\n0.02,1,1\n", "line 3: 2 values, but the header has 3"),
    "a long row": ("time,command,position\n0,0,0\n0.01,0,0,7\n0.02,1,1\n", "line 3: 4 values, but the header has 3"),
    "cut off in a row": (ROWS[:-40], "values, but the header has 5"),
    "decimal commas between commas": (
        "time,command,position\n0,00,0,01,0,0\n0,01,0,02,0,1\n",
        "'00' looks like decimals behind another comma",
    ),
    "the same without a header": ("0,00,0,01\n0,01,0,02\n0,02,0,03\n", "looks like decimals behind another comma"),
    "decimals or thousands": (
        "time;command;position\n1,234;2,345;3,456\n1,235;2,345;3,457\n",
        "'3,457' may have decimals or",
    ),
    "two signs of decimals": ("time;command;position\n0.01;0,5;1\n0.02;0,6;2\n", "only one can be"),
    "comma as both": ("time;command;position\n0,5;1,234,567;1\n0,6;1,234,568;2\n", "'0,6' the comma is a decimal one"),
    "25 rows a second are needed": ("time,command,position\n0,0,0\n1,0,0\n2,1,1\n", "1 rows a second"),
    "a command out of range": (
        "time,command,position\n0,0,0\n0.01,2000,0\n0.02,1,1\n",
        "line 3, column command: 2000 is out",
    ),
    "degrees make it out of range": (
        "time,supply_voltage [kV],command,position\n0,0.048,0,0\n0.01,9,0,0\n0.02,0.048,1,1\n",
        "line 3, column supply_voltage: 9000 .as 9 kV. is out of range",
    ),
    "a unit of something else": (ROWS.replace("position", "position [kg]"), "kg. does not measure what"),
    "no such unit": (ROWS.replace("position", "position [xyzzy]"), "'xyzzy' is not a known unit"),
    "a column of nothing": ("time,command,position\n0,,0\n0.01,n/a,0\n0.02,-,1\n", "column command: holds no number"),
    "nothing moves": ("time,command,position\n0,0,1\n0.01,0,1\n0.02,0,1\n", "nothing was measured"),
    "binary": (bytes(range(256)) * 4, "is no text file"),
    "half of a UTF-16": (lines(SOUND).encode("utf-16")[:-1], "is not the UTF-16 text"),
    "gzip cut off": (_cut("gzip"), "gzip file that is cut off"),
    "gzip damaged": (b"\x1f\x8b\x08" + b"x" * 60, "gzip file that is cut off or damaged"),
    "Parquet cut off": (_cut("Parquet"), "begins as a Parquet file, but is cut off"),
    "NetCDF cut off": (_cut("NetCDF 4"), "begins as an HDF5 file, but is cut off"),
    "NetCDF 3 cut off": (_cut("NetCDF 3", 0.2), "begins as a NetCDF file, but is cut off"),
    "HDF5 cut off": (_cut("HDF5 in groups"), "begins as an HDF5 file, but is cut off"),
    "MATLAB cut off": (_cut("MATLAB vectors"), "begins as a MATLAB file, but is cut off"),
    "MATLAB 7.3 cut off": (_cut("MATLAB 7.3"), "begins as a MATLAB 7.3 file, but is cut off"),
    "MDF cut off": (_cut("MDF 4", 0.02), "begins as an MDF file, but is cut off"),
    "TDMS cut off": (_cut("TDMS"), "begins as a TDMS file, but is cut off"),
    "xlsx cut off": (_cut("xlsx"), "a zip archive, or an .xlsx file that is cut off"),
    "a zip archive": (_zip(), "is a zip archive"),
    "an old Excel file": (b"\xd0\xcf\x11\xe0" + bytes(600), "an old Excel or Office file; save it as .xlsx"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(60), "is a picture"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_get_one_line_and_2(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    from harness.cli import main

    content, message = BAD[name]
    path = tmp_path / "own.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    monkeypatch.setattr(sys, "argv", ["ema", "identify", str(path), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as end:
        main()
    told = capsys.readouterr()
    assert end.value.code == 2 and not told.out and told.err.count("\n") == 1 and "own.csv" in told.err
    with pytest.raises(HarnessError, match=message):
        raise HarnessError(told.err)
    assert not (tmp_path / "out").exists()


def test_the_content_counts_not_the_name(tmp_path: Path) -> None:
    for name in ("MDF 4", "xlsx", "MATLAB 7.3", "Parquet", "gzip"):
        found = _read(tmp_path, DIALECTS[name].content(SOUND), "run.txt")
        assert any(key.rpartition(".")[2] == "position" for key in found)


def test_only_consistent_readings_are_taken(tmp_path: Path) -> None:
    assert _read(tmp_path, "a;b\n1,234;0,5\n2,345;0,6\n")["a"].tolist() == [1.234, 2.345]
    assert _read(tmp_path, "a;b\n1,234;0.5\n2,345;0.6\n")["a"].tolist() == [1234.0, 2345.0]
    assert _read(tmp_path, "a;b\n1.234,5;0,5\n2.345,5;0,6\n")["a"].tolist() == [1234.5, 2345.5]
    assert _read(tmp_path, "a;b\n1.234;1\n2.345;2\n")["a"].tolist() == [1.234, 2.345]
    assert _read(tmp_path, "a b\n0,5 1\n0,6 2\n")["a"].tolist() == [0.5, 0.6]


def test_a_sign_that_changes_late_is_refused_where_it_is_used(tmp_path: Path) -> None:
    text = "time;command;position\n" + "".join(f"{k},5;0,5;{k}\n" for k in range(2500))
    for late, told in (("2500,5;0.5;1", "'0.5' is not a number"), ("2500,5;1,234,567;1", "'1,234,567' is not a number")):
        (tmp_path / "own.csv").write_text(text + late + "\n")
        with pytest.raises(HarnessError, match=f"line 2502, column command: {told}"):
            read_one(tmp_path / "own.csv")


def test_rows_above_the_header_are_left_out_but_no_row_of_numbers(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text("Device;7\nRate;500\ntime;x\n0;1\n1;2\n")
    table = read_table(path)
    assert table.header == 3 and table.lines.tolist() == [4, 5] and "2 line(s) before the header" in table.remarks[0]
    path.write_text("0;5\n1;6\ntime;x\n0;1\n1;2\n")
    assert [column.labels[:2] for column in read_table(path).columns] == [("0", "1"), ("5", "6")]


def test_header_words_with_units() -> None:
    words = {
        "position [rad]": ("position", "rad"), "speed (rpm)": ("speed", "rpm"), "t_ms": ("t", "ms"), "i_A": ("i", "A"),
        "current/A": ("current", "A"), "load torque [N·m]": ("load torque", "N·m"), "Weg in mm": ("Weg", "mm"),
        "x, mm": ("x", "mm"), "phase_current_a": ("phase_current_a", ""), "motor speed": ("motor speed", ""),
        "v_mm_s": ("v", "mm/s"), "speed (actual)": ("speed (actual)", ""), "n [1/min]": ("n", "1/min"), "TIME": ("TIME", ""),
        "position_m": ("position_m", ""), "T [°C]": ("T", "°C"),
    }  # fmt: skip
    assert dict(zip(words, parse_words(list(words)), strict=True)) == words
    assert parse_words(["i_A", "i_B", "i_C"]) == [("i_A", ""), ("i_B", ""), ("i_C", "")]


cells = st.floats(allow_nan=False, allow_infinity=False, width=64).map(lambda x: 0.0 if abs(x) < 1e-300 else x) | st.just(
    np.nan
)


@settings(max_examples=120, deadline=None, derandomize=True)
@given(
    rows=st.integers(3, 12),
    width=st.integers(2, 6),
    data=st.data(),
    separator=st.sampled_from([",", ";", "\t", " ", "|"]),
    decimal=st.sampled_from([".", ","]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"]),
    header=st.booleans(),
    comment=st.booleans(),
    missing=st.sampled_from(["nan", "NaN", "n/a", "-", "N/A"]),
)
def test_what_is_written_in_any_dialect_is_read(
    rows, width, data, separator, decimal, end, encoding, header, comment, missing, tmp_path_factory
) -> None:
    """The numbers come back to the last bit, or the file is refused; they are never others."""
    decimal = "." if separator == "," else decimal
    values = np.array(data.draw(st.lists(st.lists(cells, min_size=width, max_size=width), min_size=rows, max_size=rows)))
    values[:, 0] = 0.25 + np.arange(rows)
    text = [separator.join(f"word{k}" for k in range(width))] if header else []
    text = (["# made for a test"] if comment else []) + text
    for row in values:
        text.append(separator.join(missing if np.isnan(x) else repr(float(x)).replace(".", decimal) for x in row))
    folder = tmp_path_factory.mktemp("dialect")
    try:
        found = _read(folder, (end.join(text) + end).encode(encoding))
    except HarnessError:
        if decimal == ",":
            return  # decimals or thousands: refused, test_bad_files
        raise
    assert list(found) == [f"word{k}" if header else str(k + 1) for k in range(width)]
    np.testing.assert_array_equal(np.column_stack(list(found.values())), values)


def _run() -> xr.Dataset:
    time = np.round(np.arange(200) * 0.01, 6)
    data = {
        "command": ("time", np.sin(time), {"units": "rad"}),
        "load_torque": ("time", np.cos(time), {"units": "N.m"}),
        "position": ("time", np.sin(time - 0.01), {"units": "rad"}),
        "voltage_saturated": ("time", time > 1.0, {"units": ""}),
    }
    return xr.Dataset(
        data, coords={"time": ("time", time, {"units": "s"})}, attrs={"trial": "X", "parameters": {"motor.R": 1.0}}
    )


@pytest.mark.parametrize("suffix", writers.FORMATS)
def test_what_we_write_is_read_again_with_its_inputs(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{suffix}"
    path.write_bytes(writers.encode(_run(), suffix))
    log = read_one(path)
    tolerance = 1e-9 if suffix == "csv" else 0.0
    for name, series in {**log.inputs, **log.channels}.items():
        np.testing.assert_allclose(series, _run()[name].values, rtol=tolerance, atol=tolerance)
    assert list(log.inputs) == ["command", "load_torque"] and "position" in log.channels
    if suffix != "csv":
        assert {column.name: column.unit for column in read_table(path).columns}["load_torque"] == "N.m"


@pytest.mark.parametrize("suffix", writers.FORMATS)
def test_a_rotary_run_is_in_rad_under_a_linear_actuator_too(suffix: str, tmp_path: Path) -> None:
    """A header without a unit means the port's own in what we write, as in the formats that hold every unit."""
    path = tmp_path / f"run.{suffix}"
    others = {port.name: ("time", np.zeros(200), {"units": port.unit}) for port in ports.OUTPUTS if port.name not in _run()}
    path.write_bytes(writers.encode(_run().assign(others), suffix))
    log, trial = read_one(path, output=Output(0.005)), read_trial(path, Output(0.005))
    for name, series in {"position": log.channels["position"], "command": log.inputs["command"]}.items():
        np.testing.assert_allclose(series, _run()[name].values, rtol=1e-8, atol=1e-9)
    assert float(trial.inputs["command"][0]) == pytest.approx(float(_run().command[0]), abs=1e-9)


def test_units_outside_stand_in_the_csv_and_are_read(tmp_path: Path) -> None:
    run = _run()
    run["position"] = run["position"].assign_attrs(units="mm")
    (tmp_path / "run.csv").write_bytes(writers.encode(run, "csv"))
    assert (tmp_path / "run.csv").read_text().startswith("time,command,load_torque,position [mm],")


@pytest.mark.parametrize("suffix", ["csv", "parquet", "nc", "mat", "mf4"])
def test_a_run_goes_into_the_next_command_as_a_trial(suffix: str, fmus: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("time,command,load_torque\n0,0,1\n0.05,0.01,2\n")
    common = ["--fidelity", "LF", "--reference", "LF", "--fmus", str(fmus["LF"].parent), "--format", suffix]
    for trial, out in (("own.csv", "first"), (f"first/own_LF.{suffix}", "second")):
        words = ["run", "--trial-file", str(tmp_path / trial), *common, "--set", "supply_voltage=40"]
        result = CliRunner().invoke(app, [*words, "--out", str(tmp_path / out)])
        assert result.exit_code == 0, result.output
    first, second = (read_table(tmp_path / name) for name in (f"first/own_LF.{suffix}", f"second/own_LF_LF.{suffix}"))
    assert [column.name for column in first.columns][:4] == ["time", "command", "load_torque", "supply_voltage"]
    for one, other in zip(first.columns, second.columns, strict=True):
        np.testing.assert_allclose(one.values, other.values, atol=1e-6 * max(1.0, float(np.ptp(one.values))))


def test_a_campaigns_dataset_is_read_as_one_long_table(tmp_path: Path) -> None:
    time = np.arange(5) * 0.1
    values = np.arange(15.0).reshape(3, 5)
    store = xr.Dataset({"position": (("case", "time"), values, {"units": "rad"})}, {"case": np.arange(3), "time": time})
    store.to_zarr(tmp_path / "campaign.zarr", zarr_format=2, consolidated=True)
    columns = {column.name: column for column in read_table(tmp_path / "campaign.zarr").columns}
    assert columns["position"].values.tolist() == values.ravel().tolist() and columns["position"].unit == "rad"
    assert columns["case"].values.tolist() == np.repeat(np.arange(3.0), 5).tolist()


@pytest.mark.parametrize(
    "library, name", [("asammdf", "MDF 4"), ("nptdms", "TDMS"), ("openpyxl", "xlsx"), ("h5py", "MATLAB 7.3")]
)
def test_a_missing_extra_is_one_line(library: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = DIALECTS[name].content(SOUND)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(HarnessError, match=rf"needs {library}: pip install -e '.\[files\]' in the checkout"):
        _read(tmp_path, content)


def test_a_format_that_cannot_be_written_is_said_before_the_runs() -> None:
    for form, message in (("xls", "csv, parquet, nc, mat, mf4 can be written"),):
        result = CliRunner().invoke(app, ["run", "--format", form])
        assert isinstance(result.exception, HarnessError) and message in str(result.exception)


def test_gzip_of_gzip_is_no_table(tmp_path: Path) -> None:
    with pytest.raises(HarnessError):
        _read(tmp_path, gzip.compress(gzip.compress(b"a,b\n1,2\n")))

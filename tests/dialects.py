"""One measured run in every dialect of text and every container that loggers write; made by hand, not by our writers."""

import gzip
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

Columns = Mapping[str, np.ndarray]
KEPT = ("time", "command", "position", "motor_speed", "equivalent_current_filtered")
RPM = 30.0 / np.pi


def lines(
    table: Columns, separator: str = ",", *, head: str | None = None, decimal: str = ".", end: str = "\n", tail: str = ""
) -> str:
    """The rows of a table as text, the head before them ("" for none)."""
    words = separator.join(table) if head is None else head
    rows = [separator.join(_number(value, decimal) for value in row) + tail for row in np.column_stack(list(table.values()))]
    return end.join(([words + tail] if words else []) + rows) + end


def _number(value: float, decimal: str) -> str:
    return "" if np.isnan(value) else repr(float(value)).replace(".", decimal)


def scaled(table: Columns, **factors: float) -> dict[str, np.ndarray]:
    return {name: series * factors.get(name, 1.0) for name, series in table.items()}


OTHER = {
    "time": 1e3,
    "position": 180.0 / np.pi,
    "command": 180.0 / np.pi,
    "motor_speed": RPM,
    "equivalent_current_filtered": 1e3,
}
"""Milliseconds, degrees, rpm and mA."""
OWN_WORDS = "t_ms,theta soll [deg],theta (deg),n (rpm),i_q/mA"
FLAGS = {
    "time": "t_ms",
    "command": "theta soll",
    "position": "theta",
    "motor_speed": "n",
    "equivalent_current_filtered": "i_q/mA",
}
NUMBERS = {"time": "1 [ms]", "command": "2 [deg]", "position": "3 [deg]", "motor_speed": "4 [rpm]",
           "equivalent_current_filtered": "5 [mA]"}  # fmt: skip


@dataclass(frozen=True)
class Dialect:
    """How a file is made of the run, its suffix, and what has to be said to read it."""

    content: Callable[[Columns], bytes]
    suffix: str = ".csv"
    columns: Mapping[str, str] = field(default_factory=dict)


def _iso(table: Columns) -> str:
    stamps = pd.Timestamp("2026-03-01T23:59:59") + pd.to_timedelta(np.round(table["time"] * 1e9).astype("int64"), unit="ns")
    rows = lines({name: series for name, series in table.items() if name != "time"}, head="").splitlines()
    return "time,command,position,motor_speed,equivalent_current_filtered\n" + "\n".join(
        f"{stamp.isoformat()},{row}" for stamp, row in zip(stamps, rows, strict=True)
    )


def _spaces(text: str) -> str:
    return "\n".join("   " + line.replace(" ", "    ") for line in text.splitlines())


HEAD = "time;command;position;motor_speed;equivalent_current_filtered"
TEXT: dict[str, Dialect] = {
    "commas": Dialect(lambda t: lines(t).encode()),
    "semicolons": Dialect(lambda t: lines(t, ";").encode()),
    "semicolons and decimal commas": Dialect(lambda t: lines(t, ";", decimal=",").encode()),
    "tabs": Dialect(lambda t: lines(t, "\t").encode(), ".tsv"),
    "tabs and decimal commas": Dialect(lambda t: lines(t, "\t", decimal=",").encode(), ".txt"),
    "spaces": Dialect(lambda t: _spaces(lines(t, " ")).encode(), ".dat"),
    "bars": Dialect(lambda t: lines(t, " | ").encode(), ".txt"),
    "quoted, with decimal commas": Dialect(
        lambda t: "\n".join(
            ",".join(f'"{cell}"' for cell in line.split(";")) for line in lines(t, ";", decimal=",").splitlines()
        ).encode()
    ),
    "utf-8 with a mark, CRLF": Dialect(lambda t: b"\xef\xbb\xbf" + lines(t, end="\r\n").encode()),
    "utf-16": Dialect(lambda t: lines(t, "\t").encode("utf-16")),
    "utf-16 without a mark": Dialect(lambda t: lines(t, "\t").encode("utf-16-le")),
    "latin-1": Dialect(
        lambda t: lines(scaled(t, position=57.29577951308232), ";", head=HEAD.replace("ion;", "ion [°];")).encode("latin-1")
    ),
    "comments": Dialect(lambda t: ("# bench 3, 4 kg\n# drift 0,5 %\n\n" + lines(t)).encode()),
    "head in a comment": Dialect(lambda t: ("# " + lines(t, " ")).encode(), ".dat"),
    "preamble": Dialect(lambda t: ("Logger;XY 12\nRate;500\nStart;12.3.2026\n\n" + lines(t, ";")).encode()),
    "units in a row": Dialect(
        lambda t: lines(scaled(t, **OTHER), ";", head=f"{HEAD}\n[ms];[deg];[deg];[rpm];[mA]").encode()
    ),
    "quoted head with units": Dialect(
        lambda t: lines(
            t, head='"time [s]","command [rad]","position [rad]","motor speed (rad/s)","equivalent_current_filtered, A"'
        ).encode()
    ),
    "upper case": Dialect(lambda t: lines(t, head=",".join(t).upper()).encode()),
    "empty last columns": Dialect(lambda t: lines(t, ";", tail=";;").encode()),
    "empty last columns in the rows": Dialect(lambda t: lines(t, ";", tail=";").replace("red;\n", "red\n", 1).encode()),
    "gzip": Dialect(lambda t: gzip.compress(lines(t).encode()), ".csv.gz"),
    "no header": Dialect(lambda t: lines(scaled(t, **OTHER), "\t", head="").encode(), ".txt", NUMBERS),
    "other words and units": Dialect(lambda t: lines(scaled(t, **OTHER), head=OWN_WORDS).encode(), ".csv", FLAGS),
    "by number": Dialect(lambda t: lines(scaled(t, **OTHER), head="a,b,c,d,e").encode(), ".csv", NUMBERS),
    "ISO 8601": Dialect(lambda t: _iso(t).encode()),
    "epoch in s": Dialect(lambda t: lines({**t, "time": t["time"] + 1_772_000_000.0}).encode()),
    "epoch in ms": Dialect(lambda t: lines({**t, "time": np.round(t["time"] * 1e3) + 1_772_000_000_000.0}).encode()),
    "epoch in ns": Dialect(
        lambda t: "\n".join(
            [",".join(t)]
            + [f"{round(row[0] * 1e9) + 1_772_000_000_000_000_000},{','.join(map(repr, map(float, row[1:])))}"
               for row in np.column_stack(list(t.values()))]
        ).encode()
    ),
    "thousands": Dialect(
        lambda t: lines(scaled(t, **OTHER), ";", head=HEAD + "\nms;deg;deg;rpm;mA").replace("2500.0;", "2,500.0;").encode()
    ),
}  # fmt: skip


def _parquet(table: Columns) -> bytes:
    buffer = io.BytesIO()
    pd.DataFrame(dict(table)).to_parquet(buffer)
    return buffer.getvalue()


def _netcdf(table: Columns, engine: str = "h5netcdf", path: Path = Path("run.nc")) -> bytes:
    import tempfile

    import xarray as xr

    run = xr.Dataset(
        {name: ("time", series * OTHER[name], {"units": UNITS[name]}) for name, series in table.items() if name != "time"},
        coords={"time": ("time", table["time"] * 1e3, {"units": "ms"})},
    )
    with tempfile.TemporaryDirectory() as folder:
        run.to_netcdf(Path(folder) / path, engine=engine)
        return (Path(folder) / path).read_bytes()


UNITS = {"time": "ms", "command": "deg", "position": "deg", "motor_speed": "rpm", "equivalent_current_filtered": "mA"}


def _hdf5(table: Columns, fill: Callable[[object, Columns], None], userblock: int = 0) -> bytes:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=userblock) as file:
        fill(file, table)
    return buffer.getvalue()


def _groups(file: object, table: Columns) -> None:
    for name, series in scaled(table, **OTHER).items():
        file[f"bench/run 1/{name}"] = series.reshape(-1, 1)  # type: ignore[index]
        file[f"bench/run 1/{name}"].attrs["units"] = UNITS[name]  # type: ignore[index]
    file["bench/comment"] = "drift"  # type: ignore[index]


def _compound(file: object, table: Columns) -> None:
    rows = np.empty(len(table["time"]), dtype=[(name, "f8") for name in table])
    for name, series in table.items():
        rows[name] = series
    file["log"] = rows  # type: ignore[index]


def _matlab(table: Columns, content: Callable[[Columns], dict[str, object]]) -> bytes:
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, content(table), do_compression=True, oned_as="column", long_field_names=True)
    return buffer.getvalue()


def _simulink(table: Columns) -> dict[str, object]:
    signals = [{"values": table[name], "label": name} for name in KEPT[1:]]
    return {"log": {"time": table["time"], "signals": signals}}


def _matlab73(file: object, table: Columns) -> None:
    group = file.create_group("data")  # type: ignore[attr-defined]
    group.attrs["MATLAB_class"] = np.bytes_("struct")
    for name, series in table.items():
        group[name] = series.reshape(1, -1)
        group[name].attrs["MATLAB_class"] = np.bytes_("double")
    text = group.create_dataset("note", data=np.array([[ord(letter)] for letter in "bench"], dtype=np.uint16))
    text.attrs["MATLAB_class"] = np.bytes_("char")
    file.create_group("#refs#")  # type: ignore[attr-defined]


def _header73(data: bytes) -> bytes:
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sun Mar 01 2026 HDF5 schema 1.00 ."
    return head.ljust(124) + b"\x00\x02IM" + b"\x00" * 384 + data[512:]


def _mdf(table: Columns, version: str = "4.10", groups: int = 1) -> bytes:
    import tempfile

    from asammdf import MDF, Signal

    signals = [Signal(table[name] * OTHER[name], table["time"], unit=UNITS[name], name=name) for name in KEPT[1:]]
    with MDF(version=version) as file, tempfile.TemporaryDirectory() as folder:
        for part in np.array_split(np.arange(len(signals)), groups):
            file.append([signals[place] for place in part])
        suffix = "mf4" if version.startswith("4") else "mdf"
        file.save(Path(folder) / f"run.{suffix}", overwrite=True)
        return (Path(folder) / f"run.{suffix}").read_bytes()


def _tdms(table: Columns, *, waveform: bool) -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    buffer = io.BytesIO()
    step = {"wf_increment": float(table["time"][1]), "wf_start_offset": 0.0, "wf_samples": 1} if waveform else {}
    with TdmsWriter(buffer) as writer:
        for name in KEPT[1:] if waveform else KEPT:
            properties = {"unit_string": UNITS[name], **step}
            writer.write_segment([ChannelObject("bench", name, table[name] * OTHER[name], properties=properties)])
    return buffer.getvalue()


def _sheet(table: Columns) -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.title = "about"
    book.active["A1"] = "Bench"
    sheet = book.create_sheet("data")
    sheet.append(["measured on the bench"])
    sheet.append([])
    sheet.append([f"{name} [{UNITS[name]}]" for name in KEPT])
    for row in np.column_stack(list(scaled(table, **OTHER).values())):
        sheet.append(row.tolist())
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


STRUCT = {name: f"run.{name}" for name in KEPT}
CONTAINERS: dict[str, Dialect] = {
    "Parquet": Dialect(_parquet, ".parquet"),
    "NetCDF 4": Dialect(_netcdf, ".nc"),
    "NetCDF 3": Dialect(lambda t: _netcdf(t, "scipy"), ".nc"),
    "HDF5 in groups": Dialect(lambda t: _hdf5(t, _groups), ".h5"),
    "HDF5 of one compound": Dialect(lambda t: _hdf5(t, _compound), ".h5"),
    "MATLAB vectors": Dialect(lambda t: _matlab(t, dict), ".mat"),
    "MATLAB struct": Dialect(lambda t: _matlab(t, lambda t: {"run": dict(t), "fs": 500.0}), ".mat", STRUCT),
    "MATLAB timetable as a struct": Dialect(
        lambda t: _matlab(t, lambda t: {"T": {"Time": t["time"], "Variables": np.column_stack([t[n] for n in KEPT[1:]])}}),
        ".mat",
        {"time": "T.Time", **{name: f"T.Variables.{k}" for k, name in enumerate(KEPT[1:], start=1)}},
    ),
    "Simulink structure with time": Dialect(
        lambda t: _matlab(t, _simulink),
        ".mat",
        {name: f"log.signals.{k}.values" for k, name in enumerate(KEPT[1:], start=1)},
    ),
    "MATLAB units": Dialect(lambda t: _matlab(t, lambda t: {**scaled(t, **OTHER), "units": UNITS}), ".mat"),
    "MATLAB 7.3": Dialect(lambda t: _header73(_hdf5(t, _matlab73, 512)), ".mat"),
    "MDF 4": Dialect(_mdf, ".mf4"),
    "MDF 3": Dialect(lambda t: _mdf(t, "3.30"), ".mdf"),
    "MDF 4 in two groups": Dialect(lambda t: _mdf(t, groups=2), ".mf4"),
    "TDMS": Dialect(lambda t: _tdms(t, waveform=False), ".tdms"),
    "TDMS with increments": Dialect(lambda t: _tdms(t, waveform=True), ".tdms"),
    "xlsx": Dialect(_sheet, ".xlsx"),
    "a gzip of MATLAB": Dialect(lambda t: gzip.compress(_matlab(t, dict)), ".mat.gz"),
}
DIALECTS = TEXT | CONTAINERS

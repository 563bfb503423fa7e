"""Where results come from: one record in every JSON file, page and dataset, and pages that leave each other alone.

Truth: hashlib over the files that the command line names.
"""

import hashlib
import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from harness.actuators.read import read_actuator
from harness.cli import main
from harness.errors import HarnessError
from harness.provenance import PACKAGES, provenance
from harness.show.page import document, write_page

KEYS = ["command", "versions", "fmus", "actuator", "inputs", "machine", "time"]
LOG = "time,command,position\n" + "".join(f"{row / 500},{0.05 * row / 500},{0.05 * row / 500}\n" for row in range(200))


def _ema(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["ema", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def _sha256(path: Path | str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _of_page(path: Path) -> dict[str, Any]:
    held = re.search(r'<script type="application/json" id="provenance">(.*?)</script>', path.read_text())
    assert held
    found: dict[str, Any] = json.loads(held.group(1))
    return found


@pytest.mark.parametrize(
    "words, fmus_flown, page",
    [
        (("run", "--trial-file", "own.csv", "--fidelity", "ELF,ELF+", "--reference", "LF"), ("ELF", "LF"), "report.html"),
        (("replay", "own.csv", "--actuator", "mine.toml"), ("ELF",), "own_replayed.html"),
        (("columns", "own.csv"), (), ""),
        (("actuator", "show", "mine.toml"), ("HF", "ELF", "LF"), ""),
        (
            ("compare", "{fmus}/EMA_ELF.fmu", "--reference", "{fmus}/EMA_LF.fmu", "--trial-file", "own.csv"),
            ("ELF", "LF"),
            "",
        ),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) and value else "",
)
def test_json_and_page_say_where_they_come_from(
    words: tuple[str, ...],
    fmus_flown: tuple[str, ...],
    page: str,
    fmus: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.csv").write_text(LOG)
    Path("mine.toml").write_text('[parameters]\n"motor.R" = 1.1\n[provenance]\ndate = "2026-01-31"\n')
    folder = str(fmus["HF"].parent)
    given = [word.format(fmus=folder) for word in words]
    given += ["--fmus", folder] if words[0] in ("run", "replay", "actuator") else []
    assert _ema(monkeypatch, *given, "--json", "out.json") == 0
    found = json.loads(Path("out.json").read_text())["provenance"]
    assert found.pop("date", None) == ("2026-01-31" if words[0] == "actuator" else None)  # the actuator file's own
    assert list(found) == KEYS
    assert found["command"].split() == ["ema", *given, "--json", "out.json"]
    assert found["fmus"] == {f"{folder}/EMA_{name}.fmu": _sha256(fmus[name]) for name in fmus_flown}
    read = [name for name in ("own.csv", "mine.toml") if name in words]
    assert found["inputs"] == {name: _sha256(name) for name in read}
    if "mine.toml" in words:
        assert found["actuator"] == read_actuator("mine.toml").identity
    assert set(PACKAGES) < set(found["versions"]) and set(found["machine"]) == {
        "system",
        "architecture",
        "processor",
        "cores",
    }
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", found["time"])
    if page:
        assert _of_page(tmp_path / "results" / page) == found


def test_datasets_say_it_too(fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import xarray as xr

    pytest.importorskip("h5netcdf")
    monkeypatch.chdir(tmp_path)
    Path("own.csv").write_text("time,command\n0,0\n0.05,0.01\n")
    words = ["run", "--trial-file", "own.csv", "--fidelity", "LF", "--reference", "LF", "--fmus", str(fmus["LF"].parent)]
    assert _ema(monkeypatch, *words, "--format", "nc") == 0
    with xr.open_dataset("results/own_LF.nc", engine="h5netcdf") as run:
        assert json.loads(run.attrs["provenance"]) == _of_page(Path("results/report.html"))


def test_a_page_is_replaced_by_itself_alone(tmp_path: Path) -> None:
    own = tmp_path / "run.csv"
    own.write_text("a")
    first = provenance(command="ema identify run.csv", inputs=[own])
    path = tmp_path / "run_identified.html"
    assert write_page(path, document("one", "", first)) == path
    again = provenance(command="ema identify run.csv", inputs=[own])
    assert write_page(path, document("two", "", again)) == path and "<title>two</title>" in path.read_text()
    own.write_text("b")  # as from another folder: the same command on another file
    other = provenance(command="ema identify run.csv", inputs=[own])
    beside = write_page(path, document("three", "", other))
    assert beside == tmp_path / f"run_identified-{other.digest}.html" and "<title>two</title>" in path.read_text()
    assert write_page(path, document("four", "", other)) == beside
    foreign = tmp_path / "report.html"
    foreign.write_text("what somebody else has written")
    assert write_page(foreign, document("five", "", other)) != foreign
    assert foreign.read_text() == "what somebody else has written"


def test_a_folder_stands_for_its_files_and_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("1")
    (tmp_path / "deeper").mkdir()
    assert list(provenance(command="", inputs=[tmp_path]).inputs) == [str(tmp_path / "a.csv")]
    with pytest.raises(HarnessError, match=r"gone.csv: cannot be read: No such file"):
        provenance(command="", inputs=[tmp_path / "gone.csv"])


def test_a_name_cannot_end_the_record_in_the_page(tmp_path: Path) -> None:
    record = provenance(command="ema identify '</script><b>x.csv'")
    path = write_page(tmp_path / "x.html", document("x", "", record))
    assert _of_page(path)["command"] == record.command and "<b>x" not in path.read_text()

"""The command line: what it writes, and what bad input gets: one line on stderr, exit code 2, no traceback."""

import json
import re
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ema_fmu_src import ports
from harness.actuators.actuator import DEFAULT
from harness.cli import main
from harness.cli.options import beyond
from harness.trials import trial


def _ema(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *arguments: str) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["ema", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    told = capsys.readouterr()
    return int(end.value.code or 0), told.out, told.err


def _csv(folder: Path, text: str) -> str:
    path = folder / "own.csv"
    path.write_text(text)
    return str(path)


def test_run_writes_json_trajectories_and_page(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, json_file = tmp_path / "new" / "results", tmp_path / "elsewhere" / "out.json"
    folder = str(fmus["HF"].parent)
    arguments = ["run", "SIN", "--fidelity", "ELF,ELF+,LF", "--set", "fault.N_a=0.9"]
    code, told, _ = _ema(capsys, monkeypatch, *arguments, "--fmus", folder, "--out", str(out), "--json", str(json_file))
    assert code == 0
    assert "SIN" in told
    assert "report.html" in told

    written = json.loads(json_file.read_text())
    assert set(written) == {"actuator", "runs", "comparisons", "provenance"}
    assert {run["fidelity"] for run in written["runs"]} == {"HF", "ELF", "ELF+", "LF"}
    for run in written["runs"]:
        assert set(run) == {"trial", "fidelity", "wall_s", "simulated_s"}
        assert run["simulated_s"] == pytest.approx(2.5)
    keys = {"trial", "candidate", "reference", "variable", "unit", "nrmse", "max_abs", "t_max_abs"}
    assert all(set(item) == keys for item in written["comparisons"])
    assert {(item["candidate"], item["variable"]) for item in written["comparisons"]} == {
        (candidate, port.name) for candidate in ("ELF", "ELF+", "LF") for port in ports.OUTPUTS
    }

    files = {path.name for path in out.iterdir()}
    assert files == {"SIN_HF.csv", "SIN_ELF.csv", "SIN_ELFplus.csv", "SIN_LF.csv", "report.html"}
    table = np.genfromtxt(out / "SIN_LF.csv", delimiter=",", names=True)
    assert table.dtype.names is not None
    assert table.dtype.names == ("time", "command", *(port.name for port in ports.OUTPUTS))
    assert table["time"][-1] == pytest.approx(2.5)

    page = (out / "report.html").read_text()
    assert not re.search(r"<(script|link|img|iframe)[^>]*(src|href)=[\"']?(https?:)?//", page)
    assert page.count('"name":"ELF+"') >= 3
    assert "fault.N_a = 0.9" in page
    assert "--set fault.N_a=0.9" in page
    assert len(page) < 15e6


def test_own_trial_against_another_reference(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tmp_path / "<b>own.csv"
    own.write_text("time,command,supply_voltage\n1,0,48\n1.05,0.01,40\n")
    arguments = ["run", "--trial-file", str(own), "--fidelity", "ELF", "--reference", "LF"]
    code, _, _ = _ema(capsys, monkeypatch, *arguments, "--fmus", str(fmus["LF"].parent), "--out", str(tmp_path / "results"))
    assert code == 0
    assert {path.name for path in (tmp_path / "results").iterdir()} == {"<b>own_ELF.csv", "<b>own_LF.csv", "report.html"}
    assert "<b>own" not in (tmp_path / "results" / "report.html").read_text()


def test_missing_fmus_are_built(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    own = _csv(tmp_path, "time,command\n0,0\n0.01,0.01\n")
    arguments = ["run", "--trial-file", own, "--fidelity", "ELF", "--reference", "LF", "--fmus", str(tmp_path / "fmus")]
    code, told, _ = _ema(capsys, monkeypatch, *arguments, "--out", str(tmp_path / "results"))
    assert code == 0
    assert told.count("built ") == 2
    assert {path.name for path in (tmp_path / "fmus").iterdir()} == {"EMA_ELF.fmu", "EMA_LF.fmu"}


def test_build_of_one_fidelity(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    code, told, _ = _ema(capsys, monkeypatch, "build", "--fidelity", "LF", "--out", str(tmp_path))
    assert (code, told.strip()) == (0, f"built {tmp_path / 'EMA_LF.fmu'}")


def test_compare_lists_every_variable(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    own = _csv(tmp_path, "time,command\n0,0\n0.05,0.01\n")
    json_file = tmp_path / "out.json"
    arguments = ["compare", str(fmus["ELF"]), "--reference", str(fmus["HF"]), "--trial-file", own]
    code, told, _ = _ema(capsys, monkeypatch, *arguments, "--json", str(json_file))
    assert code == 0
    assert "EMA_ELF against EMA_HF" in told
    found = {item["variable"]: item for item in json.loads(json_file.read_text())["comparisons"]}
    assert set(found) == {port.name for port in ports.OUTPUTS}
    assert found["position"]["nrmse"] < 0.01


def test_ports_lists_every_variable(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    code, told, _ = _ema(capsys, monkeypatch, "ports", "--markdown")
    assert code == 0
    rows = told.strip().splitlines()
    assert len(rows) == 2 + len(ports.VARIABLES)
    assert all(f"| {port.name} |" in row for port, row in zip(ports.VARIABLES, rows[2:], strict=True))
    assert len({row.count("|") for row in rows}) == 1
    monkeypatch.delenv("COLUMNS", raising=False)  # as wide as the table is
    code, told, _ = _ema(capsys, monkeypatch, "ports")
    assert code == 0
    assert all(port.name in told for port in ports.VARIABLES)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "SIM"], "unknown trial 'SIM': did you mean SIN"),
        (["run", "--fidelity", "HF,EFL"], "unknown fidelity 'EFL': did you mean ELF"),
        (["run", "--reference", "HFF"], "unknown fidelity 'HFF': did you mean HF"),
        (["run", "--reference", "HF,LF"], "--reference HF,LF: one fidelity is needed"),
        (["run", "--set", "fault.Na=0.9"], "unknown parameter 'fault.Na': did you mean fault.N_a"),
        (["run", "--set", "fault.N_a=2"], "fault.N_a = 2 is out of range, 0.3 to 1"),
        (["run", "--set", "fault.N_a"], "NAME=VALUE is needed"),
        (["run", "--trial-file", "none.csv"], "none.csv: cannot be read: No such file"),
        (["build", "--fidelity", "MF"], "unknown fidelity 'MF'"),
        (["compare", "none.fmu", "--reference", "none.fmu"], "none.fmu: no such file"),
        (["compare", "a.fmu", "--reference", "b.fmu", "--tube", "2"], "--tube 2: a fraction"),
        (["compare", "a.fmu", "--reference", "b.fmu", "--trial", "SIM"], "did you mean SIN"),
    ],
)
def test_bad_arguments(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, told, error = _ema(capsys, monkeypatch, *arguments)
    assert code == 2
    assert message in error
    assert error.count("\n") == 1
    assert not told
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "text",
    [
        "",
        "time,demand\n0,0\n1,0\n",
        "time,command\n0,0\n1,high\n",
        "time,command\n0,0\n1,nan\n",
        "time,command\n0,0\n1,inf\n",
        "time,command\n0,0\n0,0\n",
        "time,command\n1,0\n0,0\n",
        "time,command\n0,0\n",
    ],
)
def test_bad_csv(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    code, _, error = _ema(capsys, monkeypatch, "run", "--trial-file", _csv(tmp_path, text))
    assert code == 2
    assert error.startswith("ema: ")
    assert "own.csv" in error
    assert error.count("\n") == 1


def test_bad_fmus(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "text.fmu").write_text("text")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme.txt", "")
    for name, message in (("text.fmu", "not a zip archive"), ("empty.fmu", "no modelDescription.xml")):
        code, _, error = _ema(capsys, monkeypatch, "compare", str(tmp_path / name), "--reference", str(fmus["LF"]))
        assert (code, error.count("\n")) == (2, 1)
        assert message in error


def test_destinations_are_checked_before_the_runs(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    common = ["run", "SIN", "--fidelity", "LF", "--fmus", str(fmus["LF"].parent)]
    for arguments in (
        ["--out", str(tmp_path / "file")],
        ["--out", str(tmp_path / "file" / "below")],
        ["--out", str(tmp_path / "out"), "--json", str(tmp_path)],
    ):
        code, told, error = _ema(capsys, monkeypatch, *common, *arguments)
        assert (code, told, error.count("\n")) == (2, "", 1)


def test_own_trial_may_not_hide_a_built_in_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sin.csv").write_text("time,command\n0,0\n1,0\n")
    code, _, error = _ema(capsys, monkeypatch, "run", "SIN", "--trial-file", str(tmp_path / "sin.csv"))
    assert code == 2
    assert "rename the file" in error


def test_interrupt_is_one_line_and_130(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import signal

    from harness.flight import master

    original, runs = master.run, []

    def interrupted(*positional: object, **named: object) -> object:
        runs.append(named)
        if len(runs) == 2:
            signal.raise_signal(signal.SIGINT)
        return original(*positional, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(master, "run", interrupted)
    arguments = ["run", "SIN", "SIN4", "--fidelity", "LF", "--reference", "LF", "--fmus", str(fmus["LF"].parent)]
    code, told, error = _ema(capsys, monkeypatch, *arguments, "--out", str(tmp_path / "out"))
    assert code == 130
    assert error.strip().splitlines()[-1].startswith("ema: interrupted")
    assert "Traceback" not in told + error
    assert f"stopped; what was computed is in {tmp_path / 'out' / 'SIN4_LF.partial.csv'}" in error
    whole, saved = sorted((tmp_path / "out").iterdir(), key=lambda path: "partial" in path.name)
    assert (whole.name, saved.name) == ("SIN_LF.csv", "SIN4_LF.partial.csv")
    assert len(whole.read_text().splitlines()) == 1 + 25001
    rows = saved.read_text().splitlines()
    assert rows[0].startswith("time,command,position") and len(rows) == 1 + 1 + master.POINTS_A_NOTICE


def test_a_command_beyond_the_end_stop_is_remarked() -> None:
    sine = trial("SIN")
    far = replace(sine, inputs={"command": np.linspace(0.0, 0.9, len(sine.time))})
    (line,) = beyond([far, sine], DEFAULT, {})
    assert line.startswith("SIN: the command goes to 0.9 rad, beyond the end stop at 0.6 rad")
    assert not beyond([far], DEFAULT, {"mechanics.end_stop": 1.0})

"""`ema check`: budgets kept and exceeded, a regression caught, FMUs that crash, hang or lie contained."""

import json
import shutil
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from bad import library, replace_library, shielded
from rebuild import rebuilt

from harness.budgets import read_budgets
from harness.cli import main
from harness.errors import HarnessError

ONE = '[SIN.LF]\nposition = 5e-4\n[SIN."ELF+"]\nposition = 5e-5\n'


def ema(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["ema", "check", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.fixture
def budgets(tmp_path: Path) -> str:
    path = tmp_path / "budgets.toml"
    path.write_text(ONE)
    return str(path)


@pytest.fixture
def folder(fmus: dict[str, Path], tmp_path: Path) -> Path:
    """A folder of FMUs that a test may change."""
    copies = tmp_path / "fmus"
    copies.mkdir()
    for path in fmus.values():
        shutil.copy(path, copies)
    return copies


def test_the_shipped_budgets_are_kept(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    junit, summary = tmp_path / "check.xml", tmp_path / "check.md"
    summary.write_text("before\n")
    files = ["--junit", str(junit), "--markdown", str(summary)]
    assert ema(monkeypatch, "--fmus", str(fmus["HF"].parent), *files) == 0
    count = sum(len(variables) for fidelities in read_budgets().values() for variables in fidelities.values())
    assert f"{count} of {count} budgets kept" in capsys.readouterr().out
    suite = ElementTree.parse(junit).getroot()
    assert (suite.get("tests"), suite.get("failures"), len(suite)) == (str(count), "0", count)
    assert summary.read_text().startswith("before\n") and f"All {count} budgets kept" in summary.read_text()
    assert not shielded()


def test_a_k_e_that_is_5_percent_wrong_is_caught(
    folder: Path, budgets: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """EMA_LF.fmu built from sources in which motor.K_e starts at 0.0525 V.s/rad."""
    sources = tmp_path / "sources"
    sources.mkdir()
    rebuilt(
        "LF", folder, sources, old='"motor.K_e", "V.s/rad", 0.05,', new='"motor.K_e", "V.s/rad", 0.0525,', runtime="native"
    )
    strict = tmp_path / "strict.toml"
    strict.write_text("[SIN.LF]\nposition = 5e-4\nequivalent_current_filtered = 0.005\n")
    assert ema(monkeypatch, "--fmus", str(folder), "--budgets", str(strict), "--junit", str(tmp_path / "c.xml")) == 1
    told = capsys.readouterr().out
    assert "SIN LF equivalent_current_filtered: " in told and "budget 0.5000 %" in told
    assert int(ElementTree.parse(tmp_path / "c.xml").getroot().get("failures") or 0) >= 1


def test_a_trial_of_ones_own_and_what_ci_reads(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Held to twice and to half of what it errs by: JSON and JUnit have the error, the budget and the run's time."""
    (tmp_path / "taxi.csv").write_text("time,command\n0,0\n0.1,0.02\n0.2,0.02\n")
    files, found = tmp_path / "b.toml", tmp_path / "c.json"
    for budget, code in ((1.0, 0), (1e-12, 1)):
        files.write_text(f'[trials]\ntaxi = "taxi.csv"\n[taxi.LF]\nposition = {budget}\nmotor_speed = 1\n')
        options = ("--fmus", str(folder), "--budgets", str(files), "--json", str(found), "--junit", str(tmp_path / "c.xml"))
        assert ema(monkeypatch, *options) == code
        position, speed = json.loads(found.read_text())["verdicts"]
        assert (position["trial"], position["budget"], speed["passed"]) == ("taxi", budget, True)
        assert position["passed"] == (code == 0) and 1e-12 < position["nrmse"] < 0.01 and position["wall_s"] > 0.0
    suite = ElementTree.parse(tmp_path / "c.xml").getroot()
    assert sum(float(case.get("time") or 0.0) for case in suite) == pytest.approx(position["wall_s"], abs=1e-5)
    values = {item.get("name"): float(item.get("value") or 0.0) for item in suite[0].iter("property")}
    assert values == pytest.approx({"nrmse": position["nrmse"], "budget": 1e-12}, rel=1e-5)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bad")


@pytest.mark.parametrize(
    "way, told",
    [
        ("CRASH", "crashed (SIGABRT)"),
        ("HANG", "has not finished within 10 s"),
        ("FATAL", "fmi2DoStep at 0.1 s returned fmi2Fatal"),
        ("NEGATIVE", "fmi2DoStep at 0.1 s returned status -7"),
        ("MISSING", "its library cannot be loaded"),
        ("LIE", "its position is no finite number at 0.1001 s"),
    ],
)
def test_an_fmu_that_misbehaves_is_reported_and_the_rest_goes_on(
    folder: Path,
    budgets: str,
    compiled: Path,
    way: str,
    told: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """EMA_LF.fmu with a library that crashes, hangs, gives up or lies; ELF+ is checked all the same."""
    replace_library(folder / "EMA_LF.fmu", library(compiled, *(["-DMISSING"] if way == "MISSING" else [])))
    monkeypatch.setenv("BAD", way)
    assert (
        ema(monkeypatch, "--fmus", str(folder), "--budgets", budgets, "--time-limit", "10" if way == "HANG" else "60") == 1
    )
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("SIN LF: ") and told in lines[0]
    assert lines[1] == "1 of 2 budgets kept"
    assert not shielded()


def test_stored_results_can_be_the_reference(
    fmus: dict[str, Path], budgets: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    everything = str(fmus["HF"].parent)
    monkeypatch.setattr(sys, "argv", ["ema", "run", "SIN", "--fidelity", "HF", "--fmus", everything, "--out", str(tmp_path)])
    with pytest.raises(SystemExit):
        main()
    page = tmp_path / "check.html"
    arguments = ["--fmus", everything, "--budgets", budgets, "--stored", str(tmp_path), "--page", str(page)]
    assert ema(monkeypatch, *arguments) == 0
    text = page.read_text()
    assert "All 2 errors with a budget are within it." in text and 'SIN_HF.csv <small title="SHA-256' in text
    assert ema(monkeypatch, "--fmus", everything, "--budgets", budgets, "--stored", str(tmp_path / "none")) == 2
    assert "no stored results of SIN" in capsys.readouterr().err


def test_a_reference_that_cannot_be_flown_is_exit_code_2(
    folder: Path, budgets: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "EMA_HF.fmu").write_bytes(b"no archive")
    assert ema(monkeypatch, "--fmus", str(folder), "--budgets", budgets) == 2
    assert "EMA_HF.fmu" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text, told",
    [
        ("", "no budgets"),
        ("[SIN", "is not TOML"),
        ("[SIM.LF]\nposition = 1", r"\[SIM\]: no such trial"),
        ("[SIN.MF]\nposition = 1", r"\[SIN.MF\]: no such fidelity"),
        ("[SIN.LF]\nangle = 1", r"\[SIN.LF\] angle: no such output"),
        ("[SIN.LF]\nposition = -1", "position = -1: a number from 0 on"),
        ("[SIN.LF]\nposition = true", "position = True: a number from 0 on"),
        ("SIN = 3", "SIN: a table of fidelities"),
        ('[trials]\nSIN = "a.csv"', "SIN: a trial of that name is built in"),
        ("[trials]\nmine = 3", "mine = 3: the path of a trial's file"),
        ('[trials]\nmine = "a.csv"', "no budgets"),
        ("[SIN]\nLF = 3", "LF: a table of variables"),
        ("[SIM.LF]\nangle = 1\n[SIN.MF]\nposition = 1", "SIM.*angle.*MF"),
    ],
)
def test_mistakes_in_budgets_are_all_named(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "b.toml"
    path.write_text(text)
    with pytest.raises(HarnessError, match=told):
        read_budgets(path)


def test_run_with_isolation_goes_on_without_the_one_that_crashes(
    folder: Path, compiled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_library(folder / "EMA_LF.fmu", library(compiled))
    monkeypatch.setenv("BAD", "CRASH")
    arguments = ["run", "SIN", "--fidelity", "LF,ELF", "--reference", "ELF+", "--isolate"]
    monkeypatch.setattr(sys, "argv", ["ema", *arguments, "--fmus", str(folder), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    told = capsys.readouterr().out
    assert "EMA_LF.fmu, trial SIN: crashed (SIGABRT)" in told
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"SIN_ELF.csv", "SIN_ELFplus.csv", "report.html"}
    assert not shielded()

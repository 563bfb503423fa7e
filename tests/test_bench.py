"""`ema bench` measures what it says; no test asserts a time."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from flight import Flight

from harness.bench import overhead, peers, speed
from harness.bench.peers import scipy_hf
from harness.bench.speed import REFERENCE, Check
from harness.cli import main


def test_one_run_gives_table_page_and_json(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a coarser reference than the real one, for the sake of time."""
    monkeypatch.setitem(speed.MODES, REFERENCE, ("HF", {"solver.event_located": 0.0, "solver.step": 1e-6}))
    arguments = ["bench", "LOAD-STEP", "--repeats", "1", "--no-peers", "--fmus", str(fmus["HF"].parent)]
    monkeypatch.setattr(sys, "argv", ["ema", *arguments, "--json", str(tmp_path / "b.json"), "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    found = json.loads((tmp_path / "b.json").read_text())
    assert [row["mode"] for row in found["rows"]] == list(speed.MODES)
    assert all(row["wall"] > 0.0 for row in found["rows"])
    errors = {row["mode"]: row["errors"] for row in found["rows"]}
    assert errors[REFERENCE] == {}
    assert errors["HF fixed 1e-6 s"]["position"] == 0.0  # here it is the reference
    assert 0.0 < errors["ELF+"]["position"] < errors["ELF"]["position"] < 1e-3
    assert all(check["met"] == (check["value"] >= check["limit"]) for check in found["checks"] if check["at_least"])
    assert all(item["identical"] for item in found["overhead"])
    page = (tmp_path / "bench.html").read_text()
    assert "LOAD-STEP" in page and "http://" not in page.split("</script>")[-1]
    assert "Limits that this project sets itself" in capsys.readouterr().out


def test_a_check_can_fail() -> None:
    assert Check("error", 0.1, 0.2).met and not Check("error", 0.3, 0.2).met
    assert Check("ratio", 50.0, 40.0, at_least=True).met and not Check("ratio", 30.0, 40.0, at_least=True).met


def test_the_master_and_fmpy_give_the_same_bits(fmus: dict[str, Path]) -> None:
    for fidelity in ("HF", "ELF", "ELF+", "LF"):
        found = overhead.measure(fmus["HF"].parent, fidelity, repeats=1)
        assert found.identical
        assert found.master > 0.0 and found.fmpy > found.master


def test_scipys_solution_of_hfs_equations_is_hfs() -> None:
    """Two independent codes: events of SciPy's RK45 against the kernel, 10 ms of a step, no dead time, ideal resolver."""
    states = scipy_hf.fly(lambda t: 0.1, 0.01)
    flown = Flight("HF", sensor__resolver_bits=0, inverter__dead_time=0.0).fly(lambda t: 0.1, n=100)
    for column, name in ((0, "motor_position"), (1, "motor_speed")):
        scale = np.max(np.abs(states[1:, column]))
        assert np.max(np.abs(states[1:, column] - flown[name])) < 3e-3 * scale


def test_peers_that_are_not_there_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    found = peers.measure()
    assert len(found) == len(peers.PEERS)
    assert all(peer.wall == 0.0 and "not installed" in peer.lacks for peer in found)


def test_bad_options(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["ema", "bench", "--repeats", "0"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "--repeats 0: at least 1 is needed" in capsys.readouterr().err

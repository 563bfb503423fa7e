"""`ema bench` measures what it says; no test asserts a time."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from flight import Flight

from harness.bench import cases, drive, evolution, overhead, peers, speed
from harness.bench.peers import scipy_hf
from harness.bench.speed import REFERENCE, Check
from harness.cli import main
from harness.faults import FAULTS
from harness.inference.starts import COMMON


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


def test_drives_are_flown_beside_each_other(fmus: dict[str, Path]) -> None:
    found = drive.measure(fmus["HF"].parent, ["SIN", "CHIRP"], repeats=1)
    assert [(item.trial, item.case) for item in found] == [("SIN", case) for case in drive.CASES]
    assert found[0].error is None and 0.0 < (found[1].error or 0.0) < drive.ALLOWED["SIN"] and found[2].error is not None
    assert all(item.ratio == pytest.approx(item.oriented / item.default) for item in found)
    checks = list(drive.checks(found))
    assert len(checks) == 4 and [check.limit for check in checks] == [0.67, 1.25, drive.ALLOWED["SIN"], 1.4]


@pytest.mark.long
def test_identification_is_judged_case_by_case(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two cases with faults and a healthy one; what is printed follows from the estimates in the JSON file."""
    words = ["bench", "identify", "--cases", "2", "--healthy", "1", "--evolution", "0", "--rate", "1000", "--seed", "2"]
    words += ["--fmus", str(fmus["HF"].parent), "--json", str(tmp_path / "b.json"), "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["ema", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    found = json.loads((tmp_path / "b.json").read_text())
    assert [(entry["case"]["number"], entry["monitor"]) for entry in found["cases"]] == [
        (number, monitor) for number in range(3) for monitor in ("ELF+", "LF")
    ]
    outside = []
    for entry in found["cases"]:
        truth = entry["case"]["truth"]
        assert {item["fault"] for item in entry["outcomes"] if item["present"]} == set(truth)
        for item in entry["outcomes"]:
            if item["fault"] != "phi":
                span = FAULTS[item["fault"]].span
                assert item["error"] == pytest.approx(abs(item["value"] - item["truth"]) / span)
                assert item["truth"] == truth.get(item["fault"], FAULTS[item["fault"]].healthy)
            if item["identifiable"] and (item["fault"] == "phi" or not FAULTS[item["fault"]].rare):
                assert item["error"] < 0.05  # the 95th percentile that is asked over many
                outside += [] if item["covered"] else [item]
        assert entry["explained"] and not any(item["false_alarm"] for item in entry["outcomes"])
    assert len(outside) <= 3  # of some 50 intervals of 95 %
    judged = {check["what"]: check["value"] for check in found["checks"]}
    of_friction = [
        item["error"] for entry in found["cases"][::2] for item in entry["outcomes"] if item["fault"] == "friction"
    ]
    assert judged["friction, all runs: median error, % of its range"] == pytest.approx(100.0 * np.median(of_friction))
    assert "Limits that this project sets itself" in capsys.readouterr().out
    assert "Identification, measured" in (tmp_path / "bench_identify.html").read_text()


def test_cases_cover_single_and_combined_faults_within_their_ranges() -> None:
    drawn = cases.cases(60, 20, 1)
    assert drawn == cases.cases(60, 20, 1) != cases.cases(60, 20, 2)
    assert [len(case.truth) for case in drawn[60:]] == [0] * 20
    kinds = [{FAULTS[name].kind for name in case.truth if name in FAULTS} for case in drawn[:60]]
    assert all(len(found) == 1 for found in kinds[::2]) and all(len(found) in (2, 3) for found in kinds[1::2])
    assert set().union(*kinds[::2]) == set(cases.COMMON_KINDS) == {"friction", "backlash", "N", "zeta", "gain"}
    for case in drawn:
        assert ("zeta" in case.truth) == ("phi" in case.truth)
        for name, value in case.truth.items():
            low, high = FAULTS[name].studied if name in FAULTS else (-np.pi, np.pi)
            assert low <= value <= high


def test_evolution_that_is_given_up_says_so(fmus: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evolution, "GENERATIONS", 1)
    monkeypatch.setattr(evolution, "POPULATION", 1)
    found = evolution.evolve(cases.cases(1, 0, 1)[0], fmus["HF"].parent, 1000.0, {})
    assert not found.reached
    assert found.evaluations == 2 * len(COMMON)  # the first population and a generation
    assert found.error > found.least_squares_error


def test_a_check_can_fail() -> None:
    assert Check("error", 0.1, 0.2).met and not Check("error", 0.3, 0.2).met
    assert Check("ratio", 50.0, 40.0, at_least=True).met and not Check("ratio", 30.0, 40.0, at_least=True).met


def test_the_master_and_fmpy_give_the_same_bits(fmus: dict[str, Path]) -> None:
    for fidelity in ("HF", "ELF", "ELF+", "LF"):
        found = overhead.measure(fmus["HF"].parent, fidelity, repeats=1)
        assert found.identical
        assert found.master > 0.0 and found.fmpy > found.master


@pytest.mark.long
def test_scipys_solution_of_hfs_equations_is_hfs() -> None:
    """Two independent codes: events of SciPy's RK45 against the kernel, 10 ms of a step, no dead time, ideal resolver."""
    states = scipy_hf.fly(lambda t: 0.1, 0.01)
    flown = Flight("HF", {"sensor.resolver_bits": 0, "inverter.dead_time": 0.0}).fly(lambda t: 0.1, n=100)
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

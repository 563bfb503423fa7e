"""`ema bench identify --actuators`: cases that can be done alone, a folder of several sittings, and figures from it."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness.actuators.actuator import DEFAULT
from harness.bench import hidden, jobs, table
from harness.bench.effects import EFFECTS
from harness.bench.identify import Outcome
from harness.bench.jobs import Found, Job
from harness.bench.kept import Kept
from harness.cli import main
from harness.errors import HarnessError
from harness.faults import FAULTS
from harness.inference.measured import CURRENT


def _ema(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    """The exit code of a command."""
    monkeypatch.setattr(sys, "argv", ["ema", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_a_handful_of_cases_is_done_kept_and_shown(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A random actuator, calibrated and then diagnosed healthy and with a fault; a single fault with exact parameters."""
    folder, keep = fmus["HF"].parent, tmp_path / "kept"
    kept = Kept.opened(keep, 1, 500.0, folder)
    wanted = ("actuator-000-healthy", "actuator-000-single", "exact-gain-000")
    listed = [job for job in jobs.jobs(1, 1, 1) if job.name in wanted]
    done: list[int] = []
    jobs.run(listed, kept, folder, workers=0, on_case=lambda: done.append(1))
    assert len(done) == 1 + len(wanted) and jobs.missing(listed, kept) == ([], [])
    jobs.run(listed, kept, folder, workers=1, on_case=lambda: pytest.fail("what is there is not done again"))
    found = {item["job"]["name"]: Found.from_dict(item) for item in kept.all()}
    assert set(found) == set(wanted) and all(item.right and item.seconds > 0.0 for item in found.values())
    assert json.loads(json.dumps(found["exact-gain-000"].as_dict())) == json.loads(
        (keep / "cases" / "exact-gain-000.json").read_text()
    )
    (gain,) = table.present(found.values(), "gain")
    assert 0.0 < (found["exact-gain-000"].bound or 0.0) and gain.error < 6.0 * (found["exact-gain-000"].bound or 0.0)
    truth, sigma = hidden.hidden(0, 1), hidden.known(kept.calibration(0))
    for name in ("mechanics.C", "mechanics.T_coulomb"):
        width = sigma.tolerances[name]
        assert width < hidden.data_sheet().tolerances[name]
        assert abs(sigma.value(name) - truth[name]) < 2.0 * width

    words = ["bench", "identify", "--actuators", 0, "--exact", 0, "--part", "exact", "--rate", 500, "--keep", keep]
    words += ["--fmus", folder]
    assert _ema(monkeypatch, *words, "--json", tmp_path / "b.json", "--out", tmp_path) == 0
    content = json.loads((tmp_path / "b.json").read_text())
    judged = {check["what"]: check for check in content["checks"]}
    assert judged["healthy, calibrated: false alarms in 1 runs, %"]["met"]
    assert judged["gain, exact: median error / that at Cramer and Rao's bound"]["value"] == pytest.approx(
        gain.error / (table.MEDIAN * (found["exact-gain-000"].bound or 0.0))
    )
    assert len(content["cases"]) == 3 and len(content["calibrations"]) == 1
    assert "Limits that this project sets itself" in capsys.readouterr().out
    page = (tmp_path / "bench_actuators.html").read_text()
    assert "Coverage" in page and "Error against distance" in page and "Alarms" in page
    assert _ema(monkeypatch, *words, "--seed", 2) == 2
    assert "holds cases with another seed" in capsys.readouterr().err


def test_bad_words_are_told(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    for words, line in (
        (["--keep", "kept"], "need --actuators"),
        (["--actuators", 1, "--actuator", "small-24V"], "cannot be given too"),
        (["--actuators", 1, "--part", "rara"], "rara"),
        (["--actuators", -1], "of 0 or more"),
    ):
        assert _ema(monkeypatch, "bench", "identify", *words) == 2
        assert line in capsys.readouterr().err


def test_jobs_are_the_same_whatever_else_is_asked() -> None:
    every = {job.name: job for job in jobs.jobs(3, 4, 1)}
    assert len(every) == 2 * len(EFFECTS) + len(jobs.RARE) + 4 * 5 + 4 * 3
    assert all(every[job.name] == job for job in jobs.jobs(1, 1, 1))
    assert all(job.part == "rare" for job in jobs.jobs(3, 4, 1, ["rare"]))
    assert len({job.case.seed for job in every.values()}) == len(every)
    assert jobs.jobs(3, 0, 2, ["actuators"]) != jobs.jobs(3, 0, 1, ["actuators"])
    for job in every.values():
        assert job.waits == (job.part == "actuators" and "sheet" not in job.name)
        if job.part in ("actuators", "exact"):
            assert len(job.faults) == {"single": 1, "double": 2}.get(job.name.rpartition("-")[2], int(job.part == "exact"))
            for name in job.faults:
                lost = 1.0 - FAULTS[name].health(job.case.truth[name])
                assert 0.1 <= lost <= 0.6 and not FAULTS[name].rare


def test_hidden_parameters_are_drawn_to_their_tolerances() -> None:
    drawn = [hidden.hidden(number, 1) for number in range(500)]
    assert drawn[7] == hidden.hidden(7, 1) != hidden.hidden(7, 2)
    for name, sigma in hidden.SIGMAS.items():
        off = np.array([own[name] / DEFAULT.value(name) - 1.0 for own in drawn]) / sigma
        assert abs(off.mean()) < 0.2 and 0.9 < off.std() < 1.1 and np.abs(off).max() <= hidden.MOST + 1e-9
    assert np.sqrt(np.mean([hidden.distance(own) ** 2 for own in drawn])) == pytest.approx(1.0, abs=0.05)
    with pytest.raises(HarnessError, match="its calibration: no"):
        hidden.known({"error": "no"})


def test_effects_act_on_what_they_name() -> None:
    time = np.arange(1000) / 1000.0
    clean = {name: np.sin(6.0 * time) for name in ("command", "position", "motor_speed", CURRENT)}
    for name, effect in EFFECTS.items():
        seen = effect.logged({"time": time, **clean}, np.random.default_rng(1))
        changed = {channel for channel in clean if not np.array_equal(seen[channel], clean[channel])}
        assert bool(changed) != bool(effect.load)
        assert ("command" in changed) == (name.startswith("command") or name.startswith("jitter"))
        assert all(
            word not in name or channel in changed for word, channel in (("current", CURRENT), ("position", "position"))
        )
    early = EFFECTS["command logged 1 ms early"].logged({"time": time, **clean}, np.random.default_rng(1))
    assert early["command"][:-1] == pytest.approx(clean["command"][1:])


def _found(truth: dict[str, float], alarms: tuple[str, ...], **changes: object) -> Found:
    """What might be found in a job of a rare fault or of an actuator."""
    part = str(changes.pop("part", "rare"))
    job = Job("name", part, jobs.Case(0, "CHIRP", truth, 1), known=jobs.CALIBRATED if part == "actuators" else jobs.EXACT)
    return replace(Found(job, True, "", alarms), **changes)  # type: ignore[arg-type]


def test_a_rare_fault_is_told_right_or_in_a_group_that_holds_it() -> None:
    jam = {"jam": 0.03}
    assert table.told(_found(jam, ("jam",))) == "right"
    assert table.told(_found(jam, ("friction",), alternatives=(("jam",),))) == "in a group"
    assert table.told(_found(jam, ("friction",), groups=(("jam", "friction"),))) == "in a group"
    assert table.told(_found(jam, ("friction",))) == table.told(_found(jam, ())) == "wrong"
    assert table.told(_found(jam, (), alternatives=(("jam",),))) == "wrong"
    assert table.told(_found(jam, ("jam",), explained=False)) == "wrong"
    open_ = Outcome(0, "CHIRP", "ELF+", "jam", 0.03, True, 0.0, 0.3, False, True, False, False, False)
    assert table.told(_found(jam, (), groups=(("jam",),), outcomes=(open_,))) == "in a group"


def test_confusion_sets_what_is_missed_against_what_is_told_in_its_place() -> None:
    found = [
        _found({"N_a": 0.8, "gain": 0.8}, ("N_b", "gain"), part="actuators"),
        _found({"N_a": 0.8}, (), part="actuators"),
        _found({}, ("friction",), part="actuators"),
        _found({}, (), part="actuators"),
        _found({"zeta": 0.1, "phi": 1.0}, (), part="actuators", explained=False),
    ]
    counts = table.confusion(found)
    nothing = table.NOTHING
    assert counts == {
        ("gain", "gain"): 1,
        ("N_a", "N_b"): 1,
        ("N_a", nothing): 1,
        (nothing, "friction"): 1,
        (nothing, nothing): 1,
        ("zeta", table.UNEXPLAINED): 1,
    }
    assert table.labels(counts)[0] == [nothing, "N_a", "zeta", "gain"]
    judged = {check.what: check for check in table.checks(found, [])}
    assert judged["healthy, calibrated: false alarms in 2 runs, %"].value == 50.0
    assert judged["single and double faults, calibrated: exactly the true alarms in 3 runs, %"].value == 0.0
    assert not any(math.isnan(check.value) for check in judged.values())

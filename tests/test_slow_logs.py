"""Faults identified from logs as drives write them: slow rows, counts, shifted columns, no speed. HF is the plant."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import slow

from harness.actuators.actuator import Output
from harness.errors import HarnessError
from harness.fidelity import FIDELITIES
from harness.identification.diagnosis import Diagnosis, identify
from harness.inference import coordinates
from harness.inference.flights import Flights
from harness.inference.gap import update_gap
from harness.inference.measured import measured_from_log
from harness.inference.prior import Prior
from harness.inference.problem import Problem
from harness.inference.run import Run
from harness.logs.log import Between, Log, Logger
from harness.logs.noise import error_of, quantum_of
from harness.logs.observer import Observer
from harness.logs.read import read_log
from harness.logs.start import resting, start_of
from harness.logs.stimulus import trials_of

TRUTH = {"N_a": 0.8, "friction": 2.5}


@pytest.fixture(scope="module")
def log(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = slow.write(tmp_path_factory.mktemp("logs") / "drive.txt", slow.plant(fmus["HF"], TRUTH))
    return read_log(path, slow.COLUMNS, Output(slow.LEAD), slow.ACTUATOR)[0]


@pytest.fixture(scope="module")
def found(log: Log, fmus: dict[str, Path]) -> Diagnosis:
    run = measured_from_log(log, slow.ACTUATOR)
    return identify(run, fmus=fmus["HF"].parent, fidelity=FIDELITIES["ELF+"], parameters=slow.ACTUATOR)


def test_faults_of_a_drives_log_are_found_and_only_those_are_alarmed(found):
    assert not found.complaints
    assert {item.fault for item in found.estimates if item.alarm} == set(TRUTH)
    for name, value in TRUTH.items():
        item = found.estimate(name)
        assert item.full[0] <= value <= item.full[1] and item.value == pytest.approx(value, rel=0.08)
    assert found.estimate("gain").identifiable and found.estimate("gain").low <= 1.0 <= found.estimate("gain").high


def test_shifts_in_time_are_nuisances_with_their_deviation(found):
    for port, shift in slow.SHIFTS.items():
        name = "position" if port == "motor_position" else port  # as it is shown, on the user's side
        item = found.as_dict()["nuisances"][f"shift.{name}"]
        assert item["unit"] == "s" and item["value"] == pytest.approx(shift, abs=max(3.0 * item["sigma"], 2e-4))
        assert 0.0 < item["sigma"] < 1e-3


def test_what_is_open_is_said(found, log):
    assert any("measured on the motor" in line for line in found.remarks)
    blind = {"motor_position": log.channels["motor_position"]}
    assert any("no current" in line for line in measured_from_log(replace(log, channels=blind), slow.ACTUATOR).remarks)


def test_a_log_without_a_position_is_refused(log):
    with pytest.raises(HarnessError, match="no position"):
        measured_from_log(replace(log, channels={"equivalent_current": log.channels["equivalent_current"]}), slow.ACTUATOR)


def test_counts_are_seen_as_such_and_floats_are_not():
    """0.0196 mm a count, written to 0.01 mm, as a Hall sensor's travel is; its error is a step over the root of 12."""
    travel = 5.0 * np.sin(np.linspace(0.0, 40.0, 1000))
    counted = np.round(0.0196 * np.rint(travel / 0.0196), 2)
    assert quantum_of(np.r_[counted, counted]) == pytest.approx(0.02, rel=0.05)
    assert error_of(0.2 * np.rint(travel / 0.2)) >= 0.2 / np.sqrt(12.0)
    assert quantum_of(travel) == quantum_of(travel + 0.01 * np.random.default_rng(0).standard_normal(1000)) == 0.0


def test_counts_are_seen_whatever_their_last_digits():
    counts = np.rint(20.0 * np.sin(np.linspace(0.0, 9.0, 500)))
    noise = 1e-12 * np.random.default_rng(0).standard_normal(counts.size)
    assert quantum_of(counts + noise) == pytest.approx(quantum_of(counts)) == pytest.approx(1.0)


def test_what_hf_moves_does_not_hang_on_last_digits(log, fmus):
    """HF is chaotic in rounding: 1e-12 of a fault make another ripple, and no other difference from ELF+."""
    folder, run = fmus["HF"].parent, measured_from_log(log, slow.ACTUATOR)
    current = list(run.channels).index("equivalent_current")
    raw, smooth = [], []
    with (
        Flights(folder, FIDELITIES["ELF+"], run, slow.ACTUATOR) as model,
        Flights(folder, FIDELITIES["HF"], run, slow.ACTUATOR) as judge,
    ):
        problem = Problem([Run(model, judge)], Prior())
        for friction in (1.0, 1.0 + 1e-12):
            u = problem.start.copy()
            u[problem.unknowns.faults] = coordinates.from_values({"friction": friction})
            raw.append(run.observer.rows(judge.fly(problem.setting(u, 0)), np.zeros(len(run.channels)))[:, current])
            update_gap(problem, u, 0)
            smooth.append(problem.runs[0].gap[:, current])
    assert np.std(smooth[1] - smooth[0]) < 0.1 * np.std(raw[1] - raw[0])


def drive(between: Between | None, command: np.ndarray, rate: float = 100.0, **channels: np.ndarray) -> Log:
    time = np.arange(command.size) / rate
    return Log("run", Path("run.txt"), time, {"command": command}, channels or {"position": command}, between)


def test_the_command_is_held_ramped_or_smooth_between_rows():
    command = np.sin(2.0 * np.pi * np.arange(60) / 25.0)
    trials = trials_of(drive(None, command, 25.0))
    assert list(trials) == list(Between)
    exact = np.sin(2.0 * np.pi * trials[Between.SMOOTH].time)
    error = {how: float(np.max(np.abs(trial.inputs["command"] - exact))) for how, trial in trials.items()}
    assert error[Between.SMOOTH] < 0.5 * error[Between.RAMPED] and error[Between.RAMPED] < 0.1 * error[Between.HELD]
    assert trials[Between.HELD].continuous == frozenset() and "command" in trials[Between.RAMPED].continuous


def test_a_square_wave_makes_one_trial():
    assert list(trials_of(drive(None, np.repeat([0.0, 1.0, -1.0, 1.0], 50)))) == [Between.HELD]


def test_rows_are_taken_as_the_logger_does():
    """A ramp of 1/s: sampled it is t, averaged since the row before t - h/2, through a low-pass t - tau once settled."""
    time = np.arange(0.1, 1.0, 0.01)
    loggers = (Logger(), Logger("averaged"), Logger("filtered", 0.005))
    seen = Observer(time, 0.0, 1e-4, loggers)
    ramp = np.repeat(np.arange(0.0, 1.1, 1e-4)[:, None], 3, axis=1)
    rows = seen.rows(ramp, np.array([0.0, 0.0, 0.0])) - time[:, None]
    assert rows == pytest.approx(np.array([[0.0, -0.005, -0.005]] * len(time)), abs=1.1e-4)
    assert seen.slopes(ramp, np.full(3, 1.7e-3)) == pytest.approx(1.0, abs=1e-6)
    late = seen.rows(ramp**2, np.array([3e-3, 4e-3, 5e-3]))
    assert seen.aligned(ramp**2, late, np.ones(late.shape, dtype=bool), np.full(3, 0.01)) == pytest.approx(
        [3e-3, 4e-3, 5e-3], abs=1e-5
    )


def test_rest_and_start_are_seen_without_a_speed():
    rng = np.random.default_rng(3)
    command = np.r_[np.zeros(20), np.full(80, 0.1)]
    time = np.arange(100) / 100.0
    position = np.where(time < 0.2, 0.0, 0.1 * (1.0 - np.exp(-(time - 0.2) / 0.025))) + 1e-4 * rng.standard_normal(100)
    log = drive(None, command, position=position)
    stuck = resting(log, {})
    assert stuck[2:17].all() and not stuck[21:27].any() and stuck[50:98].mean() > 0.9
    assert start_of(log, {}).initial == {} and not start_of(log, {}).moving
    moving = drive(None, 0.1 * np.sin(6.28 * time), position=0.1 * np.sin(6.28 * (time - 0.025)))
    assert start_of(moving, {}).moving and start_of(moving, {}).initial["initial.motor_speed"] == pytest.approx(
        126.0, rel=0.05
    )
    assert not resting(moving, {}).any()


def test_a_gap_in_which_the_command_moves_is_refused(log):
    rows = np.r_[0:100, 120:400]
    cut = replace(
        log,
        time=log.time[rows],
        inputs={name: series[rows] for name, series in log.inputs.items()},
        channels={name: series[rows] for name, series in log.channels.items()},
    )
    with pytest.raises(HarnessError, match="in which the command moves"):
        measured_from_log(cut, slow.ACTUATOR)


def test_a_shift_at_its_bound_is_not_explained_by_faults(log, fmus):
    """Rows of all channels 20 ms late: more than a shift may be, and nothing is alarmed for it."""
    late = {name: np.r_[np.full(2, series[0]), series[:-2]] for name, series in log.channels.items()}
    run = measured_from_log(replace(log, channels=late), slow.ACTUATOR)
    found = identify(run, fmus=fmus["HF"].parent, fidelity=FIDELITIES["ELF+"], parameters=slow.ACTUATOR)
    assert any("shifted in time" in line for line in found.complaints) and not any(item.alarm for item in found.estimates)

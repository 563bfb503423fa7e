"""Faults identified from measured runs: HF is the plant, its faults are the truth."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from plant import NOISE, PHASES, as_run, columns, write
from typer.testing import CliRunner

from ema_fmu_src import ports
from harness.cli import app
from harness.errors import HarnessError
from harness.faults import ESTIMATED, FAULTS
from harness.fidelity import FIDELITIES
from harness.identification.diagnosis import Diagnosis, identify
from harness.inference import coordinates
from harness.inference.measured import measured, read_measured
from harness.logs.noise import noise_of
from harness.logs.stimulus import jumps_of
from harness.trials import BUILT_IN, trial

CASES = {
    "healthy": ("SIN", {}),
    "friction": ("CHIRP", {"friction": 2.2}),
    "backlash": ("SIN", {"backlash": 40.0}),
    "short": ("CHIRP", {"N_b": 0.85}),
    "eccentricity": ("SIN", {"zeta": 0.08, "phi": 2.0}),
    "gain": ("STEP-RAMP", {"gain": 0.75}),
    "combined": ("CHIRP", {"friction": 1.6, "N_a": 0.9, "backlash": 20.0, "gain": 1.2}),
}


@pytest.fixture(scope="module")
def folder(fmus: dict[str, Path]) -> Path:
    return fmus["HF"].parent


def diagnose(folder: Path, table: dict[str, np.ndarray], fidelity: str = "ELF+", **options: object) -> Diagnosis:
    return identify(as_run(table), fmus=folder, fidelity=FIDELITIES[fidelity], **options)


@pytest.mark.parametrize("fidelity", ["ELF+", "LF"])
@pytest.mark.parametrize("case", CASES)
def test_known_faults_are_found_and_only_those_are_alarmed(case, fidelity, folder, fmus):
    trial, truth = CASES[case]
    found = diagnose(folder, columns(fmus["HF"], trial, truth), fidelity)
    assert not found.complaints
    alarms = {item.fault for item in found.estimates if item.alarm}
    assert alarms == {name for name in truth if name != "phi"}
    for name, value in truth.items():
        item = found.estimate(name)
        assert (item.identifiable and item.low <= value <= item.high) or fidelity == "LF"
        assert abs(item.value - value) < (0.25 if name == "phi" else 0.05 * FAULTS[name].span)
    assert ("healthy" in found.verdict) == (not truth)


def test_hf_as_the_model_has_no_gap_to_itself(folder, fmus):
    """By way of ELF+, in seconds; without noise what is left is the ripple of two chaotic runs."""
    table = columns(fmus["HF"], "CHIRP", {"friction": 1.5, "N_a": 0.85}, rate=10000.0, noisy=False)
    found = {fidelity: diagnose(folder, table, fidelity) for fidelity in ("HF", "ELF+")}
    off = {fidelity: abs(item.estimate("N_a").value - 0.85) for fidelity, item in found.items()}
    assert max(off.values()) < 1e-3 and found["HF"].evaluations < 1000
    assert {item.fault for item in found["HF"].estimates if item.alarm} == {"friction", "N_a"}
    for name, value in (("friction", 1.5), ("N_a", 0.85), ("backlash", 1.0), ("N_b", 1.0), ("gain", 1.0)):
        item = found["HF"].estimate(name)
        assert item.low - 1e-9 <= value <= item.high + 1e-9


def test_health_is_one_when_healthy_and_zero_at_the_limit_that_the_user_sets(folder, fmus):
    table = columns(fmus["HF"], "SIN", {"friction": 2.0})
    assert diagnose(folder, table).estimate("friction").health == pytest.approx(0.5, abs=0.02)
    assert diagnose(folder, table, limits={"friction": 1.5}).health == 0.0
    assert FAULTS["gain"].health(1.5) == FAULTS["gain"].health(0.5) == 0.0 and FAULTS["zeta"].health(0.0) == 1.0


def test_phi_is_not_identifiable_without_eccentricity(folder, fmus):
    found = diagnose(folder, columns(fmus["HF"], "SIN", {}))
    assert not found.estimate("phi").identifiable and "cannot be told from 0" in found.estimate("phi").reason


def test_a_saturated_run_says_less_of_backlash_than_a_slow_one(folder, fmus):
    width = {}
    for name in ("SIN4", "SIN"):
        item = diagnose(folder, columns(fmus["HF"], name, {})).estimate("backlash")
        width[name] = item.high - item.low
    assert width["SIN4"] > 3.0 * width["SIN"]


def test_a_fault_of_a_slow_run_is_known_as_far_as_it_is_the_only_one(folder, fmus):
    """STEP-RAMP turns the rotor slowly: if any other fault may be there too, the size of a short is open."""
    table = columns(fmus["HF"], "STEP-RAMP", {"N_a": 0.7}, rate=1000.0)
    item = diagnose(folder, table).estimate("N_a")
    assert item.alarm and item.low <= 0.7 <= item.high and item.full[0] <= 0.7 <= item.full[1]
    assert item.full[1] - item.full[0] > 5.0 * (item.high - item.low)
    healthy = diagnose(folder, columns(fmus["HF"], "STEP-RAMP", {}, rate=500.0))
    assert any(not item.identifiable for item in healthy.estimates) and not any(item.alarm for item in healthy.estimates)


def test_rest_carries_no_weight(fmus):
    run = as_run(columns(fmus["HF"], "STEP-RAMP", {"friction": 2.0}))
    held = (run.time > 0.6) & (run.time < 1.2)
    moving = run.time > 1.5
    assert not run.informative[held].any() and run.informative[moving].mean() > 0.95


@pytest.mark.long
def test_intervals_cover_the_truth_over_many_noises(folder, fmus):
    """Eight noises on one run: 95 % intervals of friction and N_a hold it in 6 or more (binomial: 1 % chance of less)."""
    inside = {"friction": 0, "N_a": 0}
    clean = columns(fmus["HF"], "CHIRP", {"friction": 1.5, "N_a": 0.9}, rate=500.0, noisy=False)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        table = {name: series + NOISE.get(name, 0.0) * np.ptp(series) * rng.standard_normal(series.size)
                 for name, series in clean.items()}  # fmt: skip
        found = diagnose(folder, table)
        for name, truth in (("friction", 1.5), ("N_a", 0.9)):
            item = found.estimate(name)
            inside[name] += item.low <= truth <= item.high
    assert min(inside.values()) >= 6


def test_where_stick_and_slip_stall_a_search_others_go_on(folder, fmus):
    """A valley of friction and gain, bent by when the shaft sticks in its backlash: least squares alone end 0.3 % off or
    more, and ELF+'s own difference from HF hides where in it the truth lies; within 6 % of it, that is."""
    truth = {"friction": 2.7, "backlash": 71.0, "gain": 1.465}
    found = diagnose(folder, columns(fmus["HF"], "STEP-RAMP", truth, rate=500.0))
    assert not found.complaints
    assert found.estimate("gain").alarm and found.estimate("gain").value == pytest.approx(1.465, abs=0.05)
    for name, value in truth.items():
        assert found.estimate(name).value == pytest.approx(value, rel=0.06)
    assert {item.fault for item in found.estimates if item.alarm} == set(truth)


def test_phase_currents_do_instead_of_the_filtered_one(folder, fmus):
    table = columns(fmus["HF"], "SIN", {"N_b": 0.8}, rate=10000.0)
    run = as_run(table, ("position", "motor_speed", *PHASES))
    found = identify(run, fmus=folder, fidelity=FIDELITIES["ELF+"])
    assert not found.complaints and found.estimate("N_b").value == pytest.approx(0.8, abs=0.03)


@pytest.mark.parametrize("noisy", [True, False])
@pytest.mark.parametrize("name", BUILT_IN)
def test_a_run_from_rest_is_seen_as_such(name, noisy, fmus):
    run = as_run(columns(fmus["HF"], name, {}, noisy=noisy))
    assert run.initial.get("initial.motor_speed", 0.0) == 0.0 and run.informative[run.time < 0.2].any()


def test_a_run_that_begins_in_motion(folder, fmus):
    table = columns(fmus["HF"], "SIN", {"friction": 1.8})
    cut = {name: series[900:] for name, series in table.items()}
    found = diagnose(folder, cut)
    assert not found.complaints and found.estimate("friction").value == pytest.approx(1.8, abs=0.03)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda t: t | {"position": np.degrees(t["position"])}, "degrees instead of rad"),
        (lambda t: t | {"motor_speed": t["motor_speed"] * 30.0 / math.pi}, "rpm instead of rad/s"),
        (lambda t: t | {"equivalent_current_filtered": -t["equivalent_current_filtered"]}, "the other sign"),
        (lambda t: t | {"equivalent_current_filtered": t["motor_speed"] + 1.0}, "it looks like motor_speed"),
        (lambda t: t | {name: np.degrees(t[name]) for name in ("command", "position")}, "beyond the end stops at 0.6 rad"),
        (
            lambda t: t | {"motor_speed": t["equivalent_current_filtered"], "equivalent_current_filtered": t["motor_speed"]},
            "columns interchanged",
        ),
    ],
    ids=["degrees", "rpm", "sign", "wrong column", "command in degrees too", "interchanged"],
)
def test_what_cannot_be_explained_is_said_to_be_so(change, message, folder, fmus):
    found = diagnose(folder, change(columns(fmus["HF"], "SIN", {}, rate=500.0)))
    assert found.complaints and message in found.verdict and found.health is None
    assert not any(item.alarm for item in found.estimates)


def test_a_shaft_that_starts_at_once_begins_where_it_was(folder, fmus):
    """LOAD-STEP's command has jumped before its first row, and its friction is that of a healthy one."""
    table = columns(fmus["HF"], "LOAD-STEP", {})
    own = trial("LOAD-STEP")
    inputs = {"command": table["command"], "load_torque": np.interp(table["time"], own.time, own.inputs["load_torque"])}
    run = measured("run", table["time"], inputs, {name: table[name] for name in NOISE}, {})
    assert run.initial.get("initial.position", 0.0) == pytest.approx(0.0, abs=2e-4)
    found = identify(run, fmus=folder, fidelity=FIDELITIES["ELF+"])
    assert not found.complaints and not any(item.alarm for item in found.estimates), found.verdict


def test_a_load_that_nobody_logged_is_no_fault(folder, fmus):
    found = diagnose(folder, columns(fmus["HF"], "SIN", {}, {"load_torque": 3.0}, rate=500.0))
    assert not found.complaints and not any(item.alarm for item in found.estimates)
    assert found.nuisances["load_torque"]["value"] == pytest.approx(3.0, abs=0.6)
    assert any("an unknown load was found" in line for line in found.remarks)


def test_a_current_sensor_that_reads_too_much_is_named(folder, fmus):
    """Its factor is beyond what a sensor's prior allows, and looks much like weaker magnets."""
    table = columns(fmus["HF"], "CHIRP", {})
    name = "equivalent_current_filtered"
    found = diagnose(folder, table | {name: 1.06 * table[name]})
    assert not found.complaints and any(line.count(name) and "6 %" in line for line in found.remarks), found.remarks
    assert not any(item.alarm for item in found.estimates) or any("gains" in item for item in found.alternatives)


def test_an_open_switch_is_told_with_its_number(folder, fmus):
    found = diagnose(folder, columns(fmus["HF"], "SIN", {}, {"fault.open_switch": 1}, rate=500.0))
    assert "open_switch = 1" in found.verdict and not any(item.alarm for item in found.estimates)


RARE = {
    "jam": (0.03, 0.002),
    "magnet": (0.9, 0.03),
    "resistance": (1.4, None),
    "current_offset_a": (0.3, 0.02),
    "resolver_offset": (0.05, 0.003),
}


@pytest.mark.parametrize("name", RARE)
def test_a_rare_fault_is_told_or_named_among_what_the_run_cannot_tell(name, folder, fmus):
    """CHIRP does not saturate the voltage: it says nothing of the resistance. A jam is told as friction, and beside it."""
    value, width = RARE[name]
    found = diagnose(folder, columns(fmus["HF"], "CHIRP", {}, {f"fault.{name}": value}))
    alarms = {item.fault for item in found.estimates if item.alarm}
    assert not found.complaints and not found.verdict.startswith("healthy")
    if width is None:
        assert not alarms and not found.estimate(name).identifiable and name in found.verdict
        assert any(name in group.members for group in found.groups)
    elif name in alarms:
        assert alarms == {name} and found.estimate(name).value == pytest.approx(value, abs=width)
    else:
        beside = [item["faults"] for item in found.alternatives]
        assert any(set(faults) == {name} and faults[name] == pytest.approx(value, abs=width) for faults in beside)


@pytest.mark.parametrize("name", ESTIMATED)
def test_every_fault_is_declared_within_its_port(name):
    parameter = ESTIMATED[name]
    port = ports.VARIABLES[ports.INDEX[parameter.port]]
    lowest, highest, step = parameter.slider
    assert port.minimum <= lowest <= parameter.healthy <= highest <= port.maximum and 0.0 < step < highest - lowest


@pytest.mark.parametrize("name", FAULTS)
def test_every_range_of_a_fault_lies_within_the_next(name):
    fault = FAULTS[name]
    port = ports.VARIABLES[ports.INDEX[fault.port]]
    (low, high), (lowest, highest) = fault.studied, fault.searched
    assert port.minimum <= lowest <= low <= fault.healthy <= high <= highest <= port.maximum
    assert low <= fault.limit <= high and fault.limit != fault.healthy
    if fault.angle is not None:
        assert fault.healthy == low == lowest == 0.0 and math.hypot(highest, highest) <= port.maximum


def test_a_search_of_the_eccentricity_stays_where_the_back_emf_keeps_its_sign():
    pairs = ports.VARIABLES[ports.INDEX["motor.p"]].start
    assert pairs * math.hypot(*2 * [FAULTS["zeta"].searched[1]]) < 1.0


def test_a_fault_to_both_sides_has_a_limit_on_each():
    gain, friction = FAULTS["gain"], FAULTS["friction"]
    assert [gain.limit_towards(value) for value in (0.9, 1.0, 1.1)] == [0.5, 0.5, 1.5]
    assert [friction.limit_towards(value) for value in (0.9, 1.1)] == [3.0, 3.0]


def test_coordinates_go_both_ways():
    assert [item.fault for item in coordinates.COORDINATES].count("zeta") == 2 == len(coordinates.PLACES["zeta"])
    truth = {"friction": 2.0, "backlash": 30.0, "N_a": 0.9, "N_b": 1.0, "N_c": 0.8, "zeta": 0.1, "phi": -2.5, "gain": 1.2}
    back = coordinates.to_values(coordinates.from_values(truth))
    assert {name: back[name] for name in truth} == pytest.approx(truth)
    assert list(ESTIMATED) == list(coordinates.to_values(coordinates.from_values({})))
    assert coordinates.from_values({}) == pytest.approx(0.0, abs=0.0)


def test_noise_and_jumps_are_measured():
    t = np.linspace(0.0, 1.0, 4000)
    series = np.sin(20.0 * t) + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    assert noise_of(series) == pytest.approx(0.01, rel=0.1)
    command = np.where(t < 0.5, 0.1 * t, 0.3 - 0.1 * t)
    assert np.flatnonzero(jumps_of(command)).tolist() == [np.searchsorted(t, 0.5) - 1]


@pytest.mark.parametrize(
    "spoil, message",
    [
        (lambda t: {k: v for k, v in t.items() if k != "position"}, "no position"),
        (lambda t: {k: v[::100] for k, v in t.items()}, "at least 25 are needed"),
        (lambda t: t | {"time": 1e3 * t["time"]}, "at least 25 are needed .times in another unit"),
        (lambda t: {k: v[:100] for k, v in t.items()}, "0.2 s to 100 s"),
        (lambda t: t | {"position": 0.0 * t["position"]}, "nothing was measured"),
        (
            lambda t: t | {"motor_speed": np.where(t["time"] == t["time"][7], np.inf, t["motor_speed"])},
            "line 9, column motor_speed: inf",
        ),
    ],
)
def test_bad_files_get_one_line(spoil, message, fmus, tmp_path):
    path = write(tmp_path / "run.csv", spoil(columns(fmus["HF"], "SIN", {})))
    with pytest.raises(HarnessError, match=message) as refusal:
        read_measured(path)
    assert "\n" not in str(refusal.value)


def test_command_writes_page_and_json_and_ends_with_1_if_unexplained(folder, fmus, tmp_path):
    table = columns(fmus["HF"], "SIN", {"friction": 2.0}, rate=500.0)
    good, bad = (
        write(tmp_path / "good.csv", table),
        write(tmp_path / "bad.csv", table | {"position": np.degrees(table["position"])}),
    )
    common = ["--fmus", str(folder), "--out", str(tmp_path)]
    result = CliRunner().invoke(app, ["identify", str(good), *common, "--json", str(tmp_path / "good.json")])
    assert result.exit_code == 0 and "faulty: friction" in result.output
    written = json.loads((tmp_path / "good.json").read_text())
    assert written["explained"] and written["faults"]["friction"]["alarm"] and written["evaluations"] > 50
    assert written["monitor"] == "ELF+" and list(written["faults"]) == list(ESTIMATED)
    page = (tmp_path / "good_identified.html").read_text()
    assert (
        "residual: model minus measured" in page
        and "faulty: friction" in page
        and "identified" in page
        and "http-equiv" not in page
    )
    result = CliRunner().invoke(app, ["identify", str(bad), *common])
    assert result.exit_code == 1 and "not explained" in result.output and "ALARM" not in result.output
    assert "without faults the model leaves" in result.output and "ema replay shows where" in result.output


@pytest.mark.parametrize(
    "words, message",
    [
        (["--monitor", "ELF++"], "did you mean ELF"),
        (["--set", "fault.friction=2"], "it is what is estimated"),
        (["--limit", "frction=2"], "did you mean friction"),
        (["--limit", "friction=1"], "other than 1"),
        (["--threshold", "2"], "less than 1"),
    ],
)
def test_bad_options_get_one_line(words, message, tmp_path):
    result = CliRunner().invoke(app, ["identify", str(tmp_path / "none.csv"), *words])
    assert isinstance(result.exception, HarnessError) and message in str(result.exception)

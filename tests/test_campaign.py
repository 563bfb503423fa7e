"""Campaigns: the same data from the same plan, however they are flown and whatever ends them."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import xarray as xr
import zarr
from typer.testing import CliRunner

from ema_fmu_src import ports
from harness.actuators.read import read_actuator
from harness.campaigns import features, names
from harness.campaigns.planfile import read_plan
from harness.campaigns.run import cluster, run
from harness.cli import app
from harness.errors import HarnessError
from harness.fidelity import FIDELITIES
from harness.flight.twin import Twin
from harness.provenance import provenance
from harness.show import campaign as show
from harness.trials import trial

OPTIONS = {
    "ranges": {"fault.friction": [1.0, 3.0], "fault.N_a": [0.7, 1.0]},
    "samples": 200,
    "seed": 7,
    "noise": {"position": "0.1 %", "motor_speed": 0.5},
}
COMMAND = ("--range", "fault.friction=1:3", "--range", "fault.N_a=0.7:1", "--samples", "200", "--seed", "7",
           "--noise", "position=0.1 %", "--noise", "motor_speed=0.5")  # fmt: skip


@pytest.fixture(scope="module")
def folder(fmus: dict[str, Path]) -> Path:
    return fmus["ELF"].parent


@pytest.fixture(scope="module")
def undisturbed(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset of OPTIONS, flown at once by one worker."""
    out = tmp_path_factory.mktemp("undisturbed")
    with cluster(None, 1) as client:
        flown = run(read_plan(None, OPTIONS), client, fmus=folder, out=out)
    assert flown.cases == 200 and not flown.failures
    return out


def assert_same(one: Path, other: Path) -> None:
    """Every file of two campaigns has the same bytes, provenance apart: what is in it, and its own checksum, is left out."""
    files = [contents(one), contents(other)]
    assert files[0].keys() == files[1].keys()
    assert [name for name in files[0] if files[0][name] != files[1][name]] == []


def contents(root: Path) -> dict[str, object]:
    """What is in each file of a campaign."""
    found: dict[str, object] = {
        str(path.relative_to(root)): path.read_bytes()
        for path in root.rglob("*")
        if path.is_file() and path.name not in ("campaign.html", "dataset.sha256")
    }
    own = json.loads(found["campaign.zarr/.zattrs"])
    whole = json.loads(found["campaign.zarr/.zmetadata"])
    own.pop("provenance", None)
    whole["metadata"][".zattrs"].pop("provenance", None)
    return found | {"campaign.zarr/.zattrs": own, "campaign.zarr/.zmetadata": whole}


def launch(folder: Path, out: Path, *more: str) -> subprocess.Popen:
    code = "from harness.cli import main; main()"
    words = [sys.executable, "-c", code, "campaign", *COMMAND, "--fmus", str(folder), "--out", str(out), *more]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parent.parent)}
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment, text=True)


def batches_done(out: Path) -> int:
    """Batches of the store that are marked as done."""
    try:
        return len([path for path in (out / "campaign.zarr" / "done").iterdir() if path.name.isdigit()])
    except OSError:
        return 0


def test_latin_hypercube_takes_every_stratum_once_and_the_seed_decides():
    table = read_plan(None, OPTIONS).table()
    low, high = np.array([[1.0, 3.0], [0.7, 1.0]]).T
    strata = np.floor((table.values - low) / (high - low) * 200).astype(int)
    for column in strata.T:
        assert sorted(column) == list(range(200))
    assert np.array_equal(table.values, read_plan(None, OPTIONS).table().values)
    assert not np.array_equal(table.values, read_plan(None, OPTIONS | {"seed": 8}).table().values)


def test_toml_grids_cases_and_options_make_the_table(tmp_path):
    (tmp_path / "plan.toml").write_text(
        'trials = ["SIN", "CHIRP"]\nfidelities = ["ELF+", "LF"]\nsamples = 2\nsampling = "sobol"\n'
        "[ranges]\n'fault.friction' = [1, 3]\n[grid]\nfault.N_a = [1.0, 0.8]\n[set]\nsupply_voltage = 40.0\n"
    )
    plan = read_plan(tmp_path / "plan.toml", {"seed": 3})
    table = plan.table()
    assert table.names == ("fault.friction", "fault.N_a", "supply_voltage") and len(table) == 2 * 2 * 2 * 2
    assert set(zip(table.fidelity.tolist(), table.trial.tolist(), strict=True)) == {(0, 0), (0, 1), (1, 0), (1, 1)}
    assert (table.values[:, 2] == 40.0).all() and plan.seed == 3
    (tmp_path / "plan.toml").write_text("[set]\nfault.open_switch = 'a_lower'\n")
    switches = read_plan(tmp_path / "plan.toml", {}).table()
    assert switches.names == ("fault.open_switch",) and switches.values.tolist() == [[2.0]]
    grid = read_plan(None, {"grid": {"fault.open_switch": ["none", "c_upper", 6]}}).table()
    assert grid.values.tolist() == [[0.0], [5.0], [6.0]]
    (tmp_path / "cases.csv").write_text("fault.N_b,fault.gain\n0.9,1\n0.8,1.2\n")
    listed = read_plan(None, {"cases": tmp_path / "cases.csv"}).table()
    assert listed.values.tolist() == [[0.9, 1.0], [0.8, 1.2]]


@pytest.mark.parametrize(
    "options, message",
    [
        ({"ranges": {"fault.frction": [1, 2]}, "samples": 2}, "did you mean fault.friction"),
        ({"ranges": {"fault.N_a": [0.1, 1]}, "samples": 2}, "out of range, 0.3 to 1"),
        ({"ranges": {"fault.N_a": [1, 0.8]}, "samples": 2}, "lower end comes first"),
        ({"ranges": {"fault.open_switch": [0, 6]}, "samples": 2}, "list them under grid"),
        ({"grid": {"fault.open_switch": ["upper"]}}, "'upper' is not a number or none or a_upper"),
        ({"grid": {"fault.N_a": ["a_upper"]}}, "'a_upper' is not a number"),
        ({"samples": 5}, "would all be the same"),
        ({"rate": 3000.0}, "does not divide"),
        ({"outputs": ["positon"]}, "did you mean position"),
        ({"noise": {"position": "loud"}}, "a standard deviation is needed"),
        ({"ranges": {"fault.N_a": [0.8, 1]}, "grid": {"fault.N_a": [1.0]}, "samples": 2}, "given twice"),
        ({"samples": 0}, "1 or more"),
    ],
)
def test_a_plan_that_cannot_be_flown_is_refused_with_a_line(options, message):
    with pytest.raises(HarnessError, match=message) as refusal:
        read_plan(None, options)
    assert "\n" not in str(refusal.value)


def test_what_goes_beside_a_plan_is_told_its_option(tmp_path):
    (tmp_path / "plan.toml").write_text('trial_file = "own.csv"')
    with pytest.raises(HarnessError, match=r"plan.toml, trial_file: is no key of a plan; .* --trial-file FILE"):
        read_plan(tmp_path / "plan.toml", {})


def test_unknown_key_of_a_file_names_the_nearest(tmp_path):
    (tmp_path / "plan.toml").write_text("sample = 3\n")
    with pytest.raises(HarnessError, match="did you mean samples"):
        read_plan(tmp_path / "plan.toml", {})


def test_dataset_opens_with_plain_xarray_and_is_labelled(undisturbed, folder):
    dataset = xr.open_zarr(undisturbed / "campaign.zarr")
    assert dataset["position"].dims == ("case", "time") and dataset["position"].attrs["units"] == "rad"
    assert dataset["time"].attrs["units"] == "s" and dataset.sizes == {"case": 200, "time": 1251, "feature": 17}
    assert {port.name for port in ports.PARAMETERS} <= set(dataset.coords)
    assert (dataset["driver.coupled_saturation"] == 1).all() and set(dataset["fidelity"].values) == {"ELF+"}
    assert dataset["done"].all() and (dataset["failure"] == "").all() and dataset["position"].notnull().all()
    assert dataset.attrs["seed"] == 7 and "EMA_ELF.fmu" in dataset.attrs["fmu_sha256"]
    table = pq.read_table(undisturbed / "features.parquet")
    assert table.num_rows == 200 and table.column("fault.friction").to_pylist() == dataset["fault.friction"].values.tolist()


def test_a_case_is_the_run_that_a_twin_flies_with_noise_of_the_size_asked(undisturbed, folder):
    dataset = xr.open_zarr(undisturbed / "campaign.zarr")
    case = dataset.isel(case=150)
    given = {name: float(case[name]) for name in ("fault.friction", "fault.N_a")} | FIDELITIES["ELF+"].parameters
    with Twin(folder / "EMA_ELF.fmu") as twin:
        alone = twin.run(trial("SIN"), given).isel(time=slice(None, None, 20))
    current = "equivalent_current_filtered"
    assert np.array_equal(case[current].values, alone[current].values.astype(np.float32))
    noise = {"position": 0.001 * float(np.ptp(alone["position"].values)), "motor_speed": 0.5}
    for name, sigma in noise.items():
        off = case[name].values - alone[name].values
        assert np.std(off) == pytest.approx(sigma, rel=0.1)  # 1251 draws: 2 % standard error
        assert abs(np.mean(off)) < 4.0 * sigma / np.sqrt(off.size)


def test_features_against_analytic_truth():
    t = np.arange(0.0, 2.0, 1e-3)
    speed = 12.0 * np.pi  # whole turns
    theta = speed * t
    current = 2.0 + 0.3 * np.cos(3 * 2.0 * theta) + 0.1 * np.sin(2 * 2.0 * theta)
    amplitudes = features.harmonics(current, theta, np.full(t.size, speed), 2.0)
    assert amplitudes == pytest.approx([0.0, 0.1, 0.3, 0.0, 0.0, 0.0], abs=2e-3)
    kept = {"position": 0.1 * np.sin(2.0 * np.pi * t)}
    rest = {
        "command": 0.0 * t,
        "motor_position": theta,
        "motor_speed": 0.0 * t + speed,
        "equivalent_current_filtered": current,
    }
    level = {"supply_current": 2.0, "copper_loss": 3.0, "voltage_saturated": 0.0}
    whole = {name: 0.0 * t + value for name, value in level.items()}
    found = features.features(kept, kept | rest, whole, 48.0, step=1e-3)
    named = dict(zip(names.names(["position"]), found, strict=True))
    assert named["position_rms"] == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-6)
    assert named["tracking_error_max"] == pytest.approx(0.1, rel=1e-6)
    assert named["energy_supply"] == pytest.approx(48.0 * 2.0 * 1.999) and named["energy_copper"] == pytest.approx(
        3.0 * 1.999
    )


def test_killed_the_same_command_goes_on_to_the_same_bytes(undisturbed, folder, tmp_path):
    process = launch(folder, tmp_path, "--workers", "2")
    while process.poll() is None and batches_done(tmp_path) < 2:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert 2 <= batches_done(tmp_path) <= 4
    last = launch(folder, tmp_path)
    assert "dataset:" in last.communicate()[0] and last.returncode == 0
    assert_same(undisturbed, tmp_path)


def test_a_case_that_fails_is_recorded_and_stops_nothing(folder, tmp_path):
    options = {"grid": {"motor.p": [2, 10], "fault.zeta": [0.0, 0.2]}}  # p*zeta = 2 is refused by the FMU
    with cluster(None, 1) as client:
        flown = run(read_plan(None, options), client, fmus=folder, out=tmp_path)
    assert [case for case, _ in flown.failures] == [3] and "zeta" in flown.failures[0][1]
    dataset = xr.open_zarr(tmp_path / "campaign.zarr")
    assert dataset["position"].isel(case=3).isnull().all() and dataset["position"].isel(case=[0, 1, 2]).notnull().all()
    assert pq.read_table(tmp_path / "features.parquet").column("failure").to_pylist()[:3] == ["", "", ""]


def test_another_plan_in_the_same_folder_is_refused_and_nothing_lost(undisturbed, folder):
    before = zarr.open_group(undisturbed / "campaign.zarr", mode="r").attrs["campaign_sha256"]
    words = ["campaign", *COMMAND, "--seed", "8", "--fmus", str(folder), "--out", str(undisturbed), "--workers", "1"]
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, HarnessError) and "another campaign" in str(result.exception)
    assert zarr.open_group(undisturbed / "campaign.zarr", mode="r").attrs["campaign_sha256"] == before


@pytest.mark.parametrize("key, value", [("ranges", [1.0, 50.0]), ("grid", [1.0, 50.0])])
def test_a_fault_that_does_nothing_in_the_actuator_is_refused(key, value):
    options = {key: {"fault.backlash": value}, "samples": 2} if key == "ranges" else {key: {"fault.backlash": value}}
    with pytest.raises(HarnessError, match=r"fault.backlash: it has no effect, for gear.backlash is 0"):
        read_plan(None, options, actuator=read_actuator("maxon-linear-a"))
    read_plan(None, options)
    read_plan(None, {**options, "grid": {**options.get("grid", {}), "gear.backlash": [0.0, 1e-4]}},
              actuator=read_actuator("maxon-linear-a"))  # fmt: skip


def test_verify_tells_what_is_damaged_and_flies_nothing(undisturbed, tmp_path):
    """Also with the standard tool, as the README says."""
    copy = shutil.copytree(undisturbed, tmp_path / "copy")
    told = CliRunner().invoke(app, ["campaign", "--verify", "--out", str(copy)])
    assert told.exit_code == 0 and told.output == "200 of 200 cases are whole\n"
    proven = subprocess.run(["sh", "-c", "sha256sum --check --quiet checksums/*"], cwd=copy, check=False)
    assert proven.returncode == 0
    victim = copy / "campaign.zarr" / "motor_speed" / "1.0"
    victim.write_bytes(victim.read_bytes()[:-1])
    (copy / "checksums" / "cases_128_191.sha256").unlink()
    before = sorted(copy.rglob("*"))
    told = CliRunner().invoke(app, ["campaign", "--verify", "--out", str(copy)])
    assert told.exit_code == 1 and f"{victim}: is damaged" in told.output and "72 of 200 cases are whole" in told.output
    assert sorted(copy.rglob("*")) == before
    nothing = CliRunner().invoke(app, ["campaign", "--verify", "--out", str(tmp_path)])
    assert isinstance(nothing.exception, HarnessError) and "holds no campaign" in str(nothing.exception)


def test_the_page_shows_what_follows_what(undisturbed):
    """More friction takes more energy; a figure has every case and every parameter that is varied."""
    with xr.open_zarr(undisturbed / "campaign.zarr") as held:
        assert show.varied(held) == ["fault.friction", "fault.N_a"]
        frame = pd.DataFrame(held["features"].values, columns=held["feature"].values)
        related = show.relations(held, frame, ["fault.friction"])
        assert related.loc["energy_supply", "fault.friction"] > 0.95
        ((name, feature),) = show.panel_pairs(related)
        panel = show.against(held, frame, [(name, feature)])
        assert panel.data[0].x == pytest.approx(held["fault.friction"].values, rel=1e-5)
        assert panel.layout.xaxis.title.text == "fault.friction" and panel.layout.yaxis.title.text.endswith("]")
        labels = [
            each.label for each in show.parallel(held, frame, ["fault.friction"], [(name, feature)]).data[0].dimensions
        ]
        assert labels[0] == "fault.friction" and labels[-1] == "tracking_error_rms [rad]"
        made = show.page(held, [(3, "it <broke>")], provenance(command="ema campaign"))
    assert "1 of 200 cases have failed" in made and "it &lt;broke&gt;" in made and "Features against faults" in made

"""`ema calibrate`: parameters from healthy runs, the file that it writes, what it predicts, what it refuses."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import plant
import pytest
from typer.testing import CliRunner

from harness.actuators.actuator import DEFAULT, Actuator, Output
from harness.actuators.read import LIBRARY, read_actuator
from harness.actuators.values import tolerances_of
from harness.calibration.logs import parse_own
from harness.calibration.remarks import at_bound, correlated, not_physical, not_told, off_the_sheet
from harness.calibration.result import Parameter
from harness.calibration.search import LOSS, soften
from harness.calibration.table import file_text
from harness.calibration.told import Told, cut, linked
from harness.cli import app
from harness.errors import HarnessError
from harness.files.toml import read_toml, toml_text
from harness.inference.prior import SHAKEN, prior_of

SIGMAS = {"motor.K_e": 0.02, "mechanics.J": 0.04, "motor.R": 0.04, "mechanics.T_coulomb": 0.1, "mechanics.C": 0.3,
          "gear.backlash": 0.2}  # fmt: skip
"""Relative standard deviations of the parameters."""
HIDDEN = {"motor.K_e": 0.985, "mechanics.J": 1.05, "motor.R": 0.97, "mechanics.T_coulomb": 1.15, "mechanics.C": 0.75,
          "gear.backlash": 1.25}  # fmt: skip
"""Those of the plant, in the file's."""
TRUTH = {name: part * DEFAULT.value(name) for name, part in HIDDEN.items()}
TOLERANT = "\n".join(
    ['name = "bench"', "[tolerances]", *(f'"{name}" = "{196 * part:g} %"' for name, part in SIGMAS.items())]
)


def ema(*arguments: object) -> Any:
    return CliRunner().invoke(app, [*map(str, arguments)])


def said(result: Any) -> str:
    return str(result.exception) if isinstance(result.exception, HarnessError) else result.output


@pytest.fixture(scope="module")
def bench(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A calibration of two runs of a plant whose parameters are hidden, and a third that it predicts."""
    folder = tmp_path_factory.mktemp("bench")
    start, out, result = folder / "start.toml", folder / "bench.toml", folder / "bench.json"
    start.write_text(TOLERANT)
    logs = {}
    for seed, name in enumerate(("CHIRP", "SIN", "TRAPEZOID")):
        table = plant.columns(fmus["HF"], name, {}, TRUTH, seed=seed, rate=1000.0)
        logs[name] = plant.write(folder / f"{name}.csv", {key: table[key] for key in ("time", "command", *plant.NOISE)})
    done = ema(
        "calibrate", logs["CHIRP"], logs["SIN"], "--check", logs["TRAPEZOID"], "--actuator", start, "--out", out,
        "--json", result, "--fmus", fmus["HF"].parent,
    )  # fmt: skip
    assert done.exit_code == 0, said(done)
    return SimpleNamespace(
        folder=folder, start=start, out=out, logs=logs, told=json.loads(result.read_text()), printed=done.output
    )


def test_the_hidden_parameters_are_found(bench: Any) -> None:
    """Truth: the plant, HF, whose parameters the calibration does not know."""
    found = bench.told["parameters"]
    errors = {name: (item["value"] - TRUTH[name]) / item["sigma"] for name, item in found.items()}
    assert set(found) == set(SIGMAS)
    assert max(map(abs, errors.values())) < 2.6, errors
    assert np.sqrt(np.mean(np.square(list(errors.values())))) < 1.6, errors
    for name, width in (("mechanics.T_coulomb", 0.04), ("mechanics.C", 0.1), ("gear.backlash", 0.1), ("mechanics.J", 0.03)):
        assert found[name]["freed"] and found[name]["sigma"] < width * TRUTH[name], name
        assert found[name]["sigma"] < 0.7 * SIGMAS[name] * DEFAULT.value(name), name


def test_what_the_runs_do_not_tell_stays_as_it_was(bench: Any) -> None:
    """R does nothing while the current is what is asked; the scale of unloaded runs is as well known as K_e."""
    for name in ("motor.R", "motor.K_e"):
        item = bench.told["parameters"][name]
        assert not item["freed"] and item["value"] == item["start"] == DEFAULT.value(name)
        assert item["sigma"] == pytest.approx(SIGMAS[name] * DEFAULT.value(name))
        assert "would tell" in item["reason"]
    names = bench.told["covariance"]["names"]
    assert "motor.K_e" in names and "motor.R" not in names
    matrix = np.array(bench.told["covariance"]["values"])
    K_e, J = (names.index(name) for name in ("motor.K_e", "mechanics.J"))
    assert matrix[K_e, J] / np.sqrt(matrix[K_e, K_e] * matrix[J, J]) > 0.7
    assert any("have in common" in line for line in bench.told["remarks"])
    assert any("no voltage saturation" in line for line in bench.told["remarks"])


def test_a_run_that_was_not_fitted_is_predicted(bench: Any) -> None:
    (check,) = bench.told["checks"]
    assert check["run"] == "TRAPEZOID"
    assert check["channels"]["position"]["nrmse"] < 0.002 and check["channels"]["motor_speed"]["nrmse"] < 0.005
    assert [item["run"] for item in bench.told["runs"]] == ["CHIRP", "SIN"]
    for channels in bench.told["left"].values():
        assert channels["position"]["rms"] < 0.0015 and channels["equivalent_current_filtered"]["rms"] < 0.02
    assert "TRAPEZOID (not fitted)" in bench.printed


def test_the_file_is_read_as_it_was_found(bench: Any) -> None:
    own, found = read_actuator(str(bench.out)), bench.told["parameters"]
    names = bench.told["covariance"]["names"]
    assert own.name == "bench" and own.identity == bench.told["actuator"]
    for name in names:
        assert own.value(name) == found[name]["value"] and own.origins[name] == "calibrated"
        assert own.tolerances[name] == pytest.approx(1.96 * found[name]["sigma"])
    assert own.tolerances["motor.R"] == pytest.approx(1.96 * 0.04 * DEFAULT.value("motor.R"))
    prior = prior_of(own, own.parameters)
    places = [prior.names.index(name) for name in names]
    np.testing.assert_allclose(prior.covariance[np.ix_(places, places)], bench.told["covariance"]["values"], rtol=1e-9)
    table = tomllib.loads(bench.out.read_text())["calibration"]
    assert [len(item["sha256"]) for item in table["files"]] == [64, 64]
    assert [item["name"] for item in table["files"]] == ["CHIRP.csv", "SIN.csv"]
    assert table["inflation"]["factor"] >= 1.0 and set(table["noise"]) == {"CHIRP", "SIN"}
    assert set(table["nuisances"]["CHIRP"]["position"]) == {"offset", "gain", "shift", "lag", "gap"}


def test_the_page_shows_it_all(bench: Any) -> None:
    page = bench.out.with_suffix(".html").read_text()
    for text in (
        "Correlations",
        "spectra of the residuals",
        "TRAPEZOID, predicted",
        "What the bench adds",
        "mechanics.T_coulomb",
    ):
        assert text in page
    assert "<script src" not in page and "http-equiv" not in page


def test_what_cannot_be_calibrated_is_refused(bench: Any, fmus: dict[str, Path], tmp_path: Path) -> None:
    log, out = bench.logs["SIN"], tmp_path / "out.toml"
    given = ["calibrate", log, "--fmus", fmus["HF"].parent]
    tolerant = ["--actuator", bench.start]
    bad = tmp_path / "bad.csv"
    bad.write_text("time,command\n0,1\n")
    for options, words in (
        (["--out", out], "no tolerance is stated"),
        (["--out", tmp_path / "out.csv", *tolerant], "has to end with .toml"),
        (["--out", out, *tolerant, "--check", bad], "bad.csv"),
        (["--out", out, *tolerant, "--check", tmp_path / "none.csv"], "none.csv"),
        (["--out", out, *tolerant, "--set", "fault.friction=1.5"], "healthy actuator"),
        (["--out", out, *tolerant, "--set", "CHIRP::motor.R=1"], "none of the logs"),
        (["--out", out, *tolerant, "--free", "motor.R"], "NAME=TOL"),
        (["--out", out, *tolerant, "--free", "motor.Q=5 %"], "motor.Q"),
        (["--out", out, *tolerant, "--free", "motor.p=1"], "exact"),
        (["--out", out, *tolerant, "--tolerance", "0"], "more than 0"),
        (["--out", out, "--actuator", bench.out, "--free", "mechanics.J=5 %"], "has it calibrated"),
        (["--out", bench.start, *tolerant], "write over"),
    ):
        result = ema(*given, *options)
        assert result.exit_code != 0 and words in said(result), (options, said(result))
    assert not out.exists() and not out.with_suffix(".html").exists()
    assert bench.start.read_text() == TOLERANT


def test_settings_of_all_logs_and_of_one() -> None:
    logs = [Path("a/slow.csv"), Path("fast.csv")]
    common, own = parse_own(["motor.R=1", "fast::controller.pid.K_p=6", "a/slow.csv::motor.R=2"], logs)
    assert common == {"motor.R": 1.0}
    assert own == {logs[1]: {"controller.pid.K_p": 6.0}, logs[0]: {"motor.R": 2.0}}
    with pytest.raises(HarnessError, match="several"):
        parse_own(["x::motor.R=1"], [Path("a/x.csv"), Path("b/x.csv")])


def told(information: np.ndarray, scatter: np.ndarray | None = None, alone: Any = ()) -> Told:
    size = len(information)
    zero = np.zeros(size)
    return Told(zero, information, zero, np.eye(size), information if scatter is None else scatter, list(alone))


def test_noise_as_it_was_learnt_needs_no_inflation() -> None:
    """Where the blocks' gradients scatter as the information says, the sandwich is Laplace's covariance."""
    found = told(np.diag([100.0, 1e-9]))
    mask = np.array([True, False])
    assert found.by_blocks(mask) == 1.0 and found.by_runs(mask) == 1.0
    assert told(np.diag([100.0, 1e-9]), 9.0 * np.diag([100.0, 0.0])).by_blocks(mask) == pytest.approx(3.0, rel=0.02)
    assert np.sqrt(found.inflated(2.0).covariance()[0, 0]) == pytest.approx(2.0 / np.sqrt(104.0))


def test_runs_that_disagree_widen_each_other() -> None:
    """Two runs of equal weight that are off to either side by d: the mean of (d/sigma)^2, by hand."""
    each, pull = np.array([[1e4]]), np.array([100.0])
    found = told(2.0 * each, alone=[(each, pull), (each, -pull)])
    moved, expected = 100.0 / 10001.0, 1.0 / 10001.0 - 1.0 / 20001.0
    assert found.by_runs(np.array([True])) == pytest.approx(moved / np.sqrt(expected))


def test_what_is_not_told_keeps_its_prior_and_takes_the_others_along() -> None:
    covariance = np.array([[0.8, 0.4], [0.4, 0.21]])
    mean, joint = cut(np.array([0.5, 1.0]), covariance, np.eye(2), np.array([False, True]))
    np.testing.assert_allclose(mean, [0.0, 1.0 - 0.5 * 0.5])
    np.testing.assert_allclose(joint, [[1.0, 0.5], [0.5, 0.01 + 0.25]])
    assert linked(joint, np.array([False, True]), [True, True]).all()
    assert linked(np.eye(2), np.array([False, True]), [True, True]).tolist() == [False, True]


def test_rows_far_off_weigh_less() -> None:
    rest = np.r_[np.random.default_rng(1).standard_normal(999), 30.0]
    run = SimpleNamespace(weight=np.ones((1000, 1)), measured=SimpleNamespace(quanta=np.zeros(1)), spans=np.ones(1))
    run.weight[0] = 0.0
    soften(SimpleNamespace(runs=[run], rest=lambda u, r: rest[:, None]), np.empty(0))  # type: ignore[arg-type]
    assert run.weight[0, 0] == 0.0 and np.median(run.weight) > 0.97
    assert run.weight[-1, 0] == pytest.approx((1.0 + (30.0 / LOSS) ** 2) ** -0.25, rel=0.05)


def test_remarks() -> None:
    item = Parameter("mechanics.J", 1.0, 0.1, 1.5, 0.01, freed=True)
    assert "5.0 standard deviations" in off_the_sheet([item])[0]
    assert not off_the_sheet([replace(item, value=1.2)]) and not off_the_sheet([replace(item, freed=False)])
    assert "correlation -0.97" in correlated(["a", "b"], np.array([[1.0, -0.97], [-0.97, 1.0]]))[0]
    low, high = np.full(2, -8.0), np.full(2, 8.0)
    assert at_bound(["a", "b"], np.array([0.0, 8.0]), low, high) == [
        "b has come to its highest value: its sigma means little"
    ]
    assert "known load" in not_told("motor.K_e")
    static, coulomb = replace(item, name="mechanics.T_static"), replace(item, name="mechanics.T_coulomb")
    assert "below mechanics.T_coulomb" in not_physical([replace(static, value=1.4), coulomb])[0]
    assert not not_physical([static, coulomb]) and not not_physical([static])


def test_tolerances_beside_any_value() -> None:
    values = {"mechanics.J": 2e-5}
    table = {"mechanics.J": "10 %", "mechanics.C": 1e-5, "gear.backlash": "+- 0.1 mm", "controller.pid.T_f": "1 ms"}
    output = Output(0.01)
    found = tolerances_of(table, values, output, "here")
    assert found["mechanics.J"] == pytest.approx(2e-6) and found["mechanics.C"] == 1e-5
    assert found["gear.backlash"] == pytest.approx(0.1e-3 / 0.01 * 2.0 * np.pi) and found["controller.pid.T_f"] == 1e-3
    for bad, words in (
        ({"motor.p": 1}, "exact"),
        ({"motor.R": -1}, "more than 0"),
        ({"mechanics.T_asymmetry": "5 %"}, "of 0 is nothing"),
        ({"motor.R": "5 kg"}, "motor.R"),
        ({"motor.X": 1}, "motor.X"),
    ):
        with pytest.raises(HarnessError, match=words):
            tolerances_of(bad, values, output, "here")


def test_tolerances_of_the_library_change_no_value(tmp_path: Path) -> None:
    for name in ("maxon-linear-a", "maxon-linear-b"):
        content = read_toml(LIBRARY / f"{name}.toml")
        assert content.pop("tolerances")
        bare = tmp_path / f"{name}.toml"
        bare.write_text(toml_text(content))
        assert read_actuator(str(bare)).sha256 == read_actuator(name).sha256
        assert {"mechanics.J", "mechanics.T_coulomb"} <= set(read_actuator(name).tolerances)


def test_toml_is_written_as_it_is_read() -> None:
    for path in LIBRARY.glob("*.toml"):
        content = read_toml(path)
        assert tomllib.loads(toml_text(content)) == content
    odd = {"a.b": {"c d": {"e": [1, 2.5, "x\ty"], "f": True}, "g": {}}, "h": -1e-300, "i": [[1e22, 2.0], [0.1, 0.2]] * 9}
    assert tomllib.loads(toml_text(odd)) == odd


def test_a_calibration_of_a_calibrated_actuator(tmp_path: Path) -> None:
    """What was calibrated before and is not now stays; what is set is exact from then on."""
    before = tmp_path / "before.toml"
    before.write_text(
        'name = "x"\n[parameters]\n"motor.R" = "1 Ohm +- 5 %"\n[calibration]\nnames = ["mechanics.J", "mechanics.C"]\n'
        'covariance = [[1e-14, 0.0], [0.0, 1e-12]]\nvalues = {"mechanics.J" = 5e-5, "mechanics.C" = 4e-5}\n'
    )
    start = read_actuator(str(before))
    table = {"names": ["mechanics.C"], "covariance": [[1e-13]], "values": {"mechanics.C": 4.5e-5}}
    text = file_text(replace(start, calibration=table), str(before), {"motor.R": 1.1}, {"mechanics.T_coulomb": 0.002})
    (tmp_path / "after.toml").write_text(text)
    after = read_actuator(str(tmp_path / "after.toml"))
    assert after.value("mechanics.C") == 4.5e-5 and after.value("mechanics.J") == 5e-5 and after.value("motor.R") == 1.1
    assert after.tolerances["mechanics.J"] == pytest.approx(1.96e-7) and "motor.R" not in after.tolerances
    assert after.tolerances["mechanics.T_coulomb"] == 0.002


def test_the_models_own_error_of_static_friction_is_counted_once() -> None:
    """A calibration writes it into its covariance; a file without one has it added."""
    name = "mechanics.T_static"
    own = Actuator("x", parameters={name: 0.06}, tolerances={name: 1.96 * 0.015})
    assert prior_of(own, own.parameters).sigmas[0] == pytest.approx(np.hypot(0.015, SHAKEN * 0.06))
    table = {"names": [name], "values": {name: 0.06}, "covariance": [[0.015**2]]}
    assert prior_of(replace(own, calibration=table), own.parameters).sigmas[0] == pytest.approx(0.015)


def test_a_fault_is_not_freed(tmp_path: Path) -> None:
    done = ema("calibrate", tmp_path / "none.csv", "--out", tmp_path / "x.toml", "--free", "fault.friction=10 %")
    assert isinstance(done.exception, HarnessError) and "have no faults" in str(done.exception)

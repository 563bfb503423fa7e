"""`import harness as ema`: what it gives is what the rooms give, mistakes are one clear line, and results show themselves.

Truths: the same flight by the room itself, a fault that was flown and is found again, NetCDF read back.
"""

import json
import os
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import spring
import xarray as xr
from notebook import executed, texts

import harness as ema
from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES
from harness.flight.twin import Twin
from harness.library import shown
from harness.parameters import merged
from harness.trials import trial

EXAMPLES = Path(ema.__file__).parent / "examples"


@pytest.fixture(scope="module")
def folder(fmus: dict[str, Path]) -> str:
    return str(fmus["HF"].parent)


@pytest.fixture(scope="module")
def log(folder: str) -> xr.Dataset:
    """A run with friction times 1.6, a row every 2 ms."""
    return ema.fly("SIN", "ELF+", set={"fault.friction": 1.6}, fmus=folder).isel(time=slice(None, None, 20))


def test_the_import_brings_nothing_heavy() -> None:
    heavy = ("numpy", "xarray", "numba", "fmpy", "plotly")
    program = f"import sys, harness; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert set(ema.__all__) <= set(dir(ema))
    with pytest.raises(AttributeError, match=r"no attribute 'flu'; it has .*fly"):
        _ = ema.flu  # type: ignore[attr-defined]


def test_a_flight_is_what_the_twin_flies_and_netcdf_holds_it(folder: str, fmus: dict[str, Path], tmp_path: Path) -> None:
    given: dict[str, Any] = {"fault.N_a": 0.9, "controller.speed_limit": "19000 rpm"}
    run = ema.fly("sin", "LF", set=given, fmus=folder)
    with Twin(fmus["LF"]) as twin:
        same = twin.run(
            trial("SIN"), merged(FIDELITIES["LF"], {"fault.N_a": 0.9, "controller.speed_limit": 19000 * np.pi / 30})
        )
    assert all(np.array_equal(run[name], same[name]) for name in same.data_vars)
    run.to_netcdf(tmp_path / "run.nc")
    with xr.open_dataset(tmp_path / "run.nc") as read:
        assert read.identical(run) or all(np.array_equal(read[name], run[name]) for name in run.data_vars)
        assert read.position.attrs["units"] == "rad"
        assert json.loads(read.attrs["parameters"])["fault.N_a"] == 0.9
    assert run.identical(ema.fly("SIN", "LF", set=given, fmus=folder))


def test_a_trial_may_be_a_file_or_a_run(folder: str, tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("time,command\n0,0\n0.05,0.01\n")
    own = ema.fly(tmp_path / "own.csv", "LF", fmus=folder)
    assert (own.attrs["trial"], float(own.time[-1])) == ("own", 0.05)
    again = ema.fly(own, "LF", fmus=folder)
    np.testing.assert_allclose(again.position, own.position, atol=1e-9)  # through 9 digits of the command


def test_runs_are_compared_and_units_have_to_fit(folder: str, fmus: dict[str, Path]) -> None:
    compared = ema.compare("LF", str(fmus["LF"]), fmus=folder)
    assert {item.variable for item in compared} == {port.name for port in ports.OUTPUTS}
    assert compared["position"].nrmse == 0.0
    assert isinstance(compared.table, pd.DataFrame) and compared.table.loc["position", "nrmse"] == 0.0
    run = compared.reference
    moved = run.assign(position=(run.position + 0.01).assign_attrs(run.position.attrs))
    assert ema.compare(moved, run)["position"].max_abs == pytest.approx(0.01)
    metres = run.assign(position=run.position.assign_attrs(units="m"))
    with pytest.raises(ema.HarnessError, match="position: m in the candidate, rad in the reference"):
        ema.compare(metres, run)


def test_a_fault_is_identified_from_a_dataset(folder: str, log: xr.Dataset) -> None:
    found = ema.identify(log, fmus=folder)
    assert found.explained and found.faults["friction"].low <= 1.6 <= found.faults["friction"].high
    assert found.faults["friction"].value == pytest.approx(1.6, abs=0.02)
    assert found.as_dict()["faults"]["friction"]["value"] == found.faults["friction"].value
    curves = found.to_dataset()
    left = np.ptp((curves.position_identified - curves.position).values) / np.ptp(curves.position.values)
    assert left < 0.01 and curves.position.attrs["units"] == "rad"
    assert "friction" in repr(found) and "<table>" in found._repr_html_() and found._repr_html_().count("<polyline") >= 9


def test_a_log_is_flown_again(folder: str, log: xr.Dataset, tmp_path: Path) -> None:
    log.to_netcdf(tmp_path / "log.nc")
    (of_file,) = ema.replay(str(tmp_path / "log.nc"), set={"fault.friction": 1.6}, fmus=folder)
    replayed = ema.replay(log, set={"fault.friction": 1.6}, fmus=folder)
    assert [item.nrmse for item in replayed[0].channels] == pytest.approx(
        [item.nrmse for item in of_file.channels], rel=1e-3
    )
    assert replayed[0].channels[0].nrmse < 1e-3
    assert set(replayed.to_dataset()) >= {"command", "position", "position_twin"}
    assert "position" in repr(replayed) and "<svg" in replayed._repr_html_()


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: ema.fly("SNI"), "unknown trial 'SNI': did you mean SIN"),
        (lambda: ema.fly("SIN", "EFL"), "unknown fidelity 'EFL': did you mean ELF"),
        (lambda: ema.fly("SIN", set={"fault.Na": 1}), "unknown parameter 'fault.Na': did you mean fault.N_a"),
        (lambda: ema.fly("SIN", set="fault.N_a=1"), "a mapping is needed, such as"),  # type: ignore[arg-type]
        (lambda: ema.fly("none.csv"), "none.csv: cannot be read"),
        (lambda: ema.fly("SIN", actuator="defualt"), "did you mean default"),
        (lambda: ema.compare(xr.Dataset(), xr.Dataset()), "a dataset over time is needed"),
        (lambda: ema.identify(xr.Dataset({"position": ("x", [1.0])})), "no coordinate time"),
        (lambda: ema.identify([1.0]), "list: a path or an xarray.Dataset"),  # type: ignore[arg-type]
        (lambda: ema.identify("none.csv", set={"fault.friction": 2}), "fault.friction: it is what is estimated"),
        (lambda: ema.calibrate("none.csv"), "none.csv: cannot be read"),
        (lambda: ema.campaign(trials="SIN", ranges={"fault.N_a": (1.0, 0.5)}), "the lower end comes first"),
    ],
)
def test_mistakes_are_one_line(call: Callable[[], object], told: str) -> None:
    with pytest.raises(ema.HarnessError, match=re.escape(told)) as raised:
        call()
    assert raised.value._render_traceback_() == [f"ema: {raised.value}"]
    assert "\n" not in str(raised.value)


def test_a_dataset_that_cannot_be_read_is_named_and_not_its_copy(log: xr.Dataset) -> None:
    with pytest.raises(ema.HarnessError, match="dataset SIN") as raised:
        ema.identify(log[["motor_speed"]])
    assert "/tmp" not in str(raised.value)


def test_curves_keep_their_peaks_and_their_gaps() -> None:
    values = np.zeros(100_000)
    values[12_345], values[0] = 5.0, np.nan
    picture = shown.drawing([("x [A]", [shown.Curve("<b>", np.arange(1e5), values)])])
    assert ">5<" in picture and "nan" not in picture and "<b>" not in picture
    assert picture.count(",") < 2 * shown.MOST_POINTS
    assert shown.drawing([]) == ""


def _script(name: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    try:
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_the_example_of_a_fault_study(
    folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _script("fault_study.py", ["--fmus", folder, "--out", str(tmp_path / "s.nc")], monkeypatch) == 0
    loss = [float(found) for found in re.findall(r"loss ([\d.]+) W", capsys.readouterr().out)]
    assert len(loss) == 4
    with xr.open_dataset(tmp_path / "s.nc") as study:
        assert dict(study.sizes) == {"N_a": 4, "time": 25001}
        assert loss == pytest.approx(study.copper_loss.mean("time").values.tolist(), abs=1e-4)


def test_the_examples_of_an_own_log_and_of_ci(
    folder: str, log: xr.Dataset, fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    log.to_netcdf(tmp_path / "log.nc")
    assert _script("own_log.py", [str(tmp_path / "log.nc"), "--fmus", folder], monkeypatch) == 0
    assert re.search(r"faulty: friction = 1\.(59|60)", capsys.readouterr().out)
    assert _script("own_log.py", ["none.csv", "--fmus", folder], monkeypatch) == 2
    stored = str(tmp_path / "stored.nc")
    codes = [_script("ci.py", [str(fmus[model]), stored], monkeypatch) for model in ("LF", "LF")]
    assert codes == [0, 0]
    assert _script("ci.py", [str(fmus["ELF"]), stored, "--allowed", "1e-6"], monkeypatch) == 1
    assert "position: " in capsys.readouterr().out


def test_the_example_of_an_own_fmu(
    folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _script("own_fmu.py", [str(spring.build(tmp_path)), "--fmus", folder], monkeypatch) == 0
    reached = float(re.findall(r"([\d.]+) rad", capsys.readouterr().out)[0])
    assert reached == pytest.approx(0.1, abs=0.01)


def test_the_notebook_shows_what_it_holds(fmus: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.fidelity.FMU_DIR", fmus["HF"].parent)
    monkeypatch.setattr("harness.ready.find_spec", lambda name: None)  # as installed from a wheel: nothing is built
    held = json.loads((EXAMPLES / "twins.ipynb").read_text(encoding="utf-8"))
    assert texts(executed(held)) == texts(held)
    assert os.sep + "tmp" not in json.dumps(held)

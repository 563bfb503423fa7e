"""`ema calibrate` on logs of real actuators, which are not ours to publish."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from test_calibrate import ema, said

from harness.actuators.read import read_actuator

LOGS = os.environ.get("EMA_BENCH_LOGS", "")
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not LOGS, reason="EMA_BENCH_LOGS names no folder of bench logs"),
]
COLUMNS = ("time=1 [ms]", "command=2 [mm] held", "position=4 [mm] motor", "equivalent_current=6 [mA]")
AS_TOLD = [part for column in COLUMNS for part in ("--column", column)]


def test_a_real_actuator_on_its_two_logs(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Truth: the bench, and the motor's data sheet. Replayed with the calibrated values."""
    logs = []
    for name in ("a-10mm", "a-1mm"):
        rows = (Path(LOGS) / f"{name}.txt").read_text().splitlines()[:321]
        logs.append(tmp_path / f"{name}.txt")
        logs[-1].write_text("\n".join(rows) + "\n")
    found = real(logs, "maxon-linear-a", fmus, tmp_path)
    for run, position, tracking in zip(found["runs"], (0.0025, 0.007), (0.01, 0.04), strict=True):
        assert run["channels"]["position"]["nrmse"] <= position and run["tracking_error"]["ratio"] <= tracking
        assert run["channels"]["equivalent_current"]["nrmse"] <= 0.025
    inertia, friction = (found["parameters"][name]["value"] for name in ("mechanics.J", "mechanics.T_coulomb"))
    assert inertia == pytest.approx(182.9e-7, rel=0.1)
    assert 1 / 3 < friction / (0.507 * 70.6e-3) < 3


def test_a_real_actuator_on_a_sweep(fmus: dict[str, Path], tmp_path: Path) -> None:
    found = real([Path(LOGS) / "b-sweep.txt"], "maxon-linear-b", fmus, tmp_path)
    channels = found["runs"][0]["channels"]
    assert channels["position"]["nrmse"] <= 0.004 and channels["equivalent_current"]["nrmse"] <= 0.05


def real(logs: list[Path], actuator: str, fmus: dict[str, Path], folder: Path) -> Any:
    """What is found in real logs, for JSON."""
    out, result = folder / "out.toml", folder / "out.json"
    done = ema(
        "calibrate", *logs, "--actuator", actuator, *AS_TOLD, "--out", out, "--json", result, "--fmus", fmus["HF"].parent
    )
    assert done.exit_code in (0, 1), said(done)
    assert read_actuator(str(out)).identity == json.loads(result.read_text())["actuator"]
    return json.loads(result.read_text())

"""Comparison against differences whose size is known in closed form, and what is written of it."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from harness.comparison import Comparison, compare, summary
from harness.errors import HarnessError
from harness.files import results

TIME = np.linspace(0.0, 1.0, 1001)
NAMES = ("candidate", "reference")


def _run(time: np.ndarray, **series: np.ndarray) -> xr.Dataset:
    data = {name: ("time", values, {"units": "rad"}) for name, values in series.items()}
    attrs = {"trial": "SIN", "wall_s": 0.1, "simulated_s": 1.0}
    return xr.Dataset(data, coords={"time": ("time", time)}, attrs=attrs)


def _one(found: np.ndarray, expected: np.ndarray, **options: float) -> Comparison:
    (item,) = compare(_run(TIME, position=found), _run(TIME, position=expected), names=NAMES, **options)
    return item


def test_constant_offset_over_the_range_of_the_reference() -> None:
    item = _one(2.0 * TIME + 0.01, 2.0 * TIME)
    assert item.nrmse == pytest.approx(0.005)
    assert item.max_abs == pytest.approx(0.01)
    assert (item.variable, item.unit, item.trial) == ("position", "rad", "SIN")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_error_that_is_no_number_is_refused(sign: float) -> None:
    """Its square, or the difference itself, is beyond what doubles hold; no warning, no infinite error."""
    expected = np.where(TIME > 0.5, -1e308, 0.0) if sign > 0.0 else TIME
    with pytest.raises(HarnessError, match=r"candidate: its position is 1.7e\+308 at .* too far from the reference's"):
        _one(np.where(TIME > 0.6, 1.7e308, 0.0), expected)


def test_sine_error_has_an_rms_of_its_amplitude_over_root_two() -> None:
    error = 0.03 * np.sin(2.0 * np.pi * 5.0 * TIME)
    item = _one(TIME + error, TIME)
    assert item.nrmse == pytest.approx(0.03 / np.sqrt(2.0), rel=1e-3)


def test_largest_error_and_its_time() -> None:
    found = TIME.copy()
    found[250] -= 0.5
    item = _one(found, TIME)
    assert (item.max_abs, item.t_max_abs) == pytest.approx((0.5, 0.25))
    assert item.outside == pytest.approx(1 / 1001)


def test_tube_is_a_fraction_of_the_range_plus_an_absolute_part() -> None:
    found = TIME + np.where(TIME < 0.25, 0.02, 0.0)
    assert _one(found, TIME, tube=0.01).outside == pytest.approx(0.25, abs=1e-3)
    assert _one(found, TIME, tube=0.01, absolute=0.011).outside == 0.0


def test_constant_reference() -> None:
    still = np.full_like(TIME, 3.0)
    assert _one(still, still).nrmse == 0.0
    assert _one(still + 1.0, still).nrmse is None


def test_other_times_are_interpolated_on_the_overlap() -> None:
    coarse = np.linspace(-0.5, 0.5, 11)
    (item,) = compare(_run(coarse, position=3.0 * coarse), _run(TIME, position=3.0 * TIME), names=NAMES)
    assert item.max_abs == pytest.approx(0.0, abs=1e-12)
    assert item.t_max_abs <= 0.5


def test_no_common_time_and_infinite_values_are_refused() -> None:
    with pytest.raises(HarnessError, match="no time in common"):
        compare(_run(TIME + 5.0, position=TIME), _run(TIME, position=TIME), names=NAMES)
    broken = TIME.copy()
    broken[100] = np.nan
    with pytest.raises(HarnessError, match=r"candidate: its position is no finite number at 0\.1 s of SIN"):
        _one(broken, TIME)


def test_no_common_output_is_refused() -> None:
    with pytest.raises(HarnessError, match="candidate and reference have no output in common"):
        compare(_run(TIME, command=TIME, position=TIME), _run(TIME, command=TIME, motor_speed=TIME), names=NAMES)


def test_only_common_variables_and_never_the_command() -> None:
    found = _run(TIME, position=TIME, command=TIME, motor_speed=TIME)
    expected = _run(TIME, position=TIME, command=TIME, back_emf_a=TIME)
    assert [item.variable for item in compare(found, expected, names=NAMES)] == ["position"]


def test_json_has_exactly_the_agreed_keys(tmp_path: Path) -> None:
    still = np.full_like(TIME, 3.0)
    written = summary([("SIN", "LF", _run(TIME, position=TIME))], [_one(still + 1.0, still)])
    results.write_json(tmp_path / "out.json", written)
    written = json.loads((tmp_path / "out.json").read_text())
    assert written["runs"] == [{"trial": "SIN", "fidelity": "LF", "wall_s": 0.1, "simulated_s": 1.0}]
    (item,) = written["comparisons"]
    assert list(item) == ["trial", "candidate", "reference", "variable", "unit", "nrmse", "max_abs", "t_max_abs"]
    assert item["nrmse"] is None


def test_trajectory_csv_reads_back(tmp_path: Path) -> None:
    position = 0.1 * np.sin(7.0 * TIME)
    results.write(tmp_path / "SIN_LF.csv", results.trajectory_csv(_run(TIME, position=position)))
    table = np.genfromtxt(tmp_path / "SIN_LF.csv", delimiter=",", names=True)
    assert table.dtype.names == ("time", "position")
    np.testing.assert_allclose(table["position"], position, rtol=1e-8)


def test_a_file_is_replaced_whole_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    results.write(tmp_path / "a.txt", "old")
    results.write(tmp_path / "a.txt", "new")
    (tmp_path / "folder").mkdir()
    with pytest.raises(HarnessError, match="cannot be written"):
        results.write(tmp_path / "folder", "text")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "folder"]
    assert (tmp_path / "a.txt").read_text() == "new"

"""FMUs with odd manners that are none of ours: flown all the same, or refused; never silently wrong."""

import logging
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from small import EXITS, FALSE_RESET, NEEDS_STOP, NO_RESET, WARNS

from harness.cli import main
from harness.errors import HarnessError
from harness.flight.component import Component
from harness.flight.twin import Twin
from harness.trials import Trial, trial

Build = Callable[..., Path]


def _short() -> Trial:
    whole = trial("SIN")
    return replace(whole, inputs={name: series[:101] for name, series in whole.inputs.items()})


@pytest.mark.parametrize("manners", [0, NO_RESET, FALSE_RESET])
def test_a_run_begins_anew_whatever_reset_does(small_fmu: Build, manners: int) -> None:
    """The sum of the steps since the start: FMPy starts an instance for it, and gets the same."""
    path = small_fmu("clock", manners=manners)
    with Component(path) as component:
        for _ in range(3):
            slave = component.begin({}, {})
            for n in range(5):
                slave.doStep(0.1 * n, 0.1)
            found = component.read("y1")
            assert found == pytest.approx(0.5, rel=1e-12)
    theirs = fmpy.simulate_fmu(str(path), stop_time=0.5, output_interval=0.1, output=["y1"], validate=False)
    assert found == pytest.approx(theirs["y1"][-1], rel=1e-12)


def test_an_fmu_is_told_the_stop_time(small_fmu: Build) -> None:
    path = small_fmu("twin", manners=NEEDS_STOP)
    with Twin(path) as twin:
        run = twin.run(_short())
        np.testing.assert_array_equal(run.position[1:], run.command[:-1])  # held from point to point
        with pytest.raises(HarnessError, match=r"^twin\.fmu: stop time is needed$"):
            twin.begin({}, {})


def test_a_warning_at_the_start_is_told_once(small_fmu: Build, caplog: pytest.LogCaptureFixture) -> None:
    with Twin(small_fmu("twin", manners=WARNS)) as twin, caplog.at_level(logging.WARNING):
        for _ in range(2):
            assert len(twin.run(_short()).time) == 101
    assert [each.getMessage() for each in caplog.records] == ["twin.fmu: gain 0 of twin has 7 digits"]


def test_warnings_of_two_fmus_are_kept_apart(small_fmu: Build) -> None:
    """FMPy's proxy, which puts in printf's arguments, has one logger for all."""
    with Component(small_fmu("clock")) as one, Component(small_fmu("affine")) as other:
        one.enter({"manners": NEEDS_STOP | WARNS}, stop=1.0)
        other.begin({}, {})
        one._slave.exitInitializationMode()
        assert (one.take_messages(), other.take_messages()) == ("gain 0 of clock has 7 digits", "")


def test_compare_with_an_fmu_that_ends_its_process(
    small_fmu: Build, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It calls exit(0): no table, one line, exit code 2."""
    candidate, reference = str(small_fmu("twin", manners=EXITS)), str(small_fmu("twin"))
    monkeypatch.setattr(sys, "argv", ["ema", "compare", candidate, "--reference", reference, "--trial", "SIN"])
    with pytest.raises(SystemExit) as ended:
        main()
    told, error = capsys.readouterr()
    assert (ended.value.code, told) == (2, "")
    assert error.count("\n") == 1 and "twin.fmu, trial SIN: ended its process with exit code 0" in error


@pytest.mark.parametrize("start", [1e6, 1.7e9])
def test_a_start_at_a_date_is_as_good_as_one_at_0(
    fmus: dict[str, Path], start: float, caplog: pytest.LogCaptureFixture
) -> None:
    """There, times in doubles hold a step of 1e-4 s to 2.4e-7 s only."""
    with Twin(fmus["LF"]) as twin, caplog.at_level(logging.WARNING):
        expected = twin.run(trial("SIN4"))
        assert not caplog.records
        run = twin.run(replace(trial("SIN4"), start=start))
    assert float(run.time[0]) == start
    np.testing.assert_array_equal(run.position, expected.position)
    assert "the FMU counts its time from 0 s in trial SIN4" in caplog.text

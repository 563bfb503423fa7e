"""Stopping: what was flown is kept as a value and says that it is a part; nothing flies after it."""

import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES
from harness.flight.experiment import Experiment, fly, fly_schedules
from harness.flight.interrupt import deferred
from harness.flight.isolate import Isolated
from harness.flight.master import POINTS_A_NOTICE
from harness.flight.switch import parse_schedule
from harness.flight.twin import Twin
from harness.trials import trial

LF, ELF = FIDELITIES["LF"], FIDELITIES["ELF"]
POINTS = len(trial("SIN").time) - 1


def after(points: int) -> Callable[[int], bool]:
    """Progress that asks for a stop once so many communication points have been flown."""
    done = 0

    def on_progress(more: int) -> bool:
        nonlocal done
        done += more
        return done >= points

    return on_progress


def test_a_stopped_run_is_the_beginning_of_the_whole_one(fmus: dict[str, Path]) -> None:
    with Twin(fmus["LF"]) as twin:
        whole = twin.run(trial("SIN"))
        part = twin.run(trial("SIN"), on_progress=after(1))
        again = twin.run(trial("SIN"), on_progress=after(POINTS))
    assert part.attrs["stopped"] and not whole.attrs["stopped"]
    assert part.sizes["time"] == POINTS_A_NOTICE + 1
    assert part.attrs["simulated_s"] == pytest.approx(float(part.time[-1])) and part.attrs["wall_s"] > 0.0
    assert part.equals(whole.isel(time=slice(0, part.sizes["time"])))
    assert again.equals(whole) and not again.attrs["stopped"]  # the stop came when all was done


def test_a_stopped_recording_is_an_interrupt(fmus: dict[str, Path]) -> None:
    outputs = [port for port in ports.OUTPUTS if port.kind == "Real"]
    with Twin(fmus["LF"]) as twin:
        with pytest.raises(KeyboardInterrupt):
            twin.record(trial("SIN"), {}, outputs, on_progress=after(1))
        values, _ = twin.record(trial("SIN"), {}, outputs)
    assert np.isfinite(values).all()


@pytest.fixture
def names() -> list[tuple[str, str]]:
    """Trial and fidelity of each run that begins."""
    return []


@pytest.fixture
def stopped(fmus: dict[str, Path], names: list[tuple[str, str]]) -> Experiment:
    """SIN and SIN4 with LF and ELF, stopped in the second run."""
    flown = [trial("SIN"), trial("SIN4")]
    options = {"on_run": lambda *each: names.append(each), "on_progress": after(POINTS + 1)}
    return fly(flown, [ELF], LF, fmus=fmus["LF"].parent, parameters={}, **options)


def test_an_experiment_keeps_whole_runs_and_the_part_of_one(stopped: Experiment, names: list[tuple[str, str]]) -> None:
    assert stopped.stopped and not stopped.comparisons
    assert list(stopped.runs) == [("SIN", "LF")] and not stopped.runs["SIN", "LF"].attrs["stopped"]
    assert stopped.partial is not None and stopped.partial.attrs["stopped"]
    assert (stopped.partial.attrs["trial"], stopped.partial.attrs["fidelity"]) == ("SIN4", "LF")
    assert names == [("SIN", "LF"), ("SIN4", "LF")]


def test_no_schedule_flies_after_a_stop(fmus: dict[str, Path], stopped: Experiment) -> None:
    schedules = [parse_schedule("LF:ELF@1")]
    assert fly_schedules(stopped, schedules, [trial("SIN")], fmus=fmus["LF"].parent, parameters={}) is stopped


@pytest.mark.parametrize("points, jumps", [(1, 0), (12000, 1)])
def test_a_stopped_schedule_is_a_part_too(fmus: dict[str, Path], points: int, jumps: int) -> None:
    """It ends in its first leg, or in its second."""
    folder, schedules = fmus["LF"].parent, [parse_schedule("LF:ELF@1")]
    whole = fly([trial("SIN")], [], LF, fmus=folder, parameters={})
    options = {"fmus": folder, "parameters": {}}
    found = fly_schedules(whole, schedules, [trial("SIN")], on_progress=after(points), **options)
    assert found.stopped and found.partial is not None and found.runs == whole.runs
    assert (found.partial.attrs["fidelity"], found.partial.attrs["stopped"]) == ("LF:ELF@1", True)
    assert points <= found.partial.sizes["time"] - 1 < POINTS
    complete = fly_schedules(whole, schedules, [trial("SIN")], **options)
    assert len(complete.jumps) == 1 and not complete.stopped and not whole.jumps
    run = complete.runs["SIN", "LF:ELF@1"]
    assert found.partial.equals(run.isel(time=slice(0, found.partial.sizes["time"])))
    assert (float(found.partial.time[-1]) > 1.0) == bool(jumps)
    assert {item.candidate for item in complete.comparisons} == {"LF:ELF@1"}


def test_an_isolated_run_is_stopped_too(fmus: dict[str, Path]) -> None:
    """The stop may come when all was done; either way the run says what it is, and nothing flies after it."""
    with Twin(fmus["LF"]) as twin:
        whole = twin.run(trial("SIN"))
    with Isolated(fmus["LF"]) as isolated:
        part = isolated.run(trial("SIN"), on_progress=after(1))
        assert part.equals(whole.isel(time=slice(0, part.sizes["time"])))
        assert part.attrs["stopped"] == (part.sizes["time"] < POINTS + 1)
        assert isolated.run(trial("SIN")).equals(whole)
    flown = [trial("SIN"), trial("SIN4")]
    found = fly(flown, [], LF, fmus=fmus["LF"].parent, parameters={}, on_progress=after(1), isolate=True)
    assert found.stopped and (found.partial is None) == (list(found.runs) == [("SIN", "LF")])


def test_an_interrupt_is_deferred_and_a_second_one_is_not() -> None:
    before = signal.getsignal(signal.SIGINT)
    with deferred() as interrupted:
        assert not interrupted()
        signal.raise_signal(signal.SIGINT)
        assert interrupted()
    assert interrupted() and signal.getsignal(signal.SIGINT) is before

    def twice() -> None:
        with deferred():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        twice()
    assert signal.getsignal(signal.SIGINT) is before

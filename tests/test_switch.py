"""Switching fidelities in mid-run."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ema_fmu_src.fidelities import FIDELITIES
from harness.cli import main
from harness.comparison import compare
from harness.errors import HarnessError
from harness.flight import switch
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.trials import trial


@pytest.fixture(scope="module")
def hf_sin(fmus: dict[str, Path]):
    with Twin(fmus["HF"]) as twin:
        return twin.run(trial("SIN"))


@pytest.mark.parametrize("text", ["HF:ELF+@0.6:HF@1.4", "ELF+:HF@1.2", "LF:HF@0.7", "HF:LF@0.61234:ELF+@1.5"])
def test_the_position_stays_with_hf(fmus: dict[str, Path], hf_sin, text: str) -> None:
    """Truth: HF alone. SIN, position within 0.1 % NRMSE throughout; no jump but the play's and the ripple's."""
    schedule = switch.parse_schedule(text)
    joined, jumps = switch.fly(schedule, trial("SIN"), fmus=fmus["HF"].parent, parameters={})
    assert np.array_equal(joined.time.values, hf_sin.time.values)
    position = next(item for item in compare(joined, hf_sin, names=(text, "HF")) if item.variable == "position")
    assert position.nrmse is not None and position.nrmse < 1e-3
    assert position.max_abs < 1e-3 * float(np.ptp(hf_sin.position.values))
    assert [jump.after for jump in jumps] == [one.name for one in schedule.fidelities[1:]]
    for jump in jumps:
        assert abs(jump.values["position"]) < 1e-12 and abs(jump.values["motor_speed"]) < 1e-9
        assert jump.values["equivalent_current_filtered"] == pytest.approx(0.0, abs=1e-12)


def test_a_switch_to_itself_changes_nothing_that_matters(fmus: dict[str, Path]) -> None:
    """ELF+ has no hidden state beyond what is handed over: the same run, to rounding."""
    schedule = switch.parse_schedule("ELF+:ELF+@1")
    joined, _ = switch.fly(schedule, trial("SIN4"), fmus=fmus["HF"].parent, parameters={"fault.friction": 2.0})
    with Twin(fmus["ELF"]) as twin:
        whole = twin.run(trial("SIN4"), merged(FIDELITIES["ELF+"], {"fault.friction": 2.0}))
    assert np.max(np.abs(joined.position.values - whole.position.values)) < 1e-9


@pytest.mark.parametrize("text", ["HF", "HF:ELF", "HF@1:ELF@2", "HF:ELF@x", "HF:ELF@2:LF@1", "HF:ELF@-1", "HF:XF@1"])
def test_bad_schedules_are_refused(text: str) -> None:
    with pytest.raises(HarnessError, match=r"--switch|unknown fidelity"):
        switch.parse_schedule(text)


def test_a_switch_after_the_end_is_refused(fmus: dict[str, Path]) -> None:
    with pytest.raises(HarnessError, match=r"SIN ends at 2\.5 s"):
        switch.fly(switch.parse_schedule("HF:LF@3"), trial("SIN"), fmus=fmus["HF"].parent, parameters={})


def test_the_command_line_flies_a_schedule_and_prints_the_jump(
    fmus: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["run", "SIN", "--fidelity", "LF", "--reference", "ELF+", "--switch", "LF:ELF+@0.5"]
    folder = str(fmus["HF"].parent)
    monkeypatch.setattr(sys, "argv", ["ema", *arguments, "--fmus", folder, "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    told = capsys.readouterr().out
    assert "SIN: LF to ELF+ at 0.5 s jumps by position" in told
    assert (tmp_path / "SIN_LF_ELFplus_at_0.5.csv").is_file()

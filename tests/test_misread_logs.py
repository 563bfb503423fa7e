"""Logs that were read as something else without a word: each is read as what it says, or refused or remarked in a line.

Truth: the run that the file was made of, 0.1*sin(6 t) commanded and 0.09*sin(6 t - 0.1) measured at 100 Hz.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from dialects import lines
from test_odd_logs import DEGREES, RUN, C, T, X, _described, _is_the_run, _read
from typer.testing import CliRunner

from harness.actuators.actuator import Output
from harness.cli import app
from harness.cli.options import chosen_actuator
from harness.errors import HarnessError
from harness.faults import FAULTS, checked_limit
from harness.inference.measured import measured_from_log
from harness.logs.log import Between, Log, Logger
from harness.logs.mapping import parse_columns, parse_spec
from harness.logs.observer import observer_of, shift_bounds
from harness.logs.read import read_log, read_one
from harness.logs.spikes import spikes
from harness.logs.stimulus import trials_of
from harness.logs.trialfile import read_trial
from harness.prognosis.history import Flight, IdentifiedFlight
from harness.prognosis.outlook import outlook
from harness.replays.figures import nrmse_20hz


def _with(folder: Path, first: str, second: str, stated: dict[str, str] | None = None) -> Log:
    (folder / "a.csv").write_text(first)
    (folder / "b.csv").write_text(second)
    return read_one(folder / "a.csv", stated, with_files=[folder / "b.csv"])


@pytest.mark.parametrize("missing", ["#N/A", "#NV", "#VALUE!", "#DIV/0!", "#REF!"])
def test_a_row_whose_first_cell_has_no_value_is_a_row(missing: str, tmp_path: Path) -> None:
    rows = [f"{missing if k < 3 or 20 <= k < 30 else c},{t},{x}" for k, (c, t, x) in enumerate(zip(C, T, X, strict=True))]
    text = "\n".join(["command,time,position", *rows])
    with pytest.raises(HarnessError, match="line 22, column command: no command in 10 row"):
        _read(tmp_path, text)
    with pytest.raises(HarnessError, match="line 2, column command: holds no number"):
        read_trial(tmp_path / "own.csv")


@pytest.mark.parametrize("mark", ["#", "%", "//"])
def test_a_comment_with_the_cells_of_a_row_is_one(mark: str, tmp_path: Path) -> None:
    body = lines(RUN, head="").splitlines()
    rows = [f"{mark}{k},{row}" if k % 50 == 7 else f"{k},{row}" for k, row in enumerate(body)]
    _is_the_run(_read(tmp_path, "\n".join(["mark,time,command,position", *rows])))
    told = [f"{mark} bench 3, 4 kg, x", f"{mark} 3", *body[:90], f"{mark} lap, two, begins", *body[90:]]
    _is_the_run(_read(tmp_path, "\n".join([told[0], "time,command,position", *told[1:]])))


@pytest.mark.parametrize("cell", ["1,23,4", "1,0234.5", "12,34"])
def test_thousands_at_a_wrong_place_are_refused(cell: str, tmp_path: Path) -> None:
    rows = [f"{k};1,234.5;{cell if k == 3 else '2'}" for k in range(6)]
    with pytest.raises(HarnessError, match=rf"line 5, column n: '{cell}': behind a ','|'{cell}' .*is not"):
        _read(tmp_path, "time;command;n\n" + "\n".join(rows))


def test_means_are_over_the_columns_own_rows(tmp_path: Path) -> None:
    """A ramp of 1/s: its mean since 40 ms before is t - 20 ms, whatever rows of other files or empty cells lie between."""
    t = np.arange(0.0, 4.0, 0.04)
    mean = t - 0.02
    log = _with(tmp_path, lines({"time": np.arange(400) * 0.01, "command": np.arange(400) * 0.01}),
                lines({"time": t, "position": mean}),
                {"position": "position averaged", "command": "command ramped"})  # fmt: skip
    one = np.full(400, np.nan)
    one[::4] = mean
    own = {"time": np.arange(400) * 0.01, "command": np.arange(400) * 0.01, "position": one}
    stated = {"position": "position averaged"}
    masked = mean.copy()
    masked[50] = 900.0
    dropped = mean.copy()
    dropped[70] = np.nan
    alone = {"time": t, "command": t}
    for each in (
        log,
        _read(tmp_path, lines(own), stated),
        _read(tmp_path, lines(alone | {"position": masked}), stated),
        _read(tmp_path, lines(alone | {"position": dropped}), stated),
    ):
        assert each.loggers == {"position": Logger("averaged")}
        trial = next(iter(trials_of(each).values()))
        ramp = trial.time[:, None]
        seen = observer_of(each, trial, ("position",)).rows(ramp, np.zeros(1))[:, 0]
        known = np.isfinite(each.channels["position"])
        known[0] = False
        assert known.sum() > 90
        np.testing.assert_allclose(seen[known], each.channels["position"][known], atol=2e-4)


def test_rates_are_the_channels_own(tmp_path: Path) -> None:
    slow, fast = np.arange(50) * 0.04, np.arange(2000) * 0.001
    first, second = {"time": slow, "command": slow, "position": slow}, {"time": fast, "motor_speed": fast}
    log = _with(tmp_path, lines(first), lines(second), {"command": "command ramped"})
    assert log.rate_of("position") == pytest.approx(25.0) and log.rate_of("motor_speed") == pytest.approx(1000.0)
    assert shift_bounds(log, ["position", "motor_speed"]).tolist() == [0.01, 0.01]
    own = log.rows_of("position")
    assert nrmse_20hz(log.time[own], log.channels["position"][own], log.time[own]) is None
    assert measured_from_log(log).is_slow
    dense = {"time": fast, "command": fast, "position": fast}
    log = _with(tmp_path, lines(dense), lines({"time": slow, "motor_speed": slow}))
    assert shift_bounds(log, ["position", "motor_speed"]).tolist() == [0.0, 0.01] and log.between is None
    assert list(trials_of(log)) == [Between.RAMPED]


def test_a_gap_is_a_straight_line_in_both_low_passed_curves() -> None:
    time = np.arange(1000) * 0.001
    twin = np.sin(60.0 * time)
    measured = twin.copy()
    measured[::2] = np.nan
    measured[400:480] = np.nan
    assert nrmse_20hz(time, measured, twin) == pytest.approx(0.0, abs=1e-12)


MS = {"time": 1e3 * T, "command": C}
FURTHER: dict[str, tuple[dict[str, np.ndarray], str, dict[str, str], str]] = {
    "its header's unit": (MS, "time [s],position", {"time": "time [ms]"}, r"\[ms\] is stated, its header says \[s\]"),
    "no unit": ({"time": T, "command": C}, "t,position", {}, r"in what unit, is open: --column 'time=b.csv:t \[UNIT\]'"),
    "two words": ({"time": T, "command": C}, "elapsed [s],clock,position", {}, r"b.csv:elapsed \[s\]' or --column"),
    "both files": (RUN, "time,position", {}, "'position' is in .*a.csv and in .*b.csv; say which.*position=a.csv:position"),
}


@pytest.mark.parametrize("what", FURTHER)
def test_what_is_open_in_a_further_file_is_refused(what: str, tmp_path: Path) -> None:
    first, head, stated, told = FURTHER[what]
    table = {f"{k}": T for k in range(head.count(","))} | {"x": X + 1.0}
    with pytest.raises(HarnessError, match=told):
        _with(tmp_path, lines(first), lines(table, head=head), stated)


def test_what_is_stated_of_a_further_file_holds_for_it(tmp_path: Path) -> None:
    first = lines({"time": T, "command": C})
    _is_the_run(_with(tmp_path, first, lines({"t": 1e3 * T, "position": X}), {"time": "b.csv:t [ms]"}))
    log = _with(tmp_path, lines(MS), lines({"time [s]": T, "position": X}), {"time": "1 [ms]"})
    _is_the_run(log)  # a number is one of the first file
    log = _with(tmp_path, lines(RUN), lines({"time": T, "position": X + 1.0}), {"position": "a.csv:position"})
    _is_the_run(log)


FACTORS = {
    "motor_speed (1000 rpm)": 1e3 * np.pi / 30.0,
    "load_torque (0.1 N.m)": 0.1,
    "load_torque_N_m": 1.0,
    "equivalent_current_filtered (10 mA)": 0.01,
}


@pytest.mark.parametrize("word", FACTORS)
def test_units_with_factors_are_taken_in_round_brackets_too(word: str, tmp_path: Path) -> None:
    log = _read(tmp_path, lines(RUN | {word: X}))
    key = word.split(" ")[0].removesuffix("_N_m")
    np.testing.assert_allclose((log.inputs | log.channels)[key], FACTORS[word] * X)


@pytest.mark.parametrize(("word", "told"), [("motor_speed_rad", r"\[rad\] does not measure what \[rad/s\]"),
                                            ("load_torque_kg_m", "is no unit of it that is known")])  # fmt: skip
def test_units_that_are_none_of_it_are_refused(word: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match=told):
        _read(tmp_path, lines(RUN | {word: X}))


def test_rows_without_a_run_are_counted(tmp_path: Path) -> None:
    rows = [f"{row},{'' if k < 5 else 1}" for k, row in enumerate(lines(RUN, head="").splitlines())]
    (tmp_path / "own.csv").write_text("\n".join(["time,command,position,run", *rows]))
    assert any("5 row(s) without a run are left out" in line for line in read_log(tmp_path / "own.csv")[0].remarks)


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_a_rotary_run_is_one_in_every_format(form: str, fmus: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("time,command\n0,0\n0.05,0.01\n")
    words = ["--fidelity", "LF", "--reference", "LF", "--fmus", str(fmus["LF"].parent), "--out", str(tmp_path)]
    result = CliRunner().invoke(app, ["run", "--trial-file", str(tmp_path / "own.csv"), "--format", form, *words])
    assert result.exit_code == 0
    for output in (Output(), Output(lead=0.005)):
        log = read_one(tmp_path / f"own_LF.{form}", None, output)
        assert log.inputs["command"][-1] == pytest.approx(0.01)
        assert read_trial(tmp_path / f"own_LF.{form}", output).inputs["command"][-1] == pytest.approx(0.01)


def test_lists_in_parquet_are_left_out(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({**RUN, "raw": [[1.0, 2.0]] * len(T), "at": [{"x": 1}] * len(T)}), tmp_path / "own.parquet")
    log = read_one(tmp_path / "own.parquet")
    _is_the_run(log)
    assert sum("lists or structs" in line for line in log.remarks) == 2


def test_invalid_samples_of_one_channel_are_missing(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    invalid = np.arange(len(T)) == 54
    with MDF(version="4.10") as file:
        file.append([Signal(C, T, name="command"), Signal(X, T, name="position", invalidation_bits=invalid)])
        file.save(tmp_path / "own.mf4", overwrite=True)
    assert np.flatnonzero(np.isnan(read_one(tmp_path / "own.mf4").channels["position"])).tolist() == [54]


def test_too_few_runs_are_counted_as_they_are() -> None:
    nothing = {name: SimpleNamespace(identifiable=False, effect=True) for name in FAULTS}
    flights = [Flight(Path(f"{k}.csv"), str(k), float(k)) for k in range(3)]
    history = [IdentifiedFlight(each, nothing, "") for each in flights[:2]]  # type: ignore[arg-type]
    history.append(IdentifiedFlight(flights[2], {}, "2.csv: the file is empty"))
    with pytest.raises(HarnessError, match=r"2 run\(s\) can be used, 3 are the least.*left out: 2.csv: the file is empty"):
        outlook(history, {}, "days")


BAD_WORDS = {
    "command=2 [rad] held ramped": "'ramped' comes after",
    "equivalent_current=3 [A] sampled averaged": "'averaged' comes after",
    "equivalent_current=3 [A] averaged filtered 2 ms": "comes after",
    "position=3 [deg] motor user": "'user' comes after",
    "command=2 [deg": "a bracket without the other",
    "motor_speed=3 filtered 1e400 s": "at most 10 s",
    "motor_speed=3 filtered 1e300 s": "at most 10 s",
}


@pytest.mark.parametrize("text", BAD_WORDS)
def test_words_that_contradict_are_refused(text: str) -> None:
    key, _, rest = text.partition("=")
    with pytest.raises(HarnessError, match=BAD_WORDS[text]):
        parse_spec(key, rest, "own")


BAD_FILES = {
    "[log]\ntime = 0": r"\[log\] time: columns are numbered from 1",
    '[log]\ncommand = "4 [deg]"\nposition = "4"': r"\[log\] position: '4' is the column of command too",
    '[log]\nposition = "4 [deg] motor user"': r"\[log\] position: 'user' comes after",
    "[parameters]\ntime = 1": r"own.toml, \[parameters\] time",
    "[parameters]\nmotr.R = 1": r"own.toml, \[parameters\] motr.R",
}


@pytest.mark.parametrize("text", BAD_FILES)
def test_actuator_files_are_refused_where_they_are_wrong(text: str, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(HarnessError, match=BAD_FILES[text]):
        chosen_actuator(str(tmp_path / "own.toml"))


def test_limits_to_both_sides_stay() -> None:
    assert checked_limit("gain", 1.4, "own") == {"gain": 1.4} and checked_limit("gain", 0.6, "own") == {"gain": 0.6}


@pytest.mark.parametrize("row", [0, 50, -1])
def test_a_value_far_off_is_masked_in_any_row(row: int, tmp_path: Path) -> None:
    position = X.copy()
    position[row] = 1e6
    log = _read(tmp_path, lines(RUN | {"position": position}))
    assert np.flatnonzero(np.isnan(log.channels["position"])).tolist() == [row % len(X)]
    decay = 10.0 * 0.5 ** np.arange(100)
    assert not spikes(decay).any() and not spikes(decay[::-1]).any()


def test_an_option_replaces_what_the_actuators_log_says_of_the_position(tmp_path: Path) -> None:
    log = {"position": "4 [mm] motor", "command": "2"}
    assert parse_columns(["position_error=err [mm]"], log) == {"command": "2", "position_error": "err [mm]"}
    stated = parse_columns(["equivalent_current=command"], log | {"position": "3"})
    with pytest.raises(HarnessError, match=r"equivalent_current='command'.* by --column or the actuator's \[log\]"):
        _read(tmp_path, lines(RUN), stated)


def _headless(*series: np.ndarray) -> str:
    return lines({str(k): each for k, each in enumerate(series)}, "\t", head="")


def test_columns_leaves_a_unit_open_that_nothing_tells(tmp_path: Path) -> None:
    speed = np.gradient(1e3 * X, T)
    text = _headless(1e3 * T, 1e3 * C, 1e3 * X, speed, 1e4 * np.gradient(speed, T))
    told, columns = _described(tmp_path, text)
    assert [each["guess"] for each in columns] == ["time", "command", "position", "motor_speed", "equivalent_current"]
    assert "--column 'command=2 [UNIT]'" in told and "[deg]" not in told and told.count("--actuator names a linear") == 1
    (tmp_path / "rod.toml").write_text('[output]\nlead = "5 mm"\n')
    told, _ = _described(tmp_path, text, "own.csv", "--actuator", str(tmp_path / "rod.toml"))
    assert "--column 'command=2 [mm]' --column 'position=3 [mm]'" in told
    told, _ = _described(tmp_path, lines({"t": T, "Sollwinkel": DEGREES["command"], "Istwinkel": DEGREES["position"]}))
    assert "--column 'command=Sollwinkel [deg]'" in told and "UNIT" not in told
    with pytest.raises(HarnessError, match="'UNIT' is not a known unit"):
        _read(tmp_path, lines(RUN), {"command": "2 [UNIT]"})

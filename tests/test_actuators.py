"""Actuator files: what is read, what is refused, what follows, and that the library flies.

Truths: conversions and data-sheet formulas by hand; the definition of lead (a turn of the user shaft); for the no-load speed
the twins themselves.
"""

import json
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES
from ema_fmu_src.fmu import ssp
from harness.actuators.actuator import DEFAULT, Actuator, Output
from harness.actuators.derived import derived
from harness.actuators.fmus import variant
from harness.actuators.read import library, read_actuator
from harness.actuators.values import stated
from harness.budgets import Verdict
from harness.cli import main
from harness.comparison import compare
from harness.errors import HarnessError
from harness.faults import FAULTS
from harness.flight.tryout import refusals
from harness.flight.twin import Twin
from harness.parameters import merged
from harness.show.actuator import as_dict, unstated_lines
from harness.trials import STEP, Trial, grid

RPM = 2.0 * math.pi / 60.0
TRAVEL = 0.005 / (2.0 * math.pi)
"""Metres a radian of the user shaft, at a lead of 5 mm."""
WORKED = """
name = "mine"
description = "a worked example"
[parameters]
"mechanics.J" = "600 g.cm2 +- 5 %"
mechanics.end_stop = "60 mm +- 0.02 mm"
gear.backlash = "0,01 mm"
gear.ratio = 5.3
fault.open_switch = "a_upper"
driver.coupled_saturation = true
[sheet]
terminal_resistance = "0.16 ohm +- 10 %"
terminal_inductance = "257 uH"
torque_constant = "70.6 mN.m/A"
speed_constant = "135 rpm/V"
no_load_current = "507 mA"
no_load_speed = "6480 rpm"
nominal_voltage = "48 V"
pole_pairs = 8
[output]
lead = "5 mm"
[log]
time = "1 [ms]"
run = "stroke"
[limits]
friction = 2.5
[provenance]
by = "me"
date = 2026-01-31
[provenance.sources]
terminal_resistance = "page 3"
"""


def written(folder: Path, text: str, name: str = "mine.toml") -> Path:
    (folder / name).write_text(text)
    return folder / name


@pytest.fixture
def worked(tmp_path: Path) -> Path:
    return written(tmp_path, WORKED)


def ema(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    """The exit code of a command."""
    monkeypatch.setattr(sys, "argv", ["ema", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


# --- reading ------------------------------------------------------------------------------------------------------------


def test_a_file_is_read_as_it_is_meant(worked: Path) -> None:
    found = read_actuator(str(worked))
    K_t, I_0, w_0 = 0.0706, 0.507, 6480 * RPM
    expected = {
        "mechanics.J": 600e-7,
        "mechanics.end_stop": 0.06 / TRAVEL,
        "gear.backlash": 1e-5 / TRAVEL,
        "gear.ratio": 5.3,
        "fault.open_switch": 1.0,
        "driver.coupled_saturation": 1.0,
        "motor.R": 0.08,
        "motor.L": 128.5e-6,
        "motor.K_e": K_t / 1.5,
        "motor.p": 8.0,
        "supply_voltage": 48.0,
        "mechanics.T_coulomb": K_t * I_0 / 2.0,
        "mechanics.T_static": K_t * I_0 / 2.0,
        "mechanics.C": K_t * I_0 / 2.0 / w_0,
    }
    assert found.parameters == pytest.approx(expected, rel=1e-12)
    tolerances = {"mechanics.J": 30e-7, "mechanics.end_stop": 2e-5 / TRAVEL, "motor.R": 0.008}
    assert found.tolerances == pytest.approx(tolerances, rel=1e-12)
    assert found.origins["motor.R"] == "R_tt/2 = 0.16/2 = 0.08 Ohm; page 3"
    assert found.origins["mechanics.J"] == "stated"
    assert (found.name, found.output.lead, found.limits) == ("mine", 0.005, {"friction": 2.5})
    assert found.log == {"time": "1 [ms]", "run": "stroke"}
    assert found.warnings == ()  # 1/(135 rpm/V) is K_t within 0.2 %


@pytest.mark.parametrize(
    ("given", "unit", "value", "width"),
    [
        (3, "Ohm", 3.0, None),
        ("3", "Ohm", 3.0, None),
        ("135 rpm", "rad/s", 135 * RPM, None),
        ("7.4 mV/rpm", "V.s/rad", 7.4e-3 / RPM, None),
        ("4e-4 mN.m/rpm", "N.m.s/rad", 4e-7 / RPM, None),
        ("600 g.cm2 ± 30 g.cm2", "kg.m2", 6e-5, 3e-6),
        ("600 +- 30 g.cm2", "kg.m2", 6e-5, 3e-6),
        ("600 g.cm2 +/- 30", "kg.m2", 6e-5, 3e-6),
        ("-2 A +- 5%", "A", -2.0, 0.1),
        ("20 degC +- 2 degC", "K", 293.15, 2.0),
    ],
)
def test_values_with_units_and_tolerances(given: object, unit: str, value: float, width: float | None) -> None:
    found = stated(given, unit, "here")
    assert found.value == pytest.approx(value, rel=1e-12)
    assert found.tolerance == (None if width is None else pytest.approx(width, rel=1e-12))


BAD = {
    "[parameter]\nx = 1": r"unknown key in .*: 'parameter': did you mean parameters",
    '[parameters]\n"motor.r" = 1': r"unknown parameter 'motor.r': did you mean motor.R",
    "[parameters]\nposition = 1": r"\[parameters\] position: position is not a parameter",
    '[parameters]\n"motor.R" = "1 mm"': r"\[parameters\] motor.R: \[mm\] does not measure what \[Ohm\] does",
    '[parameters]\n"motor.R" = "one"': r"motor.R: 'one' is not a number with a unit, such as '1 Ohm'",
    '[parameters]\n"motor.R" = true': r"motor.R: True is not a number",
    '[parameters]\n"motor.R" = nan': r"motor.R: nan is not a finite number",
    '[parameters]\n"motor.R" = -1': r"motor.R = -1 is out of range, 0.001 to 1000 Ohm",
    '[parameters]\n"motor.R" = "1 ohm +- 2 mm"': r"motor.R: \[mm\] does not measure",
    '[parameters]\n"motor.R" = "1 ohm +- -2 %"': r"a tolerance of 0 or more is needed",
    '[parameters]\n"motor.R" = "1 +- 2 +- 3"': r"more than one tolerance",
    '[parameters]\n"motor.p" = 1.5': r"motor.p is a whole number, 1.5 is not",
    '[parameters]\n"fault.open_switch" = "upper"': r"'upper' is not a number or none or a_upper",
    '[parameters]\n"driver.coupled_saturation" = 1': r"1 is not true or false",
    '[parameters]\n"motor.p" = 8\n"fault.zeta" = 0.2': r"motor.p \* fault.zeta = 1.6 is out of range",
    '[parameters]\n"mechanics.end_stop" = "60 mm"': r"\[mm\] does not measure what \[rad\] does",
    '[parameters]\n"controller.speed_limit" = "50 Hz"': r"\[Hz\] counts periods",
    '[parameters]\n"controller.speed_limit" = "3000 1/min"': r"write rpm for 1/min",
    "[sheet]\ntorque = 1": r"unknown key in .*\[sheet\]: 'torque': did you mean torque_constant",
    "[sheet]\nterminal_resistance = 0": r"terminal_resistance: more than 0 is needed",
    "[sheet]\nno_load_current = 1": r"no_load_current: torque_constant, speed_constant or motor.K_e is needed",
    '[sheet]\nno_load_speed = "1 rpm"': r"no_load_speed: no_load_current is needed beside it",
    "[sheet]\npole_pairs = 99": r"\[sheet\], motor.p: motor.p = 99 is out of range, 1 to 50",
    "[output]\nlaed = 1": r"unknown key in .*\[output\]: 'laed': did you mean lead",
    '[output]\nlead = "5 V"': r"\[output\] lead: \[V\] does not measure what \[m\] does",
    "[output]\nlead = 0": r"\[output\] lead: 0 m a turn is out of range",
    '[output]\nlead = "5 mm +- 1 %"': r"\[output\] lead: a length without a tolerance",
    '[log]\nvelocity = "3"': r"unknown key in .*\[log\]: 'velocity'",
    "[log]\ntime = true": r"\[log\] time: a text 'COLUMN \[unit\]' is needed",
    "[limits]\nfrixion = 2": r"unknown fault 'frixion': did you mean friction",
    "[limits]\nfriction = 1": r"\[limits\] friction: a number other than 1, which is healthy",
    "[calibration]\nvalue = 1": r"unknown key in .*\[calibration\]: 'value': did you mean values",
    '[calibration]\nvalues = {"mechanics.C" = 1e-4}\ncovariance = [[1, 2]]': r"1 rows of 1 numbers are needed",
    '[calibration]\nvalues = {"mechanics.C" = 1e-4}\ncovariance = [[-1]]': r"no negative number on its diagonal",
    '[provenance.sources]\n"motor.X" = "page 3"': r"unknown key in .*sources\]: 'motor.X'",
    '[parameters]\n"controller.speed_limit" = "6,480 rpm"': r"thousands or decimals behind its comma; write 6480 or 6.480",
    '[parameters]\n"motor.p" = "800 %"': r"motor.p is a plain number, not one in %",
    '[parameters]\n"gear.ratio" = "50 counts"': r"gear.ratio is a plain number, not one in counts",
    '[sheet]\npole_pairs = "800 %"': r"motor.p is a plain number",
    '[sheet]\ntravel_constant = "6669 rad/m"': r"travel_constant: \[output\] lead is needed beside it",
    '[parameters]\n"motor.K_e" = "0.07 Nm/A"': r"an angle is missing in it",
    '[parameters]\n"motor.R" = 1' + 400 * "0": r"motor.R: a whole number of 401 digits is too large",
    "[sheet]\npole_pairs = 1" + 400 * "0": r"pole_pairs: a whole number of 401 digits is too large",
    "[sheet]\npole_pairs = 1" + 5000 * "0": r"is not TOML: Exceeds the limit",
    '[parameters]\nmotor.R = 1\n"motor.R" = 2': r"\[parameters\] motor.R: it is there twice, with and without quotes",
    '[calibration]\nnames = ["motor.r"]\nvalues = {"motor.R" = 1}': r"'motor.r': did you mean motor.R",
    '[calibration]\nnames = ["motor.R", "motor.R"]\nvalues = {"motor.R" = 1}': r"names: motor.R is there twice",
    '[calibration]\nnames = ["bench.x"]\nvalues = {"motor.R" = 1}': r"names: motor.R is missing",
    '[calibration]\nnames = ["motor.R", "x"]\nvalues = {"motor.R" = 1}\ncovariance = [[1, 2], [2, 1]]': r"or less than not",
    '[calibration]\nnames = ["motor.R", "x"]\nvalues = {"motor.R" = 1}\ncovariance = [[1, 2], [2, 4]]': r"vary not at all",
    "[limits]\nN_a = 1.2": r"\[limits\] N_a: less than 1, which is healthy, is needed",
    "[limits]\nfriction = 0.5": r"\[limits\] friction: more than 1, which is healthy, is needed",
    "[limits]\ngain = 2000": r"\[limits\] gain: fault.gain = 2000 is out of range",
    "[parameters]\ntime = 1": r"mine.toml, \[parameters\] time: unknown parameter 'time'",
    "[parameters]\n" + "a." * 3000 + "b = 1": r"mine.toml, parameters: more than 32 tables or lists in each other",
    "[provenance]\nx = " + 60 * "[" + "1" + 60 * "]": r"mine.toml, provenance: more than 32 tables or lists",
    'name = "../evil"': r"mine.toml, name: '../evil' cannot name a file",
    'name = "' + 300 * "x" + '"': r"cannot name a file; .* of at most 100 characters",
    "name = 3": r"name: a text is needed, not 3",
    "parameters = 3": r"parameters: a table \[parameters\] is needed, not 3",
    "[parameters": r"is not TOML",
}


@pytest.mark.parametrize("text", BAD)
def test_what_cannot_be_used_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    with pytest.raises(HarnessError, match=BAD[text]) as refused:
        read_actuator(str(written(tmp_path, text)))
    assert "\n" not in str(refused.value)


def test_names_and_files_that_are_none(tmp_path: Path) -> None:
    for name, told in (
        ("defualt", "--actuator: unknown actuator 'defualt': did you mean default"),
        (str(tmp_path / "none.toml"), "none.toml: cannot be read: No such file"),
        (str(written(tmp_path, "<a/>", "a.ssv")), "a.ssv: is no SSP parameter set"),
        (str(written(tmp_path, "<a", "b.ssv")), "b.ssv: is not XML"),
        (str(written(tmp_path, "", "c.txt")), "c.txt: a .toml file, or an .ssv file"),
    ):
        with pytest.raises(HarnessError, match=told):
            read_actuator(name)


# --- data sheets --------------------------------------------------------------------------------------------------------


def sheet(folder: Path, words: str, parameters: str = "") -> Actuator:
    return read_actuator(str(written(folder, f"[sheet]\n{words}\n[parameters]\n{parameters}\n")))


@pytest.mark.parametrize("alone", ['speed_constant = "135 rpm/V"', 'back_emf_constant = "7.407407407407 mV/rpm"'])
def test_the_torque_constant_follows_from_the_speed_constant(tmp_path: Path, alone: str) -> None:
    """K_t = 1/k_n in SI units, K_e = K_t/1.5."""
    assert sheet(tmp_path, alone).parameters["motor.K_e"] == pytest.approx(1.0 / (135 * RPM) / 1.5, rel=1e-9)


@pytest.mark.parametrize(("ratio", "named"), [(0.94, 1), (0.96, 0), (1.0, 0), (1.04, 0), (1.08, 1), (1.155, 0), (1.3, 1)])
def test_constants_that_contradict_each_other_are_named(tmp_path: Path, ratio: float, named: int) -> None:
    """1/k_n is K_t in block form, 2/sqrt(3)*K_t in sine form; 5 % off both is a contradiction."""
    found = sheet(tmp_path, f"torque_constant = 0.05\nback_emf_constant = {0.05 * ratio}")
    assert len(found.warnings) == named and found.parameters["motor.K_e"] == pytest.approx(0.05 / 1.5)
    assert all("neither 1 (block) nor 1.155 (sine, line to line)" in line for line in found.warnings)


def test_stated_friction_wins_over_the_no_load_current(tmp_path: Path) -> None:
    words = "torque_constant = 0.1\nno_load_current = 0.5\nno_load_speed = 100"  # K_t*I_0 = 0.05 N.m
    found = sheet(tmp_path, f"{words}\ncoulomb_friction = 0.03")
    assert found.parameters["mechanics.T_coulomb"] == 0.03
    assert found.parameters["mechanics.C"] == pytest.approx(0.02 / 100) and not found.warnings
    found = sheet(tmp_path, words, '"mechanics.C" = 1e-4\n"mechanics.T_coulomb" = 0.02')
    assert found.parameters["mechanics.C"] == 1e-4
    assert sum("friction at no load, T_coulomb + C*w_0, is 0.03 N.m" in line for line in found.warnings) == 1


def test_a_stated_parameter_wins_over_the_sheet_and_is_named(tmp_path: Path) -> None:
    found = sheet(tmp_path, "terminal_resistance = 2", '"motor.R" = 1.2')
    assert found.parameters["motor.R"] == 1.2 and found.origins["motor.R"] == "stated"
    assert found.warnings == ("motor.R = 1.2 is stated, off by +20 % from the sheet's: R_tt/2 = 2/2 = 1 Ohm",)


def test_calibrated_values_win_over_all(tmp_path: Path) -> None:
    text = (
        '[sheet]\nterminal_resistance = "2 ohm +- 10 %"\n[calibration]\nnames = ["bench.delay", "motor.R"]\n'
        'values = {"motor.R" = 0.9}\ncovariance = [[1.0, 0.0], [0.0, 1e-4]]\n'
    )
    found = read_actuator(str(written(tmp_path, text)))
    assert (found.parameters["motor.R"], found.origins["motor.R"]) == (0.9, "calibrated")
    assert found.tolerances["motor.R"] == pytest.approx(1.96 * 0.01)


def test_without_a_no_load_speed_all_is_coulomb_friction(tmp_path: Path) -> None:
    """K_t*I_0 = 0.05 N.m is T_coulomb and C is 0; what makes of it another current at the no-load speed is named."""
    words = "torque_constant = 0.1\nno_load_current = 0.5"
    found = sheet(tmp_path, words)
    assert found.parameters["mechanics.T_coulomb"] == pytest.approx(0.05) and found.parameters["mechanics.C"] == 0.0
    (current,) = (item for item in derived(found) if item.name == "no-load current")
    assert not found.warnings and (current.value, current.unit) == (pytest.approx(0.5), "A")
    assert found.origins["mechanics.T_coulomb"] == "K_t*I_0 = 0.1*0.5 = 0.05 N.m"  # each number once
    assert sheet(tmp_path, f"{words}\nviscous_friction = 1e-6").warnings == ()
    for more, told in (("viscous_friction = 1e-4", 0.05 + 1e-4 * 400), ('coulomb_friction = "10 N.m"', 10.0)):
        found = sheet(tmp_path, f"{words}\n{more}")
        (line,) = (line for line in found.warnings if line.startswith("no-load current"))
        amperes = float(line.split()[2])
        assert "but no_load_current is 0.5 A" in line and amperes == pytest.approx(told / 0.1, rel=0.2)


def test_a_linear_actuator_is_no_rotary_one(tmp_path: Path) -> None:
    """A travel constant of 6669 rad/m at a lead of 5 mm is a ratio of 6669*0.005/(2*pi); what is left rotary is named."""
    lead = '[output]\nlead = "5 mm"\n'
    found = read_actuator(str(written(tmp_path, lead)))
    assert [line.partition(" ")[0] for line in found.warnings] == ["gear.ratio", "mechanics.end_stop"]
    text = f'{lead}[sheet]\ntravel_constant = "6669 rad/m"\n[parameters]\nmechanics.end_stop = "50 mm"\n'
    found = read_actuator(str(written(tmp_path, text)))
    assert found.parameters["gear.ratio"] == pytest.approx(6669 * TRAVEL, rel=1e-12) and not found.warnings
    assert found.origins["gear.ratio"].startswith("k_x*lead/(2*pi) = 6669*0.005/(2*pi)")


@pytest.mark.parametrize(
    ("lead", "metres"),
    [('"5 mm/turn"', 5e-3), ('"5 mm/revolution"', 5e-3), ('"5 mm"', 5e-3), ("0.005", 5e-3), ('"5 mm/rad"', 0.01 * math.pi)],
)
def test_a_lead_is_a_travel_a_turn(tmp_path: Path, lead: str, metres: float) -> None:
    found = read_actuator(str(written(tmp_path, f"[output]\nlead = {lead}\n")))
    assert found.output.lead == pytest.approx(metres, rel=1e-12)


def test_what_is_hardly_meant_is_named(tmp_path: Path) -> None:
    stated_well = '[parameters]\ngear.ratio = 5\nmechanics.end_stop = "9 rad"\n'
    found = read_actuator(str(written(tmp_path, f"{stated_well}[output]\nlead = 5\n")))
    assert len(found.warnings) == 1 and "lead 5 m a turn" in found.warnings[0]
    found = read_actuator(str(written(tmp_path, '[parameters]\ncontroller.K_p = "80 A.s/rad"\n')))
    assert len(found.warnings) == 1 and "the sampled speed loop is unstable from 2 on" in found.warnings[0]


def test_a_band_that_hides_the_friction_is_named(tmp_path: Path) -> None:
    """T_coulomb/K_t = 0.02/0.1 = 0.2 A."""
    for band, named in ((0.19, 0), (0.21, 1)):
        text = f"mechanics.T_coulomb = 0.02\nmechanics.T_static = 0.03\ninverter.hysteresis = {band}"
        found = sheet(tmp_path, "torque_constant = 0.1", text)
        assert sum("is more than the 0.2 A that friction needs" in line for line in found.warnings) == named


def test_what_nobody_stated_is_listed(tmp_path: Path) -> None:
    text = '[parameters]\ncontroller.K_p = 0.1\ngear.ratio = 5\n[output]\nlead = "5 mm"\n'
    found = read_actuator(str(written(tmp_path, text)))
    lines = unstated_lines(found)
    assert [line.split(": ")[1] for line in lines] == ["controller", "gear", "inverter"]
    assert "K_i 10 A/rad" in lines[0] and "K_p " not in lines[0]
    assert "backlash 7.958e-08 m" in lines[1] and "ratio" not in lines[1]
    assert unstated_lines(DEFAULT) == [] and len(json.dumps(as_dict(found, None)["unstated"])) > 100


def test_end_stops_that_nobody_stated_are_told_where_it_flies(
    fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On stderr; on stdout, whose flight it was."""
    own = written(tmp_path, '[parameters]\ngear.ratio = 5.3\n[output]\nlead = "5 mm"\n')
    trial = written(tmp_path, "time,command\n0,0\n0.1,1e-4\n", "own.csv")
    common = ("--actuator", own, "--fmus", fmus["LF"].parent, "--out", tmp_path)
    told = "mechanics.end_stop is not stated: the rotary default of 0.6 is kept, 0.477 mm of travel"
    fly = ("run", "--trial-file", trial, "--fidelity", "LF", "--reference", "LF")
    again = ("replay", tmp_path / "own_LF.csv", "--fidelity", "LF")
    for words in (fly, again):
        assert ema(monkeypatch, *words, *common) == 0
        shown = capsys.readouterr()
        assert (shown.err.count(told) == 1 and "mine" in shown.out) or words is fly
    assert ema(monkeypatch, *fly, *common, "--set", "mechanics.end_stop=10") == 0
    assert told not in capsys.readouterr().err


def test_a_file_with_a_mark_of_its_encoding_is_read(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_bytes(b"\xef\xbb\xbf[parameters]\nmotor.R = 2\n")
    assert read_actuator(str(tmp_path / "mine.toml")).parameters == {"motor.R": 2.0}


# --- the border ---------------------------------------------------------------------------------------------------------


def test_a_turn_of_the_user_shaft_is_a_lead() -> None:
    """And power is the same on both sides: F*v = T*w."""
    output = Output(0.005)
    assert output.outside("position", np.array([2.0 * math.pi]))[0] == pytest.approx(0.005)
    assert output.scale("load_torque") * output.scale("position") == pytest.approx(1.0)
    assert output.inside("command", output.outside("command", np.array([0.3])))[0] == pytest.approx(0.3)
    assert [output.unit(name) for name in ("position", "load_torque", "motor_speed")] == ["m", "N", "rad/s"]
    run = xr.Dataset({"position": ("time", [2.0 * math.pi], {"units": "rad"}), "motor_speed": ("time", [1.0])})
    shown = output.shown(run)
    assert (float(shown.position[0]), shown.position.attrs["units"]) == (pytest.approx(0.005), "m")
    assert float(run.position[0]) == pytest.approx(2.0 * math.pi) and float(shown.motor_speed[0]) == 1.0
    assert Output().shown(run) is run


def test_a_linear_actuator_is_in_metres_outside(
    worked: Path, fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Truth: the same trial in rad, flown by the twin with the ports' units."""
    text = WORKED.replace('fault.open_switch = "a_upper"', "")
    worked.write_text(text)
    time = np.linspace(0.0, 0.1, 101)
    metres, newtons = 1e-4 * np.sin(40.0 * time), 3.0 * np.ones(101)
    table = np.column_stack([time, metres, newtons])
    np.savetxt(tmp_path / "own.csv", table, delimiter=",", header="time,command,load_torque", comments="", fmt="%.12g")
    folder = fmus["LF"].parent
    words = ("--trial-file", tmp_path / "own.csv", "--actuator", worked, "--fmus", folder, "--out", tmp_path)
    code = ema(monkeypatch, "run", *words, "--fidelity", "LF", "--reference", "LF", "--json", tmp_path / "run.json")
    assert code == 0
    header, *rows = (tmp_path / "own_LF.csv").read_text().splitlines()
    assert header.startswith("time,command [m],load_torque [N],supply_voltage,position [m],motor_position,")
    found = np.array([[float(cell) for cell in row.split(",")[:6]] for row in rows])
    np.testing.assert_allclose(found[:, 2], 3.0)
    actuator = read_actuator(str(worked))
    points = grid(0.0, 1001, STEP)
    inputs = {"command": np.interp(points, time, metres) / TRAVEL, "load_torque": np.full(1001, 3.0 * TRAVEL)}
    with Twin(fmus["LF"]) as twin:
        run = twin.run(Trial("own", 0.0, STEP, inputs, ""), actuator.parameters)
    np.testing.assert_allclose(found[:, 4], run.position * TRAVEL, atol=1e-9 * 1e-4)
    np.testing.assert_allclose(found[:, 5], run.motor_position, rtol=1e-6, atol=1e-6)
    assert json.loads((tmp_path / "run.json").read_text())["actuator"] == actuator.identity
    page = (tmp_path / "report.html").read_text()
    assert r"Position\u003cbr\u003e[m]" in page and "Actuator <b>mine</b>: a worked example" in page


LAYOUTS = {
    'position = "2 bogus [mm]"': None,  # a column may be named so
    'position = "2 [mm] bogus"': "\\[log\\] position: 'bogus' says nothing of position",
    'time = "1 [furlong]"': "\\[log\\] time: 'furlong' is not a known unit",
    'time = "1 [mm]"': "\\[log\\] time: .mm. does not measure what .s. does",
    'position = "2 [counts]"': "\\[log\\] position: .counts. is no angle",
    'position = "2 [mm]"': "\\[log\\] position: .mm. does not measure what .rad. does",
    'motor_torque = "2"': "\\[log\\] motor_torque: unknown|unknown port in .*motor_torque",
}


@pytest.mark.parametrize("line", LAYOUTS)
def test_a_layout_that_no_log_can_be_read_by_is_refused_at_once(tmp_path: Path, line: str) -> None:
    from harness.cli.options import chosen_actuator

    lead = '[output]\nlead = "5 mm"\n' if LAYOUTS[line] is None else ""
    path = written(tmp_path, f"{lead}[log]\n{line}\n")
    if LAYOUTS[line] is None:
        assert chosen_actuator(str(path)).log
        return
    with pytest.raises(HarnessError, match=LAYOUTS[line]):
        chosen_actuator(str(path))


def test_a_layout_holds_for_trial_files_without_names(tmp_path: Path) -> None:
    """The same trial, as a logger writes it and by name."""
    from harness.cli.options import chosen_trials

    time = np.linspace(0.0, 0.1, 11)
    log = {"time": "1 [ms]", "command": "2 [deg]", "position": "3 [deg]"}
    actuator = Actuator("mine", log=log)
    rows = "\n".join(f"{1e3 * t:.9g},{math.degrees(0.1 * t):.12g},7" for t in time)
    found = chosen_trials(None, written(tmp_path, f"t,soll,ist\n{rows}\n", "logged.csv"), actuator)[0]
    np.testing.assert_allclose(found.inputs["command"], 0.1 * found.time, atol=1e-9)
    rows = "\n".join(f"{t:.9g},{0.1 * t:.12g}" for t in time)
    named = chosen_trials(None, written(tmp_path, f"time,command\n{rows}\n", "named.csv"), actuator)[0]
    np.testing.assert_allclose(named.inputs["command"], found.inputs["command"], atol=1e-9)


def test_a_setting_may_have_a_unit() -> None:
    from harness.parameters import parse_settings

    assert parse_settings(["controller.speed_limit=6000 rpm"]) == {"controller.speed_limit": pytest.approx(6000 * RPM)}
    assert parse_settings(["fault.N_a=90 %", "motor.p=8"]) == {"fault.N_a": pytest.approx(0.9), "motor.p": 8.0}
    for text, told in (
        ("controller.speed_limit=100 Hz", "counts periods"),
        ("motor.p=800 %", "is a plain number"),
        ("motor.R=one", "'one' is not a number"),
        ("motor.R=1,234", "behind its comma"),
    ):
        with pytest.raises(HarnessError, match=f"--set {text}: .*{told}"):
            parse_settings([text])


def test_an_unknown_word_is_told_the_words(tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match=r"known: terminal_resistance, .*travel_constant"):
        read_actuator(str(written(tmp_path, "[sheet]\nxyz = 1\n")))
    with pytest.raises(HarnessError, match="'ema ports' lists all"):
        read_actuator(str(written(tmp_path, "[parameters]\nxyz = 1\n")))


def test_a_built_in_trial_that_hardly_moves_a_rod_is_named() -> None:
    from harness.cli.options import small
    from harness.trials import trial

    told = small([trial("SIN")], read_actuator("maxon-linear-a"))
    assert len(told) == 1 and "at most 0.08 mm of 50 mm" in told[0]  # 0.1 rad of a lead of 5 mm
    assert small([trial("SIN")], DEFAULT) == []


def test_the_command_line_wins_over_the_actuator() -> None:
    from harness.cli.options import chosen_limits, chosen_monitor, chosen_parameters

    actuator = Actuator("mine", parameters={"motor.R": 2.0, "motor.L": 1e-3}, limits={"friction": 2.5, "gain": 0.4})
    assert chosen_parameters(actuator, ["motor.R=3"]) == {"motor.R": 3.0, "motor.L": 1e-3}
    assert chosen_limits(actuator, ["friction=2"]) == {"friction": 2.0, "gain": 0.4}
    assert merged(FIDELITIES["ELF+"], {"driver.coupled_saturation": 0.0})["driver.coupled_saturation"] == 1.0
    for faults, refused in (({"fault.friction": 1.0}, False), ({"fault.friction": 2.0}, True)):
        healthy = Actuator("mine", parameters=faults)
        if refused:
            with pytest.raises(HarnessError, match=r"fault.friction = 2: it is what is estimated"):
                chosen_monitor("ELF+", [], estimated=["fault.friction"], actuator=healthy)
        else:
            assert chosen_monitor("ELF+", [], estimated=["fault.friction"], actuator=healthy)[1] == {}


# --- parameter sets of SSP ----------------------------------------------------------------------------------------------


def test_an_actuator_goes_through_a_parameter_set(worked: Path, tmp_path: Path) -> None:
    actuator = read_actuator(str(worked))
    for name, faults in ssp.PARAMETER_SETS.items():
        path = tmp_path / "set.ssv"
        path.write_bytes(ssp.parameter_set(name, faults, variant(actuator)))
        found = read_actuator(str(path))
        assert found.parameters == {**actuator.parameters, **faults}
        assert found.output == actuator.output
        assert found.name == ("mine" if name == "healthy" else f"mine, {name}")
    path.write_bytes(ssp.parameter_set("healthy", {}, variant(actuator)))
    assert read_actuator(str(path)).sha256 == actuator.sha256


def test_a_foreign_parameter_set_may_have_other_units(tmp_path: Path) -> None:
    text = (
        '<s:ParameterSet xmlns:s="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="2.0" name="theirs">'
        '<s:Parameters><s:Parameter name="motor.R"><s:Real value="80" unit="mOhm"/></s:Parameter>'
        '<s:Parameter name="motor.p"><s:Integer value="8"/></s:Parameter></s:Parameters></s:ParameterSet>'
    )
    found = read_actuator(str(written(tmp_path, text, "theirs.ssv")))
    assert found.parameters == pytest.approx({"motor.R": 0.08, "motor.p": 8.0}) and found.name == "theirs"
    with pytest.raises(HarnessError, match=r"motor.R: .* does not measure"):
        read_actuator(str(written(tmp_path, text.replace("mOhm", "V"), "theirs.ssv")))


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('output_lead="0.005 m"', 'output_lead="0"', r"output_lead: 0 m a turn is out of range, 1e-06 to 1000 m"),
        ('output_lead="0.005 m"', 'output_lead="-5 mm"', r"output_lead: -0.005 m a turn is out of range"),
        ('output_lead="0.005 m"', 'output_lead="5 mm +- 1 %"', r"output_lead: a length without a tolerance"),
        ('encoding="UTF-8"', 'encoding="foo"', r"is not XML: unknown encoding"),
        ('encoding="UTF-8"', 'encoding="utf-7"', r"is not XML"),
        ('description="mine"', 'description="../evil"', r"name: '../evil' cannot name a file"),
    ],
)
def test_a_parameter_set_that_cannot_be_used_is_refused(worked: Path, tmp_path: Path, old: str, new: str, told: str) -> None:
    text = ssp.parameter_set("healthy", {}, variant(read_actuator(str(worked)))).decode()
    text = text.replace("utf-8", "UTF-8")
    assert old in text
    with pytest.raises(HarnessError, match=told):
        read_actuator(str(written(tmp_path, text.replace(old, new), "set.ssv")))


# --- what follows -------------------------------------------------------------------------------------------------------


def test_derived_quantities_by_hand() -> None:
    found = {item.name: item.value for item in derived(DEFAULT)}
    R, V, K_e = 1.01, 48.0, 0.05
    assert found["saturation speed"] == pytest.approx(V / math.sqrt(3) / K_e)
    assert found["stall torque at the current limit"] == pytest.approx(0.75)
    assert found["stall torque"] == pytest.approx(0.075 * V / math.sqrt(3) / R)
    assert found["electrical time constant"] == pytest.approx(0.7e-3 / R)
    assert found["mechanical time constant"] == pytest.approx(6e-5 * R / (0.075 * K_e))
    assert found["stall torque at the output"] == pytest.approx(200 * 0.9 * (0.75 - 0.03))


@pytest.mark.parametrize("name", ["default", "default-oriented", "anaheim-bly171d", "maxon-linear-a", "maxon-linear-b"])
def test_the_no_load_speed_is_that_of_the_twin(fmus: dict[str, Path], name: str) -> None:
    """Truth: LF, which reaches the fundamental of six steps, at a command out of reach; HF gets some percent more, at a
    carrier less."""
    actuator = read_actuator(name)
    command = np.full(6001, 900.0)
    free = {"mechanics.end_stop": 1000.0, "controller.speed_limit": 1e5, "controller.K_pos": 1e3}
    speed = next(item.value for item in derived(actuator) if item.name == "no-load speed")
    of_hf = (0.95, 0.06) if actuator.value("controller.current_control") == 2.0 else (1.04, 0.04)
    for model, more, width in (("LF", 1.0, 1e-4), ("HF", *of_hf)):
        with Twin(fmus[model]) as twin:
            run = twin.run(Trial("away", 0.0, STEP, {"command": command}, ""), {**actuator.parameters, **free})
        assert float(run.motor_speed[-1]) == pytest.approx(more * speed, rel=width)


# --- the drive ----------------------------------------------------------------------------------------------------------


ORIENTED = "controller.current_control = 'field_oriented'\ninverter.modulation = 'space_vector'\n"


def test_the_pid_is_shown_as_its_cascade(tmp_path: Path) -> None:
    """K_P = K_pos*K_p + K_i, K_I = K_i*K_pos, K_D = K_p; real only where K_P^2 >= 4*K_D*K_I."""
    from harness.actuators import drive

    found = read_actuator(str(written(tmp_path, "[parameters]\ncontroller.structure = 'pid'\n")))
    cascade = drive.as_cascade(found)
    assert cascade is not None and vars(cascade) == pytest.approx({"K_pos": 40.0, "K_p": 1.3, "K_i": 10.0, "b": 52.0 / 62.0})
    assert found.value("controller.pid.b") == pytest.approx(cascade.b)
    assert "K_pos 40 1/s, K_p 1.3 A.s/rad, K_i 10 A/rad" in drive.lines(found)[0]
    real = read_actuator("maxon-linear-a")
    assert drive.as_cascade(real) is None and "as no cascade, because K_P^2 < 4*K_D*K_I" in drive.lines(real)[0]
    assert "controller: K_pos" not in str(unstated_lines(real)) and not real.warnings


@pytest.mark.parametrize(
    "gains", ["", "current.K_p = 2\ncurrent.K_i = 500", "current.K_p = 1\ncurrent.K_i = 60000", "current.K_p = 60"]
)
def test_the_current_loop_is_that_of_the_twins(tmp_path: Path, gains: str) -> None:
    """Truth: the twins' own gains and response, which decide whether they fly."""
    from ema_fmu_src.physics import current_loop as twins
    from harness.actuators import drive

    lines = "".join(f"controller.{line}\n" for line in gains.splitlines())
    found = read_actuator(str(written(tmp_path, f"[parameters]\n{ORIENTED}{lines}")))
    R, L, T = 1.01, 0.7e-3, 0.5 / 20e3
    loop = drive.current_loop(found)
    names = ("bandwidth", "K_p", "K_i")
    K, K_i = twins.gains(R, L, T, *(found.value(f"controller.current.{name}") for name in names))
    assert (loop.K, loop.K_i, loop.T) == pytest.approx((K, K_i, T))
    of = twins.response(twins.Loop(K, K_i, T, R, L, 0.05, 1.0, 1.0))
    assert loop.settles == (of.decay_1 >= 0.0 and of.decay_2 >= -1e-6)
    assert ("it settles" if loop.settles else "does NOT settle") in drive.lines(found)[1]
    if loop.settles:
        assert sorted(-pole.real for pole in loop.poles) == pytest.approx(
            sorted([of.decay_1, of.decay_2]), rel=1e-3, abs=1e-6
        )
        assert abs(loop.poles[0].imag) == pytest.approx(of.turning, abs=1e-6)
        assert as_dict(found, None)["drive"]["current_loop"]["settles"]  # type: ignore[index]


@pytest.mark.parametrize("text", [ORIENTED.splitlines()[0], ORIENTED.splitlines()[1]])
def test_what_does_not_go_together_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    from harness.campaigns.planfile import read_plan
    from harness.cli.options import chosen_parameters

    with pytest.raises(HarnessError, match=r"does not go with .*; ideal goes with hysteresis") as refused:
        read_actuator(str(written(tmp_path, f"[parameters]\n{text}")))
    assert "mine.toml: controller.current_control = " in str(refused.value) and "\n" not in str(refused.value)
    name, value = text.replace("'", "").split(" = ")
    with pytest.raises(HarnessError, match=r"^--set: controller\.current_control = "):
        chosen_parameters(DEFAULT, [f"{name}={value}"])
    with pytest.raises(HarnessError, match=r"^--set: controller\.current_control = "):
        read_plan(None, {"set": {name: value}})
    assert chosen_parameters(read_actuator("default-oriented"), [f"{name}={value}"])[name] > 1.0


def test_budgets_are_those_of_the_drive_that_flies() -> None:
    from dataclasses import replace

    from harness.budgets import BANDWIDTHS, budgets_for, read_budgets
    from harness.budgets import DEFAULT as IDEAL
    from harness.budgets import ORIENTED as OF_CARRIER

    one = read_actuator("default-oriented")
    assert budgets_for(DEFAULT, {}) == IDEAL and budgets_for(one, one.parameters) == OF_CARRIER
    assert (
        budgets_for(DEFAULT, one.parameters) == OF_CARRIER and read_budgets(OF_CARRIER)["SIN4"]["ELF+"]["position"] == 1e-3
    )
    assert budgets_for(read_actuator("maxon-linear-a"), read_actuator("maxon-linear-a").parameters) is None
    for port, value in {
        "controller.current.bandwidth": 2.0 * BANDWIDTHS[1], "inverter.modulation": 2.0, "motor.R": 2.0
    }.items():  # fmt: skip
        other = replace(one, parameters={**one.parameters, port: value})
        assert budgets_for(other, other.parameters) is None


# --- the library --------------------------------------------------------------------------------------------------------

SCALE = {"default": 0.1, "default-oriented": 0.1, "siemens-1ft6084": 20.0, "anaheim-bly171d": 0.5} | {
    "maxon-linear-a": 0.005, "maxon-linear-b": 0.005
}  # fmt: skip
"""Amplitude of a sine of 1 Hz at each actuator's own scale, in its unit outside."""
ALLOWED = {"HF": 0.0, "ELF": 1e-3, "ELF+": 1e-3, "LF": 5e-3}
"""NRMSE of position against HF, in this trial."""


def test_the_library_names_a_source_for_every_number() -> None:
    assert set(library()) == set(SCALE)
    for name in library():
        actuator = read_actuator(name)
        assert actuator.name == name and actuator.description
        assert all(line.startswith("inverter.hysteresis") for line in actuator.warnings)  # as wide as HF's speed asks for
        for port, origin in actuator.origins.items():
            assert ";" in origin or origin.startswith("T_coulomb, for no breakaway"), (name, port, origin)
    assert read_actuator("default").sha256 == DEFAULT.sha256


@pytest.mark.parametrize(("name", "angle"), [("maxon-linear-a", 6669.0), ("maxon-linear-b", 22405.0)])
def test_linear_ones_have_the_stated_motor_angle_a_travel(name: str, angle: float) -> None:
    actuator = read_actuator(name)
    assert actuator.value("gear.ratio") / actuator.output.scale("position") == pytest.approx(angle, rel=1e-4)


@pytest.mark.parametrize("name", SCALE)
def test_the_library_flies_in_every_fidelity(fmus: dict[str, Path], name: str) -> None:
    """A sine at its own scale: followed with the lag of its position loop, and alike in all fidelities."""
    actuator = read_actuator(name)
    time = grid(0.0, 12501, STEP)
    amplitude = actuator.output.inside("command", np.array(SCALE[name]))
    trial = Trial("SINE", 0.0, STEP, {"command": amplitude * np.sin(2.0 * math.pi * time)}, "", frozenset({"command"}))
    runs = {}
    for fidelity in FIDELITIES.values():
        with Twin(fmus["HF"].parent / fidelity.fmu) as twin:
            runs[fidelity.name] = run = twin.run(trial, merged(fidelity, actuator.parameters))
        pid = actuator.value("controller.structure") == 2.0  # acts on the error alone, derivative too: hardly any lag
        lag = 0.01 if pid else 2.0 * math.pi / actuator.value("controller.K_pos")
        error = np.sqrt(float(((run.command - run.position) ** 2).mean())) / float(amplitude)
        assert error < 1.2 * lag / math.sqrt(2.0)
        found = {item.variable: item.nrmse for item in compare(run, runs["HF"], names=(fidelity.name, "HF"))}
        assert found["position"] is not None and found["position"] <= ALLOWED[fidelity.name]
    assert set(refusals(fmus["HF"].parent, actuator.parameters).values()) == {""}


def test_what_an_fmu_refuses_is_told_in_its_own_words(fmus: dict[str, Path]) -> None:
    told = refusals(fmus["HF"].parent, {"fault.zeta": 0.9})
    assert list(told) == list(FIDELITIES)
    assert all("cannot start: motor.p * fault.zeta must be less than 1" in reason for reason in told.values())


# --- ema actuator -------------------------------------------------------------------------------------------------------


def test_a_new_file_is_the_default_actuator(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "sub" / 'my "EMA".toml'
    assert ema(monkeypatch, "actuator", "new", path) == 0
    found = read_actuator(str(path))
    assert (found.name, found.parameters, found.sha256) == ('my "EMA"', {}, DEFAULT.sha256)
    before = path.read_text()
    assert ema(monkeypatch, "actuator", "new", path) == 2
    assert "is there already" in capsys.readouterr().err and path.read_text() == before
    assert ema(monkeypatch, "actuator", "new", tmp_path / "x.txt") == 2


def test_every_line_of_a_new_file_may_be_used(tmp_path: Path) -> None:
    from harness.actuators.template import template

    lines = template("x").splitlines()
    settled = [line[2:] if line.startswith('# "') and '" = ' in line else line for line in lines]
    found = read_actuator(str(written(tmp_path, "\n".join(settled))))
    assert len(found.parameters) > 25
    assert all(value == ports.VARIABLES[ports.INDEX[name]].start for name, value in found.parameters.items())
    settled = [line[2:] if re.match("# [A-Za-z_]+ = ", line) else line for line in lines]
    found = read_actuator(str(written(tmp_path, "\n".join(settled))))
    assert found.output.lead == 0.005 and len(found.limits) == len(FAULTS) and found.log["position"] == "4 [mm]"


def test_show_prints_values_origins_and_flights(
    worked: Path,
    fmus: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    worked.write_text(WORKED.replace('speed_constant = "135 rpm/V"', 'speed_constant = "110 rpm/V"'))
    code = ema(monkeypatch, "actuator", "show", worked, "--fmus", fmus["HF"].parent, "--json", tmp_path / "show.json")
    told = capsys.readouterr()
    assert code == 0
    assert "fault.zeta" not in told.out and "fault.open_switch" in told.out  # a fault only where it is stated
    assert "gain of the sampled speed loop" in told.out
    assert max(map(len, told.out.splitlines())) <= 120 or "not stated, the default" in max(told.out.splitlines(), key=len)
    assert "not stated, the default actuator's: controller: K_pos 40 1/s" in told.out
    assert "R_tt/2 = 0.16/2 = 0.08 Ohm; page 3" in told.out and "rad (0.06 m)" in told.out
    assert told.err.startswith("warning: torque constant 0.0706 N.m/A and 1/k_n")
    found = json.loads((tmp_path / "show.json").read_text())
    assert found["flies"] == {"HF": True, "ELF": True, "ELF+": True, "LF": True}
    assert found["parameters"]["mechanics.J"] == {
        "value": pytest.approx(6e-5),
        "unit": "kg.m2",
        "tolerance": pytest.approx(3e-6),
        "origin": "stated",
    }
    assert found["parameters"]["monitor.tau"]["origin"] == "default"
    assert found["derived"]["no-load speed at the output"]["unit"] == "m/s"
    assert found["provenance"]["date"] == "2026-01-31" and len(found["warnings"]) == 1


def test_list_names_the_library(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert ema(monkeypatch, "actuator", "list") == 0
    told = capsys.readouterr().out
    assert all(name in told for name in library())


# --- other commands -----------------------------------------------------------------------------------------------------


def test_check_flies_another_actuator_and_judges_nothing(
    fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    own = written(tmp_path, "[SIN.LF]\nposition = 1e-9\n", "own_budgets.toml")
    monkeypatch.setattr("harness.budgets.DEFAULT", own)  # fewer runs than the real ones
    words = ("check", "--actuator", "anaheim-bly171d", "--fmus", fmus["HF"].parent)
    assert ema(monkeypatch, *words, "--markdown", tmp_path / "c.md") == 0
    assert "none judged: the budgets are the default actuator's" in capsys.readouterr().out
    assert ema(monkeypatch, "check", "--actuator", "maxon-linear-a", "--fmus", fmus["HF"].parent) == 0
    assert "SIN: angles of a rotary actuator, here at most 0.08 mm of 50 mm" in capsys.readouterr().err
    assert "no budgets" in (tmp_path / "c.md").read_text()
    judged, free = (Verdict("SIN", "LF", "position", budget, found=0.5) for budget in (1e-9, math.inf))
    assert not judged.passed and free.passed and not Verdict("SIN", "LF", "x", math.inf, failure="crashed").passed


def test_a_campaign_keeps_the_actuator(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Without Dask: the plan, and what the store says of it."""
    from harness.campaigns.planfile import read_plan
    from harness.campaigns.store import Store

    actuator = read_actuator("maxon-linear-a")
    plan = read_plan(None, {"ranges": {"motor.R": [0.07, 0.09]}, "samples": 2}, actuator=actuator)
    assert "motor.R" not in plan.fixed and plan.fixed["motor.p"] == 8.0
    Store(tmp_path, plan, {"EMA_ELF.fmu": "0"})
    found = xr.open_zarr(tmp_path / "campaign.zarr")
    assert found.attrs["actuator"] == actuator.name and found.attrs["actuator_sha256"] == actuator.sha256
    assert found.position.attrs == {"units": "m", "long_name": "Position of the rod, after backlash"}
    assert found["mechanics.end_stop"].attrs["units"] == "m" and float(found["mechanics.end_stop"][0]) == pytest.approx(0.05)
    for name in (port.name for port in ports.PARAMETERS if found[port.name].attrs["units"] == "m"):
        assert "rod" in found[name].attrs["long_name"]
    rotary = read_plan(None, {"ranges": {"motor.R": [0.07, 0.09]}, "samples": 2})
    assert rotary.digest({"EMA_ELF.fmu": "0"}) != plan.digest({"EMA_ELF.fmu": "0"})

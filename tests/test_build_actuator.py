"""FMUs and SSP packages that start as an actuator.

Truth: the default FMU with the actuator's parameters set, to the last bit.
"""

import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from test_importers import fmpys, libcosims

from ema_fmu_src import ports
from ema_fmu_src.fmu import build as building
from ema_fmu_src.fmu.build import SSP, build, built_from, is_current
from ema_fmu_src.fmu.variant import Variant
from harness.actuators.fmus import variant
from harness.actuators.read import read_actuator
from harness.cli import main
from harness.flight.twin import Twin
from harness.trials import trial

NAME = "maxon-linear-a"
PLAIN = "anaheim-bly171d"
"""An actuator whose parameter set holds no Enumeration."""
MODELS = ("ELF", "LF")


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """FMUs that start as an actuator of the library."""
    paths = build(MODELS, out=tmp_path_factory.mktemp("own"), variant=variant(read_actuator(NAME)))
    return dict(zip(MODELS, paths, strict=True))


def ema(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr(sys, "argv", ["ema", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.mark.parametrize("model", MODELS)
def test_the_description_says_whose_it_is(own: dict[str, Path], fmus: dict[str, Path], model: str) -> None:
    actuator = read_actuator(NAME)
    assert own[model].name == f"EMA_{model}.fmu" and validate_fmu(str(own[model])) == []
    found, default = (fmpy.read_model_description(str(path)) for path in (own[model], fmus[model]))
    assert found.modelName == f"EMA_{model} {NAME}" and found.coSimulation.modelIdentifier == f"EMA_{model}"
    whose = f"{default.description}; start values of the actuator {NAME} ({actuator.description})"
    travel = 0.005 / (2 * np.pi)
    rod = f"1 rad of the user shaft is {travel:.9g} m of the rod, and 1 N.m of load_torque {1.0 / travel:.9g} N"
    assert found.description == f"{whose}; linear: {rod}"
    assert found.guid != default.guid
    for variable, other in zip(found.modelVariables, default.modelVariables, strict=True):
        expected = actuator.parameters.get(variable.name)
        assert variable.start == other.start if expected is None else float(variable.start) == expected
    with zipfile.ZipFile(own[model]) as archive:
        page = archive.read("documentation/index.html").decode()
        assert NAME in page and rod in page
        assert not any(name.startswith("extra/") for name in archive.namelist())  # results of the default actuator


@pytest.mark.parametrize("model", MODELS)
def test_it_flies_as_the_default_one_with_these_parameters(own: dict[str, Path], fmus: dict[str, Path], model: str) -> None:
    parameters = read_actuator(NAME).parameters
    with Twin(own[model]) as twin, Twin(fmus[model]) as other:
        found, expected = twin.run(trial("SIN")), other.run(trial("SIN"), parameters)
    for port in ports.OUTPUTS:
        np.testing.assert_array_equal(found[port.name], expected[port.name])


def test_the_python_runtime_starts_so_too(fmus: dict[str, Path], tmp_path: Path) -> None:
    starts = {"motor.R": 0.5, "motor.p": 3, "driver.coupled_saturation": 1, "fault.open_switch": 2}
    told = Variant("mine", 'with "quotes", {braces} & <tags>', starts, {}, "1 rad is 2 m")
    (path,) = build(["LF"], out=tmp_path, runtime="python", variant=told)
    description = fmpy.read_model_description(str(path))
    assert description.description.endswith("; 1 rad is 2 m")
    found = {variable.name: variable for variable in description.modelVariables}
    assert [found[name].start for name in starts] == ["0.5", "3", "true", "2"]
    with Twin(path) as twin, Twin(fmus["LF"]) as other:
        run, expected = twin.run(trial("SIN")), other.run(trial("SIN"), {"motor.R": 0.5, "motor.p": 3})
    np.testing.assert_array_equal(run.position, expected.position)


def test_the_bytes_are_the_same_each_time_and_the_record_knows_the_actuator(own: dict[str, Path], tmp_path: Path) -> None:
    actuator = read_actuator(NAME)
    (again,) = build(["LF"], out=tmp_path, variant=variant(actuator))
    assert again.read_bytes() == own["LF"].read_bytes()
    record = built_from(again)
    assert (record["actuator"], record["actuator_sha256"]) == (NAME, actuator.sha256)
    assert is_current(again, variant(actuator)) and not is_current(again)
    other = Variant(NAME, actuator.description, {**actuator.parameters, "motor.R": 0.1}, variant(actuator).about)
    assert not is_current(again, other)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (Variant("x", "", {"motor.Q": 1.0}), "motor.Q is no parameter and no input"),
        (Variant("x", "", {"position": 1.0}), "position is no parameter and no input"),
        (Variant("x", "", {"motor.R": -1.0}), "motor.R = -1 is out of range"),
        (Variant("", "", {"motor.R": 1.0}), "needs a name"),
    ],
)
def test_starts_that_no_port_has_are_refused(tmp_path: Path, given: Variant, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        building.build(["LF"], out=tmp_path / "none", variant=given)
    assert not (tmp_path / "none").exists()


def test_fmus_of_another_actuator_are_not_flown(
    own: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("run", "SIN", "--fidelity", "LF", "--reference", "LF", "--fmus", own["LF"].parent, "--out", tmp_path)
    for others in ((), ("--actuator", "default"), ("--actuator", "maxon-linear-b")):
        assert ema(monkeypatch, *words, *others) == 2
        assert f"EMA_LF.fmu: was built for another actuator, {NAME}" in capsys.readouterr().err
    assert ema(monkeypatch, *words, "--actuator", NAME) == 0


def test_the_folder_of_the_default_fmus_is_kept(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert ema(monkeypatch, "build", "--actuator", NAME) == 2
    assert f"ema: --actuator {NAME}: --out DIR is needed" in capsys.readouterr().err


def test_export_puts_the_parameters_into_the_ssp(
    fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """libcosim, which applies the set that is bound, then gets what FMPy gets with these parameters. It knows no
    Enumerations, by which the drive of the linear one is chosen: so, it gets another."""
    monkeypatch.setattr("harness.fidelity.FMU_DIR", fmus["HF"].parent)
    actuator = read_actuator(NAME)
    assert ema(monkeypatch, "export", tmp_path, "--actuator", NAME) == 0
    told = capsys.readouterr().out
    assert f"the FMUs are the default actuator's; {SSP} and {NAME}.ssv make them {NAME}" in told
    assert "1 rad of the user shaft is 0.000795774715 m of the rod, and 1 N.m of load_torque 1256.63706 N" in told
    assert (tmp_path / "EMA_HF.fmu").read_bytes() == fmus["HF"].read_bytes()
    assert read_actuator(str(tmp_path / f"{NAME}.ssv")).sha256 == actuator.sha256
    worn = read_actuator(str(unpacked(tmp_path) / "resources" / "worn.ssv"))
    assert worn.parameters == {**actuator.parameters, "fault.friction": 2.0, "fault.backlash": 50.0}
    plain = read_actuator(PLAIN)
    assert ema(monkeypatch, "export", tmp_path / "plain", "--actuator", PLAIN) == 0
    assert libcosims(unpacked(tmp_path / "plain"), {}) == fmpys(fmus["HF"], plain.parameters)


def unpacked(folder: Path) -> Path:
    """What is in the SSP in a folder."""
    subprocess.run([sys.executable, "-m", "zipfile", "-e", str(folder / SSP), str(folder / "unpacked")], check=True)
    return folder / "unpacked"

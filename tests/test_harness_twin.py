"""Twin on the built FMUs, and on files that are none."""

import dataclasses
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from ema_fmu_src import ports
from ema_fmu_src.fidelities import FIDELITIES
from harness.errors import HarnessError
from harness.flight.twin import Twin
from harness.trials import STEP, Trial, trial

DESCRIPTION = "modelDescription.xml"


def _short(points: int = 300) -> Trial:
    flown = trial("SIN4")
    return dataclasses.replace(flown, inputs={name: values[:points] for name, values in flown.inputs.items()})


def _changed(fmu: Path, folder: Path, *changes: tuple[str, str]) -> Path:
    """A copy of `fmu` whose model description has these regular expressions replaced."""
    copy = folder / "changed.fmu"
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(copy, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == DESCRIPTION:
                text = content.decode()
                for pattern, replacement in changes:
                    text, count = re.subn(pattern, replacement, text, flags=re.DOTALL)
                    assert count
                content = text.encode()
            new.writestr(name, content)
    return copy


def test_run_has_every_output_with_unit_and_attributes(fmus: dict[str, Path]) -> None:
    with Twin(fmus["LF"]) as twin:
        run = twin.run(_short(), {"fault.N_a": 0.9, "supply_voltage": 40.0})
    assert set(run.data_vars) == {"command", "supply_voltage", *(port.name for port in ports.OUTPUTS)}
    for port in ports.OUTPUTS:
        assert run[port.name].attrs["units"] == port.unit
        assert run[port.name].attrs["long_name"]
        assert np.isfinite(run[port.name].values.astype(float)).all()
    np.testing.assert_allclose(run.time, np.arange(300) * STEP)
    assert run.attrs["trial"] == "SIN4"
    assert run.attrs["simulated_s"] == pytest.approx(299 * STEP)
    assert run.attrs["wall_s"] > 0.0
    assert run.attrs["parameters"] == {"fault.N_a": 0.9, "supply_voltage": 40.0}
    assert len(run.attrs["fmu_sha256"]) == 64


@pytest.mark.parametrize("model", ports.MODELS)
def test_reset_gives_the_same_run_again(fmus: dict[str, Path], model: str) -> None:
    with Twin(fmus[model]) as twin:
        first = twin.run(_short())
        other = twin.run(_short(), {"fault.friction": 2.0, "supply_voltage": 30.0})
        again = twin.run(_short())
    assert first.equals(again)
    assert not first.equals(other)


def test_elf_plus_is_elf_with_another_parameter(fmus: dict[str, Path]) -> None:
    flown = _short(1500)
    with Twin(fmus["ELF"]) as twin:
        plain = twin.run(flown)
        coupled = twin.run(flown, FIDELITIES["ELF+"].parameters)
    assert plain.voltage_saturated.any()
    assert not plain.position.equals(coupled.position)


def test_start_time_other_than_zero_shifts_the_run(fmus: dict[str, Path]) -> None:
    with Twin(fmus["LF"]) as twin:
        run = twin.run(_short())
        later = twin.run(dataclasses.replace(_short(), start=5.0))
    np.testing.assert_allclose(later.time, run.time + 5.0)
    np.testing.assert_allclose(later.position, run.position, atol=1e-9)


def test_inputs_are_held_from_their_communication_point_on(fmus: dict[str, Path]) -> None:
    """A drop of the supply voltage during the third step shows at its end, not before."""
    flown = _short(20)
    pulse = np.full(20, 48.0)
    pulse[2] = 0.0
    with Twin(fmus["LF"]) as twin:
        steady = twin.run(flown)
        shaken = twin.run(dataclasses.replace(flown, inputs={**flown.inputs, "supply_voltage": pulse}))
    differs = np.flatnonzero(steady.equivalent_current.values != shaken.equivalent_current.values)
    assert differs[0] == 3


def test_progress_counts_every_step_once(fmus: dict[str, Path]) -> None:
    done: list[int] = []
    with Twin(fmus["LF"]) as twin:
        twin.run(_short(1300), on_progress=done.append)
    assert sum(done) == 1299


def test_closing_removes_the_unpacked_files_and_twice_does_no_harm(fmus: dict[str, Path]) -> None:
    twin = Twin(fmus["LF"])
    folder = twin._folder
    assert folder.is_dir()
    twin.close()
    twin.close()
    assert not folder.exists()
    with pytest.raises(HarnessError, match="already closed"):
        twin.run(_short())


def test_a_refusal_carries_the_fmus_own_message_and_the_instance_lives_on(fmus: dict[str, Path]) -> None:
    with Twin(fmus["LF"]) as twin:
        with pytest.raises(HarnessError, match=r"EMA_LF.fmu: fault.N_a = 7 .*maximum 1"):
            twin.run(_short(), {"fault.N_a": 7.0})
        broken = _short()
        command = broken.inputs["command"].copy()
        command[50] = np.nan
        with pytest.raises(HarnessError, match=r"derivative of command refused"):  # the slope into the bad point
            twin.run(dataclasses.replace(broken, inputs={"command": command}))
        with pytest.raises(HarnessError, match=r"has no variable 'fault.none'"):
            twin.run(_short(), {"fault.none": 1.0})
        assert np.isfinite(twin.run(_short()).position).all()


def test_files_that_are_no_fmu(tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match="no such file"):
        Twin(tmp_path / "none.fmu")
    with pytest.raises(HarnessError, match="no such file"):
        Twin(tmp_path)
    (tmp_path / "text.fmu").write_text("not a zip")
    with pytest.raises(HarnessError, match="not a zip archive"):
        Twin(tmp_path / "text.fmu")
    with zipfile.ZipFile(tmp_path / "zip.fmu", "w") as archive:
        archive.writestr("readme.txt", "nothing here")
    with pytest.raises(HarnessError, match=r"modelDescription.xml"):
        Twin(tmp_path / "zip.fmu")
    with zipfile.ZipFile(tmp_path / "xml.fmu", "w") as archive:
        archive.writestr(DESCRIPTION, "<fmiModelDescription")
    with pytest.raises(HarnessError, match=r"modelDescription.xml cannot be read"):
        Twin(tmp_path / "xml.fmu")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([('fmiVersion="2.0"', 'fmiVersion="1.0"')], "FMI 2.0"),
        ([('fmiVersion="2.0"', 'fmiVersion="3.0"')], "FMI 2.0"),
        (
            [("<CoSimulation.*?(/>|</CoSimulation>)", '<ModelExchange modelIdentifier="EMA_LF"/>')],
            "not a co-simulation FMU",
        ),
        ([('name="position"', 'name="angle"')], "missing or of another kind: position$"),
        ([('name="command"', 'name="demand"'), ('name="motor_speed"', 'name="w"')], "command, motor_speed$"),
        ([('(name="load_torque".*?causality=)"input"', r'\1"local"')], "load_torque$"),
    ],
)
def test_fmus_of_another_kind(fmus: dict[str, Path], tmp_path: Path, changes: list[tuple[str, str]], message: str) -> None:
    with pytest.raises(HarnessError, match=message) as caught:
        Twin(_changed(fmus["LF"], tmp_path, *changes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["../outside.txt", "/outside.txt", "a/../../outside.txt", "..\\outside.txt", "C:x"])
def test_members_outside_the_folder_are_refused(fmus: dict[str, Path], tmp_path: Path, name: str) -> None:
    bad = tmp_path / "bad.fmu"
    bad.write_bytes(fmus["LF"].read_bytes())
    with zipfile.ZipFile(bad, "a") as archive:
        archive.writestr(name, "outside")
    with pytest.raises(HarnessError, match="outside its folder"):
        Twin(bad)
    assert not list(tmp_path.rglob("outside.txt"))


def test_links_and_damaged_archives_are_refused(fmus: dict[str, Path], tmp_path: Path) -> None:
    bad = tmp_path / "link.fmu"
    bad.write_bytes(fmus["LF"].read_bytes())
    with zipfile.ZipFile(bad, "a") as archive:
        link = zipfile.ZipInfo("resources/link")
        link.create_system, link.external_attr = 3, 0o120777 << 16
        archive.writestr(link, "/etc/hostname")
    with pytest.raises(HarnessError, match="is a link"):
        Twin(bad)
    cut = tmp_path / "cut.fmu"
    cut.write_bytes(fmus["LF"].read_bytes()[:-200])
    with pytest.raises(HarnessError, match="not a zip archive"):
        Twin(cut)
    with zipfile.ZipFile(fmus["LF"]) as archive:
        member = max(archive.infolist(), key=lambda item: item.compress_size)
    damaged = bytearray(fmus["LF"].read_bytes())
    middle = member.header_offset + member.compress_size // 2
    damaged[middle : middle + 50] = bytes(50)
    (tmp_path / "damaged.fmu").write_bytes(damaged)
    with pytest.raises(HarnessError, match="cannot be unpacked"):
        Twin(tmp_path / "damaged.fmu")


def test_no_binary_for_this_platform(fmus: dict[str, Path], tmp_path: Path) -> None:
    bare = tmp_path / "bare.fmu"
    with zipfile.ZipFile(fmus["LF"]) as old, zipfile.ZipFile(bare, "w") as new:
        for name in old.namelist():
            if not name.startswith("binaries/"):
                new.writestr(name, old.read(name))
    with pytest.raises(HarnessError, match="no binary for this platform"):
        Twin(bare)

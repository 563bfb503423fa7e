"""What the FMUs and the SSP carry besides their binaries."""

import io
import string
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from flight import Flight
from fmpy.ssp.ssd import read_ssd
from PIL import Image

from ema_fmu_src import ports
from ema_fmu_src.fmu import crosscheck, description, documentation, font, image, ssp
from ema_fmu_src.fmu.build import SSP

MODELS = pytest.mark.parametrize("model", ports.MODELS)


@pytest.fixture
def package(fmus: dict[str, Path]) -> Path:
    return fmus["HF"].parent / SSP


@MODELS
def test_types_have_the_units_of_their_variables(fmus: dict[str, Path], model: str) -> None:
    found = fmpy.read_model_description(str(fmus[model]))
    types = {item.name: item for item in found.typeDefinitions}
    reals = [variable for variable in found.modelVariables if variable.type == "Real"]
    assert len(reals) > 50
    for variable in reals:
        assert variable.declaredType.name in types
        assert (variable.declaredType.unit, variable.declaredType.displayUnit) == (variable.unit, variable.displayUnit)


@MODELS
def test_initial_dependencies_are_the_kernels(model: str) -> None:
    """Each output at the start moves with the variables it is said to depend on, and with no other."""
    base = {
        "initial.motor_position": 1.0, "initial.motor_speed": 50.0, "initial.position": 0.00498,
        "initial.phase_current_a": 1.0, "initial.phase_current_b": -3.0, "initial.reference_current": 2.0,
        "initial.current_filtered": 0.5, "initial.integral": 0.1, "fault.zeta": 0.1, "fault.phi": 0.3,
    }  # fmt: skip
    starts = (
        base,
        base | {"initial.motor_position": 1e3},
        base | {"initial.position": 0.0},
    )  # free, at the stop, at the play
    names = [variable.name for variable in ports.OUTPUTS]
    moved: dict[str, set[str]] = {name: set() for name in names}
    for start in starts:
        before = Flight(model, start)
        for variable in (*ports.INPUTS, *ports.PARAMETERS):
            if variable.kind == "Boolean" or variable.name == "sensor.resolver_bits":
                continue
            value = start.get(variable.name, variable.start_for(model))
            other = value * 0.9 if variable.kind == "Real" and value else value + 1
            after = Flight(model, {**start, variable.name: min(other, variable.maximum or np.inf)})
            for name in names:
                if after[name] != before[name]:
                    moved[name].add(variable.name)
    for name in names:
        assert moved[name] == set(description.INITIAL_DEPENDENCIES.get(name, ())), name


@MODELS
def test_the_page_names_every_variable(fmus: dict[str, Path], model: str) -> None:
    with zipfile.ZipFile(fmus[model]) as archive:
        page = archive.read("documentation/index.html").decode()
    assert page == documentation.page(model)
    for variable in ports.VARIABLES:
        assert f">{variable.name}</td>" in page
    assert "Covers:" in page and "oes not cover:" in page and "Eq. 2" in page


@MODELS
def test_the_picture_is_a_picture(fmus: dict[str, Path], model: str) -> None:
    with zipfile.ZipFile(fmus[model]) as archive:
        picture = Image.open(io.BytesIO(archive.read("model.png")))
        picture.load()
    assert picture.size == (400, 240)
    assert len(picture.getcolors(100000)) > 100


@pytest.mark.parametrize("name", [*string.ascii_uppercase, *string.digits, "ELF+", "a_long-NAME_0123456789"])
def test_any_name_has_a_picture(name: str) -> None:
    """The name is what tells one twin's picture from another's: it lies between the margins and is as high as the font."""
    picture, blank = (np.asarray(Image.open(io.BytesIO(image.png(text)))) for text in (name, "_"))
    drawn = np.argwhere((picture != blank).any(axis=2))
    assert drawn[:, 0].min() >= image.TOP and image.MARGIN <= drawn[:, 1].min() and drawn[:, 1].max() < 400 - image.MARGIN


def test_no_two_letters_look_alike() -> None:
    assert len(set(font.GLYPHS.values())) == len(font.GLYPHS) == 39
    for rows in font.GLYPHS.values():
        assert len(rows) == 7 and len({len(row) for row in rows}) == 1


@MODELS
def test_cross_check_results_are_repeated(fmus: dict[str, Path], model: str) -> None:
    """By FMPy, from the inputs as written; to the digits as written on one platform, and the bits are the same on all."""
    stimuli, expected, options = crosscheck.paths(model)
    told = dict(line.split(",") for line in options.read_text().splitlines())
    run = fmpy.simulate_fmu(
        str(fmus[model]),
        start_time=float(told["StartTime"]),
        stop_time=float(told["StopTime"]),
        output_interval=float(told["StepSize"]),
        input=fmpy.util.read_csv(str(stimuli)),
    )
    table = fmpy.util.read_csv(str(expected))
    every = round(float(told["OutputIntervalLength"]) / float(told["StepSize"]))
    assert set(table.dtype.names) == {"time", *(variable.name for variable in ports.OUTPUTS)}
    for name in table.dtype.names:
        np.testing.assert_allclose(run[name][::every], table[name], rtol=5.1e-9, atol=1e-12, err_msg=name)


@MODELS
def test_cross_check_results_are_in_the_fmu(fmus: dict[str, Path], model: str) -> None:
    with zipfile.ZipFile(fmus[model]) as archive:
        manifest = ElementTree.fromstring(archive.read(f"{crosscheck.EXTRA}/fmi-ls-manifest.xml"))
        sources = [related.get("source") for related in manifest]
        experiment = ElementTree.fromstring(archive.read(f"{crosscheck.EXTRA}/experiments.xml"))[0]
        assert {child.get("source") for child in experiment} <= set(sources)
        for path in crosscheck.paths(model):
            assert path.name in sources
            assert archive.read(f"{crosscheck.EXTRA}/{path.name}") == path.read_bytes()


def test_the_package_is_valid_ssp(package: Path) -> None:
    """Against the schemas of SSP 1.0, by FMPy."""
    (component,) = read_ssd(str(package), validate=True).system.elements
    assert component.source == "resources/EMA.fmu"
    assert {connector.name for connector in component.connectors} == {v.name for v in (*ports.INPUTS, *ports.OUTPUTS)}


def test_parameter_sets_fit_the_ports(package: Path) -> None:
    with zipfile.ZipFile(package) as archive:
        for name, values in ssp.PARAMETER_SETS.items():
            root = ElementTree.fromstring(archive.read(f"resources/{name}.ssv"))
            entries = {entry.get("name"): entry[0] for entry in root.iter(f"{{{ssp.SSV}}}Parameter")}
            assert entries.keys() == values.keys() <= ports.INDEX.keys()
            for parameter, element in entries.items():
                assert element.tag == f"{{{ssp.SSV}}}{ports.VARIABLES[ports.INDEX[parameter]].kind}"

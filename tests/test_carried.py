"""What the FMUs and the SSP carry besides their binaries."""

import io
import re
import string
import zipfile
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from flight import Flight
from fmpy.ssp.ssd import read_ssd
from lxml import etree
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
        assert variable.declaredType.name in types and variable.declaredType.unit == variable.unit
        own = ports.VARIABLES[ports.INDEX[variable.name]].display
        assert variable.displayUnit == (own or variable.declaredType.displayUnit)


UNTRIED = ("sensor.resolver_bits", "controller.current_control", "inverter.modulation")
"""Beside Booleans: the resolution of sensors, and what goes in pairs."""


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
            if variable.kind == "Boolean" or variable.name in UNTRIED:
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
        relative_tolerance=float(told["RelTol"]),
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
        assert float(experiment.get("tolerance", "")) == description.DEFAULT_TOLERANCE
        assert {child.get("source") for child in experiment} <= set(sources)
        for path in crosscheck.paths(model):
            assert path.name in sources
            assert archive.read(f"{crosscheck.EXTRA}/{path.name}") == path.read_bytes()


def test_the_package_is_read(package: Path) -> None:
    (component,) = read_ssd(str(package), validate=True).system.elements
    assert component.source == "resources/EMA.fmu"
    assert {connector.name for connector in component.connectors} == {v.name for v in (*ports.INPUTS, *ports.OUTPUTS)}


def schemas(version: str) -> Path:
    """Folder with the schemas of that version of SSP: FMPy has those of 1.0, pyssp_standard those of 2.0."""
    package, *folder = {"1.0": ("fmpy", "ssp", "schema"), "2.0": ("pyssp_standard", "resources", "ssp2")}[version]
    return Path(find_spec(package).origin).parent.joinpath(*folder)


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_the_package_is_valid_ssp(package: Path, version: str) -> None:
    """Every system structure and every parameter set, against the standard's own schemas."""
    kinds = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}
    checked = []
    with zipfile.ZipFile(package) as archive:
        for name in archive.namelist():
            if Path(name).suffix in kinds:
                schema = etree.XMLSchema(file=str(schemas(version) / kinds[Path(name).suffix]))
                schema.assertValid(etree.fromstring(archive.read(name)))
                checked.append(Path(name).suffix)
    assert checked.count(".ssd") == checked.count(".ssv") == len(ssp.PARAMETER_SETS)


def test_no_two_system_structures_have_one_name(package: Path) -> None:
    """OMSimulator refuses a package in which two have, and names of other characters than these."""
    with zipfile.ZipFile(package) as archive:
        texts = [archive.read(name) for name in archive.namelist() if name.endswith(".ssd")]
    names = [ElementTree.fromstring(text).get("name", "") for text in texts]
    assert len(set(names)) == len(names) == len(ssp.PARAMETER_SETS)
    assert all(re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) for name in names)


def test_parameter_sets_fit_the_ports(package: Path) -> None:
    with zipfile.ZipFile(package) as archive:
        for name, values in ssp.PARAMETER_SETS.items():
            root = ElementTree.fromstring(archive.read(f"resources/{name}.ssv"))
            entries = {entry.get("name"): entry[0] for entry in root.iter(f"{{{ssp.SSV}}}Parameter")}
            assert entries.keys() == values.keys() <= ports.INDEX.keys()
            for parameter, element in entries.items():
                port = ports.VARIABLES[ports.INDEX[parameter]]
                assert element.tag == f"{{{ssp.SSV}}}{port.kind}"
                if port.kind == "Enumeration":
                    assert port.items[element.get("value", "")] == values[parameter]

"""The build refuses kernels that could not live without Python."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from ema_fmu_src import ports
from ema_fmu_src.fmu.native import emit, targets
from ema_fmu_src.fmu.native.library import header, libraries
from ema_fmu_src.twins import SLOPES, Status

PROGRAM = """
import dataclasses, math, sys
import numba
from ema_fmu_src import ports
from ema_fmu_src.fmu.native import emit
from ema_fmu_src import twins

@numba.njit(error_model="numpy")
def advance(v, x, t):
    {body}
    return 0

twins.TWINS["LF"] = dataclasses.replace(twins.TWINS["LF"], advance=advance)
try:
    emit.emit("LF", ["x86_64-unknown-linux-gnu"])
except emit.EmitError as error:
    sys.exit(str(error))
"""


def _emitted(body: str, tmp_path: Path, **environment: str) -> str:
    """What the emission of a kernel with this body says; empty if it succeeds."""
    own = os.environ | emit.ENVIRONMENT | {"XDG_CACHE_HOME": str(tmp_path)} | environment
    command = [sys.executable, "-c", PROGRAM.format(body=body)]
    done = subprocess.run(command, capture_output=True, text=True, env=own, check=False)
    return done.stderr.strip()


@pytest.mark.parametrize(
    "body, told",
    [
        ("v[0] = v[1] + t", ""),
        ("v[0] = math.sin(t)", "sin"),
        ("v[0] = t ** 0.3", "LF: the kernels call"),
        ("v[0] = t % v[1]", "fmod"),
        ("print(t)", "kernel"),
        ("if t > 1.0:\n        raise ValueError", "a kernel can raise"),
    ],
)
def test_what_can_be_emitted(body: str, told: str, tmp_path: Path) -> None:
    found = _emitted(body, tmp_path)
    assert told in found if told else found == ""


def test_a_kernel_for_this_machine_alone_is_refused(tmp_path: Path) -> None:
    assert "numba would compile for this machine" in _emitted("v[0] = t", tmp_path, NUMBA_CPU_NAME="")


def test_the_header_holds_the_bits_of_the_bounds() -> None:
    text = header("HF", "{guid}")
    assert f'{{"supply_voltage", REAL, INPUT, 0, {(0.0).hex()}, {(2000.0).hex()}, {(48.0).hex()}}}' in text
    assert f'{{"solver.step", REAL, PARAMETER, 1, {(1e-9).hex()}, {(1e-2).hex()}, {(2e-5).hex()}}}' in text
    assert '{"initial.motor_speed", REAL, PARAMETER, 1, -DBL_MAX, DBL_MAX' in text
    assert '{"fault.open_switch", INTEGER, PARAMETER, 0,' in text


@pytest.mark.parametrize("model", ports.MODELS)
def test_the_header_finds_the_slope_of_each_input(model: str) -> None:
    """By the input's number, which INPUT_OF gives for its value reference, and -1 for every other variable."""
    text = header(model, "{guid}")
    number_of, slope_of = (
        [int(entry) for entry in re.search(rf"{name}\[\] = {{(.*?)}}", text)[1].split(",")]
        for name in ("INPUT_OF", "SLOPE_OF")
    )
    assert len(number_of) == len(ports.VARIABLES) and len(slope_of) == len(ports.INPUTS)
    for variable, number in zip(ports.VARIABLES, number_of, strict=True):
        assert number == (-1 if variable not in ports.INPUTS else ports.INPUTS.index(variable))
        assert number < 0 or slope_of[number] == SLOPES[variable.name]


def test_the_header_holds_every_status() -> None:
    text = header("HF", "{guid}")
    for status in Status:
        assert f"STATUS_{status.name} = {status.value}" in text and json.dumps(status.message) in text


@pytest.mark.parametrize(
    "text, names",
    [("all", list(targets.PLATFORMS)), ("win64, linux64", ["win64", "linux64"]), ("host,host", [targets.host()])],
)
def test_platforms_by_name(text: str, names: list[str]) -> None:
    assert targets.parse(text) == names


@pytest.mark.parametrize("text, told", [("beos", "no platform beos"), (",", "no platform given")])
def test_unknown_platforms(text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        targets.parse(text)


def test_without_zig_the_missing_module_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("ema_fmu_src.fmu.native.library.find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match="ziglang"):
        libraries("LF", "{guid}", ["linux64"], scratch=tmp_path)

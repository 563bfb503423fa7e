"""Fixtures: the FMUs, built once for the whole session."""

from pathlib import Path

import pytest

from ema_fmu_src import ports
from ema_fmu_src.fmu.build import build


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Path of the built FMU of each twin, all in one folder."""
    paths = build(out=tmp_path_factory.mktemp("fmus"))
    return dict(zip(ports.MODELS, paths, strict=True))

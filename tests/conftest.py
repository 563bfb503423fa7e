"""What the tests share."""

from pathlib import Path

import pytest

from ema_fmu_src import ports
from ema_fmu_src.fmu.build import build


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The three FMUs, built once: {"HF": path, "ELF": path, "LF": path}."""
    return dict(zip(ports.MODELS, build(out=tmp_path_factory.mktemp("fmus")), strict=True))

"""Fixtures: the FMUs, built once for the whole session, in both runtimes; instances of them."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import small
from filelock import FileLock
from fmi import Instance

from ema_fmu_src import ports
from ema_fmu_src.fidelities import fmu_name
from ema_fmu_src.fmu.build import RUNTIMES, build

SLOWEST = (
    "test_hosts", "test_examples", "test_campaign", "test_campaign_kept", "test_campaign_cluster", "test_identify",
    "test_monitor", "test_packing",
    "test_build_actuator", "test_calibrate", "test_inference", "test_bench_actuators", "test_slow_logs", "test_rippled",
    "test_check", "test_bench", "test_bits", "test_drive", "test_python_runtime", "test_cli",
)  # fmt: skip
"""Files that take a minute and more, the longest first: begun last, they would leave all processes but one idle."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The slowest files first, the others as they are."""
    order = {name: place for place, name in enumerate(SLOWEST)}
    items.sort(key=lambda item: order.get(item.path.stem, len(order)))


def _built_once(tmp_path_factory: pytest.TempPathFactory, runtime: str) -> dict[str, Path]:
    """FMUs in a folder that all processes of a run (pytest-xdist) share: the first to come builds them."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / f"{runtime}_fmus"
    folder.mkdir(exist_ok=True)
    with FileLock(folder.with_suffix(".lock")):
        paths = [folder / fmu_name(model) for model in ports.MODELS]
        if not (folder / "built").exists():
            paths = build(out=folder, runtime=runtime)
            (folder / "built").touch()
    return dict(zip(ports.MODELS, paths, strict=True))


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Path of the native FMU of each twin, all in one folder."""
    return _built_once(tmp_path_factory, "native")


@pytest.fixture(scope="session")
def python_fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same with the python runtime."""
    return _built_once(tmp_path_factory, "python")


@pytest.fixture(scope="session")
def small_fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Builds a small FMU of some kind, as `small.build`; the library is compiled once."""
    library = small.library(tmp_path_factory.mktemp("small"))
    return lambda kind, **options: small.build(library, tmp_path_factory.mktemp(kind), kind, **options)


@pytest.fixture(params=RUNTIMES)
def runtime(request: pytest.FixtureRequest) -> str:
    """Each runtime in turn; a test module may take fewer by a fixture of its own."""
    return str(request.param)


@pytest.fixture
def built(runtime: str, fmus: dict[str, Path], python_fmus: dict[str, Path]) -> dict[str, Path]:
    return fmus if runtime == "native" else python_fmus


@pytest.fixture
def open_fmu(built: dict[str, Path], tmp_path: Path) -> Iterator[Callable[..., Instance]]:
    """Opens instances of a model (or of an FMU elsewhere) and closes them after the test."""
    opened: list[Instance] = []

    def open_one(model: str | Path) -> Instance:
        path = built[model] if isinstance(model, str) else model
        opened.append(Instance(path, tmp_path / f"instance{len(opened)}"))
        return opened[-1]

    yield open_one
    for instance in opened:
        instance.close()


@pytest.fixture(params=ports.MODELS)
def instance(request: pytest.FixtureRequest, open_fmu: Callable[..., Instance]) -> Instance:
    """An instance of each twin in turn."""
    return open_fmu(request.param)

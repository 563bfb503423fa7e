"""The FMUs that a flight needs: those of a folder, or our own, which are built where they are missing or out of date."""

from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

from ema_fmu_src.fidelities import Fidelity, fmu_name
from harness import fidelity as home
from harness.actuators.actuator import DEFAULT, Actuator
from harness.actuators.fmus import belongs_to_another, record_of, variant
from harness.errors import HarnessError
from harness.files import results


def build_into(
    models: Sequence[str],
    folder: Path,
    *,
    runtime: str = "native",
    platform: str | None = None,
    actuator: Actuator | None = None,
) -> list[Path]:
    """Build the FMUs of `models`, which start as `actuator`, into `folder`; HarnessError if that fails."""
    results.prepare(folder)
    try:
        from ema_fmu_src.fmu import build
        from ema_fmu_src.fmu.native import targets

        platforms = targets.parse(platform) if platform else None
        return build.build(models, out=folder, runtime=runtime, platforms=platforms, variant=variant(actuator or DEFAULT))
    except ImportError as error:
        raise HarnessError(f"building FMUs needs {error.name}: pip install -e '.[build]' in the checkout") from None
    except OSError as error:
        raise HarnessError(f"{folder}: cannot be written: {error.strerror}") from None
    except (RuntimeError, ValueError) as error:  # a compiler's or a program's own report may be long
        raise HarnessError(_reason(str(error))) from error


def _reason(report: str) -> str:
    """The line of a report that says why: a compiler's first error, or the last one, as under a traceback."""
    lines = [line.strip() for line in report.splitlines() if line.strip()]
    why = next((line for line in lines if "error:" in line), lines[-1])
    return lines[0] if why == lines[0] else f"{lines[0]} {why}"


def fmu_folder(
    fidelities: Iterable[Fidelity],
    given: Path | None = None,
    actuator: Actuator | None = None,
    on_built: Callable[[Path], object] = lambda path: None,
) -> Path:
    """The folder `given`, or our own, with the FMUs that these fidelities need: those that are missing are built.

    In our own folder, those whose sources have changed since they were built are built again. `on_built` is told the path of
    each that was built. HarnessError as from `refuse_another`, for `actuator`.
    """
    folder = given or home.FMU_DIR
    models = list(dict.fromkeys(fidelity.model for fidelity in fidelities))
    missing = [model for model in models if not (folder / fmu_name(model)).is_file()]
    if given is None and find_spec("ziglang"):  # without the extra [build], what is there is what came with the package
        from ema_fmu_src.fmu.build import is_current

        missing = [model for model in models if not is_current(folder / fmu_name(model))]
    if missing:
        for path in build_into(missing, folder):
            on_built(path)
    refuse_another([folder / fmu_name(model) for model in models], actuator)
    return folder


def refuse_another(paths: Iterable[Path], actuator: Actuator | None) -> None:
    """HarnessError if one of the FMUs at `paths` was built for an actuator that is not `actuator` (None: the default one).

    What that actuator leaves to the ports' defaults would be the other's, and its gear ratio unknown to who reads a log.
    """
    for path in paths:
        record = record_of(path)
        if belongs_to_another(record, actuator or DEFAULT):
            raise HarnessError(
                f"{path}: was built for another actuator, {record['actuator']}; give --actuator with its file "
                f"(or with healthy.ssv out of the ema.ssp beside it), or build it again with ema build"
            )

"""The folder of a bench that takes several sittings: a file for each case that is done, and for each calibration."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ema_fmu_src import __version__
from harness.errors import HarnessError
from harness.fidelity import FIDELITIES
from harness.files import results
from harness.provenance import file_hash

KEY = "bench.json"
CASES, CALIBRATIONS = "cases", "calibrations"


@dataclass(frozen=True)
class Kept:
    """What was found in cases of the `seed`, measured at `rate` rows a second, in `folder`. Any process may write a file; it
    is written whole or not at all."""

    folder: Path
    seed: int
    rate: float

    @classmethod
    def opened(cls, folder: Path, seed: int, rate: float, fmus: Path) -> "Kept":
        """The folder, new or as it was left; HarnessError if it holds cases of another seed, rate, version or other FMUs."""
        key = {
            "seed": seed,
            "rate": rate,
            "version": __version__,
            "fmu_sha256": {name: file_hash(fmus / FIDELITIES[name].fmu) for name in ("HF", "ELF+")},
        }
        for each in (folder / CASES, folder / CALIBRATIONS):
            results.prepare(each)
        path = folder / KEY
        if not path.exists():
            results.write_json(path, key)
        elif (held := _read(path)) != key:
            other = ", ".join(name for name in key if held.get(name) != key[name])
            raise HarnessError(f"--keep {folder}: holds cases with another {other}; choose another folder")
        return cls(folder, seed, rate)

    def has(self, name: str) -> bool:
        """Whether the case `name` is done."""
        return (self.folder / CASES / f"{name}.json").exists()

    def write(self, name: str, content: object) -> None:
        """Keep what was found in the case `name`."""
        results.write_json(self.folder / CASES / f"{name}.json", content)

    def all(self) -> Iterator[dict[str, Any]]:
        """What was found in every case that is done, by name."""
        for path in sorted((self.folder / CASES).glob("*.json")):
            yield _read(path)

    def has_calibration(self, number: int) -> bool:
        """Whether the actuator `number` is calibrated."""
        return self._calibration(number).exists()

    def write_calibration(self, number: int, content: object) -> None:
        """Keep the calibration of the actuator `number`."""
        results.write_json(self._calibration(number), content)

    def calibration(self, number: int) -> dict[str, Any]:
        """That of the actuator `number`."""
        return _read(self._calibration(number))

    def calibrations(self) -> list[dict[str, Any]]:
        """All that there are."""
        return [_read(path) for path in sorted((self.folder / CALIBRATIONS).glob("*.json"))]

    def _calibration(self, number: int) -> Path:
        return self.folder / CALIBRATIONS / f"actuator-{number:03d}.json"

    def as_dict(self) -> dict[str, Any]:
        """What it holds cases of, for JSON."""
        return {key: value for key, value in asdict(self).items() if key != "folder"}


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise HarnessError(f"{path}: cannot be read: {error}; delete it, and it is done anew") from None
    if not isinstance(content, dict):
        raise HarnessError(f"{path}: is no result of this bench; delete it, and it is done anew")
    return content

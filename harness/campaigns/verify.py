"""Whether what lies in a campaign's folder is whole, whatever its plan: `ema campaign --verify`."""

from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from harness.campaigns.checksums import Checksums
from harness.campaigns.dataset import begun
from harness.campaigns.store import BEGUN, FEATURES, STORE, checked, chunks
from harness.errors import HarnessError


@dataclass(frozen=True)
class Verified:
    """What lies in a folder: number of cases of the campaign, of those that are whole, and what is wrong, a line each."""

    cases: int
    whole: int
    problems: list[str]


def verify(folder: Path) -> Verified:
    """Check every file of the campaign in `folder` against its checksum, whatever its plan.

    HarnessError if there is no campaign, or if its description is damaged so that it does not say what should be there.
    """
    path = folder / STORE
    if not path.is_dir():
        raise HarnessError(f"{folder}: holds no campaign, for there is no {STORE} in it; --out DIR names its folder")
    found = Checksums(folder)
    try:
        with xr.open_zarr(path, chunks=None) as held:
            coordinates = [str(name) for name in held.coords]
            outputs = [str(name) for name in held.data_vars if held[name].dims == ("case", "time")]
            together, count = int(held["done"].encoding["chunks"][0]), held.sizes["case"]
    except Exception as error:  # noqa: BLE001 - zarr raises whatever its codecs and stores raise
        reason = " ".join(str(error).split())
        raise HarnessError(f"{path}: cannot be opened: {reason}; the command that made it mends it") from None
    problems = found.problems(BEGUN, [f"{STORE}/{name}" for name in begun(coordinates, outputs)])
    whole = 0
    for cases, been, wrong in checked(found, chunks(count, together), together, outputs):
        whole += 0 if wrong else len(cases)
        problems += wrong if been else []
    if whole == count or found.has("features"):
        problems += found.problems("features", [FEATURES])
    return Verified(count, whole, problems)

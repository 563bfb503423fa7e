"""The dataset of a campaign on disk: a Zarr store that plain xarray opens, filled chunk by chunk, and features as Parquet.

A chunk of cases counts as done when `checksums.py` proves every file of it; else it is flown again.
"""

import json
import os
import shutil
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import xarray as xr
import zarr

from harness.campaigns import checksums, dataset
from harness.campaigns.batch import Result
from harness.campaigns.checksums import Checksums
from harness.campaigns.plan import Plan
from harness.errors import HarnessError
from harness.provenance import Provenance, sha256

PARQUET_ROWS = 65536
"""Cases that are in memory at a time while the Parquet file is written."""
READERS = 4
"""Threads that check files: disks answer several at a time."""
STORE, FEATURES = "campaign.zarr", "features.parquet"
BEGUN = "dataset"
"""The entry of the checksums for all that is there before a case is flown."""


class Store:
    """The dataset of a plan in `folder`, created, or opened where it was left; `fmus`: file name -> hash of each FMU.

    `record`: how it is made. What of it is damaged is in `damaged`, a line each, and made again. HarnessError if the folder
    holds another plan's.
    """

    def __init__(self, folder: Path, plan: Plan, fmus: Mapping[str, str], record: Provenance | None = None) -> None:
        self.folder, self.path = folder, folder / STORE
        self.plan, self.table = plan, plan.table()
        self.digest = plan.digest(fmus)
        self.damaged: list[str] = []
        self._fmus, self._record = fmus, record
        self._checksums = Checksums(folder)
        self._tidy()
        begun = [f"{STORE}/{name}" for name in dataset.begun(dataset.coordinates_of(plan), plan.outputs)]
        if not self.path.exists():
            shutil.rmtree(folder / checksums.CHECKSUMS, ignore_errors=True)
            self._create()
        else:
            self._refuse_others()
            if problems := self._checksums.problems(BEGUN, begun):
                self.damaged += problems
                self._create()
        self._scratch: dict[str, Any] = {}
        group = zarr.open_group(zarr.storage.MemoryStore(self._scratch), mode="w", zarr_format=2)
        with zarr.config.set(dataset.EVERY_CHUNK):
            dataset.add_arrays(group, plan, plan.chunk)
            self._arrays: dict[str, Any] = {name: group[name] for name in dataset.arrays(plan.outputs)}

    def _tidy(self) -> None:
        """Take away what was being written when a campaign was killed."""
        shutil.rmtree(self.path.with_suffix(".new"), ignore_errors=True)
        for folder in (
            self.folder,
            self.folder / checksums.CHECKSUMS,
            *(self.path / n for n in dataset.arrays(self.plan.outputs)),
        ):
            for left in folder.glob(f"*{checksums.PART}"):
                left.unlink(missing_ok=True)

    def _refuse_others(self) -> None:
        """HarnessError unless the store says that it is this campaign's, in one of the two places where it says so."""
        held = set()
        for name, keys in ((".zattrs", ()), (".zmetadata", ("metadata", ".zattrs"))):
            try:
                found = json.loads((self.path / name).read_bytes())
                for key in keys:
                    found = found[key]
                held.add(found["campaign_sha256"])
            except (OSError, ValueError, KeyError, TypeError):
                continue
        if self.digest in held:
            return
        if held:
            raise HarnessError(
                f"{self.path}: holds another campaign (other cases, seed, FMUs or outputs); choose another --out"
            )
        raise HarnessError(
            f"{self.path}: cannot be opened: its .zattrs and .zmetadata are both damaged; delete it or choose another --out"
        )

    def _create(self) -> None:
        """Create the empty store under another name, and give it its own when it is whole; or mend the one that is there."""
        made = self.path.with_suffix(".new")
        try:
            dataset.create(made, self.plan, self.digest, self._fmus, self._record)
            files = sorted(path.relative_to(made).as_posix() for path in made.rglob("*") if path.is_file())
            hashes = {f"{STORE}/{name}": sha256(made / name) for name in files}
            if self.path.exists():
                for name in files:
                    (self.path / name).parent.mkdir(exist_ok=True)
                    (made / name).replace(self.path / name)
                shutil.rmtree(made)
            else:
                made.rename(self.path)
            self._checksums.add(BEGUN, hashes)
        except OSError as error:
            shutil.rmtree(made, ignore_errors=True)
            raise HarnessError(f"{self.path}: cannot be written: {error.strerror}") from None

    def chunks(self) -> list[range]:
        """The cases of each chunk."""
        return chunks(len(self.table), self.plan.chunk)

    def waiting(self) -> list[range]:
        """The cases of each chunk that is not yet done; those that were and are no longer whole are in `damaged`."""
        found = []
        for cases, begun, problems in checked(self._checksums, self.chunks(), self.plan.chunk, self.plan.outputs):
            if problems:
                found.append(cases)
                self.damaged += problems if begun else []
        return found

    def write(self, cases: range, result: Result) -> None:
        """Write the result of a whole chunk; it counts as done when all of it is on the disk.

        HarnessError if the disk does not take it; what was done before is kept.
        """
        rows = slice(0, len(cases))
        for name, array in self._arrays.items():
            array[:] = array.fill_value if name != "failure" else ""
        for place, name in enumerate(self.plan.outputs):
            self._arrays[name][rows] = result.values[:, place]
        self._arrays["features"][rows] = result.features
        reasons = [reason[: dataset.REASON_LENGTH] for reason in result.failures]
        self._arrays["failure"][rows] = np.array(reasons, dtype=f"<U{dataset.REASON_LENGTH}")
        self._arrays["done"][rows] = True
        files = zip(_files(0, self.plan.outputs), _files(cases.start // self.plan.chunk, self.plan.outputs), strict=True)
        try:
            hashes = {
                target: checksums.write(self.folder / target, self._scratch[source.removeprefix(f"{STORE}/")].to_bytes())
                for source, target in files
            }
            self._checksums.add(_entry(cases), hashes)
        except OSError as error:
            raise HarnessError(self._kept(error)) from None

    def _kept(self, error: OSError) -> str:
        return (
            f"{self.folder}: cannot be written: {error.strerror}; what is done is kept: "
            "make room, and the same command goes on"
        )

    def finish(self) -> list[tuple[int, str]]:
        """Write the features as Parquet; returns number and reason of each case that failed."""
        made, failed = self.folder / f"{FEATURES}{checksums.PART}", []
        writer: pq.ParquetWriter | None = None
        if self._checksums.has("features"):
            self.damaged += self._checksums.problems("features", [FEATURES])
        try:
            with made.open("wb") as file:
                for first in range(0, len(self.table), PARQUET_ROWS):
                    part = self._dataframe(slice(first, first + PARQUET_ROWS))
                    writer = writer or pq.ParquetWriter(file, part.schema)
                    writer.write_table(part)
                    reasons = enumerate(part.column("failure").to_pylist(), start=first)
                    failed += [(case, reason) for case, reason in reasons if reason]
                assert writer is not None  # a plan has at least one case
                writer.close()
                file.flush()
                os.fsync(file.fileno())
            made.replace(self.folder / FEATURES)
            self._checksums.add("features", {FEATURES: sha256(self.folder / FEATURES)})
        except OSError as error:
            made.unlink(missing_ok=True)
            raise HarnessError(self._kept(error)) from None
        return failed

    def _dataframe(self, cases: slice) -> pa.Table:
        """Parameters, failures and features of some cases, for the Parquet file."""
        held = xr.open_zarr(self.path, chunks=None).isel(case=cases)
        columns: dict[str, Any] = {"case": held["case"].values}
        columns |= {name: held[name].values for name in ("trial", "fidelity", *self.table.names, "failure")}
        values = held["features"].values
        columns |= {str(name): values[:, place] for place, name in enumerate(held["feature"].values)}
        return pa.table(columns).replace_schema_metadata({"campaign_sha256": self.digest})


def chunks(cases: int, together: int) -> list[range]:
    """The numbers of `cases` cases, chunk by chunk."""
    return [range(first, min(first + together, cases)) for first in range(0, cases, together)]


def checked(
    sums: Checksums, parts: Iterable[range], together: int, outputs: Iterable[str]
) -> Iterable[tuple[range, bool, list[str]]]:
    """Of each chunk: its cases, whether it has been there, and what is wrong with it."""

    def one(cases: range) -> tuple[range, bool, list[str]]:
        name = _entry(cases)
        return cases, sums.has(name), sums.problems(name, _files(cases.start // together, outputs))

    with ThreadPoolExecutor(READERS) as pool:
        yield from pool.map(one, parts)


def _entry(cases: range) -> str:
    return f"cases_{cases.start}_{cases.stop - 1}"


def _files(place: int, outputs: Iterable[str]) -> list[str]:
    """The files of the chunk at `place`, of every array, by their path in the campaign's folder."""
    return [f"{STORE}/{name}/{place}{'.0' * (dimensions - 1)}" for name, dimensions in dataset.arrays(list(outputs)).items()]

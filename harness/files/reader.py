"""One reader for every file of columns: what it is, is told from its first bytes, not from its name."""

import gzip
import io
import os
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

from harness.errors import HarnessError, required_extra
from harness.files.table import Table
from harness.files.text import read_text

SUFFIXES = frozenset(
    [
        ".csv",
        ".txt",
        ".tsv",
        ".dat",
        ".asc",
        ".log",
        ".gz",
        ".parquet",
        ".pq",
        ".nc",
        ".cdf",
        ".h5",
        ".hdf5",
        ".hdf",
        ".mat",
        ".mf4",
        ".mdf",
        ".dat",
        ".tdms",
        ".xlsx",
        ".xlsm",
    ]
)
"""Of files that are read where a folder is searched for them."""
HDF5 = b"\x89HDF\r\n\x1a\n"
FOREIGN = {
    b"\xd0\xcf\x11\xe0": "an old Excel or Office file; save it as .xlsx or as text",
    b"BZh": "packed with bzip2; unpack it, or pack it with gzip",
    b"\xfd7zXZ": "packed with xz; unpack it, or pack it with gzip",
    b"7z\xbc\xaf": "a 7-Zip archive; unpack it",
    b"%PDF": "a PDF document; a file of numbers is needed",
    b"\x89PNG": "a picture; a file of numbers is needed",
    b"\x7fELF": "a program; a file of numbers is needed",
    b"\x28\xb5\x2f\xfd": "packed with zstandard; unpack it, or pack it with gzip",
}
"""First bytes of what is not read, and what it is."""


def read_table(path: Path) -> Table:
    """The columns of `path`: text in any dialect, gzip, Parquet, NetCDF, HDF5, .mat, MDF, TDMS, .xlsx, a campaign's Zarr.

    HarnessError, one line, if it cannot be read, is cut off or damaged, is none of these, or needs the extra [files].
    """
    if path.is_dir() and any((path / name).exists() for name in ("zarr.json", ".zgroup", ".zmetadata")):
        from harness.files.containers import netcdf

        return _contained(path, "a Zarr store", "campaign", lambda: netcdf.read_zarr(path))
    try:
        data = path.read_bytes()
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror}") from None
    if data.startswith(b"\x1f\x8b"):
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error) as error:
            raise HarnessError(f"{path}: is a gzip file that is cut off or damaged ({error})") from None
    return _read(path, data)


def _read(path: Path, data: bytes) -> Table:
    from harness.files.containers import hdf5, matlab, mdf, netcdf, parquet, sheet, tdms

    kinds: list[tuple[bool, str, Callable[[Path, bytes], Table]]] = [
        (data.startswith(b"PAR1"), "a Parquet file", parquet.read),
        (data.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05")), "a NetCDF file", netcdf.read),
        (data.startswith(b"MATLAB 7.3") or (HDF5 in data[512:520]), "a MATLAB 7.3 file", hdf5.read_matlab),
        (data.startswith(HDF5), "an HDF5 file", hdf5.read),
        (data.startswith(b"MATLAB 5") or (path.suffix == ".mat" and b"\x00" in data[:128]), "a MATLAB file", matlab.read),
        (data.startswith((b"MDF     ", b"UnFinMF ")), "an MDF file", mdf.read),
        (data.startswith(b"TDSm"), "a TDMS file", tdms.read),
    ]
    for fits, what, read in kinds:
        if fits:
            return _contained(path, what, "files", lambda read=read: read(path, data))  # type: ignore[misc]
    if data.startswith(b"PK\x03\x04"):
        if not _is_workbook(data):
            raise HarnessError(f"{path}: is a zip archive, or an .xlsx file that is cut off; unpack it, or save it again")
        return _contained(path, "an .xlsx file", "files", lambda: sheet.read(path, data))
    for magic, what in FOREIGN.items():
        if data.startswith(magic):
            raise HarnessError(f"{path}: is {what}")
    return read_text(path, data)


def _is_workbook(data: bytes) -> bool:
    try:
        return any(name.startswith("xl/") for name in zipfile.ZipFile(io.BytesIO(data)).namelist())
    except zipfile.BadZipFile:
        return False


def _contained(path: Path, what: str, extra: str, read: Callable[[], Table]) -> Table:
    """What `read` gives; whatever its library raises is one line."""
    with required_extra(extra, f"{path}: {what}"):
        try:
            return read()
        except (HarnessError, ImportError, MemoryError):
            raise
        except Exception as error:  # noqa: BLE001 - each library raises what it likes on a damaged file
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
            raise HarnessError(f"{path}: begins as {what}, but is cut off or damaged ({reason[:120]})") from None


def is_readable(path: Path) -> bool:
    """Whether the name of `path` is that of a file that `read_table` reads."""
    return path.suffix.lower() in SUFFIXES and not path.name.startswith((".", "~$")) and os.access(path, os.R_OK)


def stem(path: Path) -> str:
    """The name of a file without what says how it is written: `run` of run.csv.gz."""
    return path.name.removesuffix(".gz").rpartition(".")[0] or path.stem

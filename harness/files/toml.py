"""Reads TOML files."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from harness.errors import HarnessError


def read_toml(path: Path) -> dict[str, Any]:
    """The content of the TOML file at `path`; HarnessError if it cannot be read or is not TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # what is no text, too many digits, or too deep, too
        raise HarnessError(f"{path}: is not TOML: {' '.join(str(error).split())}") from None


def flat(table: Mapping[str, Any], where: str, before: str = "") -> dict[str, Any]:
    """Names with dots again: TOML reads `fault.N_a = 1` as a table in a table.

    HarnessError, beginning with `where`, if a name is there with and without quotes.
    """
    names: dict[str, Any] = {}
    for name, value in table.items():
        found = flat(value, where, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value}
        for full in found:
            if full in names:
                raise HarnessError(f"{where} {full}: it is there twice, with and without quotes")
        names |= found
    return names

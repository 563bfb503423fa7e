"""Reads TOML files."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from harness.errors import HarnessError


def read_toml(path: Path) -> dict[str, Any]:
    """The content of the TOML file at `path`; HarnessError if it cannot be read or is not TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise HarnessError(f"{path}: is not TOML: {error}") from None


def flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Names with dots again: TOML reads `fault.N_a = 1` as a table in a table."""
    names: dict[str, Any] = {}
    for name, value in table.items():
        names |= flat(value, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value}
    return names

"""Reads TOML files."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from harness.errors import HarnessError

DEEPEST = 32
"""Tables and lists in each other that a file may have."""


def read_toml(path: Path) -> dict[str, Any]:
    """The content of the TOML file at `path`; HarnessError if it cannot be read, is not TOML, or is nested too deep."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise HarnessError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # what is no text, too many digits, or too deep, too
        raise HarnessError(f"{path}: is not TOML: {' '.join(str(error).split())}") from None
    _check_depth(content, path)
    return content


def _check_depth(content: Mapping[str, Any], path: Path) -> None:
    """HarnessError for more than DEEPEST tables and lists in each other, as a dotted name of that many parts makes them."""
    level: list[tuple[str, Any]] = list(content.items())
    for _ in range(DEEPEST):
        level = [
            (top, item)
            for top, value in level
            if isinstance(value, dict | list)
            for item in (value.values() if isinstance(value, dict) else value)
        ]
    if level:
        raise HarnessError(f"{path}, {level[0][0]}: more than {DEEPEST} tables or lists in each other; no key is so deep")


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

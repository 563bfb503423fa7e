"""Reads TOML files, and writes them."""

import datetime
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
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
    except RecursionError:
        raise HarnessError(f"{path}: more than {DEEPEST} tables or lists in each other; no key is so deep") from None
    except ValueError as error:  # what is no text, or too many digits, too
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


BARE = re.compile(r"[A-Za-z0-9_-]+")
"""Keys that need no quotes."""
LONGEST_LINE = 110
"""Characters of a list beyond which each of its items has a line of its own."""


def toml_text(table: Mapping[str, Any]) -> str:
    """A table as TOML, which `read_toml` reads as the same: texts, numbers, dates, lists of these, and tables of all.

    Tables follow what is no table; those that hold no other table and fit a line stand in one, below the first level.
    """
    return "\n".join(_lines(table, ())).strip() + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    lines, after = [], []
    for key, value in table.items():
        if isinstance(value, Mapping) and not (len(path) > 1 and _fits(value)):
            inner = (*path, key)
            own = _lines(value, inner)
            after += (
                own if own and not own[0] else ["", f"[{'.'.join(map(_key, inner))}]", *own]
            )  # tables alone need no head
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    return lines + after


def _fits(table: Mapping[str, Any]) -> bool:
    return not any(isinstance(value, Mapping) for value in table.values()) and len(_value(table)) < LONGEST_LINE


def _key(key: str) -> str:
    return key if BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        items = [_value(item) for item in value]
        line = f"[{', '.join(items)}]"
        return line if len(line) < LONGEST_LINE else "[\n" + "".join(f"  {item},\n" for item in items) + "]"
    raise TypeError(f"{value!r} is nothing that TOML has")

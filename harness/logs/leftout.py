"""Columns that a log leaves out although they look like something: said, or refused where a port's name is in them."""

import re
from collections.abc import Mapping, Sequence

from ema_fmu_src import ports
from harness.errors import HarnessError
from harness.files.table import Column, Table
from harness.logs.find import Found
from harness.logs.guess import guesses, plain
from harness.logs.log import CHANNELS
from harness.logs.mapping import INPUTS

_LIKE_A_UNIT = re.compile(
    r"(?:[kmuµ]?(?:n|g|v|a|w)|rad|deg|rpm|lbs?|lbf|oz|cm|mm|in|ft|m|s|ms|volts?|amp(?:ere)?s?|newtons?|rms|dc|per"
    r"|[/*.^%°0-9_ ])+",
    re.IGNORECASE,
)
"""What is left of a word when a port's name is taken away, if it can only be a unit, known or not."""
_NO_UNITS = frozenset(["min", "in", "m", "s", "a", "n", "g"])
_LOADS = re.compile(r"torque|moment|load|force|kraft|last", re.IGNORECASE)
_SUPPLIES = re.compile(r"supply|volt|spannung|[uv]_?(?:bat|bus|dc)|bat(?:t|$)", re.IGNORECASE)
_NOT_LOADS = re.compile(r"motor|const|limit|max|min|rated|nominal|phase|sat", re.IGNORECASE)


def left_out(table: Table, found: Mapping[str, Found]) -> list[str]:
    """A remark on each column that looks like an input but is not taken: a misspelt load is no load.

    HarnessError for a column that begins with the name of a port that the log lacks and goes on like a unit: it was meant,
    and nothing tells in what unit.
    """
    used = {each.column.number for each in found.values() if each.table is table}
    open_ones = [
        column
        for column in table.columns
        if column.number not in used and not column.labels and column.name.rpartition(".")[2] not in ports.INDEX
    ]
    remarks = []
    offered = {guess.column.number: guess for guess in guesses(table) if guess.key in INPUTS[1:] and guess.key not in found}
    for column in open_ones:
        _refuse_meant(table, column, found)
        if column.number in offered:
            remarks.append(f"column {column.called} is left out; to take it: {offered[column.number].flag}")
        elif key := _like_an_input(column, found):
            remarks.append(
                f"column {column.called} is left out; if it is the {key}: --column '{key}={column.called} [UNIT]'"
            )
    return remarks


def _refuse_meant(table: Table, column: Column, found: Mapping[str, Found]) -> None:
    word = plain(column.name.rpartition(".")[2])
    keys = [key for key in (*INPUTS, *CHANNELS) if key not in found and word.startswith(plain(key)) and word != plain(key)]
    for key in sorted(keys, key=len, reverse=True):
        rest = _rest(column.name.rpartition(".")[2], key)
        if _LIKE_A_UNIT.fullmatch(rest) and rest.lower() not in _NO_UNITS:
            raise HarnessError(
                f"{table.at_header}: column '{column.name}' begins like {key}, but '{rest}' is no unit of it that is known; "
                f"state one: --column '{key}={column.name} [UNIT]'"
            )
        return


def _rest(word: str, key: str) -> str:
    """What follows the name of a key in a word, without brackets and blanks."""
    letters = r"[^A-Za-z0-9]*".join(plain(key))
    return re.sub(rf"^[^A-Za-z0-9]*{letters}[\s_\-\[({{<,:]*", "", word, flags=re.IGNORECASE).strip(" ])}>_")


def _like_an_input(column: Column, found: Mapping[str, Found]) -> str:
    """The input that a column may be by some part of its word, "" if the log has it or nothing speaks for it."""
    likely: Sequence[tuple[str, re.Pattern[str]]] = (("load_torque", _LOADS), ("supply_voltage", _SUPPLIES))
    if _NOT_LOADS.search(column.name):
        return ""
    return next((key for key, words in likely if key not in found and words.search(column.name)), "")

"""Tables of the benches, as the terminal shows them."""

from typing import TYPE_CHECKING

from harness.cli import terminal

if TYPE_CHECKING:
    from harness.bench.page import Table
    from harness.bench.speed import Check

WORDS = ("Fidelity", "Trial", "runs", "paper, a run", "computes", "does not", "same bits", "there", "told", "")
"""Headings of columns that hold words."""


def check_table(checks: "list[Check]") -> "Table":
    """The limits that this project sets itself, and which are met."""
    rows: list[tuple[str, ...]] = []
    for check in checks:
        asked = f"{'>=' if check.at_least else '<='} {check.limit:.4g}"
        rows.append((check.what, f"{check.value:.4g}", asked, "met" if check.met else "NOT met"))
    met = sum(check.met for check in checks)
    return f"Limits that this project sets itself: {met} of {len(checks)} met", ("Figure", "found", "asked", ""), rows


def show(table: "Table") -> None:
    """Print a table; nothing if it has no rows."""
    caption, heads, rows = table
    if rows:
        terminal.show(caption, heads, rows, words=WORDS)

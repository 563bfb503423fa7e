"""Tables of the benches, as the terminal shows them."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.bench.page import Table
    from harness.bench.speed import Check


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
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as Shown

    caption, heads, rows = table
    if not rows:
        return
    shown = Shown(title=caption)
    for head in heads:
        shown.add_column(head)
    for row in rows:
        shown.add_row(*map(escape, row))
    Console().print(shown)

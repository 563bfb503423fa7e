"""`ema ports`."""

import sys
from typing import Annotated

import typer


def ports(
    markdown: Annotated[bool, typer.Option("--markdown", help="As a Markdown table.")] = False,
) -> None:
    """List every variable of the FMUs."""
    from rich.console import Console
    from rich.table import Table

    from harness.tables import PORT_HEADINGS, port_rows, ports_markdown

    if markdown:
        typer.echo(ports_markdown())
        return
    table = Table(*PORT_HEADINGS)
    for row in port_rows():
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else 220).print(table)

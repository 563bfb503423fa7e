"""`ema ports`."""

from typing import Annotated

import typer

from harness.cli.terminal import show


def ports(
    markdown: Annotated[bool, typer.Option("--markdown", help="As a Markdown table.")] = False,
) -> None:
    """List every variable of the FMUs."""
    from harness.show.tables import PORT_HEADINGS, port_rows, ports_markdown

    if markdown:
        typer.echo(ports_markdown())
        return
    show("", PORT_HEADINGS, port_rows(), words=PORT_HEADINGS[1:])

"""What goes for all commands: nothing is written in place of what one is given to read, and no empty folder stays."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

OUTPUTS = ("out", "json_file", "junit", "page", "markdown", "folder", "keep")
"""Parameters of the commands that name what is written; every other path is read."""


class Guarded(TyperCommand):
    """A command within which its inputs are kept: an output that is one of them is refused, before it flies."""

    def invoke(self, ctx: Any) -> Any:
        from harness.files import results

        with results.tidy(), results.kept(_inputs(ctx.params)):
            return super().invoke(ctx)


def _inputs(params: dict[str, Any]) -> Iterator[Path]:
    """The files and folders that a command reads, and the FMUs in such a folder."""
    for name, value in params.items():
        if name in OUTPUTS:
            continue
        for each in value if isinstance(value, list | tuple) else [value]:
            if isinstance(each, Path) or (isinstance(each, str) and Path(each).suffix.lower() in (".toml", ".ssv")):
                path = Path(each)
                yield path
                if path.is_dir():
                    yield from path.glob("*.fmu")

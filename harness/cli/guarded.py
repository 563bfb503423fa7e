"""What goes for all commands: what they read is known, nothing is written in place of it, and no empty folder stays."""

from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

OUTPUTS = ("out", "json_file", "junit", "page", "markdown", "figures", "folder", "keep")
"""Parameters of the commands that name what is written; every other path is read."""
FMUS = "fmus"
"""The parameter that names a folder of FMUs, of which a command flies some."""
_READ: ContextVar[tuple[Path, ...]] = ContextVar("read", default=())


def read_now() -> tuple[Path, ...]:
    """The files and folders that the command line of the command that runs now names to be read, without that of FMUs."""
    return _READ.get()


class Guarded(TyperCommand):
    """A command within which its inputs are kept: an output that is one of them is refused, before it flies."""

    def invoke(self, ctx: Any) -> Any:
        from harness.files import results

        named = dict(_inputs(ctx.params))
        fmus = [file for path in named if path.is_dir() for file in path.glob("*.fmu")]
        token = _READ.set(tuple(path for path, option in named.items() if option != FMUS and path.exists()))
        try:
            with results.tidy(), results.kept([*named, *fmus]):
                return super().invoke(ctx)
        finally:
            _READ.reset(token)


def _inputs(params: dict[str, Any]) -> Iterator[tuple[Path, str]]:
    """The files and folders that a command reads, and the parameter that names each."""
    for name, value in params.items():
        if name in OUTPUTS:
            continue
        for each in value if isinstance(value, list | tuple) else [value]:
            if isinstance(each, Path) or (isinstance(each, str) and Path(each).suffix.lower() in (".toml", ".ssv")):
                yield Path(each), name

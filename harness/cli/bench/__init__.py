"""`ema bench`: a group of benches, of which speed is the one that runs if none is named."""

from typing import Any

import typer
from typer.core import TyperGroup

from harness.cli.bench.identify import identify
from harness.cli.bench.speed import speed
from harness.cli.guarded import Guarded


class _SpeedByDefault(TyperGroup):
    """`ema bench SIN --repeats 3` is `ema bench speed SIN --repeats 3`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        named = bool(args) and (args[0] in self.commands or args[0] == "--help")
        return super().parse_args(ctx, args if named else ["speed", *args])


bench = typer.Typer(cls=_SpeedByDefault, help="Measure speed and accuracy (speed, unless another is named).")
for command in (speed, identify):
    bench.command(cls=Guarded)(command)

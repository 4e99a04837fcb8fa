"""An instant of a run, as an option of a command takes it."""

from __future__ import annotations

from typing import Any

import click

from batch.cli.run import measured


class Instant(click.ParamType):
    """An instant of a run, with its unit: `2 s`, `250 ms`; a bare number is seconds."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read an instant as seconds."""
        try:
            return measured(value, "s")
        except ValueError:
            self.fail(f"`{value}` is no instant: write `2 s` or `250 ms`", param, ctx)

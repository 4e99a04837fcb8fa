"""An instant of a run, as an option of a command takes it."""

from __future__ import annotations

from typing import Any

import click

from batch.cli.run import measured


class Instant(click.ParamType):
    """An instant of a run, with its unit: `2 s`, `250 ms`; a bare number is seconds.

    words  what else may be tried here, each with what to do instead
    """

    name = "time"

    def __init__(self, **words: str) -> None:
        self.words = words

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read an instant as seconds."""
        try:
            return measured(value, "s")
        except ValueError:
            helps = "write `2 s` or `250 ms`"
            self.fail(f"`{value}` is no instant: {self.words.get(str(value), helps)}", param, ctx)

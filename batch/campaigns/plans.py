"""The plan that a command is given: compiled from a deck, or read from a plan file."""

from __future__ import annotations

import sys
from typing import Any

from met.diagnostic import Problem
from met.host.sources import names_plan
from met.outputs import settings_of
from met.plan import Plan


def read_plan(
    source: str,
    names: tuple[str, ...] = (),
    *,
    everything: bool = False,
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
) -> Plan:
    """The plan of a deck, or in a plan file. Warnings go to stderr; errors are a Problem."""
    if names_plan(source):
        from met.plan import file as plan_file

        return plan_file.read(source)
    import ic
    from ic.find import find

    select: Any = "all" if everything else names or None
    find(source, include_dirs)  # a misspelt name is reported with the one that was probably meant
    compiled = ic.check(source, include_dirs=include_dirs, defines=defines, **settings_of(settings), select=select)
    if compiled.plan is None:
        raise Problem(compiled.diagnostics, compiled.sources)
    if compiled.diagnostics and not quiet:
        from met.messages import render

        colour = render.wants_colour(sys.stderr)
        print(render.render(compiled.diagnostics, compiled.sources, colour=colour), file=sys.stderr)
    return compiled.plan

"""The deck compiler: deck text -> tokens -> syntax -> model -> plan.

    plan = ic.compile("two_link.ic")
    plan = ic.compile(text="#include <two_link.ic> ...")

Importing this package loads nothing of it: each function imports what it needs when it is called.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from ic.driver.compile import Compiled
    from met.plan import Plan

__all__ = ["check", "compile"]


def check(
    path: str | PathLike[str] | None = None,
    *,
    text: str | None = None,
    include_dirs: Iterable[str | PathLike[str]] = (),
    defines: Iterable[str] = (),
    set: Mapping[str, object] | Iterable[str] = (),
    vary: Mapping[str, object] | Iterable[str] = (),
    select: Sequence[str] | Literal["all"] | None = "all",
) -> Compiled:
    """The plan of all runs and sweeps or None, all diagnostics, every file's text. A mistake raises nothing.

    Parameters as of `compile`.
    """
    from ic.driver.compile import check as lowered
    from met.outputs import VARY, to_set

    if (path is None) == (text is None):
        raise TypeError("a deck is given by its path or by its text")
    return lowered(
        path or "",
        include_dirs=tuple(include_dirs),
        defines=tuple(defines),
        select=select,
        settings=(*map(to_set, _settings(set)), *(f"{VARY} {setting}" for setting in _settings(vary))),
        text=text,
    )


def compile(
    path: str | PathLike[str] | None = None,
    *,
    text: str | None = None,
    include_dirs: Iterable[str | PathLike[str]] = (),
    defines: Iterable[str] = (),
    set: Mapping[str, object] | Iterable[str] = (),
    vary: Mapping[str, object] | Iterable[str] = (),
    select: Sequence[str] | Literal["all"] | None = None,
) -> Plan:
    """The run plan of a deck.

    text    of a deck in no file; what it includes is looked for as if it stood in the current folder
    set     values in place of the deck's, as the deck would write them: `{"gearbox.kp": "0.02 V*s/rad"}`, or
            texts, `["gearbox.kp=0.02 V*s/rad"]`
    vary    what a sweep of the one run varies, as the deck would write it: `{"gearbox.kp": "[0.01, 0.02] V*s/rad"}`; of
            a list of values each as `set` has them, `{"gearbox.kp": ["0.01 V*s/rad", "0.02 V*s/rad"]}`
    select  names of runs and sweeps, "all", or None: the only one, else the one marked `default`
    Raises `met.diagnostic.Problem` with every error and warning found, and the text of every file read.
    """
    from met.diagnostic import Problem

    compiled = check(path, text=text, include_dirs=include_dirs, defines=defines, set=set, vary=vary, select=select)
    if compiled.plan is None:
        raise Problem(compiled.diagnostics, compiled.sources)
    return compiled.plan


def _settings(settings: Mapping[str, object] | Iterable[str]) -> Iterable[str]:
    """The settings as texts `PATH=VALUE`; several values as the deck's list of them."""
    if not isinstance(settings, Mapping):
        return (settings,) if isinstance(settings, str) else settings
    return [f"{path}={_as_written(value)}" for path, value in settings.items()]


def _as_written(value: object) -> str:
    if isinstance(value, str) or not isinstance(value, Iterable):
        return str(value)
    return f"[{', '.join(map(str, value))}]"

"""Settings from outside of a deck, in the form of a command line: `PATH=VALUE`, and `vary PATH=VALUES` of `--vary`."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from met.outputs import quoted

VARY = "vary"
"""First word of a setting that varies a path."""

_SUFFIX = "_varied"


def varies(setting: str) -> bool:
    """Return True for `vary PATH=VALUES`."""
    return setting.startswith(f"{VARY} ")


def to_set(text: str) -> str:
    """The setting that `--set` makes of a text; it never varies a path, whatever the text begins with."""
    return f" {text}" if varies(text) else text


def settings_of(settings: Iterable[str]) -> dict[str, Any]:
    """The settings as the arguments `set` and `vary` of `ic.compile`."""
    texts = tuple(settings)
    return {
        "set": tuple(text for text in texts if not varies(text)),
        "vary": tuple(text.removeprefix(f"{VARY} ") for text in texts if varies(text)),
    }


def setting_path(setting: str) -> str:
    """The path that is set or varied: `drive.kp`, `macro PARTS`."""
    return " ".join(setting.partition("=")[0].removeprefix(f"{VARY} ").split())


def setting_option(setting: str) -> str:
    """The option of a command line that makes this setting: `--set 'drive.kp=2 V/rad'`."""
    if varies(setting):
        return f"--vary {quoted(setting.removeprefix(f'{VARY} '))}"
    return f"--set {quoted(setting)}"


def varied_name(run: str, taken: Iterable[str]) -> str:
    """The name of the sweep of a run that a command line varies, which no run or sweep of the deck has."""
    known = set(taken)
    name, number = f"{run}{_SUFFIX}", 1
    while name in known:
        number += 1
        name = f"{run}{_SUFFIX}_{number}"
    return name


def varied_run(sweep: str) -> str:
    """The run that was varied, from the `varied_name` of the sweep."""
    return re.sub(rf"{_SUFFIX}(_\d+)?$", "", sweep)

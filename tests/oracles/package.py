"""Packages that answer independently of MET, which only `scripts/test --ci` installs.

A file that asks one in some of its tests can be read without it; the tests that do ask carry the mark `oracle`.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class Package:
    """A package that is imported when something of it is first used.

    Raises ModuleNotFoundError then where it is not installed: the test lacks its mark `oracle`.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self._name), name)

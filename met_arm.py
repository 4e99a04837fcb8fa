"""Starts MET with its own packages, whatever else is called `met`, `ic`, `batch` or `hw` where Python looks.

Python takes the first module of a name: a file `met.py` in a folder of PYTHONPATH is taken for MET. This file has a
name that no one else's has, and MET is beside it. As a program, it runs a module, as `python -m` does:

    python met_arm.py batch.executors.worker 3
"""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

PACKAGES = ("met", "ic", "batch", "hw")
HOME = os.path.dirname(os.path.abspath(__file__))


class _OwnPackages:
    """Finds MET's packages beside this file. It comes before all other finders."""

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        return PathFinder.find_spec(name, [HOME], target) if name in PACKAGES else None


def find_own_packages() -> None:
    """Let every later import of MET's packages find them. Raises ImportError where another module of that name has been
    imported."""
    if _OwnPackages not in sys.meta_path:
        sys.meta_path.insert(0, _OwnPackages)
    for name in PACKAGES:
        file = getattr(sys.modules.get(name), "__file__", None)
        if file is not None and os.path.dirname(os.path.dirname(os.path.abspath(file))) != HOME:
            raise ImportError(f"`{name}` is {file} here, and not MET's package", name=name)


def hiding(reason: BaseException) -> str:
    """Which file hides one that MET needs by having its name, in words, if that may be why this was raised; else ""."""
    module: Any = None
    if isinstance(reason, ImportError):
        module = sys.modules.get((reason.name or "").partition(".")[0])
    elif isinstance(reason, AttributeError) and isinstance(reason.obj, ModuleType):
        module = sys.modules.get(reason.obj.__name__.partition(".")[0])
    file = getattr(module, "__file__", None)
    if file is None:
        return ""
    folder = os.path.dirname(os.path.dirname(file) if hasattr(module, "__path__") else file)
    others = [each for each in sys.path if os.path.realpath(each) != os.path.realpath(folder)]
    spec = PathFinder.find_spec(module.__name__, others)
    hidden = None if spec is None else spec.origin
    return "" if hidden is None else f"`{module.__name__}` is {file} here, which hides {hidden}"


REMEDY = "rename that file, or take its folder off PYTHONPATH"


def main() -> int:
    """The command `met`."""
    if sys.platform == "win32":
        helps = "on Windows, install it in a Linux of WSL 2: `wsl --install`"
        print(f"error[E338]: MET does not run on Windows itself\n = help: {helps}\n\n1 error", file=sys.stderr)
        return 2
    try:
        find_own_packages()
        command = import_module("met.cli").main
    except (ImportError, AttributeError) as reason:
        if not (words := hiding(reason)):
            raise
        print(f"error[E339]: {words}\n = help: {REMEDY}\n\n1 error", file=sys.stderr)
        return 2
    status: int = command()
    gc.freeze()  # else Python looks for garbage among all that is left before it ends: 20 ms of `met check`
    return status


if __name__ == "__main__":
    from runpy import run_module

    find_own_packages()
    del sys.argv[0]
    run_module(sys.argv[0], run_name="__main__", alter_sys=True)

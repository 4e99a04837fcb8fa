"""Other Pythons that MET starts: with the packages of this one, and nothing of the working folder.

`python -m` and `python -c` look for every module in the working folder first, so a `json.py` beside a deck would be
run. A child finds what Python itself finds, what the user named in PYTHONPATH, and MET where this process has it. All
that starts a Python does so by these functions.
"""

from __future__ import annotations

import os
import site
import sys
from pathlib import Path


def command(module: str, *arguments: str) -> list[str]:
    """The words that run a module in a Python like this one; `environment` belongs to them."""
    return [sys.executable, "-P", "-m", module, *arguments]


def environment() -> dict[str, str]:
    """The variables of this process for a Python that it starts, and for those that this one starts in turn."""
    return {**os.environ, **packages()}


def packages() -> dict[str, str]:
    """The variables that decide where a Python finds packages.

    Folders of PYTHONPATH are written out: there an empty one, as `PYTHONPATH=$PYTHONPATH:more` leaves it, is the
    working folder, and one like `lib` is another wherever the child starts. MET's own folder comes first, for a script
    may have found it by other ways; it is left out where Python looks anyway, and where it would hide its library.
    """
    named = [os.path.abspath(each) for each in os.environ.get("PYTHONPATH", "").split(os.pathsep) if each]
    home = str(Path(__file__).resolve().parents[2])
    ours = [] if home in map(os.path.realpath, [*site.getsitepackages(), site.getusersitepackages()]) else [home]
    return {"PYTHONPATH": os.pathsep.join(dict.fromkeys([*ours, *named])), "PYTHONSAFEPATH": "1"}


def looked_in() -> list[str]:
    """The folders of `sys.path` but for the one that Python puts first by itself: the script's, or the working folder.
    What lies there is no package that somebody has installed."""
    found = list(dict.fromkeys(sys.path))
    if not sys.flags.safe_path:
        main = getattr(sys.modules["__main__"], "__file__", None)
        own = [os.getcwd(), *([] if main is None else [os.path.dirname(os.path.realpath(main))])]
        if sys.path[:1] and os.path.realpath(sys.path[0]) in map(os.path.realpath, own):
            found = list(dict.fromkeys(sys.path[1:]))
    return [each for each in found if each]

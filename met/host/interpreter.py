"""Other Pythons that MET starts, with the packages of this one and without modules of the working folder.

`python -m` and `python -c` look for every module in the working folder first, so a `json.py` beside a deck would be
run. A child finds Python's own modules, those that the user named in PYTHONPATH, and MET where this process has it.
Every Python is started by these functions.
"""

from __future__ import annotations

import os
import site
import sys
from pathlib import Path

import met_arm


def command(module: str, *arguments: str) -> list[str]:
    """The command line that runs a module in a Python like this one; it needs the variables of `environment`. MET's own
    packages are found first, whatever PYTHONPATH names."""
    return [sys.executable, "-P", met_arm.__file__, module, *arguments]


def environment() -> dict[str, str]:
    """The environment variables for a Python that this process starts, and for those that it starts in turn."""
    return {**os.environ, **packages()}


def packages() -> dict[str, str]:
    """The environment variables that decide where a Python finds packages.

    Folders of PYTHONPATH are written out: there an empty one, as `PYTHONPATH=$PYTHONPATH:more` leaves it, is the
    working folder, and one like `lib` is another wherever the child starts. MET's own folder comes first, since a
    script may have found it in another way; it is left out where Python finds it anyway, and where it would hide the
    standard library.
    """
    named = [os.path.abspath(folder) for folder in os.environ.get("PYTHONPATH", "").split(os.pathsep) if folder]
    home = str(Path(__file__).resolve().parents[2])
    ours = [] if home in map(os.path.realpath, [*site.getsitepackages(), site.getusersitepackages()]) else [home]
    return {"PYTHONPATH": os.pathsep.join(dict.fromkeys([*ours, *named])), "PYTHONSAFEPATH": "1"}


def looked_in() -> list[str]:
    """The folders of `sys.path` without the one that Python puts first: the script's, or the working folder, whose
    modules do not count as installed packages."""
    folders = list(dict.fromkeys(sys.path))
    if not sys.flags.safe_path:
        main = getattr(sys.modules["__main__"], "__file__", None)
        own = [os.getcwd(), *([] if main is None else [os.path.dirname(os.path.realpath(main))])]
        if sys.path[:1] and os.path.realpath(sys.path[0]) in map(os.path.realpath, own):
            folders = list(dict.fromkeys(sys.path[1:]))
    return [folder for folder in folders if folder]

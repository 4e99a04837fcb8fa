"""Pictures of docs/plots.md: what its commands draw.

python -m tests.batch.plotting.figures          writes docs/figures/plot_*.png
"""

from __future__ import annotations

import contextlib
import re
import shlex
import shutil
import tempfile
from pathlib import Path

from met import cli

FOLDER = Path(__file__).parents[3] / "docs" / "figures"
PAGE = (FOLDER.parent / "plots.md").read_text(encoding="utf-8")


def run(folder: Path) -> list[str]:
    """Write the page's deck into a folder and run its commands there; the names of the pictures."""
    [(name, deck)] = re.findall(r"<!-- (\S+\.ic) -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    (folder / name).write_text(deck, encoding="utf-8")
    drawn = []
    with contextlib.chdir(folder):
        for command in re.findall(r"^    \$ met (.*)$", PAGE, re.MULTILINE):
            words = shlex.split(command)
            quiet = ["-q", "--no-picture"] if words[0] == "run" else ["-q"]
            status = cli.main([*words, *quiet])
            if status not in ((cli.YES, cli.NO) if words[0] == "run" else (cli.YES,)):
                raise RuntimeError(f"met {command}: {status}")
            drawn += [words[words.index("-o") + 1]] if words[0] == "plot" else []
    return drawn


def draw(target: Path) -> list[Path]:
    """The page's own pictures, in `target`; gives back their paths."""
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        shown = [each for each in run(Path(name)) if each.startswith("plot_")]
        return [Path(shutil.copyfile(Path(name) / each, target / each)) for each in shown]


if __name__ == "__main__":
    for path in draw(FOLDER):
        print(path)

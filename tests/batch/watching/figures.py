"""Picture of docs/webassembly.md: the page of a deck that is watched, with a mistake that was just saved.

python -m tests.batch.watching.figures          writes docs/figures/view_deck.png
"""

from __future__ import annotations

import base64
import os
import tempfile
from pathlib import Path

from tests.batch.report.browser import browser
from tests.batch.watching.watched import replace, viewing

FOLDER = Path(__file__).parents[3] / "docs" / "figures"

DECK = """\
#include <panda.ic>

run carry like reach {
    with d3 = 0.35 m;
    require settle < 3 s;
}

default sweep loads of carry {
    vary links.load.mass = [0.5, 1, 2, 3] kg;
}
"""

READY = """new Promise(done => { const look = () => {
    const run = document.querySelector('iframe:not(.coming)')?.contentWindow;
    (%s) && run && run.document.documentElement.dataset.haunted ? done() : setTimeout(look, 30); }; look(); })"""


def draw(folder: Path) -> list[Path]:
    """All pictures, in `folder`; gives back their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, browser() as chromium:
        deck = Path(name, "carry.ic")
        deck.write_text(DECK, encoding="utf-8")
        with viewing("carry.ic", "-q", cwd=name) as view:
            page = chromium.open(view.address, width=1280, height=800)
            page.run(READY % "document.documentElement.dataset.numbers")
            page.run("document.querySelector('iframe').contentWindow.scrollTo(0, 110)")
            replace(deck, "links.load.mass", "links.load.mas")
            page.run(READY % "!document.querySelector('aside').hidden")
            page.settle()
            picture = page.ask("Page.captureScreenshot", format="png")["data"]
            path = folder / "view_deck.png"
            path.write_bytes(base64.b64decode(picture))
    return [path]


if __name__ == "__main__":
    for each in draw(FOLDER):
        print(os.path.relpath(each))

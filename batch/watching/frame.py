"""The page around the run of a watched deck: messages of `met check`, the shown run, and its progress.

The run is a page of its own in it, with all scripts, and no run at first. Each run to show is passed to it as data,
replaces the one before, and keeps its viewpoint.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from batch.portable.page import page_text
from batch.report.html import inlined
from batch.report.html.markup import Html, el, lines

_ASSETS = Path(__file__).with_name("assets")


BY_CASE = ("points.js", "overview.js", "cells.js", "map.js")
"""Scripts of the report that draw a sweep's cases as points and maps."""


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8").strip()


@cache
def frame() -> tuple[str, str]:
    """The whole text, the same for each deck, with its content security policy."""
    script, style = _asset("frame.js"), "\n".join([inlined.style(), _asset("frame.css")])
    policy = (
        f"default-src 'none'; script-src {inlined.digest(script)}; style-src {inlined.digest(style)}; img-src data:; "
        "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    head = lines(
        [
            el("meta", charset="utf-8"),
            el("meta", name="viewport", content="width=device-width, initial-scale=1"),
            el("meta", name="color-scheme", content="light dark"),
            el("link", rel="icon", href="data:,"),
            el("title", "met view"),
            Html(f"<style>{style}</style>"),
        ]
    )
    none = el("noscript", el("p", "This page needs scripts, which this reader does not run."))
    body = lines([none, Html(f"<script>{script}</script>")])
    text = f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'
    return text, policy


@cache
def page_of_runs() -> str:
    """The whole text of the page in the frame, the same for each run; `assets/kept.js` passes it one run after
    another."""
    empty = {"kicker": "", "name": "", "lede": ""}
    return page_text(empty, [_asset("kept.js")], before=BY_CASE, style=_asset("kept.css"))


FRAME_POLICY = "default-src 'none'; frame-ancestors 'none'"
"""The policy of answers that are not pages."""

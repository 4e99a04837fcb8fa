"""The head of a page, and the files that it includes: style, scripts and an unmodified uPlot, checked by its digest."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path

from batch.arms.look import arm_scripts
from batch.report.html.markup import Html, el, lines

FOLDER = Path(__file__).with_name("assets")

STYLES = ("uPlot.min.css", "report.css")
SCRIPTS = (
    "uPlot.iife.min.js",
    "core.js",
    "points.js",
    "overview.js",
    "cells.js",
    "map.js",
    "timeline.js",
    "signals.js",
    "stability.js",
)
SIMULATING = ("simulation.js", "posing.js")
"""Scripts of a page that runs cases again."""

LAST = "report.js"
"""The last script of a page; the scripts are in an order in which each builds on those before."""


@cache
def style() -> str:
    """The style sheet of the page, as one text."""
    return "\n".join(_read(name) for name in STYLES)


def script(modules: str = "") -> str:
    """All scripts, in their order. modules: the script with the modules for running cases again
    (`payload.modules_script`)"""
    if not modules:
        return licensed(*SCRIPTS, LAST)
    from met.backends.wasm.module import KERNEL_JS

    kernel = KERNEL_JS.read_text(encoding="utf-8").strip()
    return "\n".join([licensed(*SCRIPTS), arm_scripts(), kernel, *map(_read, SIMULATING), modules, _read(LAST)])


@cache
def licensed(*names: str) -> str:
    """Scripts of these names, after the licence of uPlot, which requires that."""
    licence = (FOLDER / "uPlot.LICENSE").read_text(encoding="utf-8").strip()
    parts = (_read(name) for name in names)
    return "\n".join([f"/*! uPlot:\n{licence}\n*/", *parts])


def _read(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8").strip()


def digest(text: str) -> str:
    """The name of an inline style or script in a Content-Security-Policy: `'sha256-...'`."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}'"


def page_head(title: str, *, generator: str, style: str, script: str, allowed: str = "") -> Html:
    """The elements of the head, with the style.

    generator  who wrote the page;  script: the only one that it may run
    allowed    a further source of code that its security policy grants: `'wasm-unsafe-eval'`
    """
    scripts = " ".join(filter(None, (digest(script), allowed)))
    rules = (
        f"default-src 'none'; script-src {scripts}; style-src {digest(style)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
    return lines(
        [
            el("meta", charset="utf-8"),
            el("meta", name="generator", content=generator),
            Html(f'<meta http-equiv="Content-Security-Policy" content="{rules}">'),
            el("meta", name="viewport", content="width=device-width, initial-scale=1"),
            el("meta", name="color-scheme", content="light dark"),
            el("meta", name="referrer", content="no-referrer"),
            el("link", rel="icon", href="data:,"),
            el("title", title),
            Html(f"<style>{style}</style>"),
        ]
    )

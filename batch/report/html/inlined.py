"""The files that a page brings with it: style and scripts, and uPlot as it was fetched, held by its digest."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).with_name("assets")

STYLES = ("uPlot.min.css", "report.css")
SCRIPTS = (
    "uPlot.iife.min.js",
    "core.js",
    "points.js",
    "overview.js",
    "cells.js",
    "map.js",
    "signals.js",
    "stability.js",
    "report.js",
)
"""In the order in which they stand in a page; each builds on those before."""


@cache
def style() -> str:
    return "\n".join(_read(name) for name in STYLES)


@cache
def script() -> str:
    """All scripts, in their order."""
    return licensed(*SCRIPTS)


@cache
def licensed(*names: str) -> str:
    """Scripts of these names, after the licence that uPlot's wants to go with it."""
    licence = (FOLDER / "uPlot.LICENSE").read_text(encoding="utf-8").strip()
    parts = (_read(name) for name in names)
    return "\n".join([f"/*! uPlot:\n{licence}\n*/", *parts])


def _read(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8").strip()


def digest(text: str) -> str:
    """The name of an inline style or script in a Content-Security-Policy: `'sha256-...'`."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}'"

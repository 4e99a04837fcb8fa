"""The scripts and the style with which a page draws an arm; they build on `core.js` of the report."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from batch.arms.look import look_json

FOLDER = Path(__file__).with_name("assets")

SCRIPTS = ("formulas.js", "arm.js", "camera.js", "webgl.js", "painter.js", "acting.js", "triad.js", "stage.js")
"""The scripts in the order in which they stand in a page; each builds on those before."""


@cache
def arm_scripts() -> str:
    """The scripts that draw an arm on a page, with the colours and sizes that they use, as one text."""
    texts = [(FOLDER / name).read_text(encoding="utf-8").strip() for name in SCRIPTS]
    return "\n".join([f"MET.look = {json.dumps(look_json())};", *texts])


@cache
def arm_style() -> str:
    """The style sheet of the stage on which an arm is drawn."""
    return (FOLDER / "stage.css").read_text(encoding="utf-8").strip()

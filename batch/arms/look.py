"""The look of an arm's picture, for `met plot --arm` and for pages: sizes, colours, viewpoint, and a page's scripts."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

FIELD = math.tan(math.radians(13.0))
"""Half of the visible height at a distance of 1."""

ROOM = 1.08
"""Distance of the eye, relative to that at which everything just touches the picture's edges."""

AZIMUTH, LOW, HIGH, FLAT = -0.95, 0.34, 0.85, 0.02
"""The initial viewpoint, rad: azimuth, elevation, and the elevation for a flat arm, whose variance upward is at most
this share of that across."""

JOINT, CUBE, RAIL = (1.32, 2.9), 2.4, 0.4
"""Radius and length of a revolute joint, edge of a prismatic one, radius of its rail; in limbs (`ArmScene.limb`)."""

FOOT = (2.6, 0.5)
"""Radius and height of the disc under a fixed base, in limbs."""

LINK, BASE, PAYLOAD = "#c3ccd6", "#76818d", "#e0a02a"
"""Colours on white; a joint has the colour of its line in plots."""


def look_json() -> dict[str, Any]:
    """The looks as a page's scripts take them."""
    return {
        "field": FIELD,
        "room": ROOM,
        "azimuth": AZIMUTH,
        "low": LOW,
        "high": HIGH,
        "flat": FLAT,
        "joint": list(JOINT),
        "cube": CUBE,
        "rail": RAIL,
        "foot": list(FOOT),
        "colours": [LINK, BASE, PAYLOAD],
    }


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

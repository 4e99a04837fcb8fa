"""Sizes, colours and the viewpoint of an arm's picture, for `met plot --arm` and, as JSON, for pages."""

from __future__ import annotations

import math
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

"""Sizes, colours and the viewpoint with which an arm is drawn: by `met plot --arm` and by pages, as JSON."""

from __future__ import annotations

import math
from typing import Any

FIELD = math.tan(math.radians(13.0))
"""Half the height that is seen, at a distance of 1."""

ROOM = 1.08
"""Distance of the eye, against that at which everything just touches the picture's edges."""

AZIMUTH, LOW, HIGH, FLAT = -0.95, 0.34, 0.85, 0.02
"""From where an arm is seen first, rad: direction, elevation, and elevation of an arm that is flat, whose variance
upward is at most this share of that across."""

JOINT, CUBE, RAIL = (1.32, 2.9), 2.4, 0.4
"""Radius and length of a joint that turns, edge of one that slides, radius of its rail; in limbs (`ArmScene.limb`)."""

FOOT = (2.6, 0.5)
"""Radius and height of the disc under a base that stays, in limbs."""

LINK, BASE, PAYLOAD = "#c3ccd6", "#76818d", "#e0a02a"
"""Colours on white; a joint has that of its line in plots."""


def look_json() -> dict[str, Any]:
    """All of it as a page's scripts take it."""
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

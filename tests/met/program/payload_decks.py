"""Decks with payloads, for tests that change them: on the flyer of `free_flyers`."""

from __future__ import annotations

from tests.ic.small_decks import changed
from tests.met.program.free_flyers import RUN as TUMBLING

BOX = """\
    payload box {
        mass     = 12 kg;
        com      = [0.1, -0.05, 0.02] m;
        inertia  = [0.8, 0.9, 1.1, 0.02, -0.03, 0.05] kg*m^2;
        on       = lower;
        at       = [1, 0, 0] m;
        grapple  = 0.8 s;
        release  = 1.5 s;
        position = [2.6, 3, 3.4] m;
        attitude = [10, -20, 30] deg;
        velocity = [0.3, -0.6, 0.2] m/s;
        rate     = [-30, 20, 45] deg/s;
    }
"""

RUN = changed(
    TUMBLING,
    ("    environment {}\n", BOX + "    environment {}\n"),
    (
        "energy, momentum, J_eff, b]",
        "energy, momentum, J_eff, b, payloads.box.position, "
        "payloads.box.orientation, payloads.box.velocity, payloads.box.rate, payloads.box.distance, "
        "payloads.box.carried, reaction]",
    ),
)

"""The drives' side of every dialect of hw/drives, over a simulated shaft: a bench without motors, to rehearse on.

A player is written from the dialect's documentation, as the host's side of it is, and shares no code with that. Both
may be wrong alike: what a maker's firmware does is known once one was there.
"""

from collections.abc import Callable, Mapping

from tests.hw.players.cia402 import PlayedCia402
from tests.hw.players.damiao import PlayedDamiao
from tests.hw.players.moteus import PlayedMoteus
from tests.hw.players.odrive import PlayedOdrive
from tests.hw.players.odrive_ascii import PlayedOdriveAscii
from tests.hw.players.player import PlayedDrive
from tests.hw.players.robstride import PlayedRobstride

PLAYED: Mapping[str, Callable[[int, int], PlayedDrive]] = {
    "odrive": PlayedOdrive,
    "damiao": PlayedDamiao,
    "moteus": PlayedMoteus,
    "cia402": PlayedCia402,
    "robstride": PlayedRobstride,
    "odrive_ascii": PlayedOdriveAscii,
}
"""Makes a played drive of a dialect: (node, sense)."""

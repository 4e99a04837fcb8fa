"""How a deck says what is not read of an MJCF file, by the element or attribute."""

from __future__ import annotations

from collections.abc import Iterator

from ic.robots.robot import Robot

CLOSED = "the loop is open in the deck: a stiff `bushing` of the environment closes it, or a `loop` of the arm"
SERVO = "a servo drives a joint, `servo NAME { model = MODEL; ... }`"
WAYS = {
    "geom": "mass and inertia are in the deck; a `contact` of the environment lets two links touch",
    "contact": "a `contact` of the environment lets two links touch",
    "connect": CLOSED,
    "weld": CLOSED,
    "equality": "in the deck, `follows`, `ratio` and `offset` couple joints by a straight line, without circles",
    "tendon": "a cable between two points is a `spring` of the environment; joints that move together are `follows`",
    "sensor": "the run's `record` names what is recorded, and `sensor NAME = MODEL { link = LINK; ... }` measures",
    "site": "a place on a link is a link of `mass = 0 kg` on a fixed joint",
    "body": "the arm does not carry it: a `payload` of the run is a body that the arm grapples or releases",
    "key": "a run `like hold` with another `initial` begins there",
    **dict.fromkeys(
        ("general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion",
         "dcmotor"), SERVO),
    "plugin": "a model of your own does it: `met new servo`, `met new environment`",
    "gravcomp of body": "a `wrench` of the environment holds the weight of a link",
}  # fmt: skip
"""Others are for pictures, for MuJoCo's solver, or without a counterpart."""


def ways_on(robot: Robot) -> Iterator[str]:
    """Yield a line for each kind of what is not read, if a deck can say it in another way."""
    for what, elements in robot.dropped.items() if robot.format == "MJCF" else ():
        if what in WAYS:
            yield f"not in the deck: {len(elements)} {what}: {WAYS[what]}"

"""Long decks, two macros a line: nine lines of ten are a `let`, the tenth a link and its joint."""

from __future__ import annotations

LINKS_IN_ROW = 50  # of one chain; then the next begins at the base

_HEAD = """\
#include <servos/rigid_gearbox.ic>
#define NAMED(I) length_##I
#define METRES(I) (0.001 * I) * 1 m
#define LINK(I, LENGTH) link link_##I { mass = 1 kg; shape = rod(length = LENGTH, along = x); }
#define JOINT(I, FROM, AXIS) joint joint_##I revolute { parent = FROM; child = link_##I; axis = AXIS; }
servo drive like rigid_gearbox { command = rate(0.1 rad/s); }
"""
_RUN = """\
run hold {
    arm      = many;
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 1 s;
    record   = [q];
"""


def text(lines: int) -> str:
    """A deck of that many lines of two macros each, and a few more."""
    links = lines // 10
    lets = [f"let NAMED({i}) = METRES({i});" for i in range(1, lines - links + 1)]
    arm = []
    for i in range(links):
        parent = "base" if i % LINKS_IN_ROW == 0 else f"link_{i - 1}"
        arm.append(f"LINK({i}, length_{i + 1}) JOINT({i}, {parent}, {'zy'[i % 2]})")
    servos = [f"joint_{i} = drive;" for i in range(links)]
    return "\n".join([_HEAD, *lets, "arm many {", *arm, "}", _RUN, "servos {", *servos, "}", "}", ""])

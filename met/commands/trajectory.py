"""The motion of one joint from a CSV file: a curve through its rows; the first row holds before it, the last after it.

    time [s], shoulder [deg], elbow [deg]
    0,        0,              10
    0.5,      12.5,           20

The first line names the columns and their units; one of them is `time`, whose values rise. A command takes the column
of its joint's name, unless `column` names another. The file is looked for in the folder of the deck that names it, then
in the folders of `-I`. Its rows are read when the deck is compiled, and become part of the plan: a plan file needs no
CSV file.

linear: straight lines, whose slope jumps at the rows. cubic: the clamped cubic spline, which is at rest at both ends
and has a continuous slope and second derivative between them; where rows jump, it swings beyond them.
"""

from __future__ import annotations

from typing import Any

from met.commands.points import cubic, ends, linear
from met.commands.profile import Profile
from met.content import Content, content_of_points
from met.parameter import Parameter
from met.trace import Real


def course(p: Any, t: Real) -> tuple[Real, Real]:
    curve = linear if p.interpolation == "linear" else cubic
    return curve(p.times, p.values, t - p.begin)


def content(p: Any, duration: float) -> Content:
    return content_of_points(p.times, p.values, p.begin)


PROFILE = Profile(
    name="trajectory",
    doc=__doc__,
    from_file=True,
    parameters=(
        Parameter(name="times", unit="s", shape="list", doc="times of the rows, rising"),
        Parameter(name="values", unit="command", shape="list", doc="values at `times`, one for each"),
        Parameter(
            name="interpolation",
            shape="word",
            words=("linear", "cubic"),
            default="linear",
            doc="interpolation between the rows: straight lines, or a cubic spline",
        ),
        Parameter(
            name="begin", unit="s", default=0.0, at_least=0.0, doc="time of the run at which the file's time 0 lies"
        ),
    ),
    course=course,
    content=content,
    limits=(ends(lambda p, t: t - p.begin),),
    jumps=lambda p: "none" if p.interpolation == "cubic" else "rate",
)

"""A force and a moment on a link that change in time: straight lines through the rows of a table, or of a CSV file.

    time [s], force_x [N], moment_z [N*m]
    0,        0,           0
    0.5,      12.5,        -3

Before the first row the values of the first row hold, and after the last row those of the last. A component that is not
given is zero. The force acts at `point` of the link, which moves with the link; with `axes = link`, force and moment
turn with the link too. In a deck, a component is a list with as many numbers as `times`; in a file, which takes the
place of the lists, it is a column of its name, and the times are the column `time`. The table is read at every stage of
a step. A step that contains a row gets the mean over the step at all of its stages, so the impulse is right however
close together the rows are.
"""

from __future__ import annotations

import math
from typing import Any

from met.commands.points import ends, linear, segment
from met.environments.environment import Environment, Force, Loads, World, never
from met.parameter import ZEROS, Parameter
from met.trace import Real, Scalar, gather, where
from met.vectors import Vector

EARLY = 1e-7
"""Share of a step by which a row may miss the step's end and still count as lying on it."""

NAMES = tuple(f"{kind}_{axis}" for kind in ("force", "moment") for axis in "xyz")


def loads(p: Any, world: World) -> Loads:
    """The force and moment of the table on the link now, N and N m in the world."""

    def triple(kind: str) -> Vector:
        x, y, z = (_value_now(p, getattr(p, f"{kind}_{axis}"), world) for axis in "xyz")
        return world.to_world(p.link, (x, y, z)) if p.axes == "link" else (x, y, z)

    return Loads(forces=(Force(p.link, force=triple("force"), moment=triple("moment"), point=p.point),))


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing in a run of this length, with the parameters that say
    so."""
    if not any(number for name in NAMES for number in getattr(p, name)):
        return NAMES, "it has neither force nor moment"
    if any(len(getattr(p, name)) not in (0, len(p.times)) for name in NAMES):
        return None  # the mistake is reported there
    rows = [any(values[row] for name in NAMES if (values := getattr(p, name))) for row in range(len(p.times))]
    first, last = rows.index(True), len(rows) - 1 - rows[::-1].index(True)
    begins = p.begin + p.times[first - 1] if first else -math.inf
    until = p.begin + p.times[last + 1] if last + 1 < len(rows) else math.inf
    reason = never(begins, until, duration)
    return (("begin", "times"), reason[1]) if reason is not None else None


def _value_now(p: Any, values: tuple[float, ...], world: World) -> Real:
    """The table's value at this stage of a step: on the line between rows, or the mean over the step where a row lies
    within it."""
    if len(values) < 2:
        return values[0] if values else 0.0
    value = linear(p.times, values, world.time - p.begin)[0]
    step, begins = world.step, world.begin - p.begin
    if _steps_meet_rows(p, step):
        return value
    ends, early = begins + step, EARLY * step
    # with held ends, so that the first and the last row lie between two segments too
    times = (p.times[0] - 1.0, *p.times, p.times[-1] + 1.0)
    held = (values[0], *values, values[-1])
    mean = (_integral(times, held, ends) - _integral(times, held, begins)) / step
    return where(segment(times, begins + early) < segment(times, ends - early), mean, value)


def _steps_meet_rows(p: Any, step: float) -> bool:
    """True where every row is known to lie on a step of the dynamics, so that a step sees only straight lines."""
    if isinstance(p.begin, Scalar):
        return False
    places = [(p.begin + time) / step for time in p.times]
    return all(abs(place - round(place)) <= EARLY for place in places)


def _integral(times: tuple[float, ...], values: tuple[float, ...], time: Real) -> Real:
    """The integral of the lines until this time, from a fixed one; beyond the ends, the lines are held."""
    done = [0.0]
    for k in range(len(times) - 1):
        done.append(done[-1] + 0.5 * (values[k] + values[k + 1]) * (times[k + 1] - times[k]))
    i = segment(times, time)
    t_0, t_1 = gather(times, i), gather(times, i + 1.0)
    v_0, v_1 = gather(values, i), gather(values, i + 1.0)
    since = time - t_0
    return gather(tuple(done), i) + since * (v_0 + 0.5 * since * ((v_1 - v_0) / (t_1 - t_0)))


ENVIRONMENT = Environment(
    name="wrench_table",
    doc=__doc__,
    from_file=True,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link that force and moment act on"),
        Parameter(
            name="point",
            unit="m",
            shape="vector",
            default=ZEROS,
            doc="point at which the force acts, in the link's frame",
        ),
        Parameter(
            name="axes",
            shape="word",
            words=("world", "link"),
            default="world",
            doc="axes of force and moment: those of the world, or those of the link, which turn with it",
        ),
        Parameter(name="begin", unit="s", default=0.0, doc="time of the run at which the table's time 0 lies"),
        Parameter(name="times", unit="s", shape="list", rises=True, doc="times of the rows"),
        *(
            Parameter(
                name=name,
                unit="N" if name.startswith("force") else "N*m",
                shape="list",
                as_many_as="times",
                default=(),
                doc=f"{name[-1]} component of the {name[:-2]} at `times`",
            )
            for name in NAMES
        ),
    ),
    loads=loads,
    idle=idle,
    pushed_links=lambda p: ("link",),
    limits=(ends(lambda p, world: world.time - p.begin),),
)

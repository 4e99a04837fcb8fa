"""The motion of a prescribed base: pose, velocity and acceleration as formulas of time, recorded once.

A course gives a value and its slope (`Profile.course`). The acceleration is the derivative of the recorded slope, and
that of the turn the derivative of the angular velocity, so no profile declares anything twice. Where a slope has a
kink, the acceleration is that of the piece which the profile takes there.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from met import models
from met.diagnostic import Place
from met.dynamics.spatial import Real, Vector, add, rotation_rpy, turn_vector
from met.plan import COMPONENTS, Course, Experiment, Formula
from met.program.cells import Read, answer, parameters
from met.trace import Formulas, Graph, Scalar
from met.trace.derivative import derivative

TIME = "time"


def recorded(experiment: Experiment) -> Formulas:
    """The motion of a prescribed base as formulas of the time (`TIME`, s) and of the parameters that vary, by path: the
    rows of R_WB, and in world axes the origin, angular velocity, velocity, angular acceleration and acceleration of the
    origin; three numbers each."""
    graph = Graph()

    def number(path: str) -> Any:
        value = experiment.parameters[path].value
        return graph.input(path) if isinstance(value, Formula) else value

    base = experiment.structure.base
    courses, written = (base.courses, base.place) if base is not None else ((), None)
    place, moving, angles, turning = pose_and_rates("the base", "base", courses, written, number, graph.input(TIME))
    w = rate_of_rpy(angles, turning)
    vectors = [*rotation_rpy(*angles), place, w, moving, *([_changing(x) for x in vector] for vector in (w, moving))]
    return Formulas.of(graph, [x for vector in vectors for x in vector])


def pose_and_rates(
    whose: str, head: str, courses: Iterable[Course], written: Place | None, number: Read, time: Real
) -> tuple[list[Real], list[Real], list[Real], list[Real]]:
    """A pose that courses give at a time (s): position x y z (m), its rate, angles roll, pitch, yaw (rad), and their
    rates; 0 where there is no course.

    whose  for messages;  head  of the paths of the courses' parameters, which `number` gives
    """
    values: dict[str, Real] = dict.fromkeys(COMPONENTS, 0.0)
    rates: dict[str, Real] = dict.fromkeys(COMPONENTS, 0.0)
    for course in courses:
        profile = models.find("command", course.model, written)
        owner = f"course `{profile.name}` of `{course.component}` of {whose}"
        p = parameters(owner, f"{head}.{course.component}", profile.parameters, number)
        values[course.component], rates[course.component] = answer(owner, profile.course, p, time)
    place, moving = ([part[name] for name in COMPONENTS[:3]] for part in (values, rates))
    angles, turning = ([part[name] for name in COMPONENTS[3:]] for part in (values, rates))
    return place, moving, angles, turning


def rate_of_rpy(angles: list[Real], rates: list[Real]) -> Vector:
    """Angular velocity in world axes of R = Rz(yaw) Ry(pitch) Rx(roll)."""
    _, pitch, yaw = angles
    roll_rate, pitch_rate, yaw_rate = rates
    about_x = turn_vector(rotation_rpy(0.0, pitch, yaw), (roll_rate, 0.0, 0.0))
    about_y = turn_vector(rotation_rpy(0.0, 0.0, yaw), (0.0, pitch_rate, 0.0))
    return add(about_x, add(about_y, (0.0, 0.0, yaw_rate)))


def _changing(x: Real) -> Real:
    return derivative(x, TIME) if isinstance(x, Scalar) else 0.0

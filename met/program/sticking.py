"""Rates of a system that have dry friction: of joints, and on the motor's side of servos (docs/physics.md)."""

from __future__ import annotations

from met.diagnostic import Problem, error
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan.following import leaders
from met.program.system import Actuator, System
from met.trace import Real


@frozen
class Sticking:
    """A rate that dry friction may hold at zero: a joint's, or a state of its servo.

    name      of its cells: the joint, or the state's channel
    cell      that holds the rate
    actuator  the servo whose physics gives its friction; None of a joint without one
    state     name of the state; "" where it is the joint
    number    of the joint in `Motion.qd`; of the state in `Motion.x`
    level     of its friction, where it is the same at all times and for all cases; None where it varies
    followers  numbers of joints with dry friction that follow it: all of them stick and slide with it
    """

    name: str
    cell: str
    actuator: Actuator | None
    state: str
    number: int
    level: float | None
    followers: tuple[int, ...] = ()

    def rate(self, y: Motion) -> Real:
        return y.x[self.number] if self.state else y.qd[self.number]


def sticking(system: System) -> tuple[Sticking, ...]:
    """Joints first, then states; none of a joint whose motor is on a bed: its friction is the bed's."""
    on_bed = [actuator.index for actuator, _, _ in system.mounted]
    free = [actuator for actuator in system.working if actuator.index not in on_bed]
    own = [
        None if joint.name in system.braked else 0.0 if actuator is None else actuator.level
        for joint, actuator in zip(system.joints, system.actuators, strict=True)
    ]
    known = {joint.name: joint for joint in system.joints}
    followers: dict[int, tuple[int, ...]] = {}
    for joint in system.followers:
        i = system.joints.index(joint)
        if own[i] != 0.0:
            first, *more = (system.joints.index(known[name]) for name in leaders(joint.name, known))
            actuator = system.actuators[first]
            if more or first in on_bed or (actuator is not None and actuator.gives):
                message = f"joint `{joint.name}` has dry friction, and no torque of one joint that leads it feels that"
                help = "leave the friction out, or put it on the joints that lead"
                raise Problem(error("E219", message, joint.place, help=help))
            followers[first] = (*followers.get(first, ()), i)
    joints = []
    for i, (joint, actuator) in enumerate(zip(system.joints, system.actuators, strict=True)):
        level = None if i in followers else own[i]
        if i not in on_bed and level != 0.0 and not joint.follows:
            joints.append(Sticking(joint.name, f"{joint.name}.qd", actuator, "", i, level, followers.get(i, ())))
    names = system.states
    states = [
        Sticking(f"{a.path}.{name}", f"{a.path}.{name}", a, name, names.index(f"{a.path}.{name}"), level)
        for a in free
        for name, level in a.levels.items()
        if level != 0.0
    ]
    return (*joints, *states)

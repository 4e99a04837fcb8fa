"""The derivative: what every model does at a state, and the motion of the arm that follows (docs/physics.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager

from met.dynamics.recursion import Solved, solve
from met.dynamics.tree import Tree
from met.frozen import frozen
from met.integrators.integrator import Motion, Slope
from met.program.base import Base, base_of, slopes_of_base
from met.program.machine import Actuator, Machine, ReadCell
from met.program.values import Values, answer, parameters, returned
from met.program.world import ArmWorld
from met.servos.servo import Control, Drive, JointMotion, Seen
from met.trace import Real, Truth, not_, where
from met.vectors import Vector


@frozen
class Derivative:
    """What holds at one stage.

    slope    derivative of the state
    tau      torque of the servo on each moving joint, its rotor's share included (N m; N)
    need     what dry friction must hold where it sticks, by the name of what sticks: of a joint the smooth torque less
             what the arm takes, of a servo's state its slope without friction
    solved   the recursion's own results
    shown    what servos show of this stage, by channel
    gravity  acceleration of free fall, of all environment models, world axes, m/s^2
    base     where the base is and how it moves
    """

    slope: Slope
    tau: tuple[Real, ...]
    need: Mapping[str, Real]
    solved: Solved
    shown: Mapping[str, Real]
    gravity: Vector
    base: Base


def derivative(
    machine: Machine,
    read: ReadCell,
    *,
    y: Motion,
    held: Sequence[Values],
    friction: Mapping[str, Real],
    time: Real,
    begin: Real,
    part: Callable[[str], AbstractContextManager[None]],
    told: Mapping[int, Real] | None = None,
) -> Derivative:
    """The derivative at state y.

    held      what the servos' computers hold, one for each moving joint
    begin     time at which the dynamics step began that this stage is part of, s
    friction  s in {0, +1, -1}, by the name of what may stick (`Sticking.name`): stuck, sliding forward, backward
    told      accelerations of joints whose motors are on a bed, by number: the servo does nothing to these
    part      of the tape: tells servos, environment and dynamics apart where a profile asks
    """
    with part("servo physics"):
        driven = tuple(
            None if actuator is None else driven_by(machine, actuator, read, y, held[i], time, begin)
            for i, actuator in enumerate(machine.actuators)
        )
    drives = tuple(None if each is None else each.drive for each in driven)
    tree, base, n = machine.tree(read), base_of(machine, read, y, time), len(machine.joints)
    with part("environment"):
        gravity, torques, wrenches = _environment(machine, tree, read, y, base, time, begin)

    told = told or {}
    given: list[Real] = []
    mode: list[Truth] = []
    dry: list[Real] = []
    for i, drive in enumerate(drives):
        s = friction.get(machine.joints[i].name)
        if i in told:
            mode.append(False)
            given.append(told[i])
            dry.append(0.0)
            continue
        in_torque_mode: Truth = True
        if drive is not None and drive.given is not None:
            in_torque_mode = not_(drive.given)
        elif s is not None:
            in_torque_mode = s != 0.0
        mode.append(in_torque_mode)
        given.append(drive.qdd if drive is not None else 0.0)
        dry.append(0.0 if drive is None or s is None else s * drive.dry)

    smooth = [
        torques[i] + (0.0 if drive is None or i in told else drive.torque) for i, drive in enumerate(drives)
    ]
    with part("dynamics"):
        solved = solve(
            tree,
            y.q[:n],
            y.qd[:n],
            tau=tuple(a - b for a, b in zip(smooth, dry, strict=True)),
            qdd=tuple(given),
            mode=tuple(mode),
            rotor=tuple(0.0 if drive is None else drive.rotor for drive in drives),
            gravity=base.to_base(gravity),
            base_acceleration=(base.wd, base.a),
            base_rate=base.w,
            wrenches=wrenches,
            velocity_products=machine.structure.velocity_products,
        )
    slopes, state_needs = _slopes(machine, driven, friction)
    needs = {joint.name: a - b for joint, a, b in zip(machine.joints, smooth, solved.tau_load, strict=True)}
    qd, qdd = slopes_of_base(base, solved.base_acceleration, y) if machine.structure.free else ((), ())
    return Derivative(
        slope=Slope((*y.qd[:n], *qd), (*solved.qdd, *qdd), slopes),
        tau=tuple(a - b for a, b in zip(solved.tau, torques, strict=True)),
        need=needs | state_needs,
        solved=solved,
        shown={path: value for each in driven if each is not None for path, value in each.shown.items()},
        gravity=gravity,
        base=base,
    )


@frozen
class Driven:
    """A servo at a stage: its physics, the slopes of its states and law, and what it shows, by channel."""

    drive: Drive
    slopes: Mapping[str, Real]
    shown: Mapping[str, Real]


def driven_by(
    machine: Machine, actuator: Actuator, read: ReadCell, y: Motion, held: Values, time: Real, begin: Real
) -> Driven:
    """What a servo does at state y with this memory, its answers checked against its declaration.

    A continuous law is asked here, for this stage; `held` is then not read.
    """
    servo, parts, owner = actuator.servo, actuator.parts, actuator.owner
    own = {state.name: y.x[machine.states.index(f"{actuator.path}.{state.name}")] for state in parts.states}
    natural = Values(owner, {state.name: own[state.name] for state in parts.natural})
    p = machine.servo_values(actuator, read)
    q, qd = y.q[actuator.index], y.qd[actuator.index]
    slopes: dict[str, Real] = {}
    shown: dict[str, Real] = {}
    if parts.continuous:
        asked = machine.asked(actuator, read, time)
        integrals = {state.name: own[state.name] for state in parts.integrals}
        found = law(actuator, p, Values(owner, integrals), Seen(q, qd, asked, 0.0, time, natural))
        held = Values(owner, {**found.outputs, **integrals})
        slopes.update(found.slopes)
        shown.update({"command": asked.value} if actuator.use.command is not None else {}, **found.outputs)
    motion = JointMotion(q, qd, time, begin, actuator.asked)
    drive = answer(owner, servo.drive, p, held, natural, motion)
    slopes.update(returned(owner, "slopes", drive.slopes, (state.name for state in parts.natural)))
    shown.update(returned(owner, "signals", drive.signals, (signal.name for signal in parts.signals)))
    return Driven(drive, slopes, {f"{actuator.path}.{name}": value for name, value in shown.items()})


def law(actuator: Actuator, p: Values, held: Values, seen: Seen) -> Control:
    """What a servo's control law gives, checked against its declaration."""
    owner, parts = actuator.owner, actuator.parts
    assert actuator.servo.control is not None
    found = answer(owner, actuator.servo.control, p, held, seen)
    returned(owner, "control", found.outputs, (output.name for output in parts.outputs))
    returned(owner, "slopes of control", found.slopes, (state.name for state in parts.integrals))
    return found


def _slopes(
    machine: Machine, driven: Sequence[Driven | None], friction: Mapping[str, Real]
) -> tuple[tuple[Real, ...], dict[str, Real]]:
    """Slopes of the servos' states, and those of states with dry friction as they are without."""
    slopes: list[Real] = []
    needs: dict[str, Real] = {}
    for actuator in machine.working:
        each = driven[actuator.index]
        assert each is not None
        for state in actuator.parts.states:
            channel, slope = f"{actuator.path}.{state.name}", each.slopes[state.name]
            if channel in friction:
                s, needs[channel] = friction[channel], slope
                slope = where(s == 0.0, 0.0, slope - s * each.drive.friction[state.name])
            slopes.append(slope)
    return tuple(slopes), needs


def _environment(
    machine: Machine, tree: Tree, read: ReadCell, y: Motion, base: Base, time: Real, begin: Real
) -> tuple[Vector, list[Real], dict[str, tuple[Vector, Vector]]]:
    """Sum of all loads: gravity (world), torque a joint, wrench a link (moment about its origin, force; link axes)."""
    world = ArmWorld(machine, read, tree, y, base, time, begin)
    gravity: list[Real] = [0.0, 0.0, 0.0]
    torques: list[Real] = [0.0 for _ in machine.joints]
    wrenches: dict[str, tuple[Vector, Vector]] = {}
    for name, model in machine.environment:
        prefix = f"environment.{name}"
        owner = f"environment model `{model.name}` (as `{name}`)"
        p = parameters(owner, prefix, model.parameters, lambda path: machine.value(path, read))
        loads = answer(owner, model.loads, p, world)
        gravity = [a + b for a, b in zip(gravity, loads.gravity, strict=True)]
        for joint, torque in loads.torques.items():
            number = world._number(joint)
            torques[number] = torques[number] + torque
        for force in loads.forces:
            if world.is_ground(force.link):
                continue
            moment, total = world.link(force.link).wrench(force.force, force.moment, force.point)
            if force.link in wrenches:
                before = wrenches[force.link]
                moment = tuple(a + b for a, b in zip(before[0], moment, strict=True))  # type: ignore[assignment]
                total = tuple(a + b for a, b in zip(before[1], total, strict=True))  # type: ignore[assignment]
            wrenches[force.link] = (moment, total)
    return (gravity[0], gravity[1], gravity[2]), torques, wrenches

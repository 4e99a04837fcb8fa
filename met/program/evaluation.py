"""The derivative: what every model does at a state, and the motion of the arm that follows (docs/physics.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager

from met.dynamics.recursion import Solved, solve
from met.dynamics.tree import Tree
from met.environments.environment import Vector
from met.frozen import frozen
from met.integrators.integrator import Motion, Slope
from met.program.base import Base, base_of, slopes
from met.program.machine import Actuator, Machine, ReadCell
from met.program.values import Values, answer, parameters, returned
from met.program.world import ArmWorld
from met.servos.servo import Drive, JointMotion
from met.trace import Real, Truth, not_


@frozen
class Derivative:
    """What holds at one stage.

    slope    derivative of the state
    tau      torque of the servo on each moving joint, its rotor's share included (N m; N)
    need     smooth torque on each joint less what the arm takes: what dry friction must hold where it sticks
    solved   the recursion's own results
    drives   what each servo does, by joint number; None for a passive joint
    gravity  acceleration of free fall, of all environment models, world axes, m/s^2
    base     where the base is and how it moves
    """

    slope: Slope
    tau: tuple[Real, ...]
    need: tuple[Real, ...]
    solved: Solved
    drives: tuple[Drive | None, ...]
    gravity: Vector
    base: Base


def derivative(
    machine: Machine,
    read: ReadCell,
    *,
    y: Motion,
    held: Sequence[Values],
    friction: Sequence[Real | None],
    time: Real,
    begin: Real,
    part: Callable[[str], AbstractContextManager[None]],
    told: Mapping[int, Real] | None = None,
) -> Derivative:
    """The derivative at state y (`held`, `friction`: one for each moving joint).

    begin     time at which the dynamics step began that this stage is part of, s
    friction  None for a joint without dry friction; else s in {0, +1, -1}: stuck, sliding forward, backward
    told      accelerations of joints whose motors are on a bed, by number: the servo does nothing to these
    part      of the tape: tells servos, environment and dynamics apart where a profile asks
    """
    with part("servo physics"):
        drives = tuple(
            None if actuator is None else drive_of(machine, actuator, read, y, held[i], time, begin)
            for i, actuator in enumerate(machine.actuators)
        )
    tree, base, n = machine.tree(read), base_of(machine, read, y, time), len(machine.joints)
    with part("environment"):
        gravity, torques, wrenches = _environment(machine, tree, read, y, base, time, begin)

    told = told or {}
    given: list[Real] = []
    mode: list[Truth] = []
    dry: list[Real] = []
    for i, drive in enumerate(drives):
        s = friction[i]
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
    qd, qdd = slopes(base, solved.base_acceleration, y) if machine.structure.free else ((), ())
    return Derivative(
        slope=Slope((*y.qd[:n], *qd), (*solved.qdd, *qdd), _slopes(machine, drives)),
        tau=tuple(a - b for a, b in zip(solved.tau, torques, strict=True)),
        need=tuple(a - b for a, b in zip(smooth, solved.tau_load, strict=True)),
        solved=solved,
        drives=drives,
        gravity=gravity,
        base=base,
    )


def drive_of(
    machine: Machine, actuator: Actuator, read: ReadCell, y: Motion, held: Values, time: Real, begin: Real
) -> Drive:
    """What a servo does to its joint at state y with this memory, its answer checked against its declaration."""
    servo = actuator.servo
    names = state_names(machine)
    states = {state.name: y.x[names.index(f"{actuator.path}.{state.name}")] for state in servo.states}
    motion = JointMotion(y.q[actuator.index], y.qd[actuator.index], time, begin, actuator.asked)
    p = machine.servo_values(actuator, read)
    drive = answer(actuator.owner, servo.drive, p, held, Values(actuator.owner, states), motion)
    returned(actuator.owner, "slopes", drive.slopes, states)
    returned(actuator.owner, "signals", drive.signals, (signal.name for signal in servo.signals))
    return drive


def state_names(machine: Machine) -> tuple[str, ...]:
    """Channels of the states that servos integrate, in the order of `Motion.x`."""
    return tuple(f"{a.path}.{state.name}" for a in machine.working for state in a.servo.states)


def _slopes(machine: Machine, drives: Sequence[Drive | None]) -> tuple[Real, ...]:
    slopes: list[Real] = []
    for actuator in machine.working:
        drive = drives[actuator.index]
        assert drive is not None
        slopes.extend(drive.slopes[state.name] for state in actuator.servo.states)
    return tuple(slopes)


def _environment(
    machine: Machine, tree: Tree, read: ReadCell, y: Motion, base: Base, time: Real, begin: Real
) -> tuple[Vector, list[Real], dict[str, tuple[Vector, Vector]]]:
    """Sum of all loads: gravity (world), torque a joint, wrench a link (moment about its origin, force; link axes)."""
    world = ArmWorld(machine, tree, y, base, time, begin)
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
            moment, total = world.link(force.link).wrench(force.force, force.moment, force.point)
            if force.link in wrenches:
                before = wrenches[force.link]
                moment = tuple(a + b for a, b in zip(before[0], moment, strict=True))  # type: ignore[assignment]
                total = tuple(a + b for a, b in zip(before[1], total, strict=True))  # type: ignore[assignment]
            wrenches[force.link] = (moment, total)
    return (gravity[0], gravity[1], gravity[2]), torques, wrenches

"""The derivative: the outputs of every model at a state, and the resulting motion of the arm (docs/physics.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import Any

from met.dynamics.coupling import Ratios, inertia_at, solve_coupled
from met.dynamics.linearised import tell
from met.dynamics.recursion import Solved, solve
from met.dynamics.spatial import is_zero
from met.dynamics.tree import Tree
from met.environments.environment import Environment
from met.frozen import frozen
from met.integrators.integrator import Motion, Slope
from met.program import rotors
from met.program.cells import NamedValues, answer, returned
from met.program.control import guiding, link_sensors, sensing
from met.program.motion.base import ArmWorld, BaseMotion, base_of, environment_values, free_base
from met.program.motion.bodies import slopes, slopes_of_payloads, split_wrenches, tree_with_payloads
from met.program.system import Actuator, ReadCell, System
from met.servos.servo import Control, Drive, JointMotion, Seen, Setpoint
from met.trace import Real, Truth, absolute, both, not_, sign, where
from met.vectors import Vector


@frozen
class Derivative:
    """The derivative at one stage, with quantities computed along with it.

    slope    derivative of the state
    tau      torque of the servo on each moving joint, its rotor's share included (N m; N); of dry friction that a brake
             bears with it, the servo's share
    need     what dry friction must hold where it sticks, by the name of what sticks: of a joint the smooth torque less
             what the arm takes, of a servo's state its slope without friction
    solved   the recursion's own results
    signals  what servos show of this stage, by channel
    gravity  acceleration of free fall, of all environment models, world axes, m/s^2
    base     where the base is and how it moves
    stored   kinetic and potential energy in the servos, of what does not move with their joints, J
    angular_momenta  of the rotors that a free base feels, by joint, about its axis against the link that carries them,
             kg m^2/s; none of them where the base does not move freely
    out_of_range  of each moving joint, whether a state of its servo is where it can never be
    loads    what each moving joint would have to be driven with to move so, N m (N): what the arm takes less what the
             environment gives
    felt     where joints follow others: the inertia of the arm at a joint, by its number (`J_eff`)
    """

    slope: Slope
    tau: tuple[Real, ...]
    need: Mapping[str, Real]
    solved: Solved
    signals: Mapping[str, Real]
    gravity: Vector
    base: BaseMotion
    stored: tuple[Real, Real]
    angular_momenta: tuple[Real, ...]
    out_of_range: tuple[Truth, ...]
    loads: tuple[Real, ...]
    felt: Callable[[int], Real] | None = None


def derivative(
    system: System,
    read: ReadCell,
    *,
    y: Motion,
    held: Sequence[NamedValues],
    friction: Mapping[str, Real],
    time: Real,
    begin: Real,
    part: Callable[[str], AbstractContextManager[None]],
    prescribed_qdd: Mapping[int, Real] | None = None,
) -> Derivative:
    """The derivative at state y.

    held      what the servos' computers hold, one for each moving joint
    begin     time at which the dynamics step began that this stage is part of, s
    friction  s in {0, +1, -1}, by the name of what may stick (`Sticking.name`): stuck, sliding forward, backward
    prescribed_qdd  accelerations of joints whose motors are on a bed, by number: the servo does nothing to these
    part      of the tape: tells servos, environment and dynamics apart where a profile asks
    """
    with part("servo physics"):
        driven = tuple(
            None if actuator is None else servo_response(system, actuator, read, y, held[i], time, begin)
            for i, actuator in enumerate(system.actuators)
        )
    drives = tuple(None if response is None else response.drive for response in driven)
    tree, base, n = tree_with_payloads(system, read), base_of(system, read, y, time), len(system.joints)
    with part("environment"):
        loads = _environment(system, tree, read, y, base, time, begin)
        wrenches, on_payloads = split_wrenches(system, read, loads.wrenches)

    prescribed_qdd, ratios = prescribed_qdd or {}, system.ratios(read, y.q)
    given_qdd: list[Real] = []
    mode: list[Truth] = []
    dry: list[Real] = []
    for i, drive in enumerate(drives):
        leader = min(ratios[i], default=i)
        s = friction.get(system.joints[leader].name)
        if i in prescribed_qdd:
            mode.append(False)
            given_qdd.append(prescribed_qdd[i])
            dry.append(0.0)
            continue
        in_torque_mode: Truth = True
        if drive is not None and drive.given is not None:
            in_torque_mode = not_(drive.given)
        elif s is not None:
            in_torque_mode = s != 0.0
        mode.append(in_torque_mode)
        given_qdd.append(drive.qdd if drive is not None else 0.0)
        if s is None or leader != i:
            dry.append(0.0)
        else:
            dry.append(s * group_level(system, ratios, i, drives, loads))

    smooth = [
        loads.torques[i] + (0.0 if drive is None or i in prescribed_qdd else drive.torque)
        for i, drive in enumerate(drives)
    ]
    turning = None
    if free_base(system) is not None:
        of_states, state_needs = _slopes(system, driven, friction)
        turning = rotors.of(system, drives, y, of_states, friction, prescribed_qdd)
    with part("dynamics"):
        arguments: dict[str, Any] = {
            "q": y.q[:n],
            "qd": y.qd[:n],
            "tau": tuple(a - b for a, b in zip(smooth, dry, strict=True)),
            "qdd": tuple(given_qdd),
            "mode": tuple(mode),
            "rotor": tuple(0.0 if drive is None else drive.rotor for drive in drives),
            "spin": None if turning is None else turning.spin,
            "free_rotors": None if turning is None else turning.free,
            "gravity": base.to_base(loads.gravity),
            "base_acceleration": (base.wd, base.a),
            "base_rate": base.w,
            "wrenches": wrenches,
            "velocity_products": system.structure.velocity_products,
        }
        if any(ratios):
            solved = solve_coupled(tree, ratios, system.bends(read, y), **arguments)
        else:
            solved = solve(tree, **arguments)
            tell(tree, arguments, solved)
    if turning is None:
        of_states, state_needs = _slopes(system, driven, friction)
    else:
        of_states, state_needs = rotors.against_their_links(system, turning, solved, of_states, state_needs, friction)
    needs = {joint.name: a - b for joint, a, b in zip(system.joints, smooth, solved.tau_load, strict=True)}
    qd, qdd = (*y.qd[:n],), solved.qdd
    body = free_base(system)
    if body is not None:
        of_base = slopes(body, y, pose=base.pose, turned=base.turned, solved=solved.base_acceleration)
        qd, qdd = (*qd, *of_base[0]), (*qdd, *of_base[1])
    of_payloads = slopes_of_payloads(system, read, y, on_payloads, loads.gravity)
    qdd = (*qdd, *of_payloads[1])
    if system.sensors:
        with part("sensors"):
            moved = link_sensors.Accelerations(qdd, solved.base_acceleration, loads.gravity)
            felt = link_sensors.Aboard(system, read, tree, y, base, time, begin, moved)
            own = dict(zip(system.states, y.x, strict=True))
            of_states = (*of_states, *link_sensors.slopes(system, read, felt, own))
    return Derivative(
        slope=Slope((*qd, *of_payloads[0]), qdd, of_states),
        tau=_servo_torques(system, ratios, drives, loads, smooth, solved),
        need=needs | state_needs,
        solved=solved,
        signals={
            path: value for response in driven if response is not None for path, value in response.signals.items()
        },
        gravity=loads.gravity,
        base=base,
        stored=(
            sum((drive.kinetic for drive in drives if drive is not None), 0.0),
            sum((drive.potential for drive in drives if drive is not None), 0.0),
        ),
        angular_momenta=() if turning is None else turning.momenta(y.qd),
        out_of_range=tuple(False if drive is None else drive.state_out_of_range for drive in drives),
        loads=tuple(a - b for a, b in zip(solved.tau_load, loads.torques, strict=True)),
        felt=partial(inertia_at, tree, ratios, arguments) if any(ratios) else None,
    )


@frozen
class ServoResponse:
    """A servo at a stage: its physics, the slopes of its states, law and sensors, and its signals, by channel."""

    drive: Drive
    slopes: Mapping[str, Real]
    signals: Mapping[str, Real]


def servo_response(
    system: System, actuator: Actuator, read: ReadCell, y: Motion, held: NamedValues, time: Real, begin: Real
) -> ServoResponse:
    """A servo's physics at state y with this memory, its answers checked against its declaration.

    A continuous law is evaluated here, for this stage; `held` is then not read.
    """
    servo, parts, owner = actuator.servo, actuator.parts, actuator.owner
    own = {name: y.x[system.states.index(name)] for name in actuator.states}
    natural = NamedValues(owner, {state.name: own[f"{actuator.path}.{state.name}"] for state in parts.natural})
    p = system.servo_values(actuator, read)
    q, qd = y.q[actuator.index], y.qd[actuator.index]
    slopes: dict[str, Real] = {}
    signals: dict[str, Real] = {}
    seen = Seen(*sensing.measured(actuator, p, q, qd, natural), Setpoint("none", 0.0, 0.0), 0.0, time, natural)
    of_sensors = sensing.slopes(system, actuator, read, seen, own)
    if parts.continuous:
        with_setpoint = replace(seen, setpoint=guiding.setpoint(system, actuator, read, time))
        seen = sensing.seen_at_stage(system, actuator, read, with_setpoint, own)
        seen = sensing.seen(system, actuator, read, seen, None)
        integrals = {state.name: own[f"{actuator.path}.{state.name}"] for state in parts.integrals}
        control = law(actuator, p, NamedValues(owner, integrals), seen)
        control = sensing.law_outputs(system, actuator, read, p, seen.time, control)
        held = NamedValues(owner, {**control.outputs, **integrals})
        slopes.update(control.slopes)
        signals.update({"command": seen.setpoint.value} if actuator.use.command is not None else {}, **control.outputs)
        for quantity in map(sensing.quantity, actuator.sensors):
            signals[f"sensor.{quantity}"] = sensing.true_value(seen, quantity)
    coupled = sensing.coupled(system, actuator, read, begin)
    motion = JointMotion(q, qd, time, begin, actuator.command_kind, 1.0 if coupled is None else coupled)
    drive = answer(owner, servo.drive, p, held, natural, motion)
    if coupled is not None:
        prescribed = None if drive.given is None else both(drive.given, coupled > 0.0)
        drive = replace(drive, torque=coupled * drive.torque, dry=coupled * drive.dry, given=prescribed)
    slopes.update(returned(owner, "slopes", drive.slopes, (state.name for state in parts.natural)))
    if coupled is not None:
        for state in parts.natural:
            if state.in_transmission:
                back = (state.start - own[f"{actuator.path}.{state.name}"]) / system.structure.schedule.step
                slopes[state.name] = coupled * slopes[state.name] + (1.0 - coupled) * back
    signals.update(returned(owner, "signals", drive.signals, (signal.name for signal in parts.signals)))
    by_channel = {f"{actuator.path}.{name}": slope for name, slope in slopes.items()}
    return ServoResponse(drive, by_channel | of_sensors, {f"{actuator.path}.{name}": x for name, x in signals.items()})


def law(actuator: Actuator, p: NamedValues, held: NamedValues, seen: Seen) -> Control:
    """Outputs and slopes of a servo's control law, checked against its declaration."""
    owner, parts = actuator.owner, actuator.parts
    assert actuator.servo.control is not None
    control = answer(owner, actuator.servo.control, p, held, seen)
    returned(owner, "control", control.outputs, (output.name for output in parts.outputs))
    returned(owner, "slopes of control", control.slopes, (state.name for state in parts.integrals))
    return control


def _slopes(
    system: System, driven: Sequence[ServoResponse | None], friction: Mapping[str, Real]
) -> tuple[tuple[Real, ...], dict[str, Real]]:
    """Slopes of the servos' states, and frictionless slopes of those with dry friction."""
    slopes: list[Real] = []
    needs: dict[str, Real] = {}
    for actuator in system.working:
        response = driven[actuator.index]
        assert response is not None
        for channel in actuator.states:
            slope = response.slopes[channel]
            if channel in friction:
                s, needs[channel] = friction[channel], slope
                level = response.drive.friction[channel.removeprefix(f"{actuator.path}.")]
                slope = where(s == 0.0, 0.0, slope - s * level)
            slopes.append(slope)
    return tuple(slopes), needs


@frozen
class _Loads:
    """The sum of all loads.

    gravity   world axes, m/s^2;  torques: one a moving joint, N m (N)
    wrenches  by link: moment about its frame's origin, and force, link axes
    dry       dry friction on joints, by name, N m (N)
    """

    gravity: Vector
    torques: list[Real]
    wrenches: dict[str, tuple[Vector, Vector]]
    dry: dict[str, Real]


def level_of(system: System, joint: int, drive: Drive | None, loads: _Loads) -> Real:
    """The level of dry friction at a joint: its servo's, and brakes'."""
    name = system.joints[joint].name
    if drive is None:
        return loads.dry.get(name, 0.0)
    return drive.dry + loads.dry[name] if name in loads.dry else drive.dry


def group_level(system: System, ratios: Ratios, leader: int, drives: Sequence[Drive | None], loads: _Loads) -> Real:
    """The level of dry friction at a joint that moves by itself, with that of the joints that follow it alone."""
    total = level_of(system, leader, drives[leader], loads)
    for i, ratio in _rubbing(system, ratios, leader, drives, loads).items():
        total = total + absolute(ratio) * level_of(system, i, drives[i], loads)
    return total


def _servo_torques(
    system: System,
    ratios: Ratios,
    drives: Sequence[Drive | None],
    loads: _Loads,
    smooth: Sequence[Real],
    solved: Solved,
) -> tuple[Real, ...]:
    """The torque of each joint's servo. The dry friction of a group, which the recursion has at its leader, is divided
    in proportion to the levels of its joints."""
    tau = [a - b for a, b in zip(solved.tau, loads.torques, strict=True)]
    friction = [a - b for a, b in zip(smooth, solved.tau, strict=True)]
    for leader, row in enumerate(ratios):
        rubbing = _rubbing(system, ratios, leader, drives, loads) if leader in row else {}
        if rubbing:
            total, whole = group_level(system, ratios, leader, drives, loads), friction[leader]
            for i, ratio in {leader: 1.0, **rubbing}.items():
                friction[i] = sign(ratio) * whole * _share(level_of(system, i, drives[i], loads), total)
                tau[i] = smooth[i] - loads.torques[i] - friction[i]
    return tuple(
        a + _of_brakes(system, i, drives[i], loads, b) for i, (a, b) in enumerate(zip(tau, friction, strict=True))
    )


def _rubbing(
    system: System, ratios: Ratios, leader: int, drives: Sequence[Drive | None], loads: _Loads
) -> dict[int, Real]:
    """The joints with dry friction whose motion follows from this joint's alone, by number, with their ratios."""
    return {
        i: row[leader]
        for i, row in enumerate(ratios)
        if i != leader and leader in row and len(row) == 1 and not is_zero(level_of(system, i, drives[i], loads))
    }


def _share(level: Real, total: Real) -> Real:
    """The share of a level in the total, 0 where the total is."""
    has_friction = total > 0.0
    return where(has_friction, level / where(has_friction, total, 1.0), 0.0)


def _of_brakes(system: System, joint: int, drive: Drive | None, loads: _Loads, friction: Real) -> Real:
    """The brakes' share of a joint's dry friction, against the motion, N m (N)."""
    name = system.joints[joint].name
    if name not in loads.dry:
        return 0.0
    level, own = level_of(system, joint, drive, loads), loads.dry[name]
    has_friction = level > 0.0
    return where(has_friction, own / where(has_friction, level, 1.0) * friction, 0.0)


def gravity(system: System, read: ReadCell, y: Motion, time: Real) -> Vector:
    """Uniform gravity of all environment models at state y, world axes, m/s^2."""
    base = base_of(system, read, y, time)
    return _environment(system, tree_with_payloads(system, read), read, y, base, time, time).gravity


def followers_level(
    system: System,
    read: ReadCell,
    y: Motion,
    followers: Sequence[int],
    on_joints: Mapping[str, Real],
    time: Real,
    begin: Real,
) -> Real:
    """The dry friction of joints that follow one joint, as that joint feels it through their ratios, N m (N).
    on_joints: that of brakes, by joint."""
    ratios = system.ratios(read, y.q)
    total: Real = 0.0
    for i in followers:
        level, actuator = on_joints.get(system.joints[i].name, 0.0), system.actuators[i]
        if actuator is not None:
            held = NamedValues(actuator.owner, {})
            level = level + servo_response(system, actuator, read, y, held, time, begin).drive.dry
        (ratio,) = ratios[i].values()
        total = total + absolute(ratio) * level
    return total


def brake_levels(system: System, read: ReadCell, y: Motion, time: Real, begin: Real) -> dict[str, Real]:
    """Dry friction that environment models put on joints at state y, by name, N m (N)."""
    if not system.braked:
        return {}
    tree, base = tree_with_payloads(system, read), base_of(system, read, y, time)
    return _environment(
        system, tree, read, y, base, time, begin, [m for m in system.environment if m[1].friction_joint]
    ).dry


def _environment(
    system: System,
    tree: Tree,
    read: ReadCell,
    y: Motion,
    base: BaseMotion,
    time: Real,
    begin: Real,
    models: Sequence[tuple[str, Environment]] | None = None,
) -> _Loads:
    """The sum of the loads of these models; of all, where None. Wrenches are on links and payloads."""
    world = ArmWorld(system, read, tree, y, base, time, begin)
    gravity: list[Real] = [0.0, 0.0, 0.0]
    torques: list[Real] = [0.0 for _ in system.joints]
    wrenches: dict[str, tuple[Vector, Vector]] = {}
    dry: dict[str, Real] = {}
    for name, model in system.environment if models is None else models:
        if model.loads is None:
            continue
        owner, p = environment_values(system, name, model, read)
        loads = answer(owner, model.loads, p, world)
        gravity = [a + b for a, b in zip(gravity, loads.gravity, strict=True)]
        for joint, torque in loads.torques.items():
            number = world._number(joint)
            torques[number] = torques[number] + torque
        returned(owner, "dry", loads.dry, [getattr(p, model.friction_joint)] if model.friction_joint else [])
        for joint, level in loads.dry.items():
            dry[joint] = dry[joint] + level if joint in dry else level
        for force in loads.forces:
            if world.is_ground(force.link):
                continue
            moment, total = world.link(force.link).wrench(force.force, force.moment, force.point)
            if force.link in wrenches:
                before = wrenches[force.link]
                moment = tuple(a + b for a, b in zip(before[0], moment, strict=True))  # type: ignore[assignment]
                total = tuple(a + b for a, b in zip(before[1], total, strict=True))  # type: ignore[assignment]
            wrenches[force.link] = (moment, total)
    return _Loads((gravity[0], gravity[1], gravity[2]), torques, wrenches, dry)

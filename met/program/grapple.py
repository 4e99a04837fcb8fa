"""Grapples and releases of payloads, the first events at an instant (docs/physics.md).

Each at the first instant of the dynamics that is not before its time. All grapples of an instant are one impact, and
releases follow it. Joints that are told their acceleration do not jump, nor do those whose motors are on a bed; dry
friction holds no joint against a blow; states of servos stay what they are, but for the rate of a rotor behind an
elastic gear on a free base: the rotor goes on turning as it did, and the link that its rate counts from jumps.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from met.dynamics.coupling import solve_coupled
from met.dynamics.payload import momentum, raised, twist_against
from met.dynamics.recursion import Wrench, solve
from met.dynamics.spatial import ZERO, add, choose, compose, inverse, turn_vector
from met.integrators.integrator import Motion
from met.plan import INSTANT
from met.program import cells, rotors
from met.program.evaluation import servo_response
from met.program.grappled import GrappleWatch
from met.program.motion import bodies
from met.program.motion.base import base_of, free_base, motions
from met.program.motion.bodies import CARRIED, FLYING, place
from met.program.system import Actuator, System
from met.program.values import NamedValues
from met.servos.servo import Drive
from met.trace import Real, Truth, any_of, both, either, not_
from met.trace.program import CallPhase, Control, Every, Phase, RunPhase, Tape, WhileAny
from met.vectors import quaternion


class Grapple:
    """The phases in which payloads change hands. Every method that takes a tape is the body of a phase.

    state  gives the state at an instant
    held   gives what a servo's computer holds there
    keep_followers  puts joints that follow others where those that lead are
    """

    def __init__(
        self,
        system: System,
        state: Callable[[Tape], Motion],
        held: Callable[[Tape, Actuator], NamedValues],
        keep_followers: Callable[[Tape], None],
    ) -> None:
        self.system, self._state, self._held, self._keep_followers = system, state, held, keep_followers
        self.watch = GrappleWatch(system, state)

    def events(self) -> tuple[Control, ...]:
        """Phases of grapples and releases at an instant."""
        if not self.system.flying:
            return ()
        parts: list[Control] = [RunPhase(Phase("payloads", self.due))]
        if any(payload.grappled for payload in self.system.flying):
            before, after = (
                CallPhase(Phase(f"grapple_{name}", look))  # of their own: the impact's code is as without them
                for name, look in (("before", self.watch.before), ("after", self.watch.after))
            )
            parts.append(WhileAny("grappling", 1, (before, RunPhase(Phase("grapple", self.grapple)), after)))
        if any(payload.released for payload in self.system.flying):
            parts.append(WhileAny("releasing", 1, (RunPhase(Phase("release", self.release)),)))
        return (Every(self.system.structure.schedule.dynamics, tuple(parts)),)

    def due(self, tape: Tape) -> None:
        """Write which payloads are grappled and released at this instant."""
        grappling: list[Truth] = []
        releasing: list[Truth] = []
        for payload in self.system.flying:
            stage: Real = tape.read(cells.PAYLOAD_STAGE(payload.name))
            on = stage == CARRIED
            if payload.grappled:
                caught = both(stage == FLYING, self._is_time(tape, payload.name, "grapple"))
                tape.write_mask(cells.GRAPPLING(payload.name), caught)
                grappling.append(caught)
                on = either(on, caught)
            if payload.released:
                gone = both(on, self._is_time(tape, payload.name, "release"))
                tape.write_mask(cells.RELEASING(payload.name), gone)
                releasing.append(gone)
        tape.write_mask("grappling", any_of(grappling))
        tape.write_mask("releasing", any_of(releasing))

    def grapple(self, tape: Tape) -> None:
        """Compute the impact of all payloads that are grappled at this instant, and attach them from now on."""
        system, y = self.system, self._state(tape)
        base, tree = base_of(system, tape.read, y, tape.time), system.tree(tape.read)
        links = motions(tree, y.q[: len(system.joints)], y.qd[: len(system.joints)], base)
        blows: dict[str, Wrench] = {}
        for payload in system.flying:
            if not payload.grappled:
                continue
            caught = tape.read_mask(cells.GRAPPLING(payload.name))
            own, link = bodies.flying_motion(system, payload, tape.read, y), links[payload.link]
            body, pose = bodies.body_of(system, payload, tape.read), compose(inverse(link.pose), own.pose)
            blow = raised(momentum(body, twist_against(own, link)), pose)
            before = blows.get(payload.link, (ZERO, ZERO))
            blows[payload.link] = tuple(  # type: ignore[assignment]
                add(a, tuple(choose(caught, x, 0.0) for x in b))  # type: ignore[arg-type]
                for a, b in zip(before, blow, strict=True)
            )
            bodies.attach(system, tape, caught, payload, pose)
            for name in bodies.free_body(system, payload).coordinates:
                cells.keep(tape, caught, f"{name}.qd", 0.0)
        self._jump(tape, y, blows)

    def release(self, tape: Tape) -> None:
        """Release payloads at this instant, with the motion of their links."""
        system, y = self.system, self._state(tape)
        base, n = base_of(system, tape.read, y, tape.time), len(system.joints)
        links = motions(system.tree(tape.read), y.q[:n], y.qd[:n], base)
        for payload in system.flying:
            if payload.released:
                gone = tape.read_mask(cells.RELEASING(payload.name))
                motion = bodies.carried_motion(payload, tape.read, links)
                body, v = bodies.free_body(system, payload), turn_vector(motion.pose.R, motion.v)
                place(body, tape, gone, quaternion(motion.pose.R), motion.pose.p, v, motion.w)
                bodies.detach(tape, gone, payload)

    def _jump(self, tape: Tape, y: Motion, blows: dict[str, Wrench]) -> None:
        """Rates after the impact; by link, the momentum transferred to it, about its origin and in its axes."""
        system, n = self.system, len(self.system.joints)
        drives = [self._drive(tape, actuator, y) for actuator in system.actuators]
        on_beds = {actuator.index for actuator, _, _ in system.mounted}
        body = free_base(system)
        turning = None if body is None else rotors.of(system, drives, y, (0.0,) * len(system.states), {}, on_beds)
        ratios, tree = system.ratios(tape.read, y.q), bodies.tree_with_payloads(system, tape.read)
        solver = partial(solve_coupled, tree, ratios) if any(ratios) else partial(solve, tree)
        solved = solver(
            q=y.q[:n],
            qd=(0.0,) * n,
            mode=tuple(False if i in on_beds else _yields(drive) for i, drive in enumerate(drives)),
            rotor=tuple(0.0 if drive is None else drive.rotor for drive in drives),
            spin=None if turning is None else turning.spin,
            free_rotors=None if turning is None else turning.free,
            wrenches=blows,
        )
        jumping = tape.read_mask("grappling")
        jumps = [(joint.name, jump) for joint, jump in zip(system.joints, solved.qdd, strict=True)]
        if body is not None:
            wd, a = solved.base_acceleration
            R = base_of(system, tape.read, y, tape.time).pose.R
            jumps += zip(body.coordinates, (*turn_vector(R, a), *wd), strict=True)
        for name, jump in jumps:
            cells.keep(tape, jumping, f"{name}.qd", tape.read(f"{name}.qd") + jump)
        for i, channel in ({} if turning is None else turning.states).items():
            cells.keep(tape, jumping, channel, tape.read(channel) - solved.about[i])
        self._keep_followers(tape)

    def _drive(self, tape: Tape, actuator: Actuator | None, y: Motion) -> Drive | None:
        if actuator is None:
            return None
        held = self._held(tape, actuator)
        return servo_response(self.system, actuator, tape.read, y, held, tape.time, tape.time).drive

    def _is_time(self, tape: Tape, name: str, event: str) -> Truth:
        """True at an instant that is not before the event's time."""
        time: Real = self.system.value(f"payloads.{name}.{event}", tape.read)
        return tape.time >= time - INSTANT * self.system.structure.schedule.step


def _yields(drive: Drive | None) -> Truth:
    """True where a blow moves the joint."""
    return True if drive is None or drive.given is None else not_(drive.given)

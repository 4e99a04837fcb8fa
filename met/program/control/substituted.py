"""Joints whose motors are on a bed: their computations at each tick of their servos (docs/physics.md, motor
substitution).

Rates, torques, voltages and inertias here are those of the joint's motor; a bed of another size (`scale`) has its own
in its memory, its parameters and on its wire (met/substitution/bed_scale.py).

At a servo's tick, in this order: the bed has come to this instant under what its amplifiers held; its filtered rate is
read, and the observer corrected; joint position and rate of the arm are made the shaft's (at an instant of the
dynamics: between two the step under way keeps its own); the servo sets the voltage from the filtered rate. At an
instant the arm is then asked what it is to these joints: tau_load = Lambda qdd + b_0, all other joints in their modes.
Then the law gives the load torque and the joint's acceleration, and the observer looks ahead to the next tick.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from met.frozen import frozen
from met.parameter import Parameter
from met.program import cells
from met.program.cells import NamedValues, answer, parameters, returned
from met.program.control.rate_drives import Mounted, RateDrives
from met.program.control.sensing import READING, seed_and_repeat
from met.program.system import Actuator, System
from met.servos.motor import Motor, torque
from met.servos.servo import Seen
from met.substitution import balance, bed_scale, drive, observer
from met.substitution.bed import DRIVES, Wire
from met.substitution.bed_scale import BedScale
from met.substitution.law import LawInput, LawOutput
from met.substitution.shaft import lasting
from met.trace import Real, absolute, clip, sign, where
from met.trace.noise import Stream, normal
from met.trace.program import Control, Every, Phase, RunPhase, Tape, Unless0, WhileAny

QUEUE = 3
"""Largest delay in ticks (parameter `delay` of a bed)."""

LIMITED = "bed.limited"
"""Output that counts, for each case, the ticks at which a bed's load motor was at its limit."""

SETTLING = 0.25
"""Time in which the observer's covariance settles, s: some thirty of its slowest time constants."""

# covariance of the observer's state before the first reading: of rates (rad/s)^2, of a slope, of a torque
_UNKNOWN = (1e4, 1e4, 1e8, 1e-2)


@frozen
class _Ahead:
    """A joint's shaft at the time when the present output begins to act. w: rad/s; integral: that of a drive's own rate
    loop as modelled, rad, 0 for other drives."""

    w: Real
    integral: Real


Loads = Callable[[Tape], tuple[list[list[Real]], list[Real]]]
"""A function of the state at an instant: Lambda (a row a substituted joint) and b_0."""


class Substituted:
    """The phases of a system's substituted joints, which tick together. wire: a real bed is at the wire, which accounts
    for `late` of the bed's ticks of delay."""

    def __init__(self, system: System, loads: Loads, *, wire: bool = False, late: int = 0) -> None:
        self.system = system
        self.loads = loads
        self.wire = wire
        self.late = late
        scaled = {use.joint for use in system.structure.substitutions if use.scaled}
        self.mounted = tuple(
            Mounted(a, system.joints[a.index].name, bed, law, a.use.joint in scaled) for a, bed, law in system.mounted
        )
        self.dynamics = system.structure.schedule.dynamics
        self.base_hz = system.structure.schedule.base_hz
        self.divisor = self.mounted[0].actuator.use.divisor if self.mounted else 1
        self.law = self.mounted[0].law if self.mounted else None
        self.period = self.divisor / self.base_hz
        self.rate_drives = RateDrives(system, self.period)

    def alone(self, joint: Mounted) -> Substituted:
        """The phases of one joint alone."""
        phases = copy.copy(self)
        phases.mounted = (joint,)
        return phases

    @property
    def wire_inputs(self) -> tuple[str, ...]:
        """Names of the program's inputs that come over the wires at each tick."""
        return tuple(f"wire:{joint.joint}.rate" for joint in self.mounted) if self.wire else ()

    @property
    def wire_outputs(self) -> dict[str, str]:
        """Names of the outputs that go over the wires to real motor beds, by the cells that hold them."""
        return (
            {
                f"wire:{joint.joint}.{name}": cells.SENT(joint.joint, name)
                for joint in self.mounted
                for name in (joint.bed.drive, "current")
            }
            if self.wire
            else {}
        )

    # Control.

    def begin_run(self) -> tuple[Control, ...]:
        """Phases before the first tick."""
        if not self.mounted:
            return ()
        parts: tuple[Control, ...] = (RunPhase(Phase("beds", self.start)),)
        if self.law is not None and self.law.observer:
            turns = max(100, math.ceil(SETTLING / self.period))
            settle = WhileAny("always", turns, (RunPhase(Phase("covariance", self.covariance)),))
            parts = (*parts, settle, RunPhase(Phase("gain", self.gain)))
        return parts

    def before_servos(self) -> tuple[Control, ...]:
        """Phases at the servos' ticks, before they see anything."""
        if not self.mounted:
            return ()
        moved: tuple[Control, ...] = ()
        if not self.wire:
            moved = (Unless0((Every(self.divisor, (RunPhase(Phase("bed", self.advance)),)),)),)
        both_due = math.lcm(self.divisor, self.dynamics)
        follow = Every(both_due, (RunPhase(Phase("follow", self.follow)),))
        return (*moved, Every(self.divisor, (RunPhase(Phase("read", self.read)),)), follow)

    def after_modes(self) -> tuple[Control, ...]:
        """Phases at an instant once modes are decided, and at the servos' ticks after that."""
        if not self.mounted:
            return ()
        arm, law, first = (
            Every(due, (RunPhase(Phase(name, body)),))
            for due, name, body in (
                (self.dynamics, "arm", self.arm),
                (self.divisor, "law", self.act),
                (self.dynamics, "given", self.first),
            )
        )
        return arm, law, first

    # The run's start.

    def start(self, tape: Tape) -> None:
        """Start each bed's shaft turning with its joint, as if for long; the observer knows that, and nothing else."""
        tape.write("always", 1.0)
        for joint in self.mounted:
            motor = self.motor(tape, joint)
            w = motor.ratio * tape.read(f"{joint.joint}.qd")
            self.begin_bed(tape, joint, w / self.scale(tape, joint).rate)
            if self.wire:  # the inner state of a real bed is unknown
                for memory in joint.bed.memory:
                    tape.write(f"{joint.joint}.bed.{memory.name}", math.nan)
            for cell in (cells.READ, cells.READ_BEFORE, cells.SHAFT_RATE, cells.REFERENCE_RATE):
                tape.write(cell(joint.joint), w)
            for part in "wy":
                tape.write(cells.OBSERVED(joint.joint, part), w)
            tape.write(cells.SHAFT_ANGLE(joint.joint), motor.ratio * tape.read(f"{joint.joint}.q"))
            if joint.closes_rate_loop:
                self.rate_drives.begin(tape, joint)
            for i in range(4):
                for j in range(i + 1):
                    tape.write(cells.COVARIANCE(joint.joint, i, j), _UNKNOWN[i] if i == j else 0.0)

    def begin_bed(self, tape: Tape, joint: Mounted, w: Real) -> None:
        """Start the emulated bed of a joint's motor; its shaft has turned at w rad/s for long."""
        begun = answer(self._owner(joint), joint.bed.begin, self._bed_values(tape, joint), w)
        returned(self._owner(joint), "begin", begun, (memory.name for memory in joint.bed.memory))
        for name, value in begun.items():
            tape.write(f"{joint.joint}.bed.{name}", value)

    def covariance(self, tape: Tape) -> None:
        """Run one turn of the Riccati recursion."""
        for joint in self.mounted:
            model, P, noise = self._model(tape, joint), self._covariance(tape, joint), self._noise(tape, joint)
            P = observer.next_covariance(model, P, noise)
            for i in range(4):
                for j in range(i + 1):
                    tape.write(cells.COVARIANCE(joint.joint, i, j), P[i][j])

    def gain(self, tape: Tape) -> None:
        for joint in self.mounted:
            gains = observer.gain_of(self._covariance(tape, joint), self._noise(tape, joint))
            for i, value in enumerate(gains):
                tape.write(cells.OBSERVER_GAIN(joint.joint, i), value)

    # A tick.

    def advance(self, tape: Tape) -> None:
        """Advance the emulated motor beds from the last tick to this one."""
        tick = tape.tick / float(self.divisor) - 1.0
        seed, repeat = seed_and_repeat(self.system, tape)
        for joint in self.mounted:
            self.advance_bed(tape, joint, self.period, seed=seed, repeat=repeat, tick=tick)

    def advance_bed(self, tape: Tape, joint: Mounted, period: float, *, seed: Real, repeat: Real, tick: Real) -> None:
        """Advance one emulated motor bed by period s under its amplifiers' outputs, with the noise of tick number
        `tick`."""
        p = self._bed_values(tape, joint)
        held = (f"drive_{joint.bed.drive}", "load_current")
        wire = Wire(*(tape.read(f"{joint.joint}.bed.{name}") for name in held))

        def draw(name: str) -> Real:
            return normal(Stream(seed, repeat, f"{joint.joint}.bed.{name}"), tick)

        new = answer(self._owner(joint), joint.bed.advance, p, self._bed(tape, joint), wire, period, draw)
        returned(self._owner(joint), "advance", new, (memory.name for memory in joint.bed.memory))
        for name, value in new.items():
            tape.write(f"{joint.joint}.bed.{name}", value)

    def reading(self, tape: Tape, joint: Mounted) -> Real:
        """The filtered rate of an emulated bed's shaft, rad/s, as the computer reads it."""
        p, held = self._bed_values(tape, joint), self._bed(tape, joint)
        with tape.part(READING):
            return answer(self._owner(joint), joint.bed.read, p, held)

    def read(self, tape: Tape) -> None:
        """Read the filtered rate, correct the observer, and read the shaft's angle."""
        for joint in self.mounted:
            name = joint.joint
            read = tape.input(f"wire:{name}.rate") if self.wire else self.reading(tape, joint)
            rate = read * self.scale(tape, joint).rate
            w: Real = rate
            if joint.law.observer:
                gain = tuple(tape.read(cells.OBSERVER_GAIN(name, i)) for i in range(4))
                x = observer.corrected(self._observed(tape, joint), gain, rate)  # type: ignore[arg-type]
                self._observe(tape, joint, x)
                w = x[0]
                tape.write(f"{name}.law.unknown_torque", x[3])
            turned = 0.5 * self.period * (w + tape.read(cells.SHAFT_RATE(name)))
            tape.write(
                cells.SHAFT_ANGLE(name),
                tape.read(cells.SHAFT_ANGLE(name)) + where(tape.tick == 0.0, 0.0, turned),
            )
            tape.write(cells.READ_BEFORE(name), tape.read(cells.READ(name)))
            tape.write(cells.READ(name), rate)
            tape.write(cells.SHAFT_RATE(name), w)
            tape.write(f"{name}.law.rate", w)

    def follow(self, tape: Tape) -> None:
        """Set the arm's joints to the shafts' positions and rates."""
        for joint in self.mounted:
            ratio = self.motor(tape, joint).ratio
            tape.write(f"{joint.joint}.q", tape.read(cells.SHAFT_ANGLE(joint.joint)) / ratio)
            tape.write(f"{joint.joint}.qd", tape.read(cells.SHAFT_RATE(joint.joint)) / ratio)

    def seen(self, tape: Tape, actuator: Actuator) -> tuple[Real, Real] | None:
        """Position and filtered rate of a substituted joint, as its servo's computer sees them; None for others. Where
        the drive closes the rate loop the rate is not filtered: the drive measures its shaft itself."""
        for joint in self.mounted:
            if joint.actuator is actuator:
                ratio = self.motor(tape, joint).ratio
                q = tape.read(cells.SHAFT_ANGLE(joint.joint)) / ratio
                rate = cells.SHAFT_RATE if joint.closes_rate_loop else cells.READ
                return q, tape.read(rate(joint.joint)) / ratio
        return None

    def want(self, tape: Tape, actuator: Actuator, seen: Seen) -> None:
        """Keep the command of a drive with a rate loop of its own, once its servo has seen its joint at this tick."""
        for joint in self.mounted:
            if joint.actuator is actuator and joint.closes_rate_loop:
                self.rate_drives.want(tape, joint, seen)

    def arm(self, tape: Tape) -> None:
        """Write Lambda and b_0 at this instant: the load of the arm on the substituted joints."""
        Lambda, b_0 = self.loads(tape)
        for joint, row, b in zip(self.mounted, Lambda, b_0, strict=True):
            tape.write(cells.ARM_TORQUE(joint.joint), b)
            for other, entry in zip(self.mounted, row, strict=True):
                tape.write(cells.ARM_INERTIA(joint.joint, other.joint), entry)

    def act(self, tape: Tape) -> None:
        """Run the law: load torque, commands over the wire, the joint's acceleration; the observer looks ahead."""
        assert self.law is not None
        Lambda = [[tape.read(cells.ARM_INERTIA(a.joint, b.joint)) for b in self.mounted] for a in self.mounted]
        b_0 = [tape.read(cells.ARM_TORQUE(joint.joint)) for joint in self.mounted]
        ahead = [self._ahead(tape, joint) for joint in self.mounted]
        motions: Sequence[balance.Balanced | None] = [None] * len(self.mounted)
        if self.law.balance != "none":
            sides = [self._own_side(tape, joint, shaft) for joint, shaft in zip(self.mounted, ahead, strict=True)]
            solve = balance.bare if self.law.balance == "bare" else balance.balanced
            motions = solve(sides, Lambda, b_0)
        commands = [self._command(tape, *parts) for parts in zip(self.mounted, ahead, motions, strict=True)]
        inputs = [
            self._law_input(tape, joint, self._on_bed(tape, joint, command, shaft, motion), shaft)
            for joint, command, shaft, motion in zip(self.mounted, commands, ahead, motions, strict=True)
        ]
        p = [self._law_values(tape, joint) for joint in self.mounted]
        held = [
            NamedValues(
                f"law `{joint.law.name}`", {m.name: tape.read(f"{joint.joint}.law.{m.name}") for m in joint.law.memory}
            )
            for joint in self.mounted
        ]
        owner = f"law `{self.law.name}`"
        answers = answer(owner, self.law.give, p, held, inputs, lambda qdd: balance.loads(Lambda, b_0, qdd))
        applied = []
        for joint, command, (output, memory) in zip(self.mounted, commands, answers, strict=True):
            returned(owner, "give", memory, (m.name for m in joint.law.memory))
            for name, value in memory.items():
                tape.write(f"{joint.joint}.law.{name}", value)
            applied.append(self._send(tape, joint, command, output))
            tape.write(cells.GIVEN(joint.joint), output.qdd)
            tape.write(f"{joint.joint}.law.torque", output.torque)
        if self.law.observer:
            self._look_ahead(tape, Lambda, b_0, applied)
        for joint, wire, motion in zip(self.mounted, applied, motions, strict=True):
            if joint.closes_rate_loop:
                self._wind(tape, joint, wire, motion)

    def first(self, tape: Tape) -> None:
        """The acceleration with which the step begins; a servo faster than the dynamics changes it during the step."""
        for joint in self.mounted:
            tape.write(cells.GIVEN_FIRST(joint.joint), tape.read(cells.GIVEN(joint.joint)))

    def accelerations(self, tape: Tape, fraction: Real) -> dict[int, Real]:
        """Accelerations of the substituted joints at a share of the step, by number."""
        qdd = {}
        for joint in self.mounted:
            now = tape.read(cells.GIVEN(joint.joint))
            if self.divisor % self.dynamics:
                first = tape.read(cells.GIVEN_FIRST(joint.joint))
                now = first + fraction * (now - first)
            qdd[joint.index] = now
        return qdd

    # Parts of a tick.

    def _ahead(self, tape: Tape, joint: Mounted) -> _Ahead:
        """The shaft when the present output acts: the observer's, over the delay; else the one just read."""
        integral = self.rate_drives.integral(tape, joint)
        if not joint.law.observer:
            return _Ahead(tape.read(cells.READ(joint.joint)), integral)
        delay, x = self._delay(tape, joint), self._observed(tape, joint)
        for turn in range(QUEUE):
            wire = self._queued(tape, joint, delay - float(turn))
            new = self._predicted(tape, joint, x, wire, integral)
            if joint.closes_rate_loop:
                commanded = wire.drive * self.scale(tape, joint).rate
                wound = self.rate_drives.wound(tape, joint, commanded, integral, x[0], new[0])
                integral = where(delay > float(turn), wound, integral)
            w, y, z, d = (where(delay > float(turn), b, a) for a, b in zip(x, new, strict=True))
            x = (w, y, z, d)
        return _Ahead(x[0], integral)

    def _queued(self, tape: Tape, joint: Mounted, ago: Real) -> Wire:
        """The pair of drive and load commands that was sent this many ticks ago, from 1 to `QUEUE`."""
        commanded: Real = 0.0
        current: Real = 0.0
        for i in range(QUEUE):
            due = ago == float(i + 1)
            commanded = where(due, tape.read(cells.QUEUED(joint.joint, i, joint.bed.drive)), commanded)
            current = where(due, tape.read(cells.QUEUED(joint.joint, i, "current")), current)
        return Wire(commanded, current)

    def _own_torque(self, tape: Tape, joint: Mounted, w: Real) -> Real:
        """Torque of the joint's own motor at its servo's voltage and a rate of its shaft, N m."""
        motor = self.motor(tape, joint)
        return torque(motor.kt, motor.resistance, motor.tau_max, self._voltage(tape, joint), w)

    def _own_side(self, tape: Tape, joint: Mounted, ahead: _Ahead) -> balance.JointSide:
        """A joint's side of the balance with its own motor, under its drive's rate loop where the drive has one."""
        if joint.closes_rate_loop:
            driving, falls = self._under_loop(tape, joint, ahead)
            return self._side(tape, joint, ahead.w, driving, self._band(tape, joint), falls=falls)
        return self._side(tape, joint, ahead.w, self._own_torque(tape, joint, ahead.w), self._band(tape, joint))

    def _command(self, tape: Tape, joint: Mounted, ahead: _Ahead, motion: balance.Balanced | None) -> Real | None:
        """The torque or rate that the bed's drive is commanded at this tick, of the joint's size; None where it is
        commanded the servo's voltage."""
        if joint.bed.drive == "voltage":
            return None
        if joint.closes_rate_loop:
            return self.rate_drives.commanded_rate(tape, joint, self.motor(tape, joint))
        mean = 0.5 * self.period if joint.law.balance == "full" else 0.0
        return drive.mean_torque(self.motor(tape, joint), self._own_torque(tape, joint, ahead.w), motion, mean)

    def _under_loop(self, tape: Tape, joint: Mounted, shaft: _Ahead, w_cmd: Real | None = None) -> tuple[Real, Real]:
        """Torque of a motor under its drive's rate loop, N m, and its decrease, with viscous friction, by the shaft's
        rate, N m s/rad. w_cmd: commanded rate of the shaft, rad/s; None: the one of this tick."""
        motor = self.motor(tape, joint)
        w_cmd = self.rate_drives.commanded_rate(tape, joint, motor) if w_cmd is None else w_cmd
        loop = self.rate_drives.torque(tape, joint, motor, w_cmd, shaft.integral, shaft.w)
        return loop.torque, motor.f_v + loop.brakes

    def _wind(self, tape: Tape, joint: Mounted, wire: Wire, motion: balance.Balanced | None) -> None:
        """Advance the modelled integral of the drive's rate loop to the next tick."""
        w: Real = tape.read(cells.SHAFT_RATE(joint.joint))
        after = w if motion is None else w + self.period * self.motor(tape, joint).ratio * motion.qdd
        if joint.law.observer:
            after = self._observed(tape, joint)[0]
        self.rate_drives.wind(tape, joint, wire.drive * self.scale(tape, joint).rate, w, after)

    def _on_bed(
        self, tape: Tape, joint: Mounted, command: Real | None, ahead: _Ahead, motion: balance.Balanced | None
    ) -> balance.Balanced | None:
        """The joint's motion, with the torque that the bed's motor is commanded next in place of its own."""
        if motion is None or command is None or joint.closes_rate_loop:
            return motion
        net = motion.net - self._own_torque(tape, joint, ahead.w) + command
        return balance.Balanced(motion.qdd, motion.friction, motion.s, net)

    def _send(self, tape: Tape, joint: Mounted, command: Real | None, output: LawOutput) -> Wire:
        """Put a command on the wire; returns the pair that the amplifiers hold from now on, which is an older one if
        delayed. command: to the drive, of the joint's size; None: the servo's voltage."""
        name, tells = joint.joint, joint.bed.drive
        p = self._bed_values(tape, joint)
        scale = self.scale(tape, joint)
        to_drive = self._voltage(tape, joint) if command is None else command
        wanted = Wire(to_drive / scale.of(DRIVES[tells][0]), output.torque / scale.torque / p.kt_load)
        with tape.part(READING):
            wanted, limited = answer(self._owner(joint), joint.bed.taken, p, wanted)
        cells.count(tape, limited, LIMITED)
        delay = self._delay(tape, joint)
        late = self._queued(tape, joint, delay)
        at_once = delay == 0.0
        applied = Wire(where(at_once, wanted.drive, late.drive), where(at_once, wanted.current, late.current))
        if self.wire:
            early = self._queued(tape, joint, delay - float(self.late))
            now = delay <= float(self.late)
            tape.write(cells.SENT(name, tells), where(now, wanted.drive, early.drive))
            tape.write(cells.SENT(name, "current"), where(now, wanted.current, early.current))
        for i in reversed(range(1, QUEUE)):
            tape.write(cells.QUEUED(name, i, tells), tape.read(cells.QUEUED(name, i - 1, tells)))
            tape.write(cells.QUEUED(name, i, "current"), tape.read(cells.QUEUED(name, i - 1, "current")))
        tape.write(cells.QUEUED(name, 0, tells), wanted.drive)
        tape.write(cells.QUEUED(name, 0, "current"), wanted.current)
        tape.write(f"{name}.bed.drive_{tells}", applied.drive)
        tape.write(f"{name}.bed.load_current", applied.current)
        return applied

    def _look_ahead(self, tape: Tape, Lambda: list[list[Real]], b_0: list[Real], applied: Sequence[Wire]) -> None:
        """The observer's state at the next tick, and the rate that the joint's own motor would have then."""
        sides = []
        for joint, wire in zip(self.mounted, applied, strict=True):
            w_ref = tape.read(cells.REFERENCE_RATE(joint.joint))
            integral = self.rate_drives.integral(tape, joint)
            driving, falls = self._bed_torque(tape, joint, wire, w_ref, integral)
            sides.append(self._side(tape, joint, w_ref, driving, 0.0, falls=falls))
            self._observe(tape, joint, self._predicted(tape, joint, self._observed(tape, joint), wire, integral))
        for joint, side, motion in zip(self.mounted, sides, balance.balanced(sides, Lambda, b_0), strict=True):
            after = side.w + self.period * side.ratio * motion.qdd
            after = where(motion.s * after < 0.0, 0.0, after)
            tape.write(cells.REFERENCE_RATE(joint.joint), after)
            tape.write(f"{joint.joint}.law.reference_rate", side.w)

    def _bed_torque(self, tape: Tape, joint: Mounted, wire: Wire, w: Real, integral: Real) -> tuple[Real, Real | None]:
        """The law's estimate of a motor's torque under the amplifiers' outputs at a rate of its shaft, N m; and its
        decrease, with viscous friction, by that rate, N m s/rad, None: as at a voltage.

        integral  of the drive's rate loop, where it has one, rad
        """
        commanded, motor = wire.drive * self.scale(tape, joint).of(DRIVES[joint.bed.drive][0]), self.motor(tape, joint)
        if joint.closes_rate_loop:
            return self._under_loop(tape, joint, _Ahead(w, integral), commanded)
        falls = None if joint.bed.drive == "voltage" else motor.f_v
        return drive.bed_torque(joint.bed.drive, motor, commanded, w), falls

    def _side(
        self, tape: Tape, joint: Mounted, w: Real, driving: Real, band: Real, *, falls: Real | None = None
    ) -> balance.JointSide:
        """A joint's side of the balance at a rate of its shaft and a torque of its motor, N m.

        falls  what that torque and viscous friction fall by as the shaft gains speed, N m s/rad; None: by back-EMF
        """
        motor = self.motor(tape, joint)
        brakes = motor.damping if falls is None else falls
        mean = 0.0 if joint.law.balance == "bare" else 0.5 * brakes * self.period
        unknown = self._observed(tape, joint)[3] if joint.law.observer else 0.0
        viscous = 0.0 if joint.law.balance == "bare" else motor.f_v * w
        net = driving + unknown - viscous
        return balance.JointSide(
            motor.ratio, motor.ratio * motor.ratio * (motor.inertia + mean), net, motor.f_c, w, band
        )

    def _law_input(self, tape: Tape, joint: Mounted, motion: balance.Balanced | None, ahead: _Ahead) -> LawInput:
        """The inputs of a joint's law at this tick. motion: None where the law takes no balance."""
        motor, inertia, name = self.motor(tape, joint), self._shaft_inertia(tape, joint), joint.joint
        mean = joint.law.balance == "full"
        extra: Real = 0.0
        if mean:
            brakes = drive.bed_damping(joint.bed.drive, motor, inertia, self.period)
            if joint.closes_rate_loop:
                falls = self._under_loop(tape, joint, ahead)[1]
                brakes = drive.at_least(falls, drive.LEAST * inertia / self.period)
            extra = inertia * (self.period / lasting(brakes / inertia, self.period) - 1.0)
        return LawInput(
            motor=motor,
            inertia=inertia,
            rate=tape.read(cells.READ(name)),
            before=tape.read(cells.READ_BEFORE(name)),
            w=tape.read(cells.SHAFT_RATE(name)),
            d=self._observed(tape, joint)[3] if joint.law.observer else 0.0,
            w_ref=tape.read(cells.REFERENCE_RATE(name)) if joint.law.observer else 0.0,
            period=self.period,
            balance=motion,
            extra=extra,
        )

    def _predicted(self, tape: Tape, joint: Mounted, x: observer.Four, wire: Wire, integral: Real) -> observer.Four:
        """The observer's state one tick on, under the amplifiers' held outputs. integral: of the drive's rate loop,
        rad"""
        motor, band, scale = self.motor(tape, joint), self._band(tape, joint), self.scale(tape, joint)
        load = self._bed_values(tape, joint).kt_load * wire.current * scale.torque
        w, d = x[0], x[3]
        driving, falls = self._bed_torque(tape, joint, wire, w, integral)
        rest = clip(driving + d + load - motor.f_v * w, -motor.f_c, motor.f_c)
        dry = where(absolute(w) > band, sign(w) * motor.f_c, rest)
        # Back-EMF is in the model; where the drive is at its limit, it is taken out again.
        own = driving + motor.kt * motor.kt / motor.resistance * w if joint.bed.drive == "voltage" else driving
        u = own - dry + load
        if falls is not None and joint.closes_rate_loop:
            # the loop's gain is in the model too, and is taken out where it is at a limit
            inertia = self._shaft_inertia(tape, joint)
            slope = drive.bed_damping("rate", motor, inertia, self.period, self.rate_drives.loop(tape, joint))
            gained = self.period / inertia * (driving + d + load - dry - motor.f_v * w)
            u = driving + (slope - motor.f_v) * w + (slope - falls) * (0.5 * gained) - dry + load
        return observer.predicted(self._model(tape, joint), x, u)

    # Parameters of a joint.

    def motor(self, tape: Tape, joint: Mounted) -> Motor:
        """The joint's motor with the servo's parameters."""
        assert joint.actuator.servo.motor is not None
        p = self.system.servo_values(joint.actuator, tape.read)
        return answer(joint.actuator.owner, joint.actuator.servo.motor, p)

    def scale(self, tape: Tape, joint: Mounted) -> BedScale:
        """The scales of the joint's bed; 1 where it has none."""
        if not joint.scaled:
            return BedScale()
        p = self._values(tape, self._owner(joint), f"{joint.joint}.bed.scale", bed_scale.PARAMETERS)
        return BedScale(p.torque, p.rate, p.voltage)

    def _shaft_inertia(self, tape: Tape, joint: Mounted) -> Real:
        """The inertia of the bed's shaft at the joint's motor, kg m^2."""
        inertia: Real = self._bed_values(tape, joint).inertia
        return inertia * self.scale(tape, joint).inertia

    def _model(self, tape: Tape, joint: Mounted) -> observer.DiscreteModel:
        inertia, f_cut = self._shaft_inertia(tape, joint), self._bed_values(tape, joint).f_cut
        loop = self.rate_drives.loop(tape, joint) if joint.closes_rate_loop else None
        damping = drive.bed_damping(joint.bed.drive, self.motor(tape, joint), inertia, self.period, loop)
        return observer.model(inertia=inertia, damping=damping, f_cut=f_cut, period=self.period)

    def _noise(self, tape: Tape, joint: Mounted) -> observer.Noise:
        p, T = self._law_values(tape, joint), self.period
        return observer.Noise(torque=p.torque_noise / T, drift=p.drift * T, reading=p.reading_noise / T)

    def _covariance(self, tape: Tape, joint: Mounted) -> observer.Square:
        entries = [[tape.read(cells.COVARIANCE(joint.joint, max(i, j), min(i, j))) for j in range(4)] for i in range(4)]
        return tuple(tuple(row) for row in entries)  # type: ignore[return-value]

    def _observed(self, tape: Tape, joint: Mounted) -> observer.Four:
        w, y, z, d = (tape.read(cells.OBSERVED(joint.joint, name)) for name in "wyzd")
        return w, y, z, d

    def _observe(self, tape: Tape, joint: Mounted, x: observer.Four) -> None:
        for name, value in zip("wyzd", x, strict=True):
            tape.write(cells.OBSERVED(joint.joint, name), value)

    def _voltage(self, tape: Tape, joint: Mounted) -> Real:
        return tape.read(f"{joint.actuator.path}.voltage")

    def _band(self, tape: Tape, joint: Mounted) -> Real:
        p = self._law_values(tape, joint)
        return p.band if joint.law.balance == "full" else 0.0

    def _delay(self, tape: Tape, joint: Mounted) -> Real:
        delay: Real = self._bed_values(tape, joint).delay
        return delay

    def _bed_values(self, tape: Tape, joint: Mounted) -> Any:
        declared = [parameter for parameter in joint.bed.parameters if parameter.shape != "text"]
        return self._values(tape, self._owner(joint), f"{joint.joint}.bed", declared)

    def _law_values(self, tape: Tape, joint: Mounted) -> Any:
        owner = f"law `{joint.law.name}` of joint `{joint.joint}`"
        return self._values(tape, owner, f"{joint.joint}.law", joint.law.parameters)

    def _values(self, tape: Tape, owner: str, prefix: str, declared: Iterable[Parameter]) -> Any:
        return parameters(owner, prefix, declared, lambda path: self.system.value(path, tape.read))

    def _bed(self, tape: Tape, joint: Mounted) -> NamedValues:
        return NamedValues(
            self._owner(joint), {m.name: tape.read(f"{joint.joint}.bed.{m.name}") for m in joint.bed.memory}
        )

    def _owner(self, joint: Mounted) -> str:
        return f"bed `{joint.bed.name}` of joint `{joint.joint}`"

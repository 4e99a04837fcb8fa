"""From an experiment to its program: which phase runs when (docs/physics.md, "An instant").

At an instant t_k, in this order: the step that ends there is finished; servos tick (their commands first); friction
modes are decided; derivatives are taken, which is the first stage of the step that begins; metrics and the recorder
see the instant. Servos faster than the dynamics tick between instants, on the state carried forward.
"""

from __future__ import annotations

from collections.abc import Callable

from met.integrators.integrator import Motion, Slope
from met.parameter import Memory, State
from met.plan import Experiment
from met.program import friction
from met.program.evaluation import Derivative, derivative, drive_of, state_names
from met.program.machine import PARAMETER, Actuator, Machine
from met.program.values import Values, answer, parameters, returned
from met.servos.servo import Asked, Seen
from met.trace import Real, Truth, absolute, any_of, both, either, floor, isfinite, not_, sign, where
from met.trace.program import Control, Every, Phase, Program, Record, Run, Tape, Unless0, WhileAny

SINGULAR, NOT_FINITE = 1.0, 2.0
"""Causes of a failed case (output `failure`); 0 is none."""

Body = Callable[[Tape], None]

EVENTS = ("friction.splits", "friction.clamped", "friction.undecided")
"""Counts a case: steps split where a joint came to rest, crossings clamped, decisions at rest left open."""

OUTPUTS = ("failure", "failure.joint", "failure.tick", *EVENTS)

COORDINATE, METRIC = "coordinate:", "metric:"
"""Prefixes of the outputs, and cells, that are named by a deck: no name of a deck's is one of the engine's."""


def build(experiment: Experiment) -> Program:
    """The program of an experiment: inputs are its coordinates, columns its recorded channels."""
    return Builder(Machine(experiment)).program()


class Builder:
    """The phases of one machine. Every method that takes a tape is the body of a phase."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.schedule = machine.structure.schedule
        self.joints = tuple(joint.name for joint in machine.joints)
        self.states = state_names(machine)
        # Servos that tick between instants: faster than the dynamics, or slower and no multiple of them.
        self.between = tuple(a for a in machine.working if a.use.divisor % self.schedule.dynamics)

    def program(self) -> Program:
        instant = self.schedule.dynamics
        columns = [channel for recorded in self.machine.structure.record for channel in recorded.channels]
        sticks = bool(self.machine.sticking)
        begin: list[Control] = [Run(Phase("modes", self.modes))]
        finish: list[Control] = [Run(Phase("advance", self.advance))]
        if sticks:
            passes = friction.passes(len(self.machine.sticking))
            decide = WhileAny("undecided", passes, (Run(Phase("decide", self.decide)),))
            split = WhileAny("crossing", 1, (Run(Phase("split", self.split)),))
            substep = (
                Run(Phase("modes_again", self.modes_again)),
                decide,
                Run(Phase("derive_again", self.derive_again)),
                Run(Phase("advance_again", self.advance_again)),
                split,
            )
            begin.append(decide)
            finish += [split, WhileAny("again", friction.SPLITS, substep)]
        begin.append(Run(Phase("derive", self.derive)))
        if self.between:
            finish.append(Run(Phase("carry", self.carry)))

        tick: list[Control] = [Unless0((Every(instant, tuple(finish)),))]
        for divisor in sorted({actuator.use.divisor for actuator in self.machine.working}):
            tick.append(Every(divisor, (Run(Phase(f"servos_{divisor}", self._servos(divisor))),)))
        tick.append(Every(instant, tuple(begin)))
        for divisor in sorted({channel.divisor for _, _, channel in self.machine.metrics}):
            tick.append(Every(divisor, (Run(Phase(f"metrics_{divisor}", self._metrics(divisor))),)))
        if columns:
            tick.append(Record(Phase("record", self._recorder(columns)), self.schedule.record))

        coordinates = tuple(coordinate.path for coordinate in self.machine.experiment.cases.coordinates)
        return Program(
            base_hz=self.schedule.base_hz,
            start=(Run(Phase("start", self.start)),),
            tick=tuple(tick),
            end=(Run(Phase("end", self.end)),),
            inputs=coordinates,
            columns=len(columns),
            outputs=(
                *OUTPUTS,
                *(METRIC + name for name, _, _ in self.machine.metrics),
                *(COORDINATE + path for path in coordinates),
            ),
        )

    # The run's two ends.

    def start(self, tape: Tape) -> None:
        """Parameters that vary, then the state at t = 0."""
        experiment = self.machine.experiment
        inputs = {coordinate.path: tape.input(coordinate.path) for coordinate in experiment.cases.coordinates}
        values = experiment.formulas.replay(inputs)
        for path in self.machine.varying:
            tape.write(PARAMETER + path, values[experiment.parameters[path].value.output])  # type: ignore[union-attr]
        self.machine.keep_tree(tape.read, tape.write)
        for joint in self.joints:
            for name in ("q", "qd"):
                tape.write(f"{joint}.{name}", self.machine.value(f"initial.{joint}.{name}", tape.read))
        for actuator in self.machine.working:
            parts: tuple[Memory | State, ...] = (*actuator.servo.memory, *actuator.servo.states)
            for part in parts:
                tape.write(f"{actuator.path}.{part.name}", part.start)
        for name, metric, _ in self.machine.metrics:
            for memory in metric.memory:
                tape.write(f"{METRIC}{name}.{memory.name}", memory.start)

    def end(self, tape: Tape) -> None:
        for name in OUTPUTS:
            tape.output(name, tape.read(name))
        for name, metric, _ in self.machine.metrics:
            p, held = self._metric(tape, name)
            tape.output(METRIC + name, answer(f"metric `{name}`", metric.result, p, held, tape.time))
        for coordinate in self.machine.experiment.cases.coordinates:
            tape.output(COORDINATE + coordinate.path, tape.input(coordinate.path))

    # Servos.

    def _servos(self, divisor: int) -> Body:
        def body(tape: Tape) -> None:
            for actuator in self.machine.working:
                if actuator.use.divisor == divisor:
                    self._tick(tape, actuator)

        return body

    def _tick(self, tape: Tape, actuator: Actuator) -> None:
        """One tick of one servo's computer, on the state at this time."""
        servo, joint = actuator.servo, self.joints[actuator.index]
        asked = Asked("none", 0.0, 0.0)
        if actuator.use.command is not None and actuator.profile is not None:
            p = parameters(
                f"command `{actuator.profile.name}` of {actuator.owner}",
                f"{actuator.path}.command",
                actuator.profile.parameters,
                lambda path: self.machine.value(path, tape.read),
            )
            value, slope = answer(actuator.owner, actuator.profile.course, p, tape.time)
            asked = Asked(actuator.use.command.kind, value, slope)
            tape.write(f"{actuator.path}.command", value)
        if servo.tick is None:
            return
        q, qd = self._carried(tape, actuator) if actuator in self.between else self._state_of(tape, joint)
        held = Values(actuator.owner, {m.name: tape.read(f"{actuator.path}.{m.name}") for m in servo.memory})
        seen = Seen(q, qd, asked, actuator.use.divisor / self.schedule.base_hz)
        new = answer(actuator.owner, servo.tick, self.machine.servo_values(actuator, tape.read), held, seen)
        returned(actuator.owner, "tick", new, (memory.name for memory in servo.memory))
        for name, value in new.items():
            tape.write(f"{actuator.path}.{name}", value)

    def _carried(self, tape: Tape, actuator: Actuator) -> tuple[Real, Real]:
        """Joint position and rate between instants: carried forward with the acceleration of the step just done."""
        joint = self.joints[actuator.index]
        q, qd = self._state_of(tape, joint)
        a = tape.read(f"carry:{joint}")
        steps = tape.tick - self.schedule.dynamics * floor(tape.tick / float(self.schedule.dynamics))
        s = steps / self.schedule.base_hz
        rate = qd + s * a
        rate = where(both(self._rubs(tape, actuator), qd * rate < 0.0), 0.0, rate)
        return q + s * qd + 0.5 * s * s * a, rate

    def carry(self, tape: Tape) -> None:
        """The acceleration of the step just done, for servos that tick before the next; none for a joint at rest."""
        for actuator in self.between:
            joint = self.joints[actuator.index]
            qd = tape.read(f"{joint}.qd")
            a = (qd - tape.read(f"before:{joint}")) / self.schedule.step
            at_rest = both(self._rubs(tape, actuator), qd == 0.0)
            tape.write(f"carry:{joint}", where(at_rest, 0.0, a))

    # An instant.

    def modes(self, tape: Tape) -> None:
        """What begins at an instant: held values for the first stage, friction modes from the rates."""
        for actuator in self.between:
            for memory in actuator.servo.memory:
                channel = f"{actuator.path}.{memory.name}"
                tape.write(f"first:{channel}", tape.read(channel))
            joint = self.joints[actuator.index]
            tape.write(f"before:{joint}", tape.read(f"{joint}.qd"))
        tape.write("instant", tape.time)
        tape.write("fraction", 0.0)
        tape.write("splits", 0.0)
        self._modes(tape, True)

    def modes_again(self, tape: Tape) -> None:
        self._modes(tape, tape.read_mask("again"))

    def _modes(self, tape: Tape, active: Truth) -> None:
        """s = sign(qd), and whether any joint is at rest so that its mode must be decided."""
        any_at_rest: Truth = False
        for actuator in self.machine.sticking:
            joint = self.joints[actuator.index]
            qd = tape.read(f"{joint}.qd")
            rubs = self._dry(tape, actuator) > 0.0
            if not isinstance(rubs, bool):
                tape.write_mask(f"rubs:{joint}", rubs)
            self._keep(tape, active, f"friction:{joint}", where(rubs, sign(qd), 1.0))
            any_at_rest = either(any_at_rest, both(rubs, qd == 0.0))
        tape.write_mask("undecided", both(active, any_at_rest))

    def _dry(self, tape: Tape, actuator: Actuator) -> Real:
        """The level of dry friction at the state, N m (N)."""
        drive = drive_of(
            self.machine, actuator, tape.read, self._state(tape), self._held(tape, actuator, 0.0), tape.time
        )
        return drive.dry

    def _rubs(self, tape: Tape, actuator: Actuator) -> Truth:
        """Whether a joint has dry friction, as `modes` found it; False for a case whose level is zero."""
        if not actuator.dry:
            return False
        return True if actuator.level is not None else tape.read_mask(f"rubs:{self.joints[actuator.index]}")

    def decide(self, tape: Tape) -> None:
        """One decision pass at rest: who breaks away, who turns back; again while anything changes."""
        active = tape.read_mask("undecided")
        y, fraction = self._state(tape), tape.read("fraction")
        found = self._derivative(tape, y, fraction)
        changed: Truth = False
        for actuator in self.machine.sticking:
            i, joint = actuator.index, self.joints[actuator.index]
            s = tape.read(f"friction:{joint}")
            drive = found.drives[i]
            assert drive is not None
            at_rest = both(self._rubs(tape, actuator), y.qd[i] == 0.0)
            s_new = friction.decide(s, at_rest, found.need[i], drive.dry, found.slope.qdd[i])
            changed = either(changed, s_new != s)
            self._keep(tape, active, f"friction:{joint}", s_new)
        tape.write_mask("undecided", both(active, changed))

    def derive(self, tape: Tape) -> None:
        self._derive(tape, True, 0.0)

    def derive_again(self, tape: Tape) -> None:
        self._derive(tape, tape.read_mask("again"), tape.read("fraction"))

    def _derive(self, tape: Tape, active: Truth, fraction: Real) -> None:
        """The first stage: derivatives at the state, with everything that is recorded of it."""
        found = self._derivative(tape, self._state(tape), fraction)
        for i, joint in enumerate(self.joints):
            self._keep(tape, active, f"{joint}.qdd", found.slope.qdd[i])
            self._keep(tape, active, f"{joint}.tau", found.tau[i])
        for name, slope in zip(self.states, found.slope.xd, strict=True):
            self._keep(tape, active, f"slope:{name}", slope)
        for actuator in self.machine.working:
            drive = found.drives[actuator.index]
            assert drive is not None
            for name, value in drive.signals.items():
                self._keep(tape, active, f"{actuator.path}.{name}", value)
        self._watch(tape, active, found)
        if self.machine.sticking:
            self._count(tape, tape.read_mask("undecided"), "friction.undecided")

    def _watch(self, tape: Tape, active: Truth, found: Derivative) -> None:
        """The first failure of a case: which joint, why, when. `need` tells where a joint that sticks hides one."""
        code: Real = 0.0
        number: Real = 0.0
        for i in reversed(range(len(self.joints))):
            size = absolute(found.slope.qdd[i]) + absolute(found.need[i])
            drive = found.drives[i]
            for slope in drive.slopes.values() if drive is not None else ():
                size = size + absolute(slope)
            bad = not_(isfinite(size))
            code, number = where(bad, NOT_FINITE, code), where(bad, float(i), number)
        for i in reversed(range(len(self.joints))):
            singular = found.solved.singular[i]
            code, number = where(singular, SINGULAR, code), where(singular, float(i), number)
        news = both(active, both(tape.read("failure") == 0.0, code != 0.0))
        self._keep(tape, news, "failure.joint", number)
        self._keep(tape, news, "failure.tick", tape.tick)
        self._keep(tape, news, "failure", code)

    # A step.

    def advance(self, tape: Tape) -> None:
        self._advance(tape, True, 0.0)

    def advance_again(self, tape: Tape) -> None:
        self._advance(tape, tape.read_mask("again"), tape.read("fraction"))

    def _advance(self, tape: Tape, active: Truth, fraction: Real) -> None:
        """The rest of the (sub)step: the integrator's further stages, and whether a rate came to zero on the way."""
        left = 1.0 - fraction
        y = self._state(tape)

        def slope(c: float, there: Motion) -> Slope:
            return self._derivative(tape, there, fraction + c * left).slope

        y_new = self.machine.integrator.advance(slope, left * self.schedule.step, y, self._first_slope(tape, y.qd))
        if self.machine.sticking:
            self._store(tape, True, y, "from:")
            tape.write_mask("crossing", both(active, any_of(friction.crossings(self._sliding(tape), y_new))))
            tape.write_mask("again", False)
        self._store(tape, active, y_new)

    def split(self, tape: Tape) -> None:
        """Go back to where the first rate came to zero; the rest of the step follows as a substep."""
        active = tape.read_mask("crossing")
        fraction, splits = tape.read("fraction"), tape.read("splits")
        left = 1.0 - fraction
        may_split = splits < float(friction.SPLITS)
        y = self._state(tape, "from:")
        reached = friction.split_at_rest(
            y,
            self._first_slope(tape, y.qd),
            self._state(tape),
            left * self.schedule.step,
            self._sliding(tape),
            may_split=may_split,
        )
        fraction_new = fraction + reached.share * left
        self._keep(tape, active, "fraction", fraction_new)
        tape.write_mask("again", both(active, both(may_split, fraction_new < 1.0)))
        self._count(tape, both(active, may_split), "splits")
        self._count(tape, both(active, may_split), "friction.splits")
        self._count(tape, both(active, not_(may_split)), "friction.clamped")
        self._store(tape, active, reached.y)

    def _first_slope(self, tape: Tape, qd: tuple[Real, ...]) -> Slope:
        """The first stage's slope, as `derive` left it; qd are the rates then."""
        return Slope(
            qd,
            tuple(tape.read(f"{joint}.qdd") for joint in self.joints),
            tuple(tape.read(f"slope:{name}") for name in self.states),
        )

    def _derivative(self, tape: Tape, y: Motion, fraction: Real) -> Derivative:
        """The derivative at the state y, at the share `fraction` of the dynamics step that began last."""
        time = tape.read("instant") + fraction * self.schedule.step
        held = [
            Values("no servo", {}) if actuator is None else self._held(tape, actuator, fraction)
            for actuator in self.machine.actuators
        ]
        return derivative(self.machine, tape.read, y=y, held=held, friction=self._friction(tape), time=time)

    def _held(self, tape: Tape, actuator: Actuator, fraction: Real) -> Values:
        """What the servo's computer holds; between the first and last tick of a step for a servo that is faster."""
        numbers: dict[str, Real] = {}
        for memory in actuator.servo.memory:
            channel = f"{actuator.path}.{memory.name}"
            now = tape.read(channel)
            if actuator in self.between:
                first = tape.read(f"first:{channel}")
                now = first + fraction * (now - first)
            numbers[memory.name] = now
        return Values(actuator.owner, numbers)

    # What the phases share.

    def _state(self, tape: Tape, copy: str = "") -> Motion:
        """The state, or the copy of it under this prefix."""
        return Motion(
            tuple(tape.read(f"{copy}{joint}.q") for joint in self.joints),
            tuple(tape.read(f"{copy}{joint}.qd") for joint in self.joints),
            tuple(tape.read(f"{copy}{name}") for name in self.states),
        )

    def _store(self, tape: Tape, active: Truth, y: Motion, copy: str = "") -> None:
        for joint, q, qd in zip(self.joints, y.q, y.qd, strict=True):
            self._keep(tape, active, f"{copy}{joint}.q", q)
            self._keep(tape, active, f"{copy}{joint}.qd", qd)
        for name, x in zip(self.states, y.x, strict=True):
            self._keep(tape, active, f"{copy}{name}", x)

    def _friction(self, tape: Tape) -> list[Real | None]:
        modes: list[Real | None] = [None] * len(self.joints)
        for actuator in self.machine.sticking:
            modes[actuator.index] = tape.read(f"friction:{self.joints[actuator.index]}")
        return modes

    def _sliding(self, tape: Tape) -> list[Real | None]:
        """Friction modes as crossings count them: zero, so that it never crosses, where a case has no friction."""
        modes = self._friction(tape)
        for actuator in self.machine.sticking:
            mode = modes[actuator.index]
            assert mode is not None
            modes[actuator.index] = where(self._rubs(tape, actuator), mode, 0.0)
        return modes

    def _count(self, tape: Tape, event: Truth, name: str) -> None:
        self._keep(tape, event, name, tape.read(name) + 1.0)

    @staticmethod
    def _state_of(tape: Tape, joint: str) -> tuple[Real, Real]:
        return tape.read(f"{joint}.q"), tape.read(f"{joint}.qd")

    @staticmethod
    def _keep(tape: Tape, active: Truth, name: str, value: Real) -> None:
        """Write where active; other cases of the block keep what they have."""
        tape.write(name, value if active is True else where(active, value, tape.read(name)))

    # Metrics and the recorder.

    def _metric(self, tape: Tape, name: str) -> tuple[Values, Values]:
        metric = next(model for known, model, _ in self.machine.metrics if known == name)
        owner = f"metric `{name}` (model {metric.name})"
        p = parameters(
            owner, f"metrics.{name}", metric.parameters, lambda path: self.machine.value(path, tape.read)
        )
        held = {memory.name: tape.read(f"{METRIC}{name}.{memory.name}") for memory in metric.memory}
        return p, Values(owner, held)

    def _metrics(self, divisor: int) -> Body:
        period = divisor / self.schedule.base_hz

        def body(tape: Tape) -> None:
            dt = where(tape.tick == 0.0, 0.0, period)
            for name, metric, channel in self.machine.metrics:
                if channel.divisor == divisor:
                    p, held = self._metric(tape, name)
                    owner = f"metric `{name}` (model {metric.name})"
                    new = answer(owner, metric.update, p, held, tape.read(channel.path), tape.time, dt)
                    returned(owner, "update", new, (memory.name for memory in metric.memory))
                    for memory, value in new.items():
                        tape.write(f"{METRIC}{name}.{memory}", value)

        return body

    @staticmethod
    def _recorder(columns: list[str]) -> Body:
        def body(tape: Tape) -> None:
            for column, channel in enumerate(columns):
                tape.record(column, tape.read(channel))

        return body

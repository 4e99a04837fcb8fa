"""One step of the dynamics: friction's modes, derivatives, the integrator's stages, and splits by friction.

The derivative is most of a program, so its code is there twice, however often a step calls it: `derive`, for the
present state with all recorded quantities, and `slope`, for a stage within the step, with slopes alone. Both read and
write cells. Results for a case that did not need them (another one of the block did) are overwritten, before anything
reads them, by `derive` at the next instant.

An integrator's `advance` is one function that asks for slopes on its way. It is recorded in pieces, one to each
question and one to the end: each piece runs `advance` anew, answers the questions that are settled from cells, and
stops at the next one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import add

from met.dynamics.spatial import choose
from met.integrators.integrator import Motion, Slope
from met.program import cells, friction
from met.program.asking import Question, advance_with, changed_count, question_count
from met.program.cells import NamedValues
from met.program.control.substituted import Substituted
from met.program.evaluation import Derivative, brake_levels, derivative, followers_level, servo_response
from met.program.friction import sticking
from met.program.grapple import Grapple
from met.program.motion import base, bodies
from met.program.observe import Observed
from met.program.system import Actuator, System
from met.trace import Real, Truth, any_of, both, either, isfinite, not_, sign, where
from met.trace.program import CallPhase, Control, Every, Phase, RunPhase, Tape, WhileAny

SINGULAR, NOT_FINITE, OUT_OF_RANGE, UNBALANCED, TOO_FAST = 1.0, 2.0, 4.0, 5.0, 6.0
"""Causes of a failed case (output `failure`); 0 is none, and 3 an end from outside (met/run.py). UNBALANCED and
TOO_FAST are judged after the run, from other outputs (`met.run.judge`)."""

FAILURE = ("failure", "failure.joint", "failure.tick")
"""Outputs of a failed case: its cause, the number of the joint, body or sensor, and the tick."""

EVENTS = ("friction.splits", "friction.clamped", "friction.undecided")
"""Outputs that count, for each case: steps split where a joint came to rest, crossings clamped, decisions at rest left
open."""

FROM, STAGE = "from:", "stage:"
"""Prefixes of copies of the state: at the start of the (sub)step just done, and at a stage within a step."""


class StepPhases:
    """The phases of one step of a system. Every method that takes a tape is the body of a phase."""

    def __init__(self, system: System, *, wire: bool = False, late: int = 0) -> None:
        """wire: whether real motor beds are at the wire; late: ticks of their delay that pass on it"""
        self.system = system
        self.beds = Substituted(system, self.loads, wire=wire, late=late)
        self.schedule = system.structure.schedule
        self.joints = tuple(joint.name for joint in system.joints)
        self.coordinates = bodies.coordinates(system)
        self.states = system.states
        self._followers = frozenset(joint.name for joint in system.followers)
        self.sticking = sticking(system)
        self.grapple = Grapple(
            system, self.state, lambda tape, actuator: self._held(tape, actuator, 1.0), self.keep_followers
        )
        self._questions = question_count(system.integrator, len(self.coordinates), len(self.states), self.schedule.step)
        self._derive = CallPhase(Phase("derive", self.derive))
        self._slope = CallPhase(Phase("slope", self.slope))
        count = len(self.sticking)
        one_by_one = RunPhase(Phase("decide_one", self.decide_one))
        self._decide = (
            WhileAny(
                "undecided", friction.decision_passes(count), (self._derive, RunPhase(Phase("decide", self.decide)))
            ),
            *([WhileAny("undecided", friction.sequential_passes(count), (self._derive, one_by_one))] * (count > 1)),
            WhileAny("undecided", 1, (RunPhase(Phase("left_open", self.left_open)),)),
        )
        # what may hide a non-finite number: joints whose acceleration may be given, and all that may stick
        gives = [a.use.joint for a in system.working if a.gives or a.level != 0.0]
        self._needs = tuple(dict.fromkeys((*gives, *(part.name for part in self.sticking))))
        self._may_leave_range = [actuator for actuator in self.system.working if actuator.may_leave_range]
        self._split = WhileAny("crossing", 1, (RunPhase(Phase("split", self.split)),))

    def follow(self) -> tuple[Control, ...]:
        """The phase at the begin of an instant that puts followers where their leaders are."""
        if not self._followers:
            return ()
        return (Every(self.schedule.dynamics, (RunPhase(Phase("follow", self.keep_followers)),)),)

    def keep_followers(self, tape: Tape) -> None:
        """Write positions and rates of the joints whose motion follows from others' (by ratios or a loop)."""
        if not self._followers:
            return
        y = self.state(tape)
        for i, joint in enumerate(self.joints):
            if joint in self._followers:
                tape.write(f"{joint}.q", y.q[i])
                tape.write(f"{joint}.qd", y.qd[i])

    def begin(self) -> tuple[Control, ...]:
        """Phases at an instant once the servos have ticked: modes, then the step's first stage."""
        decide = self._decide if self.sticking else ()
        judge = WhileAny("suspect", 1, (RunPhase(Phase("judge", self.judge)),))
        modes, due = RunPhase(Phase("modes", self.modes)), self.schedule.dynamics
        return (Every(due, (modes, *decide)), *self.beds.after_modes(), Every(due, (self._derive, judge)))

    def finish(self) -> tuple[Control, ...]:
        """The rest of the step, at its end."""
        parts = self._stages(again=False)
        if self.sticking:
            again = (
                RunPhase(Phase("modes_again", self.modes_again)),
                *self._decide,
                self._derive,
                WhileAny("suspect", 1, (RunPhase(Phase("judge_again", self.judge_again)),)),
                *self._stages(again=True),
                self._split,
            )
            parts = (*parts, self._split, WhileAny("again", friction.SPLITS, again))
        return (*parts, RunPhase(Phase("carry", self.carry))) if self.system.ticking_between else parts

    # Modes.

    def modes(self, tape: Tape) -> None:
        """Begin an instant: held values for the first stage, friction modes from the rates."""
        for actuator in self.system.ticking_between:
            for memory in actuator.parts.memory:
                channel = f"{actuator.path}.{memory.name}"
                tape.write(cells.FIRST(channel), tape.read(channel))
            for name, cell in self._carried(actuator):
                tape.write(cells.BEFORE(name), tape.read(cell))
        tape.write("instant", tape.time)
        tape.write("fraction", 0.0)
        tape.write("splits", 0.0)
        self._modes(tape, True)

    def modes_again(self, tape: Tape) -> None:
        self._modes(tape, tape.read_mask("again"))

    def _modes(self, tape: Tape, active: Truth) -> None:
        """The modes s = sign(qd), and whether any joint is at rest so that its mode must be decided."""
        any_at_rest: Truth = False
        for part, level in zip(self.sticking, self._levels(tape), strict=True):
            rate = tape.read(part.cell)
            has_friction = level > 0.0
            if part.level is None:
                cells.keep(tape, active, cells.HAS_FRICTION(part.name), choose(has_friction, 1.0, 0.0))
            # without friction at rest it moves freely; a level that rises later in the step opposes the motion at once
            cells.keep(
                tape,
                active,
                cells.FRICTION_MODE(part.name),
                where(either(has_friction, rate != 0.0), sign(rate), 1.0),
            )
            any_at_rest = either(any_at_rest, both(has_friction, rate == 0.0))
        tape.write_mask("undecided", both(active, any_at_rest))

    def _levels(self, tape: Tape) -> list[Real]:
        """The levels of dry friction at the state where a step or substep begins, in the units of the quantities that
        they hold."""
        fraction, y = tape.read("fraction"), self.state(tape)
        time, begin = self._time(tape, fraction), tape.read("instant")
        on_joints = brake_levels(self.system, tape.read, y, time, begin)
        levels: list[Real] = []
        for part in self.sticking:
            own: list[Real] = [] if part.level is None else [part.level]
            if part.level is None and part.actuator is not None:
                held = self._held(tape, part.actuator, fraction)
                drive = servo_response(self.system, part.actuator, tape.read, y, held, time, begin).drive
                own.append(drive.friction[part.state] if part.state else drive.dry)
            if part.name in on_joints:
                own.append(on_joints[part.name])
            if part.followers:
                own.append(followers_level(self.system, tape.read, y, part.followers, on_joints, time, begin))
            levels.append(reduce(add, own))
        return levels

    def has_dry_friction(self, tape: Tape, name: str) -> Truth:
        """True where the joint or state of this name has dry friction, as `modes` found it: a level above zero."""
        part = next((other for other in self.sticking if other.name == name), None)
        if part is None:
            return False
        return True if part.level is not None else tape.read_mask(cells.HAS_FRICTION(name))

    def decide(self, tape: Tape) -> None:
        """Decide modes at rest once, from the derivative just taken: breaking away, and turning back."""
        self._decided(tape, single=False)

    def decide_one(self, tape: Tape) -> None:
        """Change only the first mode that is wrong, as `decide` does for all."""
        self._decided(tape, single=True)

    def _decided(self, tape: Tape, *, single: bool) -> None:
        """Decide the friction modes of all that may stick from the present accelerations. single: at most one mode
        changes."""
        active, y = tape.read_mask("undecided"), self.state(tape)
        changed: Truth = False
        for part, level in zip(self.sticking, self._levels(tape), strict=True):
            s = tape.read(cells.FRICTION_MODE(part.name))
            slope = tape.read(cells.SLOPE(part.name) if part.state else f"{part.name}.qdd")
            at_rest = both(self.has_dry_friction(tape, part.name), part.rate(y) == 0.0)
            s_new = friction.decide(s, at_rest, tape.read(cells.HOLDING(part.name)), level, slope)
            s_new = where(changed, s, s_new) if single else s_new
            changed = either(changed, s_new != s)
            cells.keep(tape, active, cells.FRICTION_MODE(part.name), s_new)
        tape.write_mask("undecided", both(active, changed))

    def left_open(self, tape: Tape) -> None:
        """Count decisions that did not settle."""
        cells.count(tape, tape.read_mask("undecided"), "friction.undecided")

    # Derivatives.

    def derive(self, tape: Tape) -> None:
        """Compute the derivative at the state, with all recorded quantities, and check it."""
        y = self.state(tape)
        answer = self._derivative(tape, y, tape.read("fraction"))
        for i, name in enumerate(self.coordinates):
            tape.write(f"{name}.qdd", answer.slope.qdd[i])
            if name in self.joints:
                tape.write(f"{name}.tau", answer.tau[i])
        for name in self._needs:
            tape.write(cells.HOLDING(name), answer.need[name])
        for name, slope in zip(self.states, answer.slope.xd, strict=True):
            tape.write(cells.SLOPE(name), slope)
        for channel, value in answer.signals.items():
            tape.write(channel, value)
        singular: Real = where(answer.solved.base_singular, float(len(self.joints) + 1), 0.0)
        for i in reversed(range(len(self.joints))):
            singular = where(answer.solved.singular[i], float(i + 1), singular)
        tape.write("singular", singular)
        out_of_range: Real = 0.0
        for actuator in reversed(self._may_leave_range):
            out_of_range = where(answer.out_of_range[actuator.index], float(actuator.index + 1), out_of_range)
        if self._may_leave_range:
            tape.write("astray", out_of_range)
        # Infinities that cancel leave a NaN, so a plain sum misses none; an overflowing sum of finite numbers only
        # makes `judge` look.
        parts = (*answer.slope.qdd, *answer.slope.xd, *y.q, *y.qd, *(answer.need[name] for name in self._needs))
        total: Real = sum((*parts, *bodies.orientation(self.system, tape)), 0.0)
        wrong = either(not_(isfinite(total)), singular != 0.0)
        tape.write_mask("suspect", either(wrong, out_of_range != 0.0) if self._may_leave_range else wrong)

    def slope(self, tape: Tape) -> None:
        """Compute the derivative at a stage within the step: slopes alone."""
        answer = self._derivative(tape, self.state(tape, STAGE), tape.read(f"{STAGE}fraction"))
        for joint, qdd in zip(self.coordinates, answer.slope.qdd, strict=True):
            tape.write(f"{STAGE}{joint}.qdd", qdd)
        for joint, qd in zip(self.coordinates[len(self.joints) :], answer.slope.qd[len(self.joints) :], strict=True):
            tape.write(f"{STAGE}{joint}.qd", qd)  # a turn's rate is not a rate of the state
        for name, slope in zip(self.states, answer.slope.xd, strict=True):
            tape.write(STAGE + cells.SLOPE(name), slope)

    def judge(self, tape: Tape) -> None:
        self._judge(tape, True)

    def judge_again(self, tape: Tape) -> None:
        self._judge(tape, tape.read_mask("again"))

    def _judge(self, tape: Tape, active: Truth) -> None:
        """The first failure of a case: what is wrong with its state or derivative, and with which joint first.

        `need` tells where a joint that sticks hides it, the state where no acceleration depends on it.
        """
        out_of_range: Real = tape.read("astray") if self._may_leave_range else 0.0
        cause: Real = where(out_of_range != 0.0, OUT_OF_RANGE, 0.0)
        number: Real = where(out_of_range != 0.0, out_of_range - 1.0, 0.0)
        of_bodies = list(enumerate(bodies.bodies(self.system), len(self.joints)))
        for i, fitted in reversed(list(enumerate(self.system.sensors, len(self.joints) + len(of_bodies)))):
            watched = [part for name in fitted.channels for part in (name, cells.SLOPE(name))]
            bad = not_(isfinite(sum((tape.read(name) for name in watched), 0.0)))
            cause, number = where(bad, NOT_FINITE, cause), where(bad, float(i), number)
        for i, body in reversed(of_bodies):
            watched = [f"{name}.{part}" for name in body.coordinates for part in ("qdd", "q", "qd")]
            turned = sum([tape.read(name) for name in body.orientation], 0.0)
            good = isfinite(sum((tape.read(name) for name in watched), turned))
            number = where(good, number, float(i))
            cause = where(good, cause, NOT_FINITE)
        elsewhere = cause == NOT_FINITE
        for i, joint in reversed(list(enumerate(self.joints))):
            watched = [f"{joint}.qdd", f"{joint}.q", f"{joint}.qd"]
            moves = isfinite(sum((tape.read(name) for name in watched), 0.0))
            watched += [
                cells.HOLDING(name) for name in self._needs if name == joint or name.startswith(f"{joint}.servo.")
            ]
            watched += [cells.SLOPE(name) for name in self.states if name.startswith(f"{joint}.servo.")]
            bad = not_(isfinite(sum((tape.read(name) for name in watched), 0.0)))
            if bodies.bodies(self.system):  # a sound joint that only bears a body's load is not named
                bad = both(bad, either(not_(moves), not_(elsewhere)))
            cause, number = where(bad, NOT_FINITE, cause), where(bad, float(i), number)
        singular = tape.read("singular")
        cause, number = where(singular != 0.0, SINGULAR, cause), where(singular != 0.0, singular - 1.0, number)
        news = both(active, both(tape.read("failure") == 0.0, cause != 0.0))
        cells.keep(tape, news, "failure.joint", number)
        cells.keep(tape, news, "failure.tick", tape.tick)
        cells.keep(tape, news, "failure", cause)

    def loads(self, tape: Tape) -> tuple[list[list[Real]], list[Real]]:
        """Compute the arm's load on the substituted joints: tau_load = Lambda qdd + b_0, all other joints in their
        modes."""
        y, numbers = self.state(tape), [mounted.index for mounted in self.beds.mounted]
        at_rest = self._derivative(tape, y, 0.0, dict.fromkeys(numbers, 0.0)).solved.tau_load
        columns = []
        for j in numbers:
            moved = self._derivative(tape, y, 0.0, {i: float(i == j) for i in numbers}).solved.tau_load
            columns.append([moved[i] - at_rest[i] for i in numbers])
        return [[column[i] for column in columns] for i in range(len(numbers))], [at_rest[i] for i in numbers]

    def observed(self, tape: Tape) -> Observed:
        """The arm at an instant, with the derivative from `derive`."""
        y = self.state(tape)
        stands = base.base_of(self.system, tape.read, y, tape.read("instant"))
        return Observed(self.system, tape.read, y, stands, tape.read("instant"), lambda: self._derivative(tape, y, 0.0))

    def _derivative(
        self, tape: Tape, y: Motion, fraction: Real, prescribed_qdd: dict[int, Real] | None = None
    ) -> Derivative:
        """The derivative at the state y, at the share `fraction` of the dynamics step that began last.

        prescribed_qdd  accelerations of the substituted joints; None: those that the law gives
        """
        held = [
            NamedValues("no servo", {}) if actuator is None else self._held(tape, actuator, fraction)
            for actuator in self.system.actuators
        ]
        return derivative(
            self.system,
            tape.read,
            y=y,
            held=held,
            friction={part.name: tape.read(cells.FRICTION_MODE(part.name)) for part in self.sticking},
            time=self._time(tape, fraction),
            begin=tape.read("instant"),
            part=tape.part,
            prescribed_qdd=self.beds.accelerations(tape, fraction) if prescribed_qdd is None else prescribed_qdd,
        )

    def _time(self, tape: Tape, fraction: Real) -> Real:
        return tape.read("instant") + fraction * self.schedule.step

    def _held(self, tape: Tape, actuator: Actuator, fraction: Real) -> NamedValues:
        """The servo's memory at a share of the step; for a faster servo between the step's first and last tick."""
        numbers: dict[str, Real] = {}
        for memory in actuator.parts.memory:
            channel = f"{actuator.path}.{memory.name}"
            now = tape.read(channel)
            if actuator in self.system.ticking_between:
                first = tape.read(cells.FIRST(channel))
                now = first + fraction * (now - first)
            numbers[memory.name] = now
        return NamedValues(actuator.owner, numbers)

    # The integrator's stages.

    def _stages(self, *, again: bool) -> tuple[Control, ...]:
        """The step (the substep, if `again`) after its first stage: pieces of the integrator, a slope between each."""
        name = "advance_again" if again else "advance"
        parts: list[Control] = []
        for settled in range(self._questions):
            parts += [RunPhase(Phase(f"{name}_{settled + 1}", self._towards(settled, again))), self._slope]
        return (*parts, RunPhase(Phase(name, self._arrival(self._questions, again))))

    def _towards(self, settled: int, again: bool) -> Callable[[Tape], None]:
        """The body of the piece that ends at a question, after `settled` answered ones."""

        def body(tape: Tape) -> None:
            """Run the integrator up to its next question, and store the state that it asks about."""
            fraction = tape.read("fraction") if again else 0.0
            question = self._integrate(tape, settled, fraction)
            if not isinstance(question, Question):
                raise changed_count(self.system.integrator)
            cells.store(tape, True, self.coordinates, self.states, question.state, STAGE)
            tape.write(f"{STAGE}fraction", fraction + question.share * (1.0 - fraction))

        return body

    def _arrival(self, settled: int, again: bool) -> Callable[[Tape], None]:
        """The body of the last piece: the state at the end, and whether a rate came to zero in between."""

        def body(tape: Tape) -> None:
            """Finish the step: store the new state, and where a sliding rate has crossed zero also the one at the
            step's start, so that the step can be split there."""
            active: Truth = tape.read_mask("again") if again else True
            y = self.state(tape)
            y_new = self._integrate(tape, settled, tape.read("fraction") if again else 0.0)
            if isinstance(y_new, Question):
                raise changed_count(self.system.integrator)
            if self.sticking:
                crossed = any_of(friction.crossings(self._sliding(tape), y_new))
                cells.store(tape, True, self.coordinates, self.states, y, FROM)
                bodies.keep_orientation(self.system, tape, FROM)
                tape.write_mask("crossing", both(active, crossed))
                tape.write_mask("again", False)
            cells.store(tape, active, self.coordinates, self.states, y_new)
            bodies.turn(self.system, tape, active, y_new)

        return body

    def _integrate(self, tape: Tape, settled: int, fraction: Real) -> Motion | Question:
        """Run the integrator with the first `settled` slopes from cells, up to the next question or to its end."""
        y = self.state(tape)
        if settled:
            for joint in self.coordinates:
                for part in ("qd", "qdd"):
                    tape.write(cells.STAGE_SLOPE(settled, f"{joint}.{part}"), tape.read(f"{STAGE}{joint}.{part}"))
            for name in self.states:
                tape.write(cells.STAGE_SLOPE(settled, name), tape.read(STAGE + cells.SLOPE(name)))
        answers = [
            Slope(
                tuple(tape.read(cells.STAGE_SLOPE(n, f"{joint}.qd")) for joint in self.coordinates),
                tuple(tape.read(cells.STAGE_SLOPE(n, f"{joint}.qdd")) for joint in self.coordinates),
                tuple(tape.read(cells.STAGE_SLOPE(n, name)) for name in self.states),
            )
            for n in range(1, settled + 1)
        ]
        h = (1.0 - fraction) * self.schedule.step
        return advance_with(self.system.integrator, answers, h, y, self._first_slope(tape, y.qd))

    def _first_slope(self, tape: Tape, qd: tuple[Real, ...]) -> Slope:
        """The first stage's slope from `derive`; qd are the rates then."""
        return Slope(
            qd,
            tuple(tape.read(f"{joint}.qdd") for joint in self.coordinates),
            tuple(tape.read(cells.SLOPE(name)) for name in self.states),
        )

    def split(self, tape: Tape) -> None:
        """Go back to where the first rate came to zero; the rest of the step follows as a substep."""
        active = tape.read_mask("crossing")
        fraction, splits = tape.read("fraction"), tape.read("splits")
        left = 1.0 - fraction
        may_split = splits < float(friction.SPLITS)
        y = self.state(tape, FROM)
        reached = friction.split_at_rest(
            y,
            self._first_slope(tape, y.qd),
            cells.state(tape, self.coordinates, self.states),
            left * self.schedule.step,
            self._sliding(tape),
            may_split=may_split,
        )
        fraction_new = fraction + reached.share * left
        cells.keep(tape, active, "fraction", fraction_new)
        tape.write_mask("again", both(active, both(may_split, fraction_new < 1.0)))
        cells.count(tape, both(active, may_split), "splits")
        cells.count(tape, both(active, may_split), "friction.splits")
        cells.count(tape, both(active, not_(may_split)), "friction.clamped")
        cells.store(tape, active, self.coordinates, self.states, reached.y)
        bodies.turn(self.system, tape, active, reached.y, FROM)

    def carry(self, tape: Tape) -> None:
        """Keep the slope of the step just done, for servos that tick before the next; 0 for parts at rest with
        friction."""
        for actuator in self.system.ticking_between:
            for name, cell in self._carried(actuator):
                now = tape.read(cell)
                slope = (now - tape.read(cells.BEFORE(name))) / self.schedule.step
                tape.write(cells.CARRY(name), where(both(self.has_dry_friction(tape, name), now == 0.0), 0.0, slope))

    def _carried(self, actuator: Actuator) -> list[tuple[str, str]]:
        """Rates that are extrapolated between instants, and their cells: the joint's rate, the servo's states."""
        joint = self.joints[actuator.index]
        return [(joint, f"{joint}.qd"), *((name, name) for name in actuator.states)]

    # What the phases share.

    def state(self, tape: Tape, copy: str = "") -> Motion:
        """The state, or a copy of it: with its turns at a stage, without them where a (sub)step begins."""
        y = cells.state(tape, self.coordinates, self.states, copy, self._followers)
        y = self.system.followed(tape.read, y)
        return y if copy == STAGE else bodies.with_zero_turn(self.system, y)

    def _sliding(self, tape: Tape) -> list[Real | None]:
        """Friction modes for crossings: zero, so that it never crosses, where a case has no friction."""
        modes: list[Real | None] = [None] * (len(self.coordinates) + len(self.states))
        for part in self.sticking:
            mode = tape.read(cells.FRICTION_MODE(part.name))
            number = part.number + (len(self.coordinates) if part.state else 0)
            modes[number] = where(self.has_dry_friction(tape, part.name), mode, 0.0)
        return modes

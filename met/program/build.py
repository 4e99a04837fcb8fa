"""The program of an experiment: its phases in the order in which they run (docs/physics.md, "An instant").

At an instant t_k, in this order: the step that ends there is finished; payloads are grappled and released; sensors of
links read; guides tick; servos tick (their commands first); friction modes are decided; derivatives are taken, which is
the first stage of the step that begins; metrics and the recorder see the instant. Servos faster than the dynamics tick
between instants, on the state carried forward.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from met.plan import Experiment
from met.plan.channel import Channel
from met.plan.judged import CHANNEL_INPUT
from met.program import balancing, cells, observe, plausible
from met.program.cells import NamedValues, answer, parameters, returned
from met.program.control import guiding, link_sensors, sensing
from met.program.control.substituted import LIMITED
from met.program.evaluation import gravity, law
from met.program.limits import LimitPhases
from met.program.motion import base, bodies
from met.program.observe import derived
from met.program.step import EVENTS, FAILURE, StepPhases
from met.program.system import FURTHEST, PARAMETER, Actuator, System
from met.servos.servo import Seen, Setpoint
from met.trace import Real, Truth, both, floor, where
from met.trace.program import CallPhase, Control, Every, Phase, Program, RecordPhase, RunPhase, Tape, Unless0

Body = Callable[[Tape], None]

OUTPUTS = (*FAILURE, *EVENTS, LIMITED)

UNHELD = "unheld"
"""Output of a run that begins balanced: the first joint whose servo cannot hold it, by number from 1; 0: all do."""

COORDINATE, METRIC = "coordinate:", "metric:"
"""Prefixes of outputs, and cells, that a deck names: so no name of a deck's clashes with one of the engine's."""


def build(
    experiment: Experiment,
    *,
    wire: bool = False,
    late: int = 0,
    furthest: bool = False,
    changing: tuple[str, ...] = (),
) -> Program:
    """The program of an experiment: inputs are its coordinates and the seeds of a case's own noise, columns its
    recorded channels.

    wire  for real beds: no bed is in the program. The filtered rate that each has read is an input of every tick,
          `wire:<joint>.rate` (rad/s); what its amplifiers are told are outputs, `wire:<joint>.voltage` (V) and
          `wire:<joint>.current` (A)
    late  ticks of a bed's `delay` that pass on the wire: what is told now is held from so many ticks later on
    furthest  as `System` has it
    changing  coordinates that may change during a run: the parameters that follow them directly are set anew at each
              tick, once the step that ends there is finished
    """
    return Builder(System(experiment, furthest=furthest), wire=wire, late=late, changing=changing).program()


class Builder:
    """The phases of one system's program. Every method that takes a tape is the body of a phase."""

    def __init__(self, system: System, *, wire: bool = False, late: int = 0, changing: tuple[str, ...] = ()) -> None:
        self.system = system
        self.changing = tuple(coord for coord in system.experiment.cases.coordinates if coord.path in changing)
        self.schedule = system.structure.schedule
        self.joints = tuple(joint.name for joint in system.joints)
        self.step = StepPhases(system, wire=wire, late=late)
        self.limits = LimitPhases(system, self.step)

    def program(self) -> Program:
        """The program of the experiment: what is done at the start, at each tick and at the end."""
        instant = self.schedule.dynamics
        columns = [channel for recorded in self.system.structure.record for channel in recorded.channels]
        held, at_rows = derived(self.system)
        tick: list[Control] = [
            Unless0((Every(instant, (*self.limits.counting(), *self.step.finish())),)),
            *([CallPhase(Phase("change", self.change))] if self.changing else []),
            *self.step.follow(),
            *self.step.grapple.events(),
        ]
        tick += self.step.beds.before_servos()
        tick += self.computers()
        tick += self.step.begin()
        if held:
            tick.append(Every(instant, (CallPhase(Phase("observe", self._observe(held))),)))
        for divisor in sorted(
            {self.system.channels[expression.name].divisor for expression in self.system.structure.expressions}
        ):
            phase = Phase(f"expressions_{divisor}", self._expressions(divisor))
            tick.append(Every(divisor, (RunPhase(phase),)))
        for divisor in sorted({channel.divisor for _, _, channel in self.system.metrics}):
            tick.append(Every(divisor, (RunPhase(Phase(f"metrics_{divisor}", self._metrics(divisor))),)))
        if not self.step.beds.wire:
            watch = RunPhase(Phase("watch", self._watch))
            tick.append(Every(instant, (Every(plausible.divisor(self.schedule), (watch,)),)))
        if columns:
            tick.append(RecordPhase(Phase("record", self._recorder(columns, held, at_rows)), self.schedule.record))

        coordinates = tuple(coordinate.path for coordinate in self.system.experiment.cases.coordinates)
        return Program(
            base_hz=self.schedule.base_hz,
            start=(RunPhase(Phase("start", self.start)), *self.step.beds.begin_run()),
            tick=tuple(tick),
            end=(RunPhase(Phase("end", self.end)),),
            inputs=(*coordinates, *self.system.experiment.cases.noise, *self.step.beds.wire_inputs),
            columns=len(columns),
            outputs=(
                *OUTPUTS,
                *self.watched,
                *(METRIC + name for name, _, _ in self.system.metrics),
                *(COORDINATE + path for path in coordinates),
                *self.step.beds.wire_outputs,
            ),
            state_outputs=(*OUTPUTS, *self.step.beds.wire_outputs),
            counters=(*EVENTS, LIMITED, *plausible.OUTPUTS[1:], *self.limits.outputs, *self.step.grapple.watch.outputs),
        )

    @property
    def watched(self) -> tuple[str, ...]:
        """Outputs that describe a run without being part of its state."""
        outputs = (*self.limits.outputs, *self.step.grapple.watch.outputs)
        if self.step.beds.wire:
            return outputs
        return (*plausible.OUTPUTS, *([UNHELD] if self.system.structure.balanced else []), *outputs)

    def computers(self) -> list[Control]:
        """The parts with clocks of their own, in this order: sensors of links, guides, servos."""
        computers: list[Control] = []
        for divisor in sorted({use.divisor for use in self.system.structure.sensors}):
            computers.append(Every(divisor, (RunPhase(Phase(f"sensors_{divisor}", self._sensors(divisor))),)))
        for divisor in sorted({use.divisor for use in guiding.ticking(self.system)}):
            computers.append(Every(divisor, (RunPhase(Phase(f"guides_{divisor}", self._guides(divisor))),)))
        for divisor in sorted({actuator.use.divisor for actuator in self.system.working if actuator.ticks}):
            computers.append(Every(divisor, (RunPhase(Phase(f"servos_{divisor}", self._servos(divisor))),)))
        return computers

    # The run's two ends.

    def start(self, tape: Tape) -> None:
        """Write varied parameters, then the state at t = 0, and the memory of sensors and metrics."""
        begun = self.begin(tape)
        if self.system.structure.balanced:
            y = self.step.state(tape)
            demands = balancing.balance(self.system, tape, y, begun)
            if UNHELD in self.watched:
                first = balancing.first_unheld(self.system, tape, y, demands)
                if self.system.structure.springs:
                    first = where(first == 0.0, balancing.first_unsettled(self.system, tape, y, begun), first)
                tape.write(UNHELD, first)
        plausible.start(tape, self.step.coordinates)
        for actuator in self.system.working:
            self._begin_sensors(tape, actuator)
        for name, metric, _ in self.system.metrics:
            for memory in metric.memory:
                tape.write(f"{METRIC}{name}.{memory.name}", memory.start)

    def begin(self, tape: Tape) -> dict[str, dict[str, Real]]:
        """Write varied parameters, then the state at t = 0 with servos unbalanced; returns each servo's memory and
        states, by joint and name."""
        self._write_varied(tape, self.system.varying)
        self.system.keep_tree(tape.read, tape.write)
        for joint in self.joints:
            for name in ("q", "qd"):
                tape.write(f"{joint}.{name}", self.system.value(f"initial.{joint}.{name}", tape.read))
        base.start(self.system, tape)
        bodies.start(self.system, tape)
        self.step.keep_followers(tape)
        guiding.start(self.system, tape)
        begun = {actuator.use.joint: self._begin_servo(tape, actuator) for actuator in self.system.working}
        if self.system.structure.balanced and self.system.structure.springs:
            balancing.settle_booms(self.system, tape, self.step.state(tape), begun)
        link_sensors.start(self.system, tape, lambda y: gravity(self.system, tape.read, y, 0.0))
        return begun

    def change(self, tape: Tape) -> None:
        """Write anew the parameters that follow the coordinates that change."""
        self._write_varied(tape, [path for coordinate in self.changing for path in coordinate.sets])

    def _write_varied(self, tape: Tape, paths: Iterable[str]) -> None:
        """Write varied parameters, as they follow from the coordinates."""
        experiment = self.system.experiment
        inputs = {coordinate.path: tape.input(coordinate.path) for coordinate in experiment.cases.coordinates}
        values = experiment.formulas.replay(inputs)
        for path in paths:
            tape.write(PARAMETER + path, values[experiment.parameters[path].value.output])  # type: ignore[union-attr]

    def _begin_servo(self, tape: Tape, actuator: Actuator) -> dict[str, Real]:
        """Write a servo's memory and states where a run begins, and return them by name."""
        parts, servo = actuator.parts, actuator.servo
        starts: dict[str, Real] = {part.name: part.start for part in (*parts.memory, *parts.states)}
        if servo.begin is not None:
            p = self.system.servo_values(actuator, tape.read)
            begun = answer(actuator.owner, servo.begin, p, *self._state_of(tape, self.joints[actuator.index]))
            starts.update(returned(actuator.owner, "begin", begun, (state.name for state in parts.natural)))
        for name, value in starts.items():
            tape.write(f"{actuator.path}.{name}", value)
        return starts

    def _begin_sensors(self, tape: Tape, actuator: Actuator) -> None:
        """Write the memory of the servo's sensors, and the seen quantities, where a run begins."""
        natural = {state.name: tape.read(f"{actuator.path}.{state.name}") for state in actuator.parts.natural}
        states = NamedValues(actuator.owner, natural)
        p, state = self.system.servo_values(actuator, tape.read), self._state_of(tape, self.joints[actuator.index])
        seen = Seen(*sensing.measured(actuator, p, *state, states), Setpoint("none", 0.0, 0.0), 0.0, 0.0, states)
        sensing.start(self.system, tape, actuator, seen)
        for quantity in sensing.quantities(actuator) if actuator.use.joint in self.system.failing else ():
            tape.write(cells.SEEN(actuator.use.joint, quantity), sensing.true_value(seen, quantity))

    def end(self, tape: Tape) -> None:
        """The phase at a run's end: excesses over limits, metrics and read-back parameters become outputs."""
        self.limits.keep_excess(tape)
        for name in (*OUTPUTS, *self.watched):
            tape.output(name, tape.read(name))
        for name, metric, _ in self.system.metrics:
            p, held = self._metric(tape, name)
            tape.output(METRIC + name, answer(f"metric `{name}`", metric.result, p, held, tape.time))
        for coordinate in self.system.experiment.cases.coordinates:
            tape.output(COORDINATE + coordinate.path, tape.input(coordinate.path))
        for name, cell in self.step.beds.wire_outputs.items():
            tape.output(name, tape.read(cell))

    # Sensors of links, guides and servos.

    def _sensors(self, divisor: int) -> Body:
        return lambda tape: link_sensors.tick(self.system, tape, divisor)

    def _guides(self, divisor: int) -> Body:
        """The phase that ticks the guides of this divisor."""

        def body(tape: Tape) -> None:
            for use in guiding.ticking(self.system):
                if use.divisor == divisor:
                    guiding.tick(self.system, tape, use)

        return body

    def _servos(self, divisor: int) -> Body:
        """The phase that ticks the servos' computers of this divisor."""

        def body(tape: Tape) -> None:
            for actuator in self.system.working:
                if actuator.ticks and actuator.use.divisor == divisor:
                    self._tick(tape, actuator)

        return body

    def _tick(self, tape: Tape, actuator: Actuator) -> None:
        """One tick of one servo's computer, on the state at this time."""
        joint = self.joints[actuator.index]
        setpoint = self.setpoint(tape, actuator)
        if actuator.use.command is not None:
            tape.write(f"{actuator.path}.command", setpoint.value)
        on_bed, between = self.step.beds.seen(tape, actuator), actuator in self.system.ticking_between

        def state(channel: str) -> Real:
            return self._carried_state(tape, channel) if between else tape.read(channel)

        if on_bed is not None:
            q, qd = on_bed
        else:
            q, qd = self._carried(tape, actuator) if between else self._state_of(tape, joint)
        states = {natural.name: state(f"{actuator.path}.{natural.name}") for natural in actuator.parts.natural}
        if on_bed is None:
            p = self.system.servo_values(actuator, tape.read)
            q, qd = sensing.measured(actuator, p, q, qd, NamedValues(actuator.owner, states))
        seen = self.seen(actuator, q, qd, setpoint, tape.time, states)
        seen = sensing.seen_at_tick(self.system, tape, actuator, seen, state)
        if joint in self.system.failing:
            seen = sensing.seen(self.system, actuator, tape.read, seen, cells.SEEN(joint, ""))
            for quantity in sensing.quantities(actuator):
                tape.write(cells.SEEN(joint, quantity), sensing.true_value(seen, quantity))
        for fitted in actuator.sensors:
            tape.write(fitted.path, sensing.true_value(seen, sensing.quantity(fitted)))
        if on_bed is not None:
            self.step.beds.want(tape, actuator, seen)
        self.compute(tape, actuator, seen)

    def setpoint(self, tape: Tape, actuator: Actuator) -> Setpoint:
        """The setpoint of a servo's joint at this tick."""
        return guiding.setpoint(self.system, actuator, tape.read, tape.time)

    def seen(
        self,
        actuator: Actuator,
        q: Real,
        qd: Real,
        setpoint: Setpoint,
        time: Real,
        states: Mapping[str, Real] | None = None,
    ) -> Seen:
        """The quantities of a servo's joint at a tick, before its sensors."""
        period = actuator.use.divisor / self.schedule.base_hz
        return Seen(q, qd, setpoint, period, time, NamedValues(actuator.owner, states or {}))

    def compute(self, tape: Tape, actuator: Actuator, seen: Seen) -> None:
        """Run the servo's computer once on its inputs: new outputs, and integrals one tick on."""
        parts, period = actuator.parts, seen.period
        held = NamedValues(
            actuator.owner, {part.name: tape.read(f"{actuator.path}.{part.name}") for part in parts.memory}
        )
        p = self.system.servo_values(actuator, tape.read)
        control = sensing.law_outputs(self.system, actuator, tape.read, p, seen.time, law(actuator, p, held, seen))
        for name, slope in control.slopes.items():
            path = f"{actuator.path}.{name}"
            tape.write(path, tape.read(path) + period * slope)
        for name, value in control.outputs.items():
            tape.write(f"{actuator.path}.{name}", value)

    def _carried(self, tape: Tape, actuator: Actuator) -> tuple[Real, Real]:
        """Joint position and rate between instants, extrapolated with the acceleration of the step just done."""
        joint = self.joints[actuator.index]
        q, qd = self._state_of(tape, joint)
        a, s = tape.read(cells.CARRY(joint)), self._since(tape)
        rate = qd + s * a
        rate = where(both(self.step.has_dry_friction(tape, joint), qd * rate < 0.0), 0.0, rate)
        return q + s * qd + 0.5 * s * s * a, rate

    def _carried_state(self, tape: Tape, state: str) -> Real:
        """A servo's state between instants, extrapolated by its change over the step just done."""
        x = tape.read(state)
        carried = x + self._since(tape) * tape.read(cells.CARRY(state))
        return where(both(self.step.has_dry_friction(tape, state), x * carried < 0.0), 0.0, carried)

    def _since(self, tape: Tape) -> Real:
        """Time since the last instant, s."""
        steps = tape.tick - self.schedule.dynamics * floor(tape.tick / float(self.schedule.dynamics))
        return steps / self.schedule.base_hz

    @staticmethod
    def _state_of(tape: Tape, joint: str) -> tuple[Real, Real]:
        return tape.read(f"{joint}.q"), tape.read(f"{joint}.qd")

    # Watched channels, metrics and the recorder.

    def _watch(self, tape: Tape) -> None:
        joints, names = len(self.joints), self.step.coordinates
        numbers = [i if i < joints else joints + (i - joints) // bodies.SIX for i in range(len(names))]
        plausible.watch(tape, names, numbers)

    def _metric(self, tape: Tape, name: str) -> tuple[NamedValues, NamedValues]:
        """The parameters and the memory of a metric."""
        metric = next(model for known, model, _ in self.system.metrics if known == name)
        owner = f"metric `{name}` (model {metric.name})"
        path = f"metrics.{name.removesuffix(FURTHEST)}"
        p = parameters(owner, path, metric.parameters, lambda path: self.system.value(path, tape.read))
        held = {memory.name: tape.read(f"{METRIC}{name}.{memory.name}") for memory in metric.memory}
        return p, NamedValues(owner, held)

    def _metrics(self, divisor: int) -> Body:
        """The body of the phase that updates the metrics of channels with this divisor."""
        period = divisor / self.schedule.base_hz

        def body(tape: Tape) -> None:
            """Update the metrics that are evaluated at this rate, each from its channel."""
            is_new: dict[str, Truth] = {}
            dt = where(tape.tick == 0.0, 0.0, period)
            for name, metric, channel in self.system.metrics:
                if channel.divisor == divisor:
                    p, held = self._metric(tape, name)
                    owner = f"metric `{name}` (model {metric.name})"
                    new = answer(owner, metric.update, p, held, tape.read(channel.path), tape.time, dt)
                    returned(owner, "update", new, (memory.name for memory in metric.memory))
                    if name in self.limits.extremes:
                        is_new[name] = new[metric.extreme] != getattr(held, metric.extreme)
                    for memory, value in new.items():
                        tape.write(f"{METRIC}{name}.{memory}", value)
            for name, new_extreme in is_new.items():  # last, so that the metrics' own code is the same as without it
                self.limits.at_extreme(tape, name, new_extreme)

        return body

    def _expressions(self, divisor: int) -> Body:
        """The phase that computes the deck's expressions of this rate, from parameters and channels as last sampled."""

        def body(tape: Tape) -> None:
            """Compute the signals of expressions that are evaluated at this rate."""
            for expression in self.system.structure.expressions:
                if self.system.channels[expression.name].divisor == divisor:
                    values = {
                        name: tape.read(name.removeprefix(CHANNEL_INPUT))
                        if name.startswith(CHANNEL_INPUT)
                        else tape.input(name)
                        for name in expression.formula.inputs
                    }
                    (value,) = expression.formula.replay(values)
                    tape.write(expression.name, value)

        return body

    def _observe(self, held: list[Channel]) -> Body:
        """The phase that computes derived channels at every instant, and keeps them in cells."""

        def body(tape: Tape) -> None:
            by_path = observe.values(tape, self.step.observed(tape), held, observe.INSTANT)
            for path, value in by_path.items():
                tape.write(path, value)

        return body

    def _recorder(self, columns: list[str], held: list[Channel], at_rows: list[Channel]) -> Body:
        """The recorder. held: derived channels that are computed at every instant. at_rows: those that only the
        recorder needs, computed where a row is kept."""
        seen = [channel for channel in held if channel.path in columns]

        def body(tape: Tape) -> None:
            """Record a row: derived channels that only it needs are computed now, others read from their cells."""
            fresh = observe.held(tape, seen)
            if at_rows:
                fresh |= observe.values(tape, self.step.observed(tape), at_rows, observe.ROW)
            for column, path in enumerate(columns):
                tape.record(column, fresh[path] if path in fresh else tape.read(path))

        return body

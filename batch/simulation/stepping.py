"""One case of a run, stepped from tick to tick by commands from outside, in a loop of the caller's.

The program is the run's own, with each command's value as an input, so the bits are those of a run with these commands.
The observation at an instant is that before the new commands: the tick is done once with the former commands, then the
case's memory is restored, and the tick is done with the new ones.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from batch.simulation.given import measured, real, short_repr
from ic.driver.given_values import GivenRun, VariedRun
from ic.text.complaints import known_words
from met import run as engine
from met.causes import causes_of
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import REPEAT, Recorded, ServoUse, Structure
from met.plan.channel import COMMAND_UNIT, joint_unit, recordable
from met.program import plausible
from met.program.build import METRIC, UNHELD
from met.program.step import FAILURE
from met.program.system import PARAMETER

LANES = 4
"""Number of cases of the kernel's block, of which one is stepped: the narrowest blocks are not the fastest."""

MOST_SHOWN = 7
"""Largest number of commands of an example."""

ALWAYS_SEEN = ("q", "qd")
"""Signals that are observed whatever a run records."""


@dataclass
class SteppedProgram:
    """The program of a run whose commands come from outside.

    paths     of the commands' values, in the order of `joints`
    divisor   base ticks between steps
    columns   of what is seen, by name: where its numbers are in a row, and its shape
    """

    varied: VariedRun
    prepared: engine.Prepared
    joints: tuple[str, ...]
    paths: tuple[str, ...]
    divisor: int
    columns: dict[str, tuple[slice, tuple[int, ...]]]


class Observation:
    """The observation of an instant: `time` (s), positions `q` and rates `qd` of all joints, and other recorded signals
    by name, `seen["tau"]`, in SI. Later steps do not change it."""

    __slots__ = ("_columns", "row", "time")

    def __init__(self, time: float, row: np.ndarray, columns: dict[str, tuple[slice, tuple[int, ...]]]) -> None:
        self.time, self.row, self._columns = time, row, columns

    def __getitem__(self, name: str) -> Any:
        """A signal: a number, or an array of the signal's shape at one instant, (joint, component)."""
        if name not in self._columns:
            helps = [*did_you_mean(name, self._columns), known_words("seen are", self._columns)]
            raise Problem(
                error("E432", f"no `{name}` is seen", help=[*helps, '`start(..., record=["..."])` says what is'])
            )
        where, shape = self._columns[name]
        values = self.row[where]
        return values.reshape(shape) if shape else float(values[0])

    @property
    def q(self) -> np.ndarray:
        """Positions of the moving joints, rad (m), in the arm's order."""
        return np.asarray(self["q"])

    @property
    def qd(self) -> np.ndarray:
        """Rates of the moving joints, rad/s (m/s), in the arm's order."""
        return np.asarray(self["qd"])

    def keys(self) -> tuple[str, ...]:
        """The names of the observed signals."""
        return tuple(self._columns)

    def __repr__(self) -> str:
        return f"Observation at {self.time:g} s of {', '.join(self._columns)}"


class SteppedRun:
    """A case under way.

    state = sim.start({"load": "25 kg"}, commands=["shoulder", "elbow"])
    while not state.done:
        seen = state.step(control(state.seen))

    seen     what is seen now (`Observation`)
    joints   whose commands `step` takes, in this order
    period   s between two steps
    done     whether the run's end is reached, or the case has failed
    """

    def __init__(self, program: SteppedProgram, table: Mapping[str, np.ndarray], repeat: int) -> None:
        """Begin the case and observe it at tick 0. table: its varied values by path, SI, one each; repeat: of its
        noise"""
        self._program, self._prepared = program, program.prepared
        experiment = self._prepared.experiment
        self.joints, self.period = program.joints, program.divisor / experiment.structure.schedule.base_hz
        input_values = [float(table[coordinate.path][0]) for coordinate in experiment.cases.coordinates]
        input_values += [
            float(repeat) if name == REPEAT else float(experiment.cases.seed) for name in experiment.cases.noise
        ]
        self._block = block = self._prepared.kernel.block(np.array([input_values]).reshape(1, -1))
        names, cells = self._prepared.program.inputs, self._prepared.recording.cells
        self._command_inputs = [block.inputs[names.index(path)] for path in program.paths]
        self._held = [block.state[cells.index(PARAMETER + path)] for path in program.paths if PARAMETER + path in cells]
        outputs = self._prepared.program.outputs
        alarms = [name for name in (FAILURE[0], plausible.FAILED_TICK, UNHELD) if name in outputs]
        self._alarms = [block.outputs[outputs.index(name)] for name in alarms]
        self._memory = np.empty_like(block.state)
        self._base_hz = experiment.structure.schedule.base_hz
        self._last = experiment.structure.schedule.ticks
        self._tick = 0
        self.done = False
        self.seen = self._look()

    def step(self, commands: Any) -> Observation:
        """Hold these commands from now to the next step; returns the observation there.

        commands  one number for each of `joints`, in the SI unit of its command: rad/s, rad, N m (m/s, m, N)

        Raises Problem E436 for other commands, E437 once `done`.
        """
        if self.done:
            raise self._over()
        values = self._checked(commands)
        for value, held_inputs in zip(values, self._command_inputs, strict=True):
            held_inputs[:] = value
        for value, held in zip(values, self._held, strict=True):
            held[:] = value
        first, self._tick = self._tick, self._tick + self._program.divisor
        self._block.step(first, self._tick - 1)
        self.seen = self._look()
        return self.seen

    @property
    def failed(self) -> bool:
        """True where the case has failed; `cause` says why."""
        return any(alarm[0] != 0.0 for alarm in self._alarms)

    @property
    def cause(self) -> str:
        """The cause of the failure, as in an archive's variable `cause`; empty where the case has not failed."""
        if not self.failed:
            return ""
        names = self._prepared.program.outputs
        outputs = self._block.outputs[: len(names), :1].T.copy()
        engine.judge(names, outputs)
        by_name = {name: outputs[:, column] for column, name in enumerate(names)}
        return causes_of(self._prepared.experiment, self._block.inputs[:, :1].T, by_name)[0]

    @property
    def metrics(self) -> dict[str, float]:
        """The run's metrics by name, SI, as they would be if it ended now."""
        names = self._prepared.program.outputs
        return {
            use.name: float(self._block.outputs[names.index(METRIC + use.name), 0])
            for use in self._prepared.experiment.structure.metrics
        }

    def _look(self) -> Observation:
        """Do the tick with the former commands, and restore the memory."""
        block, tick = self._block, self._tick
        np.copyto(self._memory, block.state)
        row = block.recorded(tick, tick)
        np.copyto(block.state, self._memory)
        if tick + self._program.divisor > self._last or self.failed:
            self.done = True
        return Observation(tick / self._base_hz, row[0, 0], self._program.columns)

    def _checked(self, commands: Any) -> list[float]:
        """The commands in a row, one for each joint. Raises Problem E436."""
        listed, units = measured(commands)
        if hasattr(listed, "__array__"):
            listed = np.atleast_1d(np.asanyarray(listed)).tolist()
        elif not isinstance(listed, list | tuple):
            listed = [listed]
        numbers = [real(command) for command in listed]
        values = [value for value in numbers if value is not None]
        if units is not None or not len(numbers) == len(values) == len(self._command_inputs):
            message = (
                f"commands are a finite number for each of {', '.join(self.joints)}, and not {short_repr(commands)}"
            )
            order = ", in this order" if len(self.joints) > 1 else ""
            example = ", ".join(f"0.{place}" for place in range(1, 1 + min(len(self.joints), MOST_SHOWN)))
            more = ", ..." if len(self.joints) > MOST_SHOWN else ""
            raise Problem(error("E436", message, help=f"in SI{order}: `state.step([{example}{more}])`"))
        return values

    def _over(self) -> Problem:
        why = f"the case has failed: {self.cause}" if self.failed else f"the run ends at {self.seen.time:g} s"
        return Problem(error("E437", why, help="begin another: `sim.start(...)`; `state.done` says when"))


def program(
    run: GivenRun,
    first: Mapping[str, tuple[float, str]],
    *,
    kinds: Mapping[str, str],
    record: Sequence[str] | None,
    repeated: bool,
) -> SteppedProgram:
    """The program of a run that is stepped.

    first  values that it is compiled with, by path, and their units
    kinds  of commands, by the joints that are commanded from outside; "" for the deck's

    Raises Problem, E435 for a joint that cannot be commanded from outside.
    """
    uses = {use.joint: use for use in run.experiment.structure.servos}
    for joint in kinds:
        if joint not in uses:
            helps = [*did_you_mean(joint, uses), known_words("joints with a servo", uses)]
            raise Problem(error("E435", f"no servo moves a joint `{joint}`", help=helps))
    if not kinds:
        raise Problem(
            error(
                "E435", "no joint is commanded from outside", help=f'name some: `commands=["{next(iter(uses), "")}"]`'
            )
        )
    structure = run.experiment.structure
    taken = {
        joint: _command(uses[joint], kind, structure, is_set=run.sets(f"{joint}.servo.command"))
        for joint, kind in kinds.items()
    }
    values = {f"{joint}.servo.command.value": (0.0, command.unit) for joint, command in taken.items()}
    words = {f"{joint}.servo.command": command.word for joint, command in taken.items() if command.word}
    varied = run.vary({**first, **values}, repeat=2 if repeated else 1, words=words)
    structure = varied.experiment.structure
    divisor = math.lcm(math.gcd(*(uses[joint].divisor for joint in taken)), structure.schedule.dynamics)
    seen = _seen(structure, record)
    structure = replace(varied.experiment.structure, record=seen, schedule=replace(structure.schedule, record=divisor))
    experiment = replace(varied.experiment, structure=structure)
    columns, place = {}, 0
    for recording in seen:
        columns[recording.name] = slice(place, place + len(recording.channels)), recording.shape
        place += len(recording.channels)
    return SteppedProgram(
        varied, engine.prepare(experiment, lanes=LANES), tuple(taken), tuple(values), divisor, columns
    )


@frozen
class OutsideCommand:
    """A joint's command from outside. unit: of its value, SI; word: the deck's text for it, "" where the deck has such
    a command"""

    unit: str
    word: str


def _command(use: ServoUse, kind: str, structure: Structure, *, is_set: bool) -> OutsideCommand:
    """The command of a joint, of a kind; "" for that of the deck. Raises Problem E435.

    is_set  whether it is what the settings make it: then it is written anew
    """
    command = use.command
    kind = kind or (command.kind if command is not None else "")
    if kind not in COMMAND_UNIT:
        message = f"joint `{use.joint}` has no command `{kind}`" if kind else f"joint `{use.joint}` has no command"
        helps = [known_words("kinds are", COMMAND_UNIT), f'`commands={{"{use.joint}": "torque"}}`']
        raise Problem(error("E435", message, help=helps))
    if use.continuous:
        message = f"the law of joint `{use.joint}` is continuous: it has no tick at which it takes a command"
        raise Problem(error("E435", message, help=f'give it a rate: `set={{"{use.joint}.servo.rate": "1 kHz"}}`'))
    (joint,) = (joint for joint in structure.moving if joint.name == use.joint)
    unit = joint_unit(COMMAND_UNIT[kind], joint)
    is_decks = (
        not is_set and command is not None and (command.kind, command.model, command.guide) == (kind, "constant", "")
    )
    return OutsideCommand(unit, "" if is_decks else f"{kind}(0 {unit})")


def _seen(structure: Structure, record: Sequence[str] | None) -> tuple[Recorded, ...]:
    """The signals observed at each step: q, qd, and these channels; None: those that the deck records. Raises Problem
    E432."""
    known = recordable(structure, record or ())
    signals = {recording.name: recording for name in ALWAYS_SEEN for recording in known[name]}
    if record is None:
        return tuple({**signals, **{recording.name: recording for recording in structure.record}}.values())
    for name in record:
        if name not in known:
            helps = [*did_you_mean(name, known), "`met plan DECK` lists the channels of a run"]
            raise Problem(error("E432", f"no channel `{name}` in this run", help=helps))
        signals |= {recording.name: recording for recording in known[name]}
    return tuple(signals.values())

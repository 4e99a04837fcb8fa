"""Linear answers about one case at an instant: states, A, B, C, D, poles with participation, natural modes, loops."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from met import run as engine
from met.analysis.linear.flow import Flow
from met.analysis.linear.jacobian import PeriodMap, at_instants, failed, period_maps
from met.analysis.linear.margins import (
    FARTHEST,
    STABLE,
    LoopMargins,
    ScalarLoop,
    bandwidth,
    comes_back,
    gain_limits,
    margins,
)
from met.analysis.linear.period import PeriodProgram
from met.analysis.linear.plant import PlantModel, plants
from met.analysis.linear.shafts import CreepingRate, creeping
from met.analysis.linear.standing import moves, refusal, settled, standing, weak
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.messages.message import nearest
from met.plan import Experiment, Recorded, Structure
from met.plan.channel import recordable
from met.plan.linear_signals import InputSignal, input_signals, no_computer

MOST_TICKS = 5000
"""Ticks of the base rate in a period, at most: each takes some 10 ms."""

MOST_TOGETHER = 256
"""Cases that are run up to an instant together: so many that their memory stays small."""

SETTLED = 1e-12
"""Size of a pole, per period, up to which its mode has vanished after one period."""

STAYS = 1e6
"""Number of periods within which a pole hardly decays or grows, for its mode to count as lasting."""

GROWS = 0.01
"""Growth over the length of a run up to which an arm is not called unstable: while it moves, its poles move too."""

TINY = 1e-14
"""Share of the largest number of a column at which a state does not act on another."""


@frozen
class Pole:
    """A mode of a linear map or of a plant; of a conjugate pair, the one with positive frequency.

    z       what a period makes of it; of a plant 0
    s       1/s: ln z over the period; of a plant its root. -inf: gone within a period
    shares  how much each state takes part, largest first: the sum is 1
    """

    z: complex
    s: complex
    shares: tuple[tuple[str, float], ...]

    @property
    def hz(self) -> float:
        """The undamped natural frequency, |s|/(2 pi), Hz."""
        return abs(self.s) / (2.0 * math.pi) if math.isfinite(self.s.real) else math.inf

    @property
    def damping(self) -> float:
        """The damping ratio, -Re s/|s|: 1 without oscillation, below 0 for growth, 0 for a mode that neither grows nor
        decays."""
        if not math.isfinite(self.s.real):
            return 1.0
        return -self.s.real / abs(self.s) if self.s else 0.0

    def stays(self, seconds: float) -> bool:
        """True where the mode neither decays nor grows, with periods of this length: a position under a rate loop."""
        return self.seconds > STAYS * seconds

    @property
    def seconds(self) -> float:
        """The time in which the mode decays, or grows, by e, s; infinite where it does neither."""
        return 1.0 / abs(self.s.real) if self.s.real else math.inf


@frozen
class OpenLoop:
    """A loop that is opened at a signal, or several that are opened at once.

    paths    of the signals;  ticks: of it in a period
    loop     as it is open; None where it ticks more than once in a period, or several are opened
    margins  None where it is unstable as it is, or `loop` is None
    gains    times all gains at which it becomes unstable, below 1 and above: None: at none
    stable   as it is
    returns  False where nothing comes back: the arm is held, or the law is at its limit
    """

    paths: tuple[str, ...]
    ticks: int
    loop: ScalarLoop | None
    margins: LoopMargins | None
    gains: tuple[float | None, float | None]
    stable: bool
    returns: bool

    @property
    def searched(self) -> float | None:
        """The largest factor on the gain up to which, and the smallest down to which, a limit was searched for; None
        where the search was complete: limits of a loop of one rate are eigenvalues."""
        return FARTHEST if self.margins is None and self.stable and self.returns else None

    @property
    def unstable(self) -> bool:
        """True for a loop that grows; where nothing comes back, growth is not due to its gain."""
        return self.returns and not self.stable


@frozen
class Linearized:
    """A case of an experiment, linearised over a period that begins at `time`, s.

    seconds   of the period
    states    by name;  inputs, outputs: channels
    A .. D    x+ = A x + B u, y = C x + D u, from period to period, inputs added to at all ticks of one
    plant     the arm without its computers, in continuous time
    held      what sticks, or is locked;  locked: joints that are
    creeping  what slides so slowly that it nearly does;  at_limit: paths of limits
    joints    of each state, the joint or body or computer that it belongs to
    stands    whether it stands still there, and `time` is none of the run's
    bandwidth  from its only input to its only output, Hz (`margins.bandwidth`); not a number without them
    bending   frequency of the first bending mode, Hz (`PlantModel.first_bending`); infinite without one
    """

    experiment: str
    case: int
    time: float
    seconds: float
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    plant: PlantModel
    loops: tuple[OpenLoop, ...]
    held: tuple[str, ...]
    creeping: tuple[CreepingRate, ...]
    at_limit: tuple[str, ...]
    joints: Mapping[str, str]
    stands: bool = False
    locked: tuple[str, ...] = ()
    bandwidth: float = math.nan
    bending: float = math.inf

    @property
    def where(self) -> str:
        """The instant in words, or that the arm stands still."""
        return "where it stands still" if self.stands else f"at t = {self.time:.6g} s"

    @property
    def poles(self) -> tuple[Pole, ...]:
        """Its modes, the slowest first."""
        poles = [_of_period(z, shares, self.seconds) for z, shares in _modes(self.A, self.states)]
        return tuple(sorted(poles, key=lambda pole: (pole.hz, -pole.damping)))

    @property
    def natural(self) -> tuple[Pole, ...]:
        """Natural modes of the arm on its gears and springs while its computers hold, the slowest first."""
        poles = [Pole(0j, s, shares) for s, shares in _modes(self.plant.A, self.plant.states) if s.imag > 0.0]
        return tuple(sorted(poles, key=lambda pole: pole.hz))

    def by_joint(self, pole: Pole) -> tuple[tuple[str, float], ...]:
        """The share of each joint that takes part in a mode, largest first."""
        shares: dict[str, float] = {}
        for state, share in pole.shares:
            shares[self.joints[state]] = shares.get(self.joints[state], 0.0) + share
        return tuple(sorted(shares.items(), key=lambda joint_share: -joint_share[1]))


@frozen
class LinearQuestion:
    """A question about an experiment's cases at the last start of a period up to `at`, s.

    inputs   channels of servos that tick: commands, outputs of laws
    outputs  channels, or what records several (`q`, `links.tip.position`)
    opened   outputs of laws, at which loops are opened: each by itself, and all of them at once
    stands   whether the experiment is one that is to stand still (`standing`)
    """

    experiment: Experiment
    at: float = 0.0
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    opened: tuple[str, ...] = ()
    stands: bool = False

    @cached_property
    def program(self) -> PeriodProgram:
        """The program, one for all cases. Raises Problem D372 where `at` is not in the run, D373 for an unknown name,
        D374 where the period is too long."""
        experiment = self.experiment
        if not 0.0 <= self.at <= experiment.structure.schedule.duration:
            raise _outside(experiment, self.at)
        every = input_signals(experiment.structure)
        solved = [signal.path for signal in every if not signal.is_output] if self.stands else []
        paths = tuple(dict.fromkeys((*self.inputs, *self.opened, *solved)))
        named = _named(experiment.structure, every, paths, self.opened)
        program = PeriodProgram(experiment, named, _records(experiment, self.outputs))
        if program.ticks > MOST_TICKS:
            raise _too_long(program)
        return program

    @property
    def loops(self) -> list[tuple[str, ...]]:
        """The loops to open, each as its signals: those of `opened` one by one, and all of them at once."""
        return [(path,) for path in self.opened] + ([self.opened] if len(self.opened) > 1 else [])

    def flows(self, inputs: np.ndarray, threads: int | None = None) -> list[Flow | None]:
        """The cases where the answer's period begins, as in the run; None for one that has failed before. inputs: the
        program's inputs, [case, input]"""
        return at_instants(self.program, inputs, self.program.begin(self.at), threads)

    def lifted(self, flows: Sequence[Flow]) -> list[LiftedPeriod | Problem]:
        """The maps of the periods that begin where flows of `program` stand; Problem D370 in place of one across an
        event."""
        return [
            period if isinstance(period, Problem) else _lifted(self.program, period)
            for period in period_maps(self.program, flows)
        ]

    def of(self, case: int) -> Linearized:
        """The answers about a row of the case table. Raises Problem D370 where an event is in the period, D371 where
        the run has failed before, D377 where the arm does not stand, and as `program` does."""
        (answer,) = self.of_cases([case])
        if isinstance(answer, Problem):
            raise answer
        return answer

    def of_cases(self, rows: Sequence[int]) -> Iterator[Linearized | Problem]:
        """The answer or Problem of each of these rows, of the bits of `of`. Raises Problem as `program` does."""
        for first in range(0, len(rows), MOST_TOGETHER):
            some = rows[first : first + MOST_TOGETHER]
            inputs = engine.inputs(self.experiment, np.array(some))
            stand, refused = list[Flow](), dict[int, Problem]()
            begun = self.flows(inputs)
            solved = iter(settled(self.program, [flow for flow in begun if flow]) if self.stands else begun)
            for place, flow in enumerate(begun):
                stood = None if flow is None else next(solved)
                if flow is None:
                    refused[place] = failed(self.experiment, self.program.begin(self.at))
                elif stood is None:
                    too_weak = weak(self.experiment, inputs[place : place + 1])[0]
                    refused[place] = refusal(self.experiment, too_weak or moves(self.program, flow))
                else:
                    stand.append(stood)
            answers = iter(self._answers([case for k, case in enumerate(some) if k not in refused], stand))
            yield from (refused[k] if k in refused else next(answers) for k in range(len(some)))

    def _answers(self, cases: Sequence[int], flows: Sequence[Flow]) -> Iterator[Linearized | Problem]:
        """The answers about cases where their flows stand, or the Problems in their place."""
        periods = self.lifted(flows)
        pairs = [(flow, period) for flow, period in zip(flows, periods, strict=True) if not isinstance(period, Problem)]
        own = [flow for flow, _ in pairs]
        more = zip(creeping(own), plants(self.program, own, [period.states for _, period in pairs]), strict=True)
        for case, lifted in zip(cases, periods, strict=True):
            yield lifted if isinstance(lifted, Problem) else self._answer(case, lifted, *next(more))

    def _answer(self, case: int, lifted: LiftedPeriod, slow: tuple[CreepingRate, ...], plant: PlantModel) -> Linearized:
        """The answers about one case from the maps of its period, with the ticks of an input summed."""
        program, inputs, period = self.program, self.inputs, lifted.map
        paths = [program.inputs[tick.entry].path for tick in period.ticks]

        def summed(columns: np.ndarray) -> np.ndarray:
            """Columns of a matrix, [row, tick of an input], with those of each input added up."""
            own = [
                columns[:, [k for k, path_of_tick in enumerate(paths) if path_of_tick == path]].sum(1)
                for path in inputs
            ]
            return np.array(own).T.reshape(len(columns), len(inputs))

        return Linearized(
            self.experiment.name, case, period.tick / program.schedule.base_hz, period.seconds, lifted.states, inputs,
            period.outputs, lifted.A, summed(lifted.B), lifted.C, summed(period.D), plant,
            tuple(lifted.opened(loop) for loop in self.loops), period.held, slow, period.at_limit,
            {name: program.joint_of(name) for name in program.states}, self.stands, period.locked,
            lifted.bandwidth(inputs), plant.first_bending(self.experiment.structure.springs),
        )  # fmt: skip


def _lifted(program: PeriodProgram, period: PeriodMap) -> LiftedPeriod:
    """The map of a period, restricted to the states that act on something."""
    places = _acting_states(program, period)
    states = tuple(period.states[place] for place in places)
    return LiftedPeriod(
        period.A[np.ix_(places, places)], period.B[places], period.C[:, places], period.Wx[:, places], period.Wu,
        states, program, period,
    )  # fmt: skip


def linear(
    experiment: Experiment,
    *,
    case: int = 0,
    at: float = 0.0,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    opened: Sequence[str] = (),
) -> Linearized:
    """The answers about one case (`LinearQuestion`). Raises Problem D370 to D374."""
    return LinearQuestion(experiment, at, tuple(inputs), tuple(outputs), tuple(opened)).of(case)


def of_deck(experiment: Experiment, name: str | None = None) -> LinearQuestion:
    """The question of a `linear` block of a run; None: of its only one. Raises Problem D376."""
    known = {use.name: use for use in experiment.linear}
    if name is None and len(known) == 1:
        (name,) = known
    if name is None or name not in known:
        message = f"there is no `linear {name}` in `{experiment.name}`"
        if name is None:
            message = f"`{experiment.name}` has {len(known) or 'no'} `linear` blocks, and none is named"
        near = nearest(name, known) if name is not None else None
        helps = [f"did you mean `{near}`?"] if near else []
        helps += ["there are " + ", ".join(f"`{block}`" for block in known)] if known else []
        raise Problem(error("D376", message, experiment.place, help=tuple(helps)))
    use = known[name]
    posed = experiment if use.pose is None else standing(experiment, use.pose)
    return LinearQuestion(posed, use.at, use.inputs, use.outputs, use.opened, use.pose is not None)


def question_of(
    experiment: Experiment,
    of: str | None = None,
    *,
    at: float | None = None,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    opened: Sequence[str] = (),
) -> LinearQuestion:
    """The question of a run's `linear` block where one is named, or where nothing is asked and there is only one; else
    one made of the arguments, at 0 s where no instant is given. Raises Problem D376, and ValueError where both are
    asked."""
    asks = [key for key, value in (("inputs", inputs), ("outputs", outputs), ("opened", opened)) if value]
    asks = ["at", *asks] if at is not None else asks
    if of is not None and asks:
        raise ValueError(f"`{asks[0]}` asks, and so does `of`, {of!r}: leave one of them out")
    if of is not None or (experiment.linear and not asks):
        return of_deck(experiment, of)
    return LinearQuestion(experiment, at or 0.0, tuple(inputs), tuple(outputs), tuple(opened))


@frozen
class LiftedPeriod:
    """The map of a period with each tick of each input apart, restricted to the states that act on something.

    A, B, C, Wx, Wu  as `PeriodMap` has them, of these states
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    Wx: np.ndarray
    Wu: np.ndarray
    states: tuple[str, ...]
    program: PeriodProgram
    map: PeriodMap

    @property
    def drift(self) -> float:
        """Growth of a period up to which it counts as none."""
        return max(STABLE, GROWS * self.map.seconds / self.program.schedule.duration)

    @property
    def poles(self) -> list[Pole]:
        """The poles without participation, unordered."""
        roots = np.linalg.eigvals(self.A).tolist() if len(self.A) else []
        return [_of_period(complex(z), (), self.map.seconds) for z in roots]

    def bandwidth(self, inputs: Sequence[str]) -> float:
        """The bandwidth from the only one of these inputs, at all its ticks alike, to the only output, Hz; not a
        number where there are several or none."""
        ticks = [k for k, tick in enumerate(self.map.ticks) if self.program.inputs[tick.entry].path in inputs]
        if len(inputs) != 1 or len(self.C) != 1:
            return math.nan
        B, D = self.B[:, ticks].sum(1), float(self.map.D[0, ticks].sum())
        return bandwidth(ScalarLoop(self.A, B, self.C[0], D, self.map.seconds, self.drift))

    def opened(self, paths: tuple[str, ...]) -> OpenLoop:
        """The loop that is opened at these signals, from what is put in there to what comes back, with its margins."""
        ticks = [k for k, tick in enumerate(self.map.ticks) if self.program.inputs[tick.entry].path in paths]
        Wx, inverse, B = self.Wx[ticks], np.linalg.inv(self.Wu[np.ix_(ticks, ticks)]), self.B[:, ticks]
        A, b, c, d = self.A - B @ inverse @ Wx, B @ inverse, inverse @ Wx, np.eye(len(ticks)) - inverse
        drift = self.drift
        scalar_loop = ScalarLoop(A, b[:, 0], c[0], float(d[0, 0]), self.map.seconds, drift) if len(ticks) == 1 else None
        own = None if scalar_loop is None else margins(scalar_loop)
        if scalar_loop is not None and own is not None:
            gains: tuple[float | None, float | None] = own.gain_down, own.gain_up
        else:
            gains = gain_limits(A, b, c, d, drift)
        stable = bool(np.max(np.abs(np.linalg.eigvals(self.A)), initial=0.0) <= 1.0 + drift)
        return OpenLoop(paths, len(ticks), scalar_loop, own, gains, stable, comes_back(A, b, c, d))


def _acting_states(program: PeriodProgram, period: PeriodMap) -> np.ndarray:
    """Places of the arm's states, and of those through which it, or an input, acts on the arm or on an output."""
    n, step = len(period.states), program.builder.step
    arm = {*program.positions, *program.rates, *step.states, *program.of_beds}
    links = np.abs(period.A) > TINY * np.max(np.abs(period.A), axis=0, initial=0.0)
    own = np.array([name in arm for name in period.states], dtype=bool)
    reached = _closed(links, own | np.any(period.B != 0.0, axis=1))
    acts = _closed(links.T, own | np.any(period.C != 0.0, axis=0) | np.any(period.Wx != 0.0, axis=0))
    return np.flatnonzero(own | (reached & acts)) if n else np.zeros(0, int)


def _closed(links: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Everything that can be reached from the first ones. links: [to, from]"""
    reached = first.copy()
    while True:
        more = reached | np.any(links[:, reached], axis=1)
        if np.array_equal(more, reached):
            return reached
        reached = more


def _modes(A: np.ndarray, names: Sequence[str]) -> Iterable[tuple[complex, tuple[tuple[str, float], ...]]]:
    """Eigenvalues, the one with positive frequency of each pair, with each state's participation |l_i r_i| from the
    left and the right eigenvector."""
    if not len(A):
        return
    roots, right = np.linalg.eig(A)
    weights = np.abs(np.linalg.pinv(right).T * right)
    for place, root in enumerate(roots.tolist()):
        if root.imag < 0.0:
            continue
        shares = weights[:, place] / max(float(weights[:, place].sum()), 1e-300)
        order = np.argsort(-shares, kind="stable").tolist()
        yield complex(root), tuple((names[k], float(shares[k])) for k in order)


def _of_period(z: complex, shares: tuple[tuple[str, float], ...], seconds: float) -> Pole:
    s = cmath.log(z) / seconds if abs(z) > SETTLED else complex(-math.inf, 0.0)
    return Pole(z, s, shares)


def _records(experiment: Experiment, outputs: Sequence[str]) -> tuple[Recorded, ...]:
    """The variables of these names of outputs. Raises Problem D373 for an unknown one."""
    known = recordable(experiment.structure, outputs)
    for name in outputs:
        if name not in known:
            raise _unknown("output", name, known)
    return tuple(recorded for name in outputs for recorded in known[name])


def _named(
    structure: Structure, every: Sequence[InputSignal], paths: Sequence[str], opened: Sequence[str]
) -> tuple[InputSignal, ...]:
    """The signals of these paths. Raises Problem for one that is no input, or at which no loop can be opened."""
    known = {signal.path: signal for signal in every}
    laws = {path: signal for path, signal in known.items() if signal.is_output}
    for path in paths:
        if path in opened and path not in laws:
            raise _unknown("place to open a loop", path, laws, no_computer(structure, path))
        if path not in known:
            raise _unknown("input", path, known, no_computer(structure, path))
    return tuple(known[path] for path in paths)


def _unknown(what: str, name: str, known: Mapping[str, object], why: Sequence[str] = ()) -> Problem:
    """The error that there is no such input or output (D373), with names that may be meant."""
    near = nearest(name, known) if not why else None
    helps = [*why, *([f"did you mean `{near}`?"] if near else [])]
    if known and len(known) <= 12:
        helps.append("there are " + ", ".join(f"`{known_name}`" for known_name in known))
    elif what == "output":
        helps.append("an output is any name that `record` takes")
    return Problem(error("D373", f"there is no {what} `{name}`", help=tuple(helps)))


def _too_long(program: PeriodProgram) -> Problem:
    """The error for computers whose ticks meet too seldom for a linear answer (D374)."""
    experiment = program.experiment
    return Problem(
        error(
            "D374",
            f"the computers of `{experiment.name}` all tick together only every {program.seconds:.6g} s, "
            f"{program.ticks:,} ticks",
            experiment.place,
            help=f"choose rates of which one divides the other: {MOST_TICKS:,} ticks of the base rate are looked at",
        )
    )


def _outside(experiment: Experiment, time: float) -> Problem:
    """The error for a time that is not in the run (D372)."""
    duration = experiment.structure.schedule.duration
    return Problem(
        error(
            "D372",
            f"t = {time:.6g} s is not in the run `{experiment.name}`",
            experiment.place,
            help=f"it goes from 0 to {duration:.6g} s",
        )
    )

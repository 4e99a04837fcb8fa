"""A model's functions called twice on the same numbers: with floats, and recorded and replayed.

What a function is called with follows from its declaration and from the types that the engine hands it, so a field that
these get is drawn too. Random numbers are the same both times: `Numbers` gives a float once, an input of the record
the other time.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, get_type_hints

import numpy as np
import pytest

from met import trace
from met.environments.environment import World
from met.guides.guide import Sight, Stance
from met.integrators.integrator import Motion, Slope
from met.parameter import Parameter
from met.plan import Experiment
from met.program.control.link_sensors import Aboard, Accelerations
from met.program.motion.base import base_of, free_base
from met.program.motion.bodies import coordinates
from met.program.system import System
from met.sensors.sensor import Felt, Sensed
from met.servos.servo import JointMotion, Seen, Servo, Setpoint
from met.substitution.balance import Balanced
from met.substitution.bed import Wire
from met.substitution.law import LawInput
from met.trace import Formulas, Graph, Mask, Real, Scalar
from met.vectors import ZERO, Matrix, Vector
from tests.met.declarations.values import holds, paths
from tests.met.small_models import Use

Draw = Callable[[], float]

SINES = (
    trace.sin,
    trace.cos,
    trace.tan,
    trace.asin,
    trace.acos,
    trace.atan,
    trace.atan2,
    trace.exp,
    trace.log,
    trace.tanh,
)
"""What models may call whose plain form is the platform's, and whose recorded form is MET's own."""


def use_sines_of_ones_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes `SINES` the same functions to floats and to recorded numbers, wherever models have them from.

    So answers are compared to the last bit. How far these are from the platform's is for
    tests/met/trace/test_accuracy.py.
    """
    for function in SINES:
        own = _replayed(function)
        for module in list(sys.modules.values()):
            if getattr(module, "__dict__", {}).get(function.__name__) is function:
                monkeypatch.setattr(module, function.__name__, own)


def _replayed(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function whose plain form is its recorded one, replayed."""
    names = ("y", "x") if function is trace.atan2 else ("x",)
    graph = Graph()
    formulas = Formulas.of(graph, [function(*map(graph.input, names))])

    def same(*numbers: Any) -> Any:
        if any(isinstance(x, Scalar) for x in numbers):
            return function(*numbers)
        if any(np.ndim(x) for x in numbers):  # over lanes of cases
            return np.vectorize(same)(*numbers)
        return np.float64(formulas.replay(dict(zip(names, map(float, numbers), strict=True)))[0])

    return same


class Numbers:
    """Numbers by name: floats, drawn when they are first asked for; or the inputs of a graph."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.drawn: dict[str, float] = {}
        self.graph: Graph | None = None

    def number(self, name: str, draw: Draw) -> Any:
        """A number that a case brings."""
        if self.graph is not None:
            return self.graph.input(name)
        return np.float64(self.known(name, draw))

    def known(self, name: str, draw: Draw) -> float:
        """A number that is known while a model is recorded."""
        if name not in self.drawn:
            self.drawn[name] = float(draw())
        return self.drawn[name]

    def any(self) -> float:
        """A number of either sign and of any size that an arm knows; now and then exactly zero."""
        return 0.0 if self.rng.random() < 0.1 else self.rng.normal() * 10.0 ** self.rng.uniform(-2.0, 2.0)

    def within(self, parameter: Parameter, near: float) -> float:
        """A number within the parameter's range, of the size of `near`; now and then that, or one at the bound."""
        if self.rng.random() < 0.1:
            return near
        low = parameter.at_least if parameter.above is None else parameter.above
        high = parameter.at_most if parameter.below is None else parameter.below
        size = abs(near) if near and math.isfinite(near) else 1.0
        if low is not None and high is not None:
            found = self.rng.uniform(low, high)
        elif low is not None or high is not None:
            away = size * 10.0 ** self.rng.uniform(-1.0, 1.0)
            away = 0.0 if self.rng.random() < 0.1 and None in (parameter.above, parameter.below) else away
            found = low + away if low is not None else high - away  # type: ignore[operator]  # one of the two is there
            found = found if holds(parameter, found) else near
        else:
            found = self.rng.normal() * size
        return float(round(found)) if parameter.whole else found


def differences(call: Callable[[Numbers], Any], seed: int) -> list[str]:
    """Where the answers to plain floats and to recorded numbers are not the same to the last bit, in words."""
    numbers = Numbers(np.random.default_rng(seed))
    with np.errstate(all="ignore"):
        plain = dict(flat(call(numbers)))
        numbers.graph = graph = Graph()
        recorded = dict(flat(call(numbers)))
    if list(plain) != list(recorded):
        return [f"plain: {', '.join(plain)}; recorded: {', '.join(recorded)}"]
    formulas = Formulas.of(graph, [each for each in recorded.values() if _is_number(each)])
    found = iter(formulas.replay(numbers.drawn))
    replayed = {name: next(found) if _is_number(each) else each for name, each in recorded.items()}
    return [
        f"{name}: plain {x}, recorded {replayed[name]}" for name, x in plain.items() if not _alike(x, replayed[name])
    ]


def flat(answer: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every number, truth and word of an answer, whatever it is made of, by where it stands."""
    if dataclasses.is_dataclass(answer):
        answer = {field.name: getattr(answer, field.name) for field in dataclasses.fields(answer)}
    if isinstance(answer, Mapping):
        for key, part in answer.items():
            yield from flat(part, f"{name}.{key}")
    elif isinstance(answer, tuple | list):
        for index, part in enumerate(answer):
            yield from flat(part, f"{name}[{index}]")
    else:
        yield name, answer


def _is_number(x: Any) -> bool:
    return isinstance(x, Scalar | Mask | float | bool | np.bool_ | int)


def _alike(a: Any, b: Any) -> bool:
    """Whether two answers are one: zeros of either sign are, and numbers that are none."""
    return bool(a == b) or (_is_number(a) and _is_number(b) and a != a and b != b)


# What the functions of each kind are called with


def calls(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    """Every function that the model declares, by name, as a call on numbers alone."""
    model = use.model
    kinds = {
        "servo": _servo,
        "sensor": _sensor,
        "environment": _environment,
        "command": _command,
        "guide": _guide,
        "metric": _metric,
        "integrator": _integrator,
        "bed": _bed,
        "law": _law,
    }
    known = kinds[use.kind](use, experiment)
    return {name: call for name, call in known.items() if getattr(model, name) is not None}


NOT_TRACED = {
    ("environment", "idle"),
    ("environment", "pushed_links"),
    ("environment", "content"),
    ("environment", "alone"),
    ("environment", "holds"),
    ("guide", "idle"),
    ("command", "jumps"),
    ("command", "content"),
    ("metric", "undefined"),
}
"""Functions that are asked only where all numbers are constants, or about words alone."""


def functions(kind: str, model: Any) -> set[str]:
    """Names of the functions that a declaration of this kind holds, and that are recorded."""
    names = {field.name for field in dataclasses.fields(model) if callable(getattr(model, field.name))}
    return {name for name in names if (kind, name) not in NOT_TRACED}


def parameters(numbers: Numbers, use: Use, experiment: Experiment, of: str = "") -> SimpleNamespace:
    """The plan's parameters of the model: numbers drawn within their ranges; words, lists and what decides the program
    as the deck has them."""
    declared = [parameter for parameter in use.in_plan() if parameter not in use.of_joint]
    return _drawn(numbers, declared, use, experiment, of)


def _drawn(
    numbers: Numbers, declared: Iterable[Parameter], use: Use, experiment: Experiment, of: str, joint: str = ""
) -> SimpleNamespace:
    """These parameters; joint: whose they are, of what each joint has."""
    values: dict[str, Any] = {}
    use = replace(use, joint=joint or use.joint)
    for parameter in declared:
        places = paths(use, parameter)
        found = [experiment.parameters[each].value for each in places]
        if parameter.shape in ("number", "vector") and not parameter.decides:
            found = [
                numbers.number(f"{of}{each}", lambda near=near, p=parameter: numbers.within(p, near))
                for each, near in zip(places, found, strict=True)
            ]
        values[parameter.name] = tuple(found) if parameter.shape == "vector" else found[0]
    return SimpleNamespace(**values)


def held(numbers: Numbers, parts: Any, of: str = "") -> SimpleNamespace:
    """Memory or states of a model: any numbers, and what they begin with."""

    def draw(start: float) -> float:
        return start if numbers.rng.random() < 0.1 else numbers.any()

    return SimpleNamespace(**{p.name: numbers.number(f"{of}held.{p.name}", lambda p=p: draw(p.start)) for p in parts})


def filled(numbers: Numbers, made: type, name: str = "", **known: Any) -> Any:
    """One of the types that the engine hands to models, every number in it drawn. known: fields that are given."""
    values = {}
    for field, hint in get_type_hints(made).items():
        if field in known:
            values[field] = known[field]
        elif hint is float:
            values[field] = numbers.known(f"{name}.{field}", lambda: abs(numbers.any()) + 1e-3)
        elif dataclasses.is_dataclass(hint):
            values[field] = filled(numbers, hint, f"{name}.{field}")  # type: ignore[arg-type]
        elif hint == Real:
            values[field] = numbers.number(f"{name}.{field}", numbers.any)
        elif hint == Vector:
            values[field] = vector(numbers, f"{name}.{field}")
        elif hint == Matrix:
            values[field] = rotation(numbers, f"{name}.{field}")
        else:
            raise TypeError(f"{made.__name__}.{field}: say what it is in tests/met/declarations/both_ways.py")
    return made(**values)


def vector(numbers: Numbers, name: str) -> Vector:
    x, y, z = (numbers.number(f"{name}.{axis}", numbers.any) for axis in "xyz")
    return x, y, z


def rotation(numbers: Numbers, name: str) -> Matrix:
    """Any rotation; now and then none."""
    quaternion = np.array([numbers.known(f"{name} {part}", numbers.rng.normal) for part in "wxyz"])
    still = numbers.known(f"{name} still", numbers.rng.random) < 0.1
    w, *v = np.array([1.0, 0.0, 0.0, 0.0]) if still else quaternion / np.linalg.norm(quaternion)
    x, y, z = v
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R = np.eye(3) + 2.0 * w * across + 2.0 * across @ across
    return tuple(
        tuple(numbers.number(f"{name}[{i}][{j}]", lambda i=i, j=j: R[i, j]) for j in range(3)) for i in range(3)
    )  # type: ignore[return-value]  # three rows of three


def _servo(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    return servo_calls(use.model, use, experiment)


def servo_calls(servo: Servo, use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    """The functions of a servo, which has the parameters of the one in use, and its parts."""
    command, parts = use.command or "none", use.parts
    known = {"period": 0.0} if use.analog else {}

    def p(n: Numbers) -> SimpleNamespace:
        return parameters(n, use, experiment)

    def states(n: Numbers) -> SimpleNamespace:
        return held(n, parts.natural, "states.")

    def control(n: Numbers) -> Any:
        assert servo.control is not None
        of_law = parts.integrals if use.analog else (*parts.outputs, *parts.integrals)
        setpoint = filled(n, Setpoint, "asked", kind=command)
        return servo.control(
            p(n), held(n, of_law), filled(n, Seen, "seen", setpoint=setpoint, states=states(n), **known)
        )

    return {
        "control": control,
        "drive": lambda n: servo.drive(
            p(n),
            held(n, (*parts.outputs, *parts.integrals)),
            states(n),
            filled(n, JointMotion, "joint", command=command),
        ),
        "begin": lambda n: servo.begin(p(n), n.number("q", n.any), n.number("qd", n.any)),
        "measured": lambda n: servo.measured(p(n), n.number("q", n.any), n.number("qd", n.any), states(n)),
        "balance": lambda n: servo.balance(
            p(n),
            n.number("torque", n.any),
            filled(n, Seen, "seen", setpoint=filled(n, Setpoint, "asked", kind=command), states=states(n), **known),
        ),
        "fastest": lambda n: servo.fastest(p(n)),
        "fastest_law": lambda n: servo.fastest_law(p(n)),
        "swings": lambda n: servo.swings(p(n), command),
        "full": lambda n: servo.full(p(n)),
        "motor": lambda n: servo.motor(p(n)),
        "at_rest": lambda n: servo.at_rest(p(n)),
        "rate_loop": lambda n: servo.rate_loop(p(n)),
        "rate_wanted": lambda n: servo.rate_wanted(
            p(n), n.number("q", n.any), filled(n, Setpoint, "asked", kind=command)
        ),
    }


def _sensor(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    sensor = use.model

    def p(n: Numbers) -> SimpleNamespace:
        return parameters(n, use, experiment)

    def states(n: Numbers) -> SimpleNamespace:
        return held(n, use.held("states"), "states.")

    def value(n: Numbers) -> Any:
        return n.number("value", n.any)

    def sensed(n: Numbers) -> Sensed:
        period = 0.0 if use.analog else n.known("period", lambda: n.rng.uniform(1e-4, 2e-3))
        return Sensed(lambda: value(n), period, lambda: n.number("draw", n.rng.normal))

    def measures(n: Numbers, world: Any) -> Any:
        return sensor.measures(parameters(n, use, experiment), world)

    return {
        "measures": _asking(use, experiment, measures),
        "fastest": lambda n: sensor.fastest(p(n)),
        "swing": lambda n: sensor.swing(p(n)),
        "follow": lambda n: sensor.follow(p(n), states(n), value(n)),
        "begin": lambda n: sensor.begin(p(n), value(n)),
        "read": lambda n: sensor.read(p(n), held(n, use.held("memory")), states(n), sensed(n)),
    }


class Answers:
    """A world whose answers are numbers of their own: what was asked, and whatever the arm answered, drawn once.

    So a model's own arithmetic is compared, and not the sines of the arm's pose.
    """

    def __init__(self, world: World, numbers: Numbers, given: list[Any]) -> None:
        self._world, self._numbers, self._given = world, numbers, given
        self._asked: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        if get_type_hints(Felt).get(name) is float or name in ("joints", "links"):
            return getattr(self._world, name)
        if name in get_type_hints(Felt):
            return self._answer(lambda: getattr(self._world, name))
        return lambda *arguments: self._answer(lambda: getattr(self._world, name)(*arguments), name, *arguments)

    def _answer(self, find: Callable[[], Any], *arguments: Any) -> Any:
        n = len(self._asked)
        self._asked.append(arguments)
        if n == len(self._given):  # the first time, with floats
            self._given.append(find())
        return self._as_numbers(self._given[n], f"answer {n}")

    def _as_numbers(self, given: Any, name: str) -> Any:
        if isinstance(given, tuple):
            return tuple(self._as_numbers(part, f"{name}.{i}") for i, part in enumerate(given))
        return given if isinstance(given, bool) else self._numbers.number(name, lambda: given)


def _asking(use: Use, experiment: Experiment, ask: Callable[[Numbers, Any], Any]) -> Callable[[Numbers], Any]:
    """A call of a function that asks a world: its answer, and what was asked. The arm is anywhere, and moves."""
    system = System(experiment)
    tree = system.tree(lambda path: math.nan)  # no case varies it
    given: list[Any] = []

    def call(numbers: Numbers) -> Any:
        if numbers.graph is None:
            given.clear()
        rng = np.random.default_rng(numbers.rng.integers(2**32))
        q, qd = (tuple(map(np.float64, rng.normal(size=len(coordinates(system))))) for _ in range(2))
        orientation = rng.normal(size=4)
        body = free_base(system)
        names = () if body is None else body.orientation
        cells = dict(zip(names, orientation / np.linalg.norm(orientation), strict=False))
        begin = rng.uniform(0.0, 0.2)
        time = begin + rng.uniform() * experiment.structure.schedule.step
        y = Motion(q, qd, ())
        base = base_of(system, cells.__getitem__, y, time)
        moved = Accelerations(tuple(map(np.float64, rng.normal(size=len(q)))), (ZERO, ZERO), (0.0, 0.0, -9.81))
        world = Answers(Aboard(system, cells.__getitem__, tree, y, base, time, begin, moved), numbers, given)
        return {"found": ask(numbers, world), "asked": world._asked}

    return call


def _environment(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    def vector(n: Numbers, name: str) -> Any:
        return tuple(n.number(f"{name}.{axis}", n.any) for axis in "xyz")

    def loads(n: Numbers, world: Any) -> Any:
        return use.model.loads(p(n), world)

    def free_fall(n: Numbers, world: Any) -> Any:
        return use.model.free_fall(p(n), world, vector(n, "position"), vector(n, "velocity"))

    def world_rate(n: Numbers, world: Any) -> Any:
        return use.model.world_rate(p(n), world)

    def jet(n: Numbers, world: Any) -> Any:
        return use.model.jet(p(n), world)

    def p(n: Numbers) -> SimpleNamespace:
        return parameters(n, use, experiment)

    def time(n: Numbers) -> Any:
        return n.number("time", lambda: n.rng.uniform(0.0, 0.2))

    def outputs(n: Numbers, of: str) -> dict[str, Any]:
        return {name: n.number(f"{of}.{name}", n.any) for name in ("voltage", "current")}

    step = experiment.structure.schedule.step
    return {
        "loads": _asking(use, experiment, loads),
        "free_fall": _asking(use, experiment, free_fall),
        "world_rate": _asking(use, experiment, world_rate),
        "jet": _asking(use, experiment, jet),
        "decoupling": lambda n: use.model.decoupling(p(n), SimpleNamespace(begin=time(n), step=step)),
        "replaced_outputs": lambda n: use.model.replaced_outputs(
            p(n), time(n), outputs(n, "outputs"), outputs(n, "full")
        ),
        "replaced_reading": lambda n: [
            use.model.replaced_reading(p(n), time(n), of, n.number("value", n.any), n.number("last", n.any))
            for of in ("q", "qd")
        ],
    }


def _command(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    def course(n: Numbers) -> Any:
        return use.model.course(parameters(n, use, experiment), n.number("t", lambda: n.rng.uniform(0.0, 0.4)))

    shortest = use.model.shortest
    more = {} if shortest is None else {"shortest": lambda n: shortest(parameters(n, use, experiment))}
    return {"course": course, **more}


class Poses:
    """An arm that answers a guide's computer with any numbers, with others where a free base answers."""

    def __init__(self, numbers: Numbers, name: str, joints: Sequence[str]) -> None:
        self._numbers, self._name, self._joints = numbers, name, joints

    def stance(self, *, answers: bool) -> Stance:
        return filled(self._numbers, Stance, f"{self._name}.{answers}")  # type: ignore[no-any-return]

    def columns(self, *, answers: bool) -> list[tuple[Vector, Vector]]:
        heads = [f"{self._name}.{answers}.{joint}" for joint in self._joints]
        return [(vector(self._numbers, f"{head}.w"), vector(self._numbers, f"{head}.v")) for head in heads]


def _guide(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    guide, kinds = use.model, use.kinds

    def p(n: Numbers) -> SimpleNamespace:
        return parameters(n, use, experiment)

    def joints(n: Numbers) -> list[SimpleNamespace]:
        return [_drawn(n, use.of_joint, use, experiment, "", joint) for joint in kinds]

    def steer(n: Numbers) -> Any:
        arms = {name: Poses(n, name, list(kinds)) for name in ("arm", "asked")}
        slides = tuple(kind == "prismatic" for kind in kinds.values())
        return guide.steer(p(n), joints(n), filled(n, Sight, "sight", slides=slides, **arms))

    def course(n: Numbers) -> Any:
        begins = [n.number(f"begins.{joint}", n.any) for joint in kinds]
        return guide.course(p(n), joints(n), begins, n.number("t", lambda: n.rng.uniform(0.0, 0.4)))

    return {
        "components": lambda n: guide.components(p(n)),
        "fastest": lambda n: guide.fastest(p(n)),
        "steer": steer,
        "course": course,
    }


def _metric(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    metric = use.model

    def p(n: Numbers) -> SimpleNamespace:
        return parameters(n, use, experiment)

    def time(n: Numbers, name: str) -> Any:
        return n.number(name, lambda: n.rng.uniform())

    return {
        "update": lambda n: metric.update(
            p(n), held(n, metric.memory), n.number("x", n.any), time(n, "t"), time(n, "dt")
        ),
        "result": lambda n: metric.result(p(n), held(n, metric.memory), time(n, "t")),
    }


def _integrator(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    def advance(n: Numbers) -> Any:
        def several(name: str, count: int = 2) -> tuple[Any, ...]:
            return tuple(n.number(f"{name}[{i}]", n.any) for i in range(count))

        a, b, c = (several(name) for name in "abc")

        def slope(share: float, y: Motion) -> Slope:
            """Any derivative of two joints and one other state that has all of them in it."""
            qdd = tuple(a[i] * y.q[1 - i] + b[i] * y.qd[i] * y.qd[1 - i] + share * c[i] * y.x[0] for i in range(2))
            return Slope(y.qd, qdd, (a[0] * y.x[0] + y.qd[1],))

        y = Motion(several("q"), several("qd"), several("x", 1))
        h = n.number("h", lambda: n.rng.uniform(1e-4, 1e-2))
        return use.model.advance(slope, h, y, slope(0.0, y))

    return {"advance": advance}


def _bed(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    bed = use.model

    def p(n: Numbers) -> SimpleNamespace:
        return parameters(n, use, experiment)

    return {
        "begin": lambda n: bed.begin(p(n), n.number("w", n.any)),
        "advance": lambda n: bed.advance(
            p(n),
            held(n, bed.memory),
            filled(n, Wire),
            n.known("time", lambda: n.rng.uniform(1e-4, 2e-3)),
            lambda name: n.number(f"draw.{name}", n.rng.normal),
        ),
        "read": lambda n: bed.read(p(n), held(n, bed.memory)),
        "taken": lambda n: bed.taken(p(n), filled(n, Wire)),
    }


def _law(use: Use, experiment: Experiment) -> dict[str, Callable[[Numbers], Any]]:
    law, joints = use.model, ("one", "other")

    def give(n: Numbers) -> Any:
        known = {"balance": None} if law.balance == "none" else {}
        told = [
            filled(n, LawInput, joint, **known or {"balance": filled(n, Balanced, f"{joint}.balance")})
            for joint in joints
        ]
        rows = [[n.number(f"Lambda[{i}][{j}]", n.any) for j in range(3)] for i in range(2)]
        return law.give(
            [parameters(n, use, experiment, joint) for joint in joints],
            [held(n, law.memory, joint) for joint in joints],
            told,
            lambda qdd: [row[0] * qdd[0] + row[1] * qdd[1] + row[2] for row in rows],
        )

    return {"give": give}

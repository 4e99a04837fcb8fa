"""Expressions of signals: numbers and conditions that a run computes from its channels, of one joint or of every joint.

A condition has a margin, at least 0 where it holds: `a < b` has b - a, `and` the least margin of its parts, `or` the
greatest, `not` the margin's opposite. This is the robustness of signal temporal logic (met/metrics/always.py names the
sources). Margins of several units are not comparable: then there is only whether the condition holds, 1 or -1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ic.grammar.expressions import EVERY_JOINT
from ic.grammar.syntax import Binary, Call, Expression, Name, Unary, Word, mapped, names_in, place_of, spell
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.evaluate import evaluate_number
from ic.meaning.expressions.quantity import Value, ValueList, in_words
from ic.meaning.expressions.truths import need_one_dimension
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.record import not_one, of_lost
from ic.text.complaints import known_words
from met import models, units
from met.diagnostic import Label, Place, Problem, error
from met.frozen import frozen
from met.metrics.metric import Metric
from met.plan import Structure
from met.plan.channel import Channel, channels, recordable
from met.plan.judged import CHANNEL_INPUT, SignalExpression
from met.trace import Formulas, Real, Scalar, maximum, minimum, where
from met.unit_parser import parse_unit
from met.units import PURE, Dimension

SIGNALS = "signals"
"""The first word of the paths of signals that a deck names."""

ORDERED = ("<", "<=", ">", ">=")
COMPARE = "compare numbers with <, <=, >, >=, and join comparisons by `and`, `or`, `not`"


@frozen
class ConditionMargin:
    """A condition's margin: in one unit, or where its parts have several, 1 where it holds and -1 where not.

    mixed  parts in two units; none where there is one
    """

    number: Real
    dimension: Dimension
    place: Place
    mixed: tuple[Value, ...] = ()


def resolve_signals(scope: Scope, block: MergedBlock, structure: Structure, names: Iterable[str] = ()) -> ChannelTable:
    """Every `signal NAME = EXPRESSION;` of a run, each of channels and of the signals before it.

    names  for which the table is to have channels besides, as `met.plan.channel.channels` takes them
    """
    written = [*(item.value for item in block.of_kind("signal")), *watched(block)]
    signals = ChannelTable(scope, structure, [expression for expression in written if expression is not None], names)
    for item in block.of_kind("signal"):
        path = f"{SIGNALS}.{item.name}"
        signals.lost.add(path)
        with scope.complaints.gather():
            signals.enter(path, item)
            signals.lost.discard(path)
        if path in signals.lost:
            scope.complaints.note_lost_names(item.name)
    return signals


def watched(block: MergedBlock) -> list[Expression | None]:
    """The expressions for the metrics of a run to watch, as written."""
    bodies = (item.body.get("of") for item in block.of_kind("metric") if item.body is not None)
    return [item.value for item in bodies if item is not None]


class ChannelTable:
    """The channels of which expressions of a run are made; every method that resolves one raises Problem.

    known        channels by path, signals of the deck among them
    lost         signals that failed (already reported)
    expressions  signals of the deck, in order
    """

    def __init__(
        self, scope: Scope, structure: Structure, written: Iterable[Expression], names: Iterable[str] = ()
    ) -> None:
        self.scope, self.structure = scope, structure
        self.known = channels(
            structure, [*(name.text for expression in written for name in names_in(expression)), *names]
        )
        self.lost: set[str] = set()
        self.expressions: list[SignalExpression] = []
        self._values: dict[str, Value] = {}

    def enter(self, path: str, item: Item) -> None:
        """Enter the signal that an item of a run declares."""
        expression = item.value
        if expression is None or item.detail or item.body is not None:
            helps = f"write `signal {item.name} = EXPRESSION;`, such as `shoulder.qd - shoulder.servo.command`"
            raise Problem(error("D356", f"signal `{item.name}` is an expression of channels", item.place, help=helps))
        if path in self.known:
            helps = "give it another name"
            raise Problem(error("D040", f"there is a channel `{path}` already", item.place, help=helps))
        expression_of = self._expanded(expression)
        if self._joints(expression_of):
            message = f"a signal is one number, and `{spell(expression)}` is one of each joint"
            helps = "name one joint, or write `max(...)` or `min(...)` of every joint's"
            raise Problem(error("D356", message, place_of(expression), help=helps))
        value = self._number(expression_of)
        signal = self._signal(path, value, expression)
        self.expressions.append(signal)
        self.known[path] = Channel(path, signal.unit, signal.text, 1)
        self._values[path] = value
        self.scope.keep_setting(path, signal.text, item=item)

    def number(self, expression: Expression, metric: Metric) -> SignalExpression:
        """The number that a metric watches; for several joints, the one that the metric declares."""
        expression_of = self._expanded(expression)
        joints = self._joints(expression_of)
        if not joints:
            return self._signal(spell(expression), self._number(expression_of), expression)
        if metric.over_joints is None:
            own = models.find_own("metric").values()
            several = [other.name for other in own if other.over_joints is not None and not other.condition]
            message = f"a metric `{metric.name}` watches one channel, and `{spell(expression)}` is one of each joint"
            remedies = ["name one joint", known_words("metrics that watch several", several)]
            raise Problem(error("D356", message, place_of(expression), help=remedies))
        values = [self._number(_of_joint(expression_of, joint)) for joint in joints]
        for joint, value in zip(joints, values, strict=True):
            if not units.same(value.dimension, values[0].dimension):
                message = f"`{spell(expression)}` of joint `{joints[0]}` and of joint `{joint}` are of different units"
                also = [Label(value.place, f"{in_words(values[0])} and {in_words(value)}")]
                helps = "watch joints of one kind, each by its name, such as `max(shoulder.q, elbow.q)`"
                raise Problem(error("D063", message, place_of(expression), also=also, help=helps))
        number = metric.over_joints.of([value.number for value in values])
        value = Value(number, values[0].dimension, place_of(expression))
        return self._signal(f"{metric.over_joints.word}({spell(expression)})", value, expression)

    def condition(self, expression: Expression, metric: Metric) -> SignalExpression:
        """The margin of a condition; for several joints, the one that the metric declares."""
        expression_of, name = self._expanded(expression), spell(expression)
        joints = self._joints(expression_of)
        margins = [self._margin(_of_joint(expression_of, joint)) for joint in joints]
        if not joints:
            margins = [self._margin(expression_of)]
        elif metric.over_joints is None:
            message = f"a metric `{metric.name}` watches one condition, and `{name}` is one of each joint"
            raise Problem(error("D356", message, place_of(expression), help="name one joint"))
        else:
            name = f"{metric.over_joints.word}({name})"
        mixed = next((margin.mixed for margin in margins if margin.mixed), ())
        other = next((margin for margin in margins if not units.same(margin.dimension, margins[0].dimension)), None)
        if other is not None and not mixed:
            mixed = tuple(Value(0.0, margin.dimension, margin.place) for margin in (margins[0], other))
        if mixed and "of" in metric.unit:
            raise Problem(
                error(
                    "D354",
                    f"the margin of this condition is of two units: {in_words(mixed[0])} and {in_words(mixed[1])}",
                    place_of(expression),
                    also=[Label(margin.place, in_words(margin)) for margin in mixed[:2]],
                    help=[
                        "of `and`, write a requirement for each part",
                        "else divide each side by its limit, so that all margins are shares: `abs(x) / (2 deg/s) < 1`",
                    ],
                )
            )
        numbers = [_truth(margin.number) for margin in margins] if mixed else [margin.number for margin in margins]
        number = metric.over_joints.of(numbers) if metric.over_joints is not None else numbers[0]
        return self._signal(
            name, Value(number, PURE if mixed else margins[0].dimension, place_of(expression)), expression
        )

    # Numbers

    def _number(self, expression: Expression) -> Value:
        return evaluate_number(expression, self._find)

    def _signal(self, name: str, value: Value, expression: Expression) -> SignalExpression:
        """The signal of an expression of channels. Raises Problem D356 where no channel is in it."""
        signal = SignalExpression(
            name,
            units.text(value.dimension),
            Formulas.of(self.scope.graph, [value.number]),
            spell(expression),
            place_of(expression),
        )
        if not signal.channels:
            helps = "name one of the run's: `met doc channels`"
            raise Problem(error("D356", f"`{signal.text}` is of no channel", place_of(expression), help=helps))
        return signal

    def _find(self, name: Name) -> Value | ValueList:
        """The value of a name: a channel, a signal, a parameter of the run, or a name that any expression may use."""
        scope = self.scope
        if name.text in self._values:
            return self._values[name.text]
        if name.text in self.lost or scope.checks.failed(name.text):
            raise Problem(())  # already reported
        if name.text in self.known:
            channel = self.known[name.text]
            measure = parse_unit(channel.unit)
            number = scope.graph.input(CHANNEL_INPUT + channel.path)
            return Value(number, measure.dimension, name.place, hertz=measure.hertz)
        settled = scope.settled(name.text)
        if settled is not None and isinstance(settled.value, (float, int, Scalar)):
            measure = parse_unit(settled.unit)
            return Value(settled.value, measure.dimension, name.place, hertz=measure.hertz)
        first = name.path[0].text
        if (
            first in scope.definitions.of_kind("servo")
            or scope.names.names_a_component(name)
            or scope.names.row_table(first, len(name.path)) is not None
            or (len(name.path) == 1 and name.text not in recordable(self.structure))
        ):
            return scope.names.find(name)
        return self._no_channel(name)

    def _no_channel(self, name: Name) -> Value:
        """Raise Problem D125 for a name of no channel; one without messages where the reason is reported already."""
        first = name.path[0].text
        if first in self.scope.failed_servos | self.scope.failed_parts or of_lost(self.scope, name, self.structure):
            raise Problem(())
        message, helps = not_one(name, self.structure)
        raise Problem(error("D125", message, name.place, help=helps))

    # Conditions

    def _margin(self, expression: Expression, negated: bool = False) -> ConditionMargin:
        """By how much a condition holds at an instant, below 0 where it does not. Raises Problem D353 or D355."""
        if isinstance(expression, Unary) and expression.operator == "not":
            return self._margin(expression.operand, not negated)
        if isinstance(expression, Binary) and expression.operator in ("and", "or"):
            left, right = (self._margin(side, negated) for side in (expression.left, expression.right))
            least = (expression.operator == "and") != negated
            return _joined(left, right, least, expression.place)
        if isinstance(expression, Binary) and expression.operator in ORDERED:
            return self._comparison(expression, negated)
        if isinstance(expression, Binary) and expression.operator in ("==", "!="):
            helps = "write how near is near enough: `abs(a - b) < 0.1 deg`"
            message = f"`{expression.operator}` of numbers that change in time has no margin"
            raise Problem(error("D353", message, expression.place, help=helps))
        if isinstance(expression, Call) and is_over_time(expression):
            helps = "join conditions by `and`, `or`, `not` inside, or write a requirement for each"
            message = f"`{expression.name.text}` inside a condition: requirements over time do not nest"
            raise Problem(error("D355", message, expression.name.place, help=helps))
        raise Problem(error("D353", "a condition is needed here", place_of(expression), help=COMPARE))

    def _comparison(self, comparison: Binary, negated: bool) -> ConditionMargin:
        """The margin of a comparison: by how much it holds, in the unit of its sides. negated: of its opposite"""
        left, right = (self._number(side) for side in (comparison.left, comparison.right))
        need_one_dimension(comparison, left, right)
        below = comparison.operator.startswith("<") != negated
        number = right.number - left.number if below else left.number - right.number
        return ConditionMargin(number, left.dimension, place_of(comparison))

    # Every joint

    def _expanded(self, expression: Expression) -> Expression:
        """The expression with one argument for each joint in a `min` or `max` of every joint."""
        if not isinstance(expression, Call) or expression.name.text not in ("min", "max"):
            return mapped(expression, self._expanded)
        arguments: list[Expression] = []
        for argument in map(self._expanded, expression.positional):
            joints = self._joints(argument)
            arguments += [_of_joint(argument, joint) for joint in joints] or [argument]
        return Call(expression.name, tuple(arguments), expression.named, expression.body, expression.place)

    def _joints(self, expression: Expression) -> Sequence[str]:
        """The joints of an expression over every joint: those with all its channels; () for other expressions."""
        wild = [name for name in names_in(expression) if name.path[0].text == EVERY_JOINT]
        if not wild:
            return ()
        moving = [joint.name for joint in self.structure.moving if joint.name not in self.structure.springs]
        rests = [".".join(word.text for word in name.path[1:]) for name in wild]
        for name, rest in zip(wild, rests, strict=True):
            if not any(f"{joint}.{rest}" in self.known for joint in moving):
                if self.scope.failed_servos or self.scope.failed_parts:
                    raise Problem(())
                has = [
                    channel_name
                    for channel_name, recorded in recordable(self.structure).items()
                    if recorded[0].joints and channel_name[:6] != "links."
                ]
                helps = known_words("channels of joints", has)
                raise Problem(error("D125", f"no joint has a channel `{rest}`", name.place, help=helps))
        joints = [joint for joint in moving if all(f"{joint}.{rest}" in self.known for rest in rests)]
        if not joints:
            message = f"no joint has all channels of `{spell(expression)}`"
            raise Problem(error("D125", message, place_of(expression), help="name one joint for each channel"))
        return joints


def is_over_time(expression: Expression) -> bool:
    """True for a call of a metric of a condition, `always(...)`."""
    if not isinstance(expression, Call) or expression.body is not None:
        return False
    name = expression.name.text
    return name in models.available("metric") and models.find("metric", name).condition


def _joined(left: ConditionMargin, right: ConditionMargin, least: bool, place: Place) -> ConditionMargin:
    """The margin of two conditions of which both must hold (least), or one."""
    choose = minimum if least else maximum
    mixed = left.mixed or right.mixed
    if not mixed and units.same(left.dimension, right.dimension):
        return ConditionMargin(choose(left.number, right.number), left.dimension, place)
    mixed = mixed or tuple(Value(0.0, margin.dimension, margin.place) for margin in (left, right))
    return ConditionMargin(choose(_truth(left.number), _truth(right.number)), PURE, place, mixed)


def _truth(margin: Real) -> Real:
    """1 where a condition holds, -1 where it does not; not-a-number where its margin is."""
    return where(margin >= 0.0, 1.0, where(margin < 0.0, -1.0, margin))


def _of_joint(expression: Expression, joint: str) -> Expression:
    """An expression over every joint, for this one."""
    if isinstance(expression, Name) and expression.path[0].text == EVERY_JOINT:
        return Name((Word(joint, expression.path[0].place), *expression.path[1:]), expression.place)
    return mapped(expression, lambda part: _of_joint(part, joint))

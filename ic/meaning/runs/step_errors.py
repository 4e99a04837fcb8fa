"""Limits on errors due to the step: `require step_error(settle) < 1 %;`, beside the requirements on metrics
themselves."""

from __future__ import annotations

from collections.abc import Sequence

from ic.grammar.syntax import Binary, Call, Expression, Name, place_of, spell
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.quantity import Value
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met.diagnostic import did_you_mean
from met.parameter import Parameter
from met.plan import Structure
from met.plan.judged import MetricUse, StepErrorLimit
from met.plan.outputs import metric_units
from met.trace import Scalar
from met.units import PURE

FLIPPED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
"""Comparisons with their sides exchanged."""

STEP_ERROR = "step_error"

WRITE = "write `require step_error(METRIC) < 1 %;`, or a limit in the metric's unit"


def is_step_error(comparison: Expression | None) -> bool:
    """True if a side of a comparison is `step_error(...)`."""
    return isinstance(comparison, Binary) and any(map(_is_call, (comparison.left, comparison.right)))


def _is_call(side: Expression) -> bool:
    return isinstance(side, Call) and side.name.text == STEP_ERROR


def resolve_step_errors(
    scope: Scope, block: MergedBlock, structure: Structure, linear: Sequence[MetricUse] = ()
) -> tuple[StepErrorLimit, ...]:
    """The limits in SI, or as shares, in the order in which they are written. structure: with its metrics; linear:
    those of linear answers."""
    limits: list[StepErrorLimit] = []
    written = {item.name for item in block.of_kind("metric")}
    units = metric_units(structure)
    for position, statement in enumerate(block.statements):
        comparison = statement.value
        if [word.text for word in statement.words] != ["require"] or not isinstance(comparison, Binary):
            continue
        if comparison.operator not in FLIPPED or not is_step_error(comparison):
            continue
        operator, call, limit = comparison.operator, comparison.left, comparison.right
        if not _is_call(call):
            operator, call, limit = FLIPPED[operator], limit, call
        assert isinstance(call, Call)
        metric = call.positional[0] if len(call.positional) == 1 else None
        if not isinstance(metric, Name) or call.named or call.body is not None:
            scope.complaints.error("D313", "an error by the step is one metric's", call.place, help=WRITE)
            continue
        if operator not in ("<", "<="):
            message = f"`{spell(comparison)}` asks for errors that are large"
            scope.complaints.error("D313", message, place_of(comparison), help=WRITE)
            continue
        name = metric.text
        if any(removed.key == f"metric {name}" and position < removed.before for removed in block.removed):
            scope.notes.append(f"`require {spell(comparison)}` went with the metric `{name}`, which is removed")
        elif name not in written:
            helps = [*did_you_mean(name, written), known_words("metrics of this run", sorted(written))]
            scope.complaints.error("D132", f"no metric `{name}`", metric.place, help=helps)
        elif any(name == use.name for use in linear):
            message = f"`{name}` is of linear answers, of which no error by the step is computed"
            scope.complaints.error(
                "D313", message, metric.place, help="leave it out: it is of metrics of the run itself"
            )
        elif name in units:  # else the metric failed (already reported)
            called = f"the limit on the error by the step of `{name}`"
            owner = Owner("", statement.place, "require", called=called)
            number, share = _limit(scope, owner, limit, units[name])
            if number is not None:
                text = spell(comparison)
                if all(known_limit.text != text for known_limit in limits):
                    limits.append(StepErrorLimit(text, name, operator, number, share, statement.place))  # type: ignore[arg-type]
    return tuple(limits)


def _limit(scope: Scope, owner: Owner, limit: Expression, unit: str) -> tuple[float | None, bool]:
    """The limit, in SI or as a share of the metric; whether it is a share."""
    value = None
    with scope.complaints.gather():
        value = scope.names.evaluate(limit)
    if value is None:
        return None, False
    share = isinstance(value, Value) and value.dimension == PURE
    wanted = Parameter(name="limit", unit="1" if share else unit, above=0.0, doc="limit", share=share)
    return number_required(scope, owner, wanted, limit), share


def number_required(scope: Scope, owner: Owner, wanted: Parameter, expression: Expression) -> float | None:
    """The number of an expression in a requirement, such as its limit, SI; None where it is not a number or varies
    (reported)."""
    item = Item("", wanted.name, (), expression, None, place_of(expression))
    number = scope.number(owner, wanted, item, record=False)
    if isinstance(number, Scalar):
        scope.complaints.error(
            "D122",
            f"the {wanted.name} of a requirement varies with the sweep",
            place_of(expression),
            help="it is the same for all cases: write a number that stands still",
        )
        return None
    return number

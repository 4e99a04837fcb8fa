"""Tolerances of a run for comparison with another version: `tolerances { qd = 1e-6 rad/s;  rel = 1e-9; }`."""

from __future__ import annotations

from collections.abc import Sequence

from ic.grammar.syntax import place_of, spell
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.requirements import share_metrics
from ic.text.complaints import known_words
from met.diagnostic import did_you_mean
from met.parameter import Parameter
from met.plan import Structure
from met.plan.channel import recordable
from met.plan.judged import MetricUse, Tolerance
from met.plan.outputs import OF_ALL, joint_parts, tolerable
from met.trace import Scalar

WRITE = "write `NAME = SIZE;`: `qd = 1e-6 rad/s;`, `elbow.q = 0.01 deg;`, `rel = 1e-9;`, `time = 1 ms;`"


def resolve_tolerances(
    scope: Scope, body: MergedBlock, structure: Structure, linear: Sequence[MetricUse] = ()
) -> tuple[Tolerance, ...]:
    """The tolerances in SI, in the order in which they are written. structure: with its metrics and record; linear: the
    metrics of linear answers."""
    for statement in body.statements:
        scope.complaints.error(
            "D239",
            f"`{statement.words[0].text}` inside the tolerances",
            statement.place,
            help="it belongs to a run or a sweep",
        )
    known = tolerable(structure, linear)
    tolerances = (_tolerance(scope, item, structure, known) for item in body.items.values())
    return tuple(tolerance for tolerance in tolerances if tolerance is not None)


def _tolerance(scope: Scope, item: Item, structure: Structure, known: dict[str, tuple[str, ...]]) -> Tolerance | None:
    """The tolerance of an entry, SI; None where it has a mistake, which is reported."""
    name = item.name
    if item.kind or item.value is None:
        scope.complaints.error("D239", f"`{item.kind or name}` is no tolerance", item.place, help=WRITE)
        return None
    if name not in known:
        if not scope.depends_on_failed(name):
            scope.complaints.error(
                "D237",
                f"no signal or metric `{name}` here that could differ",
                item.place,
                help=_nearest(item, structure, known),
            )
        return None
    if len(known[name]) > 1:
        parts = [
            path
            for recorded in structure.record
            if recorded.name == name
            for path in joint_parts(name, recorded.joints)
        ]
        scope.complaints.error(
            "D238",
            f"`{name}` is in {' and in '.join(known[name])}",
            item.place,
            help=known_words("give each joint its own", parts),
        )
        return None
    path = f"tolerances.{name}"
    owner = Owner("the tolerances", item.place, "tolerances", called=f"the tolerance of `{name}`")
    wanted = Parameter(
        name=name,
        unit=known[name][0],
        at_least=0.0,
        doc="what a diff allows",
        share=name == "rel" or name in share_metrics(structure),
    )
    size = scope.number(owner, wanted, item, record=False)
    if isinstance(size, Scalar):
        place = scope.varied[path].place if path in scope.varied else place_of(item.value)
        scope.complaints.error(
            "D122",
            f"the tolerance of `{name}` varies with the sweep",
            place,
            help="it is the same for all cases: write a number that stands still",
        )
        return None
    if size is None:
        return None
    scope.keep_setting(path, float(size), known[name][0], item=item)
    setting = scope.evaluated_settings.get(path)
    if setting is not None:
        scope.auxiliary[path].origin = setting.overriding(scope.auxiliary[path].origin)
    return Tolerance(name, float(size), spell(setting.expression if setting else item.value), item.place)


def _nearest(item: Item, structure: Structure, known: dict[str, tuple[str, ...]]) -> list[str]:
    """The remedy for a tolerance of an unknown quantity: the syntax, or a similar name."""
    name = item.name
    recorded = recordable(structure).get(name, ())
    variables = [variable.name for variable in recorded]
    if len(variables) > 1 and any(variable in known for variable in variables):
        return [known_words(f"`{name}` is several signals", variables)]
    inherited = f", or `remove {name};` here" if len(item.homes) > 1 else ""
    record = [f"only what is recorded can differ: `record += [{name}];`{inherited}"] if recorded else []
    parts = {part for variable in structure.record for part in joint_parts(variable.name, variable.joints)}
    offered = [known_name for known_name in known if known_name not in parts and known_name not in OF_ALL]
    return [*(record or did_you_mean(name, known)), known_words("signals and metrics here", offered)]

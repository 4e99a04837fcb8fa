"""Linear answers that a run asks for, `linear hand_loop { at = 2 s; open = pan.servo.voltage; }`, and metrics of
them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from ic.grammar.syntax import Call, Expression, List, Name, place_of
from ic.language.runs import LINEAR, LINEAR_AT
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.quantity import Value, ValueList
from ic.meaning.parameters.models import check_keys, refuse_values, word_of
from ic.meaning.parameters.owner import NotSweepable, Owner
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.record import nearest_channels, of_lost
from ic.text.complaints import known_words
from met.diagnostic import Place, Problem, did_you_mean, error, write
from met.parameter import Parameter
from met.plan import Joint, Structure
from met.plan.channel import recordable
from met.plan.checked_answers import is_way
from met.plan.judged import FIGURES, LinearUse, MetricUse
from met.plan.linear_signals import InputSignal, input_signals, no_computer
from met.trace import Scalar

ONE_INSTANT = NotSweepable("is one for the whole sweep", "write a `linear` block for each instant")

EQUILIBRIUM = "equilibrium"
"""The word for an arm at rest, in place of an instant."""

LISTS = {"inputs": "inputs", "outputs": "outputs", "open": "opened"}
"""Keys of a block that are lists of signals, and the fields that hold them."""


def is_figure(expression: Expression | None) -> bool:
    """Return True if this is a figure of linear answers, `phase_margin(hand_loop)`."""
    return isinstance(expression, Call) and expression.name.text in FIGURES


def is_figure_metric(item: Item) -> bool:
    """Return True if a metric of a run is a figure of linear answers."""
    return word_of(item.value) in FIGURES


def resolve_linear(scope: Scope, block: MergedBlock, structure: Structure) -> tuple[LinearUse, ...]:
    """The linear answers that a run asks for."""
    known = (
        {input_signal.path: input_signal for input_signal in input_signals(structure)}
        if any(block.of_kind("linear"))
        else {}
    )
    answers = (_answer(scope, item, structure, known) for item in block.of_kind("linear"))
    return tuple(use for use in answers if use is not None)


def _answer(scope: Scope, item: Item, structure: Structure, known: Mapping[str, InputSignal]) -> LinearUse | None:
    """One `linear` block; None where it has a mistake, which is reported."""
    if item.body is None or item.value is not None or item.detail:
        message = f"`linear {item.name}` is a block"
        scope.complaints.error("D375", message, item.place, help=f"write `{LINEAR.written}`")
        return None
    before, body = scope.complaints.error_count, item.body
    owner = Owner(f"`linear {item.name}`", item.place, f"linear.{item.name}")
    check_keys(scope, body, list(LINEAR.keys), owner)
    instant, duration = body.get("at"), structure.schedule.duration
    pose = _pose(scope, owner, instant, structure) if instant is not None and _is_equilibrium(instant.value) else None
    time: float | None = 0.0
    if instant is not None and not _is_equilibrium(instant.value):
        time = scope.constant(owner, LINEAR_AT, instant, instead=ONE_INSTANT.sweep)
    for path in owner.paths(LINEAR_AT.name, () if instant is None else instant.homes):
        scope.not_sweepable[path] = ONE_INSTANT
    if instant is not None and time is not None and time > duration:
        message = f"t = {time:.6g} s is not in the run, which ends at {duration:.6g} s"
        helps = "ask at an instant of the run, or let it last longer"
        scope.complaints.error("D375", message, instant.value_place, help=helps)
    signals: dict[str, tuple[str, ...]] = {}
    lost = False
    for key, field in LISTS.items():
        entry = body.get(key)
        names = [] if entry is None else list(_names(scope, entry, key))
        good = [name for name in names if _is_known(scope, name, key, structure, known)]
        lost = lost or len(good) < len(names)
        for name in [
            name for place, name in enumerate(good) if name.text in {earlier.text for earlier in good[:place]}
        ]:
            scope.complaints.error("D040", f"`{name.text}` is there twice", name.place, help="leave one out")
        signals[field] = tuple(name.text for name in good)
        if entry is not None and signals[field]:
            scope.keep_setting(f"{owner.path}.{key}", ", ".join(signals[field]), item=entry)
    if time is None or lost or scope.complaints.error_count > before:
        return None
    return LinearUse(item.name, time, place=item.place, pose=pose, **signals)


def _is_equilibrium(expression: Expression | None) -> bool:
    return word_of(expression) == EQUILIBRIUM


def _pose(scope: Scope, owner: Owner, item: Item, structure: Structure) -> tuple[float, ...]:
    """The positions of `equilibrium(q = [...])`, rad (m), of each joint that follows none; none for the run's first."""
    body, joints = item.body or MergedBlock(), structure.independent
    if refuse_values(scope, item.value, ["q"]):
        return ()
    check_keys(scope, body, ["q"], replace(owner, label=f"`{EQUILIBRIUM}` of {owner.label}"))
    entry, positions = body.get("q"), tuple[float, ...]()
    scope.keep_setting(owner.join("at"), EQUILIBRIUM, item=item)
    if entry is None:
        return ()
    with scope.complaints.gather():
        listed = scope.evaluate(entry)
        values = listed.items if isinstance(listed, ValueList) else (listed,)
        if len(values) != len(joints) or any(isinstance(value, ValueList) for value in values):
            message = f"`q` of an {EQUILIBRIUM} is a position of each joint that follows none, {len(joints)} in all"
            helps = f"write `q = [...] deg`, in the order {', '.join(joint.name for joint in joints)}"
            raise Problem(error("D375", message, listed.place, help=helps))
        positions = tuple(
            _position(scope, owner, joint, value)
            for joint, value in zip(joints, values, strict=True)
            if isinstance(value, Value)
        )
    return positions


def _position(scope: Scope, owner: Owner, joint: Joint, value: Value) -> float:
    """The position of a joint in SI. Raises D122 where it varies with the sweep."""
    wanted = Parameter(name="q", unit="joint", doc="position of a joint that stands still")
    scope.value_checks.dimension(
        replace(owner, joint=joint.kind, called=f"the position of `{joint.name}`"), wanted, value
    )
    if isinstance(value.number, Scalar):
        helps = "a pose is one for all cases: write a `linear` block for each"
        raise Problem(error("D122", f"the position of `{joint.name}` varies with the sweep", value.place, help=helps))
    return float(value.number)


def _names(scope: Scope, item: Item, key: str) -> Iterator[Name]:
    """The names in an entry: one, or several in brackets, including those added by `+=`."""
    for expression in (item.value, *item.appended):
        for name in expression.items if isinstance(expression, List) else (expression,):
            if isinstance(name, Name):
                yield name
            else:
                place = item.place if name is None else place_of(name)
                helps = f"write `{LINEAR[key].written}`, or several in brackets"
                scope.complaints.error("D375", f"`{key}` is a list of signals", place, help=helps)


def _is_known(scope: Scope, name: Name, key: str, structure: Structure, known: Mapping[str, InputSignal]) -> bool:
    """Return True if this is a signal of the kind that a key takes; otherwise it is reported."""
    failed = scope.failed_servos | scope.failed_parts
    if failed and (name.path[0].text in failed or "servo" in (word.text for word in name.path)):
        return False
    if key == "outputs":
        channels = recordable(structure, [name.text])
        if name.text not in channels and not of_lost(scope, name, structure):
            helps = nearest_channels(name, channels, structure)
            scope.complaints.error("D125", f"no channel `{name.text}`", name.place, help=helps)
        return name.text in channels
    places = [path for path, signal in known.items() if signal.is_output or key == "inputs"]
    if name.text in places:
        return True
    what = "place to open a loop" if key == "open" else "input"
    helps = [*no_computer(structure, name.text)] or [*did_you_mean(name.text, places)]
    helps += [known_words("there are", places)] * bool(places)
    scope.complaints.error("D375", f"there is no {what} `{name.text}`", name.place, help=helps)
    return False


def resolve_linear_metrics(
    scope: Scope, block: MergedBlock, structure: Structure, answers: Sequence[LinearUse]
) -> tuple[MetricUse, ...]:
    """The metrics of a run that are figures of linear answers."""
    figures = [item for item in block.of_kind("metric") if is_figure_metric(item)]
    metrics = [_metric(scope, item, block, structure, answers) for item in figures]
    scope.complaints.note_lost_names(*(item.name for item, use in zip(figures, metrics, strict=True) if use is None))
    return tuple(use for use in metrics if use is not None)


def _metric(
    scope: Scope, item: Item, block: MergedBlock, structure: Structure, answers: Sequence[LinearUse]
) -> MetricUse | None:
    """The metric of a run that is a figure of one of its `linear` blocks, such as a phase margin; None where it has a
    mistake, which is reported."""
    places = [input_signal.path for input_signal in input_signals(structure) if input_signal.is_output]
    figure = FIGURES[word_of(item.value) or ""]
    body = item.body or MergedBlock()
    if item.value is None or refuse_values(scope, item.value, ["of"]):
        return None
    check_keys(scope, body, ["of"], Owner(f"metric `{item.name}`", item.place, f"metrics.{item.name}"))
    of_item = body.get("of")
    names = {answer.name: answer for answer in block.of_kind("linear")}
    if of_item is None or not isinstance(of_item.value, Name) or of_item.value.text not in names:
        named = of_item.value.text if of_item is not None and isinstance(of_item.value, Name) else ""
        message = f"no `linear {named}` in this run" if named else f"a `{figure.name}` is of a `linear` block"
        helps = [*did_you_mean(named, names), known_words("linear blocks of this run", sorted(names))]
        if not names:
            opened = places[0] if places else "JOINT.servo.voltage"
            helps = [write(f"linear {named or 'NAME'} {{ open = {opened}; }}", where="inside")]
            if "." in named:  # which is what to open
                name = named.replace(".", "_")
                helps = [f"write `linear {name} {{ open = {opened}; }}` in the run, and `of = {name};` here"]
        scope.complaints.error("D376", message, _place(item, of_item), help=helps)
        return None
    use = next((answer for answer in answers if answer.name == of_item.value.text), None)
    if use is None:
        return None  # it failed (already reported)
    if figure.of_loops and not use.opened:
        message = f"`linear {use.name}` opens no loop, so it has no `{figure.name}`"
        helps = [f"write `open = {places[0]};` in it"] if places else [*no_computer(structure)]
        helps += [known_words("places to open a loop", places)] if len(places) > 1 else []
        scope.complaints.error("D376", message, _place(item, of_item), help=helps)
        return None
    if figure.of_way and not is_way(use, structure):
        message = f"`linear {use.name}` has not one input and one output, so it has no `{figure.name}`"
        commands = [command for command in input_signals(structure) if not command.is_output]
        helps = [
            f"write one of each in it: `inputs = {command.path};  outputs = {command.joint}.q;`" for command in commands
        ]
        scope.complaints.error("D376", message, _place(item, of_item), help=helps[:1] or [*no_computer(structure)])
        return None
    if figure.name == "bending_share" and not structure.springs:
        message = f"a `{figure.name}` is of an arm with a boom, and `{structure.arm}` has none"
        helps = ["a link that bends is `link NAME boom { EI = ...; ... }`: `met doc boom`"]
        scope.complaints.error("D376", message, item.place, help=helps)
        return None
    scope.keep_in_deck(f"metrics.{item.name}.model", figure.name, item)
    scope.keep_in_deck(f"metrics.{item.name}.of", use.name, of_item)
    return MetricUse(item.name, figure.name, use.name, item.place)


def _place(item: Item, of_item: Item | None) -> Place:
    return item.place if of_item is None else of_item.value_place

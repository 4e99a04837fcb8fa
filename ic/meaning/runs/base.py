"""The base of a run: fixed, prescribed component by component, or free; and consistency checks with the run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from ic.grammar.syntax import Call, place_of
from ic.language import BLOCKS
from ic.language.runs import BASE_KINDS
from ic.meaning.control.courses import use_component
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm, resolve_link
from ic.meaning.mechanics.bodies import carried_loads
from ic.meaning.mechanics.meshes import link_meshes
from ic.meaning.parameters.models import check_keys, refuse_values, word_of
from ic.meaning.parameters.owner import A_RUN_FOR_EACH, DECIDES, NotSweepable, Owner, Settled
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import Help, Label, Place, did_you_mean, leave_out
from met.parameter import WORLD, Parameter
from met.plan import BASE, COMPONENTS, Base, Course, Link, Mesh, Origin, Payload, Structure
from met.plan.chains import ground
from met.plan.defaults import INERTIA, OF_FREE_BASE, component
from met.plan.run_keys import RunKey, run_keys


def resolve_run_keys(scope: Scope, run: Owner, block: MergedBlock, cls: type) -> dict[str, Any]:
    """The fields of a plan's dataclass that keep keys of this run, by name; the default where one has a mistake, which
    is reported. Each key is settled in the scope, so that it can be explained."""
    return {field: key.in_plan(_read(scope, run, block, key)) for field, key in run_keys(cls)}


def _read(scope: Scope, run: Owner, block: MergedBlock, key: RunKey) -> Any:
    """The value of one key of a run, in SI; its default where the run does not write it."""
    wanted = key.parameter
    head, _, name = key.path.rpartition(".")
    holder = block.get(head) if head else None
    body = block if not head else (holder.body if holder is not None else None) or MergedBlock()
    item = body.get(name)
    owner = Owner(BLOCKS[head].called, item.place if item is not None else run.place, head) if head else run
    if wanted.shape == "word":
        value: Any = scope.word(owner, wanted, item)
    elif item is not None:
        value = scope.constant(owner, wanted, item)
    else:
        value = wanted.default
        scope.auxiliary[key.path] = Settled(value, wanted.unit, Origin("default"), wanted.doc)
    entry = BLOCKS[head or "run"][name]
    if entry.varies == "never":
        scope.not_sweepable[key.path] = NotSweepable("is one for the whole sweep", A_RUN_FOR_EACH)
    return wanted.default if value is None else value


USAGE = "write `base = fixed;`, `base = free;` or `base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); }`"
INITIAL_OF_BASE = tuple(f"{BASE}.{name}" for name, _ in OF_FREE_BASE)
"""The keys of `initial` for a free base."""

DOCS = {
    "position": "origin of the base at the start, world axes",
    "rpy": "turn of the base at the start, fixed x-y-z",
    "velocity": "velocity of the base's origin at the start, world axes",
    "rate": "angular velocity of the base at the start, world axes",
}
OTHERS = ("rate", "position", "acceleration", "torque", "force")
"""Kinds of command, which belong in servos."""
NOTHING = (0.0, 0.0, 0.0)


def resolve_base(scope: Scope, item: Item | None, arm: ResolvedArm) -> tuple[Base | None, ResolvedArm]:
    """The base, None where it is fixed or failed (already reported); and the arm, with the base as a link where it
    moves."""
    scope.not_sweepable[BASE] = NotSweepable(DECIDES, "write `vary base = [fixed, free];`")
    kind = word_of(item.value) if item is not None and item.value is not None else None
    if item is None:
        scope.keep_setting(BASE, "fixed")
        return None, arm
    if kind not in BASE_KINDS or item.appended:
        wrong = item.appended[0] if item.appended else item.value
        place = place_of(wrong) if wrong is not None else item.place
        message = "a base is fixed, prescribed or free" if kind is None or item.appended else f"no base `{kind}`"
        meant = did_you_mean(kind, BASE_KINDS) if kind is not None and kind not in BASE_KINDS else ()
        scope.complaints.error("D250", message, place, help=[*meant, USAGE])
        return None, arm
    scope.keep_setting(BASE, kind, item=item)
    body = item.body or MergedBlock()
    if kind != "prescribed":
        if item.body is not None or (isinstance(item.value, Call) and item.value.positional):
            help = "leave the block out"
            if kind == "free":
                help = f"its state at the start stands in `initial`: {', '.join(INITIAL_OF_BASE)}"
            scope.complaints.error("D250", f"a {kind} base takes no block", item.upon or item.place, help=help)
        return (Base("free", (), item.place), _free(scope, item, arm)) if kind == "free" else (None, arm)
    courses = () if refuse_values(scope, item.value, COMPONENTS) else _courses(scope, item, body)
    return Base("prescribed", courses, item.place), _standing(scope, item, arm)


def check_base(
    scope: Scope, base: Base | None, structure: Structure, environment: MergedBlock, item: Item | None
) -> None:
    """Report conflicts with the base: a turn without velocity products, a free base without mass."""
    off = environment.get("velocity_products")
    if base is not None and base.turns and not structure.velocity_products and off is not None and item is not None:
        what = "a free base" if base.kind == "free" else "a base that turns"
        scope.complaints.error(
            "D253",
            f"{what} moves by velocity products, and they are off",
            off.value_place,
            also=[Label(item.place, f"{what}")],
            help=leave_out("leave `velocity_products = off` out"),
        )
    if item is None:
        _remark_held(scope, structure)
    if base is None or base.kind != "free" or item is None:
        return
    loads, passing = carried_loads(scope, structure.payloads)
    paths = [f"links.{name}.mass" for name in structure.ground]
    paths += [path for name in structure.ground for path, _ in loads.get(name, ())]
    masses = [settled.value for path in paths if (settled := scope.parameters.get(path)) is not None]
    own = scope.parameters.get(f"links.{BASE}.mass")
    written = own is not None and own.origin.kind != "default"
    scope.checks.require(
        tuple(masses),  # type: ignore[arg-type]  # masses are numbers
        lambda rows: (~(rows.sum(axis=1) > 0.0), []),
        code="D254",
        message="the base moves freely and has no mass",
        place=item.place,
        needs=tuple(paths),
        help=(
            f"write a mass above 0 kg for link `{BASE}`"
            if written
            else "give the arm the base's body: `link base { mass = 400 kg; shape = sphere(radius = 0.5 m); }`",
            "or write the mass of a link that is fixed to the base",
            *(word for name in structure.ground for word in passing.get(name, ())),
        ),
    )


def _remark_held(scope: Scope, structure: Structure) -> None:
    """Warn about a base that this file makes a body where nothing weighs, and that is held since no run says `base`."""
    own = next((link for link in structure.links if link.name == BASE), None)
    runs, weighs = scope.definitions.run_blocks(), any(load.model == "gravity" for load in structure.environment)
    mass = scope.parameters.get(f"links.{BASE}.mass")
    if (
        own is None
        or (mass is not None and isinstance(mass.value, float) and mass.value == 0.0)
        or own.place is None
        or own.place.included
        or weighs
        or any(run.get(BASE) for run in runs)
    ):
        return
    scope.complaints.remark(
        "D257",
        f"link `{BASE}` has no effect: the base is held, and nothing weighs",
        own.place,
        help=f"write `base = free;` in the run, for an arm that floats; `base = fixed;` if link `{BASE}` is the ground",
    )


def initial_base(scope: Scope, body: MergedBlock, base: Base | None) -> None:
    """Settle the initial state of a free base."""
    for name, unit in OF_FREE_BASE:
        item = body.get(f"{BASE}.{name}")
        wanted = Parameter(name=name, unit=unit, shape="vector", default=NOTHING, doc=DOCS[name])
        if base is not None and base.kind == "free":
            place = item.place if item is not None else base.place
            assert place is not None  # a moving base comes from a deck
            scope.vector(Owner("the base", place, f"initial.{BASE}"), wanted, item)
        elif item is not None:
            message = "a fixed base stays at the world's origin"
            help = Help("write `base = free;`, or put the arm elsewhere: `at` and `rpy` of the joints on the base")
            if base is not None:
                message = "a prescribed base begins where its courses do"
                names = ", ".join(COMPONENTS)
                help = leave_out(f"leave it out; `base = prescribed {{ ... }}` says where it is: {names}")
            scope.complaints.error("D255", f"{message}, so `{item.name}` has no effect", item.place, help=help)


def fixed_to(arm: ResolvedArm, payloads: Sequence[Payload]) -> dict[str, str]:
    """For each link and payload, the body to which it is permanently fixed: a moving link, or the base."""
    held = {joint.child: joint.parent for joint in arm.joints if joint.kind == "fixed"}
    held |= {payload.name: payload.link for payload in payloads if not payload.flies}
    bodies = {}
    for name in held:
        last = name
        for _ in held:  # as many steps as there can be: joints in a circle are reported already
            last = held.get(last, last)
        bodies[name] = last
    return bodies


def remark_ground(
    scope: Scope,
    item: Item,
    arm: ResolvedArm,
    base: Base | None,
    environment: Any,
    values: Mapping[str, Any],
    payloads: Sequence[Payload],
) -> None:
    """Report an environment model that acts only on links that cannot move."""
    if environment.pushed_links is None or (base is not None and base.kind == "free"):
        return
    keys = environment.pushed_links(SimpleNamespace(**values))
    carriers = {payload.name: payload.link for payload in payloads if not payload.flies}
    links = [carriers.get(values[key], values[key]) for key in keys]
    still = (BASE, WORLD, *ground(arm.links, arm.joints))
    if any(link not in still for link in links) or set(links) == {WORLD}:  # the latter is refused elsewhere
        return
    key, link = next((key, link) for key, link in zip(keys, links, strict=True) if link != WORLD)
    written = (item.body or MergedBlock()).get(key)
    place = place_of(written.value) if written is not None and written.value is not None else item.place
    is_base = f"link `{link}`" + ("" if link == BASE else ", which is fixed to the base,")
    is_base += " with all that it acts upon" if len(set(links) - {link, WORLD}) else ""
    why = "moves as it is told" if base is not None else "is part of the ground"
    scope.complaints.remark(
        "D256",
        f"environment `{item.name}` changes nothing: {is_base} {why}",
        place,
        help="write `base = free;` in the run, or name a link that a joint moves",
    )


def _free(scope: Scope, item: Item, arm: ResolvedArm) -> ResolvedArm:
    """The arm with its base among the links: that of the arm, else of the file that it is made from, else without
    mass."""
    known = any(link.name == BASE for link in arm.links) or BASE in arm.failed
    written = None if known else scope.definitions.base_from_file(arm.name)
    if written is None:
        return _standing(scope, item, arm)
    parts = resolve_link(scope, written, scope.definitions.homes(scope.definitions.of_kind("arm")[arm.name]))
    return replace(arm, links=(*arm.links, *(link for link in parts if isinstance(link, Link))))


def base_meshes(scope: Scope, arm: ResolvedArm) -> tuple[Mesh, ...]:
    """The meshes of a base that is no link of the arm, by the file that the arm is made from; none of other bases."""
    if any(link.name == BASE for link in arm.links) or BASE in arm.failed:
        return ()
    written = scope.definitions.base_from_file(arm.name, of_mass=False)
    if written is None or written.body is None:
        return ()
    owner = Owner(f"link `{BASE}`", written.place, f"links.{BASE}")
    return link_meshes(scope, owner, written.body.get("mesh"))


def _standing(scope: Scope, item: Item, arm: ResolvedArm) -> ResolvedArm:
    """The arm with its base among the links: without mass, unless the arm gives it some."""
    if any(link.name == BASE for link in arm.links) or BASE in arm.failed:
        return arm
    owner = Owner(f"link `{BASE}`", item.place, f"links.{BASE}")
    scope.number(owner, Parameter(name="mass", unit="kg", default=0.0, at_least=0.0, doc="mass of the link"), None)
    for name, unit, parts in (("com", "m", tuple("xyz")), ("inertia", "kg*m^2", INERTIA)):
        wanted = Parameter(name=name, unit=unit, shape="vector", default=(0.0,) * len(parts), doc=f"{name} of the link")
        for part in parts:
            scope.number(replace(owner, path=f"links.{BASE}.{name}"), replace(wanted, name=part, default=0.0), None)
    return replace(arm, links=(*arm.links, Link(BASE, item.place)))


# A prescribed base


def _courses(scope: Scope, item: Item, body: MergedBlock) -> tuple[Course, ...]:
    """The courses (values as functions of time) of a prescribed base's components, in order; mistakes are reported."""
    owner = Owner("a prescribed base", item.place, BASE)
    check_keys(scope, body, COMPONENTS, owner)
    if not any(name in body.items for name in COMPONENTS) and not body.items:
        scope.complaints.error("D250", "this base is prescribed, and nothing says how it moves", item.place, help=USAGE)
    courses = []
    for name in COMPONENTS:
        part = body.get(name)
        if part is not None:
            with scope.complaints.gather():
                model = _course(scope, part)
                if model is not None:
                    courses.append(Course(name, model))
    return tuple(courses)


def _course(scope: Scope, item: Item) -> str | None:
    """The command's model that moves one component of a prescribed base in time, its parameters entered in the scope;
    None where it has a mistake, which is reported."""
    if item.value is None:
        scope.complaints.error(
            "D250",
            f"`{item.name}` of the base is a value or a course in time",
            item.place,
            help=f"write `{item.name} = {_example(item.name)};`",
        )
        return None
    other = item.value.name.text if isinstance(item.value, Call) else ""
    if other in OTHERS and other not in models.available("command"):
        scope.complaints.error(
            "D250",
            f"`{item.name}` of the base is told its positions, and `{other}` is a kind of command of servos",
            place_of(item.value),
            help=f"write the course alone: `{item.name} = {_example(item.name)};`",
        )
        return None
    label, path = f"`{item.name}` of the base", f"{BASE}.{item.name}"
    model = use_component(scope, item, label, path, f"{item.name} of the base", "component")
    if model is not None:
        _check_jumps(scope, item, model, place_of(item.value))
    return model


def _check_jumps(scope: Scope, item: Item, model: str, place: Place) -> None:
    """Check that a base does not jump; where its rate does, the impulse on the arm is left out, with a warning."""
    profile, head = models.find("command", model, place), f"{BASE}.{item.name}."
    values = {
        path.removeprefix(head): settled.value for path, settled in scope.parameters.items() if path.startswith(head)
    }
    words: Mapping[str, object] = {name: value for name, value in values.items() if isinstance(value, str)}
    wanted = [p.name for p in profile.parameters if p.shape == "word"]
    jump = profile.jump(SimpleNamespace(**words)) if set(wanted) <= set(words) else "none"
    smooth = _smooth()
    if jump == "value":
        scope.complaints.error(
            "D251",
            f"`{item.name}` of the base jumps, by `{model}`",
            place,
            help=[
                "a body moves from place to place in time",
                known_words("courses without a jump of the rate", smooth),
            ],
        )
    elif jump == "rate":
        scope.complaints.remark(
            "D252",
            f"the rate of `{item.name}` of the base jumps, by `{model}`: the blow that this is to the arm is left out",
            place,
            help=known_words("courses without a jump of the rate", smooth),
        )


def _smooth() -> Iterable[str]:
    """Models of commands whose value and rate never jump, each with the parameter that makes it so where it needs one:
    `NAME(KEY = WORD)`."""
    names = []
    for name, command in models.find_own("command").items():
        words = [(p.name, word) for p in command.parameters for word in p.words]
        known = {p.name: p.default for p in command.parameters if p.words}
        if not callable(command.jumps):
            names += [name] * (command.jumps == "none")
        else:
            names += [
                f"{name}({key} = {word})"
                for key, word in words
                if command.jump(SimpleNamespace(**{**known, key: word})) == "none"
            ]
    return sorted(names)


def _example(name: str) -> str:
    unit = "10 cm" if component(name).kind == "prismatic" else "10 deg"
    return f"trapezoid(to = {unit}, max_rate = {unit}/s, max_acceleration = {unit}/s^2)"

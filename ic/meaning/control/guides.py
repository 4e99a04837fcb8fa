"""Guides of a run: their models' parameters, those of each joint that follows, the courses of their paths, their
ticks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, Final

import numpy as np

from ic.grammar.syntax import spell
from ic.meaning.control.courses import use_component
from ic.meaning.control.schedule import Rate, Ticker, fixed_rate
from ic.meaning.control.servos import Use
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.cycles import components
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import idleness, model_of_entry, refuse_values, use_model
from ic.meaning.parameters.owner import COMPILED_ALONE, Owner, a_model
from ic.meaning.parameters.relations import check_names
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import counted, known_words
from met import models, units
from met.diagnostic import Label, Place, leave_out
from met.frozen import frozen
from met.plan import COMPONENTS, Course, GuideUse, Structure
from met.plan.channel import carries
from met.plan.defaults import component
from met.trace import Real

KIND: Final = "guide"
COURSES_BEHIND_GUIDES: Final = frozenset({"pulse"})
"""Courses whose names guides may have, in decks that are older than the courses: there the guide is meant."""

USAGE = "write `guide NAME = MODEL { ... }`"


@frozen
class Guiding(Ticker):
    """A guide of the run. Without a rate of its own and without a computer (`ticks`) it has none.

    link, components    the link that it guides, and in which components, where it has a path
    all_commands_known  whether the command of every joint is known, so that none is missing among `joints`
    fastest             rate constant of its error, 1/s (`Guide.fastest`); None where that is unknown
    """

    model: Any
    joints: tuple[str, ...]
    courses: tuple[Course, ...]
    link: str
    components: tuple[str, ...]
    all_commands_known: bool
    fastest: Real | None

    kind = KIND
    verb = "ticks"
    code = "D277"

    @property
    def ticks(self) -> bool:
        return self.model.steer is not None

    def use(self, divisor: int) -> GuideUse:
        """The guide as a plan has it. divisor: base ticks between its ticks"""
        return GuideUse(self.name, self.model.name, self.joints, divisor, self.courses, self.place)


def name_guides(scope: Scope, block: MergedBlock) -> None:
    """Enter the run's guides in the scope, so that commands may name them; names that are taken are reported."""
    scope.guides = {item.name: item for item in block.of_kind(KIND)}
    for name, item in scope.guides.items():
        let = scope.definitions.lets.get(name)
        if meaning := _meaning(scope, name, item.place):
            scope.complaints.error(
                "D271",
                f"`{name}` is {meaning}, so no guide can be called so",
                item.place,
                also=[Label(let.name.place, "the value")] if let is not None else [],
                help="give the guide another name: `rate(NAME)` is to mean one thing",
            )


def _meaning(scope: Scope, name: str, place: Place) -> str:
    """The other meaning of a name in place of a command's value; "" where it may be a guide's name."""
    if name in scope.definitions.lets:
        return "a value"
    if units.is_unit(name) and scope.definitions.edition_at(place) == 1:
        return "a unit"
    courses = set(models.available("command")) - COURSES_BEHIND_GUIDES
    return "a course in time" if name in courses else ""


def resolve_guides(
    scope: Scope, block: MergedBlock, arm: ResolvedArm, uses: list[Use], duration: float | None
) -> list[Guiding]:
    """Every guide of the run, in the deck's order; mistakes are reported. duration: of the run, s; None: unknown."""
    guidings = []
    for item in block.of_kind(KIND):
        with scope.complaints.gather():
            guiding = _guide(scope, item, arm, uses, duration)
            if guiding is not None:
                guidings.append(guiding)
    return guidings


def check_guides(scope: Scope, guides: Iterable[Guiding], structure: Structure) -> None:
    """Check that each guide can work: its joints carry the link, and are at least as many as its components."""
    for guide in guides:
        idle = [joint for joint in guide.joints if guide.link and not carries(structure, guide.link, joint)]
        if idle:
            scope.complaints.error(
                "D276",
                f"joint `{idle[0]}` follows guide `{guide.name}`, and does not carry link `{guide.link}`",
                guide.place,
                help="give it a command of its own, or guide a link that it carries",
            )
        elif guide.all_commands_known and 0 < len(guide.joints) < len(guide.components):
            words = next((p for p in guide.model.parameters if p.name == "guides"), None)
            others = words.words if words is not None else ()
            scope.complaints.error(
                "D275",
                f"guide `{guide.name}` moves {counted(len(guide.joints), 'joint')} and guides "
                f"{counted(len(guide.components), 'component')}: {', '.join(guide.components)}",
                guide.place,
                help=[
                    "let more joints follow it, or guide less",
                    *([known_words("`guides` may be", others)] if others else ()),
                ],
            )


def check_period(scope: Scope, guide: Guiding, rate: Rate) -> None:
    """Check that a guide reduces its error from tick to tick."""
    if guide.fastest is None:
        return

    def test(values: np.ndarray) -> tuple[np.ndarray, list[str]]:
        bad = ~(values[:, 0] < 2.0 * rate.hz)
        return bad, [f"{x / rate.hz:.3g} times the error is taken off at each tick" for x in values[bad, 0][:1]]

    scope.checks.require(
        (guide.fastest,),
        test,
        code="D279",
        message=f"guide `{guide.name}` is unstable at {rate.hz:g} Hz",
        place=guide.place,
        needs=(f"guides.{guide.name}",),
        help=f"what it takes off in a second, its gain, must stay below twice its rate, {2.0 * rate.hz:g}/s, and well "
        "below what its servos can follow",
    )


def _guide(scope: Scope, item: Item, arm: ResolvedArm, uses: list[Use], duration: float | None) -> Guiding | None:
    """The guide of an entry; None where it has a mistake, which is reported."""
    helps = [USAGE, known_words("guide models", sorted(models.available(KIND)))]
    guide = model_of_entry(scope, item, KIND, "D270", helps)
    if guide is None or refuse_values(scope, item.value, [p.name for p in guide.parameters]):
        return None
    body = item.body or MergedBlock()
    follow = [use for use in uses if use.command is not None and use.command.guide == item.name]
    whole = not scope.failed_servos and all(use.command is not None or not use.servo.commands for use in uses)
    if not follow and whole and not _meaning(scope, item.name, item.place):
        kind = guide.commands[0]
        scope.complaints.error(
            "D272",
            f"no joint follows guide `{item.name}`",
            item.place,
            help=f"write `command = {kind}({item.name});` in the servo of each joint that it moves, "
            "or leave the guide out",
        )
    for use in follow:
        assert use.command is not None
        if use.command.kind not in guide.commands:
            scope.complaints.error(
                "D273",
                f"guide `{item.name}` ({guide.name}) commands no {use.command.kind}",
                use.place,
                also=[Label(item.place, "the guide")],
                help=f"write `command = {guide.commands[0]}({item.name});` for joint `{use.joint}`",
            )
    joints = tuple(use.joint for use in follow)
    owner = Owner(f"guide `{item.name}`", item.place, f"guides.{item.name}", homes=item.homes)
    scope.keep_in_deck(f"{owner.path}.model", guide.name, item)
    known = {"joint": [joint.name for joint in arm.moving], "link": [link.name for link in arm.links]}
    named = check_names(scope, owner, guide.parameters, body, arm=arm.name, known=known, failed=arm.failed)
    paths = list(COMPONENTS) if guide.components is not None else []
    of_joint = [p.name for p in guide.of_joint]
    extra = [
        *(["rate"] if guide.steer is not None else []),
        *paths,
        *of_joint,
        *(f"{joint}.{name}" for joint in joints for name in of_joint),
    ]
    values = use_model(scope, owner, guide.parameters, body, extra)
    _of_joints(scope, owner, guide, body, arm, joints)
    guided = guide.components(SimpleNamespace(**values)) if values is not None and paths else ()
    courses = _courses(scope, owner, body, paths, guided if values is not None else COMPONENTS, joints)
    rate = None
    scope.not_sweepable[owner.path] = a_model("a guide", owner.path)
    if guide.steer is not None and body.get("rate") is not None:
        rate = fixed_rate(scope, owner, body.items["rate"], owner.label, doc="how often its law ticks")
    scope.not_sweepable[owner.join("rate")] = COMPILED_ALONE
    fastest = None
    if guide.fastest is not None and values is not None:
        with scope.complaints.gather():
            fastest = guide.fastest(SimpleNamespace(**values))
    if values is not None and duration is not None:
        _remark_idle(scope, guide, item, values, duration)
    link = named.get("link", "") if guide.components is not None else ""
    if link not in known["link"]:
        link = ""
    return Guiding(item.name, rate, item.place, guide, joints, courses, link, tuple(guided), whole, fastest)


def _remark_idle(scope: Scope, guide: Any, item: Item, values: Mapping[str, Any], duration: float) -> None:
    """Report a guide that does nothing, or a part of it, by its written constants."""
    idle = idleness(guide, values, duration)
    if idle is not None:
        keys, why = idle
        written = [part for name in keys if (part := (item.body or MergedBlock()).get(name)) is not None]
        needed = [parameter for parameter in guide.parameters if parameter.name in keys and parameter.default is None]
        scope.complaints.remark(
            "D301",
            f"guide `{item.name}` {why}",
            (written[0] if written else item).value_place,
            help="change that, or leave it out"
            if not needed
            else f"change {' or '.join(f'`{name}`' for name in keys)}",
        )


def _of_joints(
    scope: Scope, owner: Owner, guide: Any, body: MergedBlock, arm: ResolvedArm, joints: Sequence[str]
) -> None:
    """The parameters of each joint: those written for it, else those written for all, which a path without a joint
    reaches."""
    kinds = {joint.name: joint.kind for joint in arm.moving}
    for wanted in guide.of_joint:
        general = body.get(wanted.name)
        parts = [part for part in components(general, len(joints)) if part is not None]
        if general is not None and joints and len(parts) > 1:
            fits = len(parts) == len(joints)
            values = [spell(part) for part in parts] if fits else ["..."] * len(joints)
            lines = "  ".join(f"{joint}.{wanted.name} = {value};" for joint, value in zip(joints, values, strict=True))
            follow = f"{', '.join(f'`{joint}`' for joint in joints)} alone follow{'s' * (len(joints) == 1)} it"
            scope.complaints.error(
                "D071",
                f"`{wanted.name}` of {owner.label} is one number for each joint, and this is a list",
                general.value_place,
                help=f"write `{lines}`" if fits else [f"write `{lines}`", follow],
            )
            scope.checks.fail(owner.join(wanted.name))
            continue
        for joint in joints:
            own = body.get(f"{joint}.{wanted.name}")
            all_of_them = () if own is not None else (owner.path,)
            item = own or general
            item = replace(item, homes=all_of_them) if item is not None else None
            whose = Owner(
                f"joint `{joint}` of {owner.label}",
                item.place if item is not None else owner.place,
                f"{owner.path}.{joint}",
                homes=all_of_them,
                local="",
                joint=kinds[joint],
            )
            if scope.number(whose, wanted, item) is None and own is None:
                break  # the same would be reported for every joint


def _courses(
    scope: Scope, owner: Owner, body: MergedBlock, known: Iterable[str], guided: Iterable[str], joints: Iterable[str]
) -> tuple[Course, ...]:
    """The courses (values as functions of time) of those components of a guide's path that the deck writes, in order.
    Mistakes are reported (D274)."""
    courses = []
    for name in known:
        part = body.get(name)
        if part is None:
            continue
        if name in joints:
            scope.complaints.error(
                "D274",
                f"`{name}` of {owner.label} is a component of its path, and a joint that follows it",
                part.place,
                help="give the joint another name",
            )
            continue
        if name not in guided:
            chosen = body.get("guides")
            later = chosen is not None and len(chosen.homes) < len(part.homes)  # by a run `like` the one of the path
            scope.complaints.error(
                "D274",
                f"`{name}` is not guided by {owner.label}",
                chosen.value_place if chosen is not None and later else part.place,
                also=[Label(part.place, "written here")] if later else [],
                help=[
                    f"it guides {', '.join(guided)}",
                    f"write `remove {name};`, or guide more" if later else leave_out("leave it out, or guide more"),
                ],
            )
            continue
        with scope.complaints.gather():
            model = _course(scope, owner, part)
            if model is not None:
                courses.append(Course(name, model))
    return tuple(courses)


def _course(scope: Scope, owner: Owner, item: Item) -> str | None:
    """The command's model that moves one component of a guide's path in time, its parameters entered in the scope; None
    where it has a mistake, which is reported."""
    if item.value is None:
        unit = "1 m" if component(item.name).kind == "prismatic" else "30 deg"
        scope.complaints.error(
            "D274",
            f"`{item.name}` of {owner.label} is a value or a course in time",
            item.place,
            help=f"write `{item.name} = ramp(to = {unit}, over = 10 s);`",
        )
        return None
    label, path = f"`{item.name}` of {owner.label}", f"{owner.path}.{item.name}"
    return use_component(scope, item, label, path, f"{item.name} of the path", "joint")

"""Arms: links with their inertia, and joints with their frames."""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

from ic.grammar.syntax import Call, Expression, Name, Unary
from ic.language import HEADS
from ic.language.bodies import ARM, AT, AXIS, BOOM, JOINT, JOINT_KINDS, JOINT_LIMITS, LINK, LUMPED, Q_MIN, RPY
from ic.meaning.definitions.merge import Item, MergedBlock, no_block, with_meant_names
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.mechanics.bodies import check_moved
from ic.meaning.mechanics.booms import KEYS, check_names, resolve_boom
from ic.meaning.mechanics.dh import use_dh
from ic.meaning.mechanics.foreign import refuse_foreign_joint
from ic.meaning.mechanics.loops import check_followers, close_loops, resolve_loop, use_follows
from ic.meaning.mechanics.matter import use_matter
from ic.meaning.mechanics.meshes import link_meshes
from ic.meaning.mechanics.tree import check_tree
from ic.meaning.parameters.addresses import in_arm
from ic.meaning.parameters.models import check_keys, word_of
from ic.meaning.parameters.owner import COMPILED_ALONE, Owner
from ic.meaning.parameters.relations import check_relations, no_direction
from ic.meaning.parameters.scope import Scope
from ic.meaning.parameters.shared import SharedEntries
from ic.text.complaints import Complaints, known_words, where_it_belongs
from met.diagnostic import Label, did_you_mean, leave_out, meant, write
from met.frozen import frozen
from met.plan import BASE, Joint, Link
from met.plan.chains import springs
from met.plan.closing import Loop
from met.trace import Scalar, sqrt

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
LIMITS = "limits of a joint are `q_min`, `q_max`, `qd_max` and `tau_max`; what stops it is a `joint_stop` of a run"
NOT_OF_A_JOINT = {
    **dict.fromkeys(("limit", "limits", "range", "stops"), LIMITS),
    "mimic": "a joint that follows another has `follows = JOINT;`, and where they are needed `ratio` and `offset`",
}

OF_A_TUBE = dict.fromkeys(("E", "tube"), "write `EI`: of a tube of radius r and wall t it is E pi r^3 t")
OF_A_BOOM = dict.fromkeys(
    ("EI", "GJ", "damping_ratio", "nodes", *OF_A_TUBE),
    "it is of a link that bends: write `link NAME boom { ... }`, with its `EI`",
)


@frozen
class ResolvedArm:
    """An arm of a run: its links and joints, in the deck's order.

    failed          names of joints and links that could not be resolved (already reported)
    free_of_errors  whether nothing at all of the deck was wrong so far
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    failed: frozenset[str] = frozenset()
    free_of_errors: bool = True

    def kind(self, joint: str) -> str | None:
        return next((j.kind for j in self.joints if j.name == joint), None)

    @property
    def moving(self) -> tuple[Joint, ...]:
        return tuple(joint for joint in self.joints if joint.kind != "fixed")

    @cached_property
    def springs(self) -> frozenset[str]:
        """Names of the joints at which booms bend and twist."""
        return springs(self.links, self.joints)

    @property
    def independent(self) -> tuple[Joint, ...]:
        """The moving joints that follow no other and are no springs of booms."""
        return tuple(joint for joint in self.moving if not joint.follows and joint.name not in self.springs)


Part = tuple[Link | Joint | Loop, ...]
"""A link, a joint or a loop of the deck; of a boom its pieces and joints."""


@frozen
class SharedPart:
    """A link or a joint without mistakes, resolved without a sweep, and its entries of a scope. item: kind and name"""

    item: tuple[str, str]
    part: Part
    entries: SharedEntries


@frozen
class SharedArm:
    """An arm without mistakes: the parts that runs share, each run except for the parts in which it varies something.

    parts  its links, then its joints, in the deck's order
    """

    arm: ResolvedArm
    parts: tuple[SharedPart, ...]


def packed_arm(definitions: Definitions, name: str) -> bytes:
    """A definition's arm in the form that runs share, for `bring_arm`; empty where it was not, or cannot be,
    resolved."""
    shared = definitions.memo.get(_memo_key(name))
    if isinstance(shared, bytes):
        return shared
    plain = shared is not None and all(part.entries.names.is_plain for part in shared.parts)
    return pickle.dumps(shared, pickle.HIGHEST_PROTOCOL) if plain else b""


def bring_arm(definitions: Definitions, name: str, packed: bytes) -> None:
    """Let the runs of these definitions share an arm that was resolved earlier, from an equal definition."""
    if packed:
        definitions.memo[_memo_key(name)] = packed


def _memo_key(name: str) -> tuple[str, str]:
    return ("arm", name)


def resolve_arm(scope: Scope, definition: Definition) -> ResolvedArm | None:
    """The arm, with its numbers entered as parameters; None where its definition could not be merged.

    Each link and joint is resolved once for all runs of the deck, except those that set or vary something in it.
    """
    shared = _shared(scope, definition)
    if shared is None:
        return _resolved(scope, definition)
    as_written = [_is_as_written(scope, part) for part in shared.parts]
    if all(as_written):
        for part in shared.parts:
            part.entries.enter(scope)
        return replace(shared.arm, free_of_errors=not scope.complaints.errors)
    those = {part.item: part for part, plain in zip(shared.parts, as_written, strict=True) if plain}
    return _resolved(scope, definition, those)


def _shared(scope: Scope, definition: Definition) -> SharedArm | None:
    """The arm shared by all runs; None where it has a mistake, or a remark."""
    if scope.complaints.is_known_to_lack(definition.place):
        return None
    memo, key = scope.definitions.memo, _memo_key(definition.name)
    if key not in memo:
        memo[key] = _alone(scope, definition)
    if isinstance(memo[key], bytes):
        memo[key] = pickle.loads(memo[key])
    arm: SharedArm | None = memo[key]
    return arm


def _alone(scope: Scope, definition: Definition) -> SharedArm | None:
    """The arm resolved alone, each part in a scope of its own."""
    complaints, alone = Complaints(), list[tuple[tuple[str, str], Part, Scope]]()
    definitions = scope.definitions.reporting_to(complaints)
    arm = _resolved(Scope(definitions, complaints), definition, alone=alone)
    if not arm or not complaints.is_clear:
        return None
    parts = []
    for item, part, own in alone:
        entries = SharedEntries.of(own)
        if entries is None:
            return None
        parts.append(SharedPart(item, part, entries))
    return SharedArm(arm, tuple(parts))


def _is_as_written(scope: Scope, shared: SharedPart) -> bool:
    """True where neither a sweep nor a setting from outside changes a number of the part, or a name in one."""
    entries = shared.entries
    return entries.known.keys().isdisjoint((*scope.varied, *scope.settings)) and entries.has_names_as_written(scope)


def _resolved(
    scope: Scope,
    definition: Definition,
    shared: Mapping[tuple[str, str], SharedPart] = MappingProxyType({}),
    alone: list[tuple[tuple[str, str], Part, Scope]] | None = None,
) -> ResolvedArm | None:
    """The arm resolved in this scope.

    shared  parts that are taken over instead, by kind and name
    alone   takes each part with kind and name and the scope of its own in which it is resolved; None: in this scope
    """
    block = scope.definitions.block(definition)
    if block is None:
        return None
    homes = scope.definitions.homes(definition)
    for item in block.items.values():
        if item.kind not in ARM.named:
            _stray(scope, item, block)
    block = with_meant_names(block, (), ARM.named)
    for statement in block.statements:
        scope.complaints.error(
            "D080", "an arm holds links and joints; this is neither", statement.place, help="move it to the run"
        )
    ends = {item.name: None for item in block.of_kind("link")}

    def part(item: Item) -> Part:
        """The links, joints or loop that an item of the arm's block stands for, taken from `shared` where they are
        there."""
        known = shared.get((item.kind, item.name))
        if known is not None:
            known.entries.enter(scope)
            return known.part
        own_scope = scope if alone is None else Scope(scope.definitions, scope.complaints)
        if item.kind == "link":
            parts = resolve_link(own_scope, item, homes)
        elif item.kind == "loop":
            parts = _loop(own_scope, item, homes, ends)
        else:
            joint = _joint(own_scope, item, homes, block, ends)
            parts = () if joint is None else (joint,)
        if alone is not None:
            alone.append(((item.kind, item.name), parts, own_scope))
        return parts

    links, of_booms = list[Link](), list[Joint]()
    for item in block.of_kind("link"):
        parts = part(item)
        check_names(scope, item, parts, block)
        links += [link for link in parts if isinstance(link, Link)]
        ends |= {link.name: None for link in links if link.shape is not None}
        of_booms += [joint for joint in parts if isinstance(joint, Joint)]
    roots = {link.name: link.root for link in links if link.root}
    written = [part(item) for item in block.of_kind("joint")]
    own = [joint for parts in written for joint in parts if isinstance(joint, Joint)]
    joints = [replace(joint, child=roots.get(joint.child, joint.child)) for joint in own]
    complete = len(joints) == len(written) and not scope.complaints.is_known_to_lack(definition.place, "joint")
    joints += of_booms
    if not any(True for _ in block.of_kind("link")):
        scope.complaints.missing(
            definition.place,
            ("link",),
            "D081",
            f"arm `{definition.name}` has no links",
            help="write `link NAME { ... }` and a joint to hold it",
        )
    check_tree(scope, definition.name, links, joints, complete=complete)
    loops = [loop for item in block.of_kind("loop") for loop in part(item) if isinstance(loop, Loop)]
    if complete:
        joints = close_loops(scope, joints, loops)
    check_followers(scope, joints)
    free_of_errors = not scope.complaints.errors
    names = {item.name for kind in ARM.named for item in block.of_kind(kind)}
    resolved: tuple[Link | Joint | Loop, ...] = (*links, *joints, *loops)
    failed = frozenset(names - {named.name for named in resolved})
    return ResolvedArm(definition.name, tuple(links), tuple(joints), failed, free_of_errors)


def check_arm(scope: Scope, definition: Definition) -> None:
    """Report the mistakes of an arm alone, without payloads."""
    arm = resolve_arm(scope, definition)
    if arm is not None and arm.free_of_errors:
        check_moved(scope, arm.links, arm.joints)


def _stray(scope: Scope, item: Item, block: MergedBlock) -> None:
    """Report an entry that an arm's block cannot have (D082, D083), with what may have been meant."""
    known = [other.name for other in block.items.values() if other.kind in ARM.named]
    if item.kind:
        scope.complaints.error(
            "D082",
            f"no `{item.kind}` in an arm",
            item.place,
            help=[*did_you_mean(item.kind, ARM.named), *where_it_belongs(item.kind), "an arm holds links and joints"],
        )
    else:
        adds = f"`link {item.name} {{ ... }}` or `joint {item.name} revolute {{ ... }}` would add one"
        helps = [*did_you_mean(item.name, known), adds if "." not in item.name else known_words("it has", known)]
        scope.complaints.error(
            "D083", f"nothing named `{item.name}` to change in this arm", item.place, help=in_arm(item, known) or helps
        )


# Links


def resolve_link(scope: Scope, item: Item, homes: tuple[str, ...]) -> Part:
    """A link of an arm, or a boom's pieces, its numbers entered as parameters; empty where it has no block
    (reported)."""
    owner = Owner(f"link `{item.name}`", item.place, f"links.{item.name}", homes=homes)
    written_boom = [word.text for word in item.detail] == [BOOM.name]
    is_boom = written_boom and item.name != BASE
    if item.detail and not is_boom:
        scope.complaints.error(
            "D085",
            f"`{item.detail[0].text}` after the name of a link",
            item.detail[0].place,
            help=[
                f"write `link {item.name} {{ ... }}`",
                *([f"or `link {item.name} boom {{ ... }}`, of a link that bends"] if item.name != BASE else []),
            ],
        )
    if item.body is None or item.value is not None:
        scope.complaints.error(
            "D085",
            f"link `{item.name}` needs a block",
            item.place,
            help=f"write `link {item.name} {{ mass = ...; shape = ...; }}`",
        )
        return ()
    check_keys(scope, item.body, KEYS if written_boom else LINK.keys, owner, OF_A_TUBE if is_boom else OF_A_BOOM)
    if not written_boom and any(name in OF_A_BOOM for name in item.body.items):
        return ()
    written = item.body.get(LUMPED.name)
    lumped = written is not None and scope.word(owner, LUMPED, written) != "off"  # None: no such word, already reported
    shape = use_matter(scope, owner, "link", item.name, item.body, lumped=lumped)
    meshes = link_meshes(scope, owner, item.body.get("mesh"))
    link = Link(item.name, item.place, shape, lumped, meshes=meshes)
    return resolve_boom(scope, owner, item, item.body, link) if is_boom else (link,)


# Joints


def _joint(
    scope: Scope, item: Item, homes: tuple[str, ...], block: MergedBlock, links: Mapping[str, None]
) -> Joint | None:
    """The joint of an item, its frame and limits resolved; None where it has a mistake, which is reported."""
    owner = Owner(f"joint `{item.name}`", item.place, item.name, homes=homes)
    if refuse_foreign_joint(scope, item, homes[-1], block):
        return None
    kind = item.detail[0].text if item.detail else None
    if item.body is None or item.value is not None:
        scope.complaints.error(
            "D091",
            f"joint `{item.name}` needs a block",
            item.place,
            help=f"write `joint {item.name} revolute {{ parent = base; child = ...; axis = z; }}`",
        )
        return None
    if kind not in JOINT_KINDS:
        place = item.detail[0].place if item.detail else item.place
        message = f"no kind of joint `{kind}`" if kind else f"joint `{item.name}` has no kind"
        scope.complaints.error(
            "D090",
            message,
            place,
            help=[
                *(did_you_mean(kind, JOINT_KINDS) if kind else ()),
                f"write `joint {item.name} revolute {{ ... }}`, or prismatic, or fixed",
            ],
        )
        kind = meant(kind, JOINT_KINDS) if kind else None
        if kind is None or (kind != "fixed" and item.body.get("axis") is None and item.body.get("dh") is None):
            return None
    if _begins_paths(scope, item):
        return None
    body = item.body
    check_keys(scope, body, JOINT.keys, owner, NOT_OF_A_JOINT)
    parent = _end(scope, owner, "parent", body.get("parent"), {BASE: None, **links})
    child = _end(scope, owner, "child", body.get("child"), {name: None for name in links if name != BASE})
    if body.get("dh") is not None:
        use_dh(scope, owner, kind, body.items["dh"], body)
    else:
        _frame(scope, owner, kind, body)
    limits = _limits(scope, replace(owner, joint=kind), body)  # type: ignore[arg-type]  # a kind of joint by now
    for end in ("parent", "child"):
        scope.not_sweepable[f"{item.name}.{end}"] = COMPILED_ALONE
    follows = use_follows(scope, replace(owner, joint=kind), body, block)  # type: ignore[arg-type]
    if parent is None or child is None or follows is None:
        return None
    return Joint(item.name, kind, parent, child, item.place, limits, follows)  # type: ignore[arg-type]


def _loop(scope: Scope, item: Item, homes: tuple[str, ...], links: Mapping[str, None]) -> Part:
    """The loop of an entry of an arm, with its pin's numbers entered; none where it has a mistake (reported: D213)."""
    owner = Owner(f"loop `{item.name}`", item.place, item.name, homes=homes)
    if item.body is None or item.value is not None or item.detail:
        helps = f"write `loop {item.name} {{ leader = JOINT;  link = ...;  to = ...;  branch = left; }}`"
        scope.complaints.error("D213", f"{owner.label} needs a block, and no word before it", item.place, help=helps)
        return ()
    if _begins_paths(scope, item):
        return ()
    link, to = (_end(scope, owner, key, item.body.get(key), {BASE: None, **links}) for key in ("link", "to"))
    return resolve_loop(scope, owner, item.body, link, to)


def _begins_paths(scope: Scope, item: Item) -> bool:
    """Return True, with an error, if paths of a run begin with the name of this joint or loop."""
    roof = scope.definitions.roofs.get(item.name)
    if item.name not in (*HEADS, BASE) and roof is None:
        return False
    scope.complaints.error(
        "D166",
        f"`{item.name}` begins paths of its own, so no {item.kind} may be called so",
        item.place,
        also=[Label(roof.use.roof.place, "a roof")] if roof is not None else [],
        help=f"give the {item.kind} another name"
        if roof is None
        else f"give the roof another name, or the {item.kind}",
    )
    return True


def _limits(scope: Scope, owner: Owner, body: MergedBlock) -> tuple[str, ...]:
    """The names of the joint's written limits, with their numbers entered."""
    written = {wanted: item for wanted in JOINT_LIMITS if (item := body.get(wanted.name)) is not None}
    if owner.joint == "fixed":
        for wanted, item in written.items():
            message = f"a fixed joint has no `{wanted.name}`"
            helps = leave_out(f"leave `{wanted.name}` out: it does not move")
            scope.complaints.error("D346", message, item.place, help=helps)
        return ()
    values = {wanted.name: scope.number(owner, wanted, item) for wanted, item in written.items()}
    ends = [name for name in ("q_min", "q_max") if name in values]
    of_file = bool(ends) and scope.definitions.robot_files.hold(body.items[ends[0]].place)
    if len(ends) == 1:
        other = "q_max" if ends == ["q_min"] else "q_min"
        message = f"{owner.label} has `{ends[0]}` and no `{other}`"
        scope.complaints.error(
            "D346",
            message,
            body.items[ends[0]].place,
            help=[
                f"write `{other}` too: a range has two ends",
                *([f"in the arm's block: `{owner.path} {{ {other} = ...; }}`"] if of_file else []),
            ],
        )
    elif ends and None not in values.values():
        remedies: tuple[str, ...] = ("swap them, or leave both out: a range has two ends",)
        if of_file:
            instead = f"`{owner.path} {{ remove q_min;  remove q_max; }}`, or write both there"
            remedies = (*remedies, f"in the arm's block: {instead}")
        check_relations(scope, owner, (Q_MIN,), body, values, remedies)
    return tuple(values)


def _frame(scope: Scope, owner: Owner, kind: str, body: MergedBlock) -> None:
    """The joint's frame from `at`, `rpy` and `axis`."""
    for wanted in (AT, RPY):
        scope.vector(owner, wanted, body.get(wanted.name))
    _axis(scope, owner, kind, body.get("axis"))


def _end(scope: Scope, owner: Owner, key: str, item: Item | None, known: Mapping[str, None]) -> str | None:
    """The link's name that `parent` or `child` of a joint has; None where it has no link's (reported: D092 to D094)."""
    if item is None:
        scope.complaints.missing(
            owner.place, (key,), "D092", f"{owner.label} has no {key}", help=f"write `{key} = LINK;`"
        )
        return None
    if item.upon is not None:
        scope.complaints.add(no_block(item.name, item.upon, item.place))
        return None
    name = None if isinstance(item.value, Call) else word_of(item.value)
    if name in known:
        return name
    if name == BASE:
        scope.complaints.error(
            "D093", "the base cannot be a child", item.value_place, help="turn the joint round: `parent = base;`"
        )
    elif name is None:
        scope.complaints.error(
            "D094", f"a link's name is needed for {key}", item.value_place, help=known_words("links", known)
        )
    else:
        ground = name in scope.definitions.robot_files.roots
        near = (
            (write("base", f"`{name}` is the root of its robot: write `base`", old=name),)
            if ground
            else did_you_mean(name, known)
        )
        arm = scope.definitions.of_kind("arm").get(item.homes[-1] if item.homes else "")
        block = scope.definitions.block(arm) if arm is not None else None
        gone = [removal for removal in block.removed if removal.key == f"link {name}"] if block is not None else []
        helps = [f"remove joint `{owner.path}` too, or hang it elsewhere"] if gone else near
        scope.complaints.error(
            "D094",
            f"no link `{name}` in this arm",
            item.value_place,
            also=[Label(removal.place, "removed here") for removal in gone],
            help=[*helps, known_words("links", known)],
        )
    return None


def _axis(scope: Scope, owner: Owner, kind: str, item: Item | None) -> None:
    """Resolve the axis of a joint as three parameters of length 1, or report what is wrong (D065, D095 to D097)."""
    if kind == "fixed":
        if item is not None:
            helps = leave_out("leave `axis` out")
            scope.complaints.error("D095", "a fixed joint has no axis", item.place, help=helps)
        return
    if item is None:
        scope.complaints.missing(
            owner.place,
            ("axis", "dh"),
            "D096",
            f"{owner.label} has no axis",
            help="write `axis = z;`, or x, y, -x, ... or [0, 0.6, 0.8]",
        )
        return
    if item.upon is not None:
        scope.complaints.add(no_block(item.name, item.upon, item.place))
        scope.checks.fail(owner.join("axis"))
        return
    named = _named_axis(item.value)
    value = item.value.operand if isinstance(item.value, Unary) else item.value
    if named is None and isinstance(value, Name) and len(value.path) == 1 and not scope.names.is_value(value):
        scope.complaints.error(
            "D065",
            f"no axis and no value `{value.text}`",
            value.place,
            help="an axis is x, y, z, -x, -y or -z, or three numbers such as [0, 0.6, 0.8]",
        )
        scope.checks.fail(owner.join("axis"))
        return
    written = scope.vector(owner, AXIS, item if named is None else replace(item, value=None), replacements=named)
    if written is None:
        return
    scope.checks.require(
        written,
        no_direction,
        code="D097",
        message=f"the axis of {owner.label} has no direction",
        place=item.value_place,
        needs=(owner.join("axis"),),
        help="write numbers of ordinary size, not all of them zero",
    )
    x, y, z = written
    length = sqrt(x * x + y * y + z * z)
    if isinstance(length, Scalar) or 0.0 < length < math.inf:
        parts = zip("xyz", written, strict=True)
        scope.replace_values({owner.join(f"axis.{name}"): part / length for name, part in parts}, item)


def _named_axis(value: Expression | None) -> tuple[float, float, float] | None:
    """The unit vector of an axis that is written by its name, such as `-x`; None of other expressions."""
    sign = 1.0
    if isinstance(value, Unary) and value.operator in ("-", "+"):
        sign, value = (-1.0 if value.operator == "-" else 1.0), value.operand
    if isinstance(value, Name) and value.text in AXES:
        x, y, z = AXES[value.text]
        return (sign * x + 0.0, sign * y + 0.0, sign * z + 0.0)
    return None

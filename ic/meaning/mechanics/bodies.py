"""Checks that links can be bodies: their inertia, and the mass that each joint moves.

A link of `mass = 0 kg` is a frame: it has no inertia. Fixed to a body it is a place on it, between two joints it is
where they meet. An inertia of zeros is a point's, one of 0 and two that are alike is a thin rod's, as the shape `rod`
has it; else every principal moment is above zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ic.meaning.definitions.merge import Item
from ic.meaning.expressions.conditions import in_pieces
from ic.meaning.mechanics.loops import all_led_by
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from met.plan import BASE, Joint, Link, Payload
from met.trace import Real


def check_body(
    scope: Scope,
    owner: Owner,
    kind: str,
    name: str,
    item: Item | None,
    inertia: tuple[Real, ...],
    mass: Real | None,
    *,
    lumped: bool = False,
) -> None:
    """Check that the inertia is a body's, in every case. item: the inertia as written, None where it follows from a
    shape; kind: in words; lumped: it need only be finite, for the arm's mass matrix is checked instead"""
    helps = [
        f"inertia is about the centre of mass, in {kind} axes: [xx, yy, zz] or [xx, yy, zz, xy, xz, yz] kg*m^2",
        "products have the sign of -sum(m x y)",
    ]
    if _is_plainly_a_body(inertia, mass):
        return
    weightless = isinstance(mass, float) and mass == 0.0
    if weightless:
        helps = [f"leave `inertia` out, or write the {kind}'s mass"]
    place, of_file = owner.place, False
    if item is not None:
        place = item.value_place
        of_file = scope.definitions.robot_files.hold(place)
        if of_file:
            entry = f"{name} {{ {'remove inertia;' if weightless else 'inertia = [...] kg*m^2;'} }}"
            if name == BASE:  # which the arm does not hold, so that there is nothing to change
                entry = f"link {BASE} {{ mass = ...;  inertia = [...] kg*m^2; }}"
            helps.append(f"in the arm's block: `{entry}`")
    if kind == "link" and not lumped and not (of_file and name == BASE):
        entry = f"in the arm's block, `{name} {{ lumped = on; }}`" if of_file else "write `lumped = on;` in the link"
        helps.append(f"if it is of an identified set (base parameters), which need be no body's: {entry}")
    scope.checks.require(
        (*inertia, 1.0 if mass is None else mass),
        lambda values: in_pieces(lambda rows: _not_a_body(rows, kind, lumped=lumped), values),
        code="D087",
        needs=(f"{owner.path}.mass", f"{owner.path}.shape"),
        message=f"the inertia of {kind} `{name}` is no body's",
        place=place,
        help=tuple(helps),
    )


def _is_plainly_a_body(inertia: Sequence[Real], mass: Real | None) -> bool:
    """True for numbers that no case varies, without products of inertia: their moments are the written ones."""
    if not all(
        isinstance(number, float) and math.isfinite(number) for number in (*inertia, 1.0 if mass is None else mass)
    ):
        return False
    least, middle, most = sorted(float(moment) for moment in inertia[:3])
    return mass != 0.0 and not any(inertia[3:]) and least >= 0.0 and most <= least + middle


def _not_a_body(values: np.ndarray, kind: str, *, lumped: bool) -> tuple[np.ndarray, list[str]]:
    """The rows [n, 7], moments and mass, that no rigid body has, as a mask, and the reason in words; of a lumped
    link those that are not finite.

    The tolerance, 1e-9 of the largest moment, is for rounding alone: published tables have ten digits at most. With a
    moment of 0 the other two are alike, for neither may be above the sum of 0 and the other.
    """
    xx, yy, zz, xy, xz, yz, mass = values.T
    matrices = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(-1, 3, 3)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    least, middle, most = np.linalg.eigvalsh(np.where(finite[:, None, None], matrices, np.eye(3))).T
    slack = 1e-9 * np.abs(most)
    point = ~matrices.any(axis=(1, 2))
    negative = least < -slack
    triangle = least + middle < most - slack
    weightless = (mass == 0.0) & ~point
    bad = ~finite if lumped else ~finite | negative | triangle | weightless
    causes = []
    for row in np.flatnonzero(bad)[:1]:
        moments = f"principal moments {least[row]:.6g}, {middle[row]:.6g} and {most[row]:.6g} kg*m^2"
        if not finite[row]:
            causes.append("it is not finite")
        elif weightless[row]:
            causes.append(f"the {kind} has no mass, and so no inertia")
        elif negative[row]:
            causes.append(f"{moments}; none may be negative")
        else:
            causes.append(f"{moments}; no body has one above the sum of the others")
    return bad, causes


def check_moved(scope: Scope, links: Sequence[Link], joints: Sequence[Joint], payloads: Sequence[Payload] = ()) -> None:
    """Check that every moving joint that follows no other carries a link with mass, a lumped one, or a permanent
    payload, in every case, or that one that follows it does; behind one that does not, none is reported.

    The joints make a tree.
    """
    masses = {  # of a lumped link any, as its inertia alone may be enough: D182 looks at that
        link.name: 1.0 if link.lumped else settled.value
        for link in links
        if (settled := scope.parameters.get(f"links.{link.name}.mass")) is not None
    }
    if all(isinstance(mass, float) and mass > 0.0 for mass in masses.values()):
        return
    loads, passing = carried_loads(scope, payloads)
    carried: dict[str, list[Joint]] = {}
    for joint in joints:
        carried.setdefault(joint.parent, []).append(joint)
    order = list(carried.get("base", ()))
    for joint in order:  # parents before children, and all of them while the list grows
        order += carried.get(joint.child, ())
    heavy: dict[str, bool] = {}  # whether it, or something that it carries, has a mass that no case varies
    for joint in reversed(order):
        mass = masses.get(joint.child)
        outboard = (heavy[outer.child] for outer in carried.get(joint.child, ()))
        own = [mass, *(value for _, value in loads.get(joint.child, ()))]
        heavy[joint.child] = any([*outboard, *(isinstance(number, float) and number > 0.0 for number in own)])
    above: dict[str, tuple[str, ...]] = {"base": ()}  # the light joints that move, between the base and a link
    for joint in order:
        before = above[joint.child] = above[joint.parent]
        if (
            joint.kind == "fixed"
            or joint.follows
            or heavy[joint.child]
            or joint.place is None
            or any(scope.checks.failed(path) for path in before)
        ):
            continue
        above[joint.child] = (*before, f"{joint.name}.moved")
        names = [joint.child, *(follower.child for follower in all_led_by(joint, joints))]
        for name in names:
            names += [outer.child for outer in carried.get(name, ())]
        values = [value for name in names if (value := masses.get(name)) is not None]
        values += [value for name in names for _, value in loads.get(name, ())]
        also = [word for name in names for word in passing.get(name, ())]
        scope.checks.require(
            tuple(values),  # type: ignore[arg-type]  # masses are numbers
            lambda rows: (~(rows.sum(axis=1) > 0.0), []),
            code="D217",
            path=f"{joint.name}.moved",
            needs=(
                *before,
                *(f"links.{name}.mass" for name in names),
                *(path for name in names for path, _ in loads.get(name, ())),
            ),
            message=f"joint `{joint.name}` moves nothing that has mass",
            place=joint.place,
            help=(
                f"write the mass of link `{joint.child}`, or of one that it carries",
                "or make the joint fixed",
                *also,
            ),
        )


Loads = dict[str, list[tuple[str, Real]]]


def carried_loads(scope: Scope, payloads: Sequence[Payload]) -> tuple[Loads, dict[str, list[str]]]:
    """By link: path and mass of its permanent payloads, and labels for those that come or go."""
    loads: Loads = {}
    passing: dict[str, list[str]] = {}
    for payload in payloads:
        path = f"payloads.{payload.name}.mass"
        settled = scope.parameters.get(path)
        if payload.flies:
            word = "grapple" if payload.grappled else "release"
            passing.setdefault(payload.link, []).append(
                f"payload `{payload.name}` is not always there: one without `{word}` would count"
            )
        elif settled is not None:
            loads.setdefault(payload.link, []).append((path, settled.value))  # type: ignore[arg-type]  # a number
    return loads, passing

"""Scales of bodies, and of what is asked of a run: grapples, targets of metrics, and what a sweep varies."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ic.meaning.checks.reach import grapple_numbers
from ic.meaning.checks.run_numbers import RunNumbers
from ic.meaning.checks.scale import TURN, Scale
from ic.meaning.control.servos import unit_written
from met import models
from met.plan import BASE
from met.plan.defaults import INERTIA

WATER = 1000.0
"""Density of water, kg/m^3."""


def masses(run: RunNumbers) -> Iterator[Scale]:
    """Masses of links beside water in a cube as long as the link, and beside all links that carry it. Those with a
    shape, of which D298 judges the density, and those with equal moments, which stand for points, are only blamed by
    the first."""
    usual = "of 982 links of published robots none is above 7.2"
    behind = "of 985 links of published robots none is above 23" if run.gravity.any() else "in space an arm moves ships"
    carriers = {BASE: 0.0}
    for joint in run.outward:
        link, head = joint.child, f"links.{joint.child}"
        mass, carrying = run.numbers.get(f"{head}.mass", 0.0), carriers.get(joint.parent, 0.0)
        carriers[link] = carrying + (mass if link in run.moved else 0.0)
        if link not in run.moved or link in run.lumped or not mass > 0.0:
            continue
        turned = (12.0 * run.gyration(head) ** 2 * mass / WATER) ** 0.2  # the cube with this inertia
        long = max(run.extents[link], 2.0 * run.length(f"{head}.com"), turned)
        long = max([long, *(run.offsets[carried_link] for carried_link in run.carried[link])])
        moments = {run.numbers.get(f"{head}.inertia.{part}") for part in INERTIA[:3]}
        water, most = WATER * (long * long * long), 20.0 if not run.extents[link] and len(moments) > 1 else 1e9
        if water > 0.0:
            other = f"that of water in a cube as long as it, {water:.4g} kg"
            yield Scale(
                "mass of a link", f"{head}.mass", mass, "kg", water, other, 0.0, most, usual, meant="kg", typical=0.05
            )
        if carrying > 0.0:
            other, most = f"the mass of the links that carry it, {carrying:.4g} kg", 100.0 if run.gravity.any() else 1e4
            yield Scale("mass on links", f"{head}.mass", mass, "kg", carrying, other, 0.0, most, behind, meant="kg")


def centres(run: RunNumbers) -> Iterator[Scale]:
    """Written centres of mass beside the shape and the joints of their link. A link that carries no joint and has no
    rod, box or cylinder may have its mass anywhere; a shape may stand for one that leads the other way."""
    usual = "of 721 links of published robots none is further from its joints than 0.23"
    for link in sorted(run.moved - run.lumped):
        path, head = f"links.{link}.com", f"links.{link}"
        shaped = run.beside_shape(head, np.zeros(3)) is not None
        if run.is_written(path) and (shaped or run.carried[link]) and run.reach > 0.0:
            large, centre = 10.0 * run.gyration(head), run.vector(path)
            far = min(run.beside_link(link, side * centre) for side in ((1.0, -1.0) if shaped else (1.0,)))
            most, other = max((run.span, run.reach_words), (large, f"10 times its radius of gyration, {large:.4g} m"))
            if shaped:
                most = run.extents[link]
                other = f"the size of its shape, {most:.4g} m"
            verb = f"is beside the shape and the joints of `{link}` by"
            yield Scale("centre beside a link", path, far, "m", most, other, 0.0, 0.25, usual, verb=verb)


def shared_lines(run: RunNumbers) -> Iterator[Scale]:
    """Driven joints that turn about the line about which the driven joint before them turns: by the reach beside the
    distance of the two lines, which is at most the reach away. A spring in a joint is a joint of its own, undriven."""
    driven = {use.joint for use in run.uses if use.command is not None and run.kinds.get(use.joint) == "revolute"}
    before, places = dict[str, str](), run.poses({})[2]
    for joint in run.outward:
        last = before.get(joint.parent, "")
        before[joint.child] = last if joint.kind == "fixed" else joint.name
        if {joint.name, last} <= driven:
            (axis, point), (other, through) = places[joint.name], places[last]
            far = np.linalg.norm(np.cross(point - through, other)) + run.reach * np.linalg.norm(np.cross(axis, other))
            if far < 1e-6 * run.reach:
                yield Scale(
                    "line of a joint",
                    f"{joint.name}.axis",
                    run.reach,
                    "m",
                    max(float(far), 1e-9 * run.reach),
                    "the distance of the two lines",
                    0.0,
                    1e6,
                    "two motors in a row usually turn about two lines",
                    clause=f"turns `{joint.name}` about the line of `{last}`",
                    cure="write another axis, or another place, of one of the two",
                )


def forgotten(run: RunNumbers) -> Iterator[Scale]:
    """Joints that turn, or are fixed, without an `at` on a link whose shape leads away from its own joint."""
    usual, by_dh = "without `at` both joints of a link are in one place", {x.partition(".dh.")[0] for x in run.settled}
    for joint in run.structure.joints:
        long, wide = run.slender(f"links.{joint.parent}")
        placed = joint.name in by_dh or joint.kind == "prismatic" or joint.parent not in run.moved
        if wide > 0.0 and not placed and not run.is_written(f"{joint.name}.at"):
            clause = f"is not written, and `{joint.parent}`, which carries the joint, is {long:.4g} m long"
            cure = "write where it is, or `at = [0, 0, 0] m` if it is meant so"
            path, other = f"{joint.name}.at", "its width"
            yield Scale(
                "joint without a place", path, long, "m", wide, other, 0.0, 2.0, usual, clause=clause, cure=cure
            )


def booms(run: RunNumbers) -> Iterator[Scale]:
    """Lengths of booms beside their widths: springs bend, and a short beam also shears."""
    usual = "shear adds 8 % to what the tip of a tube of 5 widths yields"
    for boom in [link.name for link in run.structure.links if link.root]:
        long, wide = run.slender(f"links.{boom}")
        if wide > 0.0:
            yield Scale("length of a boom", f"links.{boom}.shape", long, "m", wide, "its width", 5.0, 1e9, usual)


def held(run: RunNumbers) -> Iterator[Scale]:
    """Loads at the start of joints that turn: of those without a servo that begin at 0 unwritten, on an arm with
    motors, and by the turns by which they wind up springs."""
    loads, servos = run.loads, {use.joint for use in run.uses}
    motors = any(run.of_motor(use, "kt") is not None for use in run.uses)
    weight = float(np.linalg.norm(run.gravity)) * sum(run.numbers.get(f"links.{link}.mass", 0.0) for link in run.moved)
    for joint in [name for name in loads if run.kinds[name] == "revolute" and not run.is_helped(name)]:
        load, most, stiffness = abs(loads[joint]), weight * run.reach, run.numbers.get(f"{joint}.servo.stiffness")
        begins = run.settled.get(f"initial.{joint}.q")
        if joint not in servos and motors and begins is not None and begins.origin.place is None and most > 0.0:
            clause = f"has no servo, and gravity loads it by {load:.4g} N*m at the start"
            cure = f"write `{joint} = SERVO;` in `servos`, of model `passive` if it is to be free, or where it begins"
            other, usual = f"the moved links' weight at the arm's reach, {most:.4g} N*m", "what nothing holds sinks in"
            yield Scale("free joint", joint, load, "N*m", most, other, 0.0, 0.01, usual, clause=clause, cure=cure)
        elif stiffness and f"{joint}.servo.kt" not in run.numbers:
            path, other, usual = f"{joint}.servo.stiffness", "half a turn", "springs bend by less than that"
            verb = "lets the load at the start wind it up by"
            yield Scale("load of a spring", path, load / stiffness, "rad", math.pi, other, 0.0, 1.0, usual, verb)


def grapples(run: RunNumbers) -> Iterator[Scale]:
    """Payloads beside their written place on the link that grapples them, by the positions that joints are asked for
    then; of one beyond the arm's reach there is D339."""
    structure = run.structure
    motions = {use.joint: run.motion(use) for use in run.uses}
    for payload in structure.payloads:
        head, known = f"payloads.{payload.name}", grapple_numbers(structure, payload, run.settled)
        t = run.numbers.get(f"{head}.grapple", math.inf)
        if known is None or t > run.duration or not run.is_written(f"{head}.at"):
            continue
        q = {joint.name: run.numbers.get(f"initial.{joint.name}.q", math.nan) for joint in structure.moving}
        for joint in q if t > 0.0 else ():
            motion = motions.get(joint)
            q[joint] = math.nan if motion is None else float(np.interp(t, run.instants, motion[0]))
        turned, places, _ = run.poses(q)
        flown = run.vector(f"{head}.position") + run.vector(f"{head}.velocity") * t + 0.5 * t * t * run.gravity
        place = places[payload.link] + turned[payload.link] @ run.vector(f"{head}.at")
        apart = float(np.linalg.norm(flown - place))
        loose = run.extent(head) + run.length(f"{head}.com") * (2.0 + run.length(f"{head}.rate") * t)
        beyond = known.away(np.array([[run.numbers[path] for path in known.paths]]), run.duration)[0].size
        most = run.depths[payload.link] + run.length(f"{head}.at") + 4.0 * loose
        if math.isfinite(apart) and most > 0.0 and not beyond:
            coordinates = ", ".join(f"{x:.4g}" for x in np.round(place, 6) + 0.0)
            yield Scale(
                "grapple",
                f"{head}.position",
                apart,
                "m",
                most,
                f"the way there from the base with 4 times the payload's size, {most:.4g} m",
                0.0,
                0.25,
                "a grapple closes on what is near",
                verb="is apart from the place of the grapple by",
                clause=f"leads it {apart:.4g} m past its place on `{payload.link}`, which grapples it at {t:.4g} s",
                cure=f"its place is at [{coordinates}] m then: let it be there",
            )


def spreads(run: RunNumbers) -> Iterator[Scale]:
    """Yield how far a sweep varies starts of revolute joints (beside a turn) and masses whose inertia stays."""
    usual = "a turn further the arm stands as before"
    for joint in run.structure.moving:
        path = f"initial.{joint.name}.q"
        least, most = run.ranges.get(path, (0.0, 0.0))
        span = run.numbers.get(f"{joint.name}.q_max", 0.0) - run.numbers.get(f"{joint.name}.q_min", 0.0)
        if joint.kind == "revolute" and least < most and max(-least, most) < 3.0 * TURN:  # else that is told
            high = max(1.001, span / TURN)
            yield Scale(
                "spread of a start", path, most - least, "rad", TURN, "a turn", 0.0, high, usual, "varies over", "rad"
            )
    usual = "of one shape, a heavier body has more inertia"
    heads = [f"links.{link}" for link in sorted(run.moved)]
    for head in [*heads, *(f"payloads.{payload.name}" for payload in run.structure.payloads)]:
        least, most = run.ranges.get(f"{head}.mass", (0.0, 0.0))
        moments = [run.ranges.get(f"{head}.inertia.{part}", (0.0, 0.0)) for part in INERTIA[:3]]
        stays, lever = max(moments)[1], run.length(f"{head}.com") + run.length(f"{head}.at")
        fine = 0.0 < stays < least * (4.0 * run.reach) ** 2  # else its radius of gyration is told
        if least < most and fine and all(low == high for low, high in moments):
            of_shape = stays * most / least
            clause = f"stays {stays:.4g} kg*m^2 while `{head}.mass` varies from {least:.4g} to {most:.4g} kg"
            yield Scale(
                "inertia that stays",
                f"{head}.inertia",
                of_shape - stays,
                "kg*m^2",
                of_shape + most * lever * lever,
                "what the heaviest has about its joint",
                0.0,
                0.5,
                usual,
                clause=clause,
                cure="write a `shape`, from which the inertia follows, or let it vary with the mass",
            )


def targets(run: RunNumbers) -> Iterator[Scale]:
    """Values that metrics wait for, beside those to which the command of their joint leads."""
    usual = "a servo goes where it is asked to"
    motions = {use.joint: motion for use in run.uses if (motion := run.motion(use)) is not None}
    for metric in run.structure.metrics:
        joint, _, quantity = metric.of.partition(".")
        head, name = f"metrics.{metric.name}", models.find("metric", metric.model, metric.place).target
        target, begins = run.numbers.get(f"{head}.{name}"), run.numbers.get(f"initial.{metric.of}")
        if target is None or begins is None or quantity not in ("q", "qd") or joint not in motions:
            continue
        k = ("q", "qd").index(quantity)
        of_both = f"{joint}.servo.command", f"{head}.{name}"
        if any(least < most and path.startswith(of_both) for path, (least, most) in run.ranges.items()):
            continue  # a sweep over commands may judge all by one target
        commanded, rates = np.append(motions[joint][k], begins), motions[joint][1]
        away = max(float(commanded.min()) - target, target - float(commanded.max()), 0.0)
        band = run.numbers.get(f"{head}.band", 0.0) * abs(target) + run.numbers.get(f"{head}.within", 0.0)
        band = max(band, 0.02 * abs(target - begins))
        if band > 0.0 and math.isfinite(away):
            unit, scale = unit_written([run.settled[f"{head}.{name}"]], run.settled[f"{head}.{name}"].unit)
            low, high = (f"{end / scale:.4g}" for end in (commanded.min(), commanded.max()))
            others = [
                other_joint for other_joint, of_it in motions.items() if of_it[k].min() <= target <= of_it[k].max()
            ]
            cure = (
                f"look at `{others[0]}.{quantity}`, whose command leads there"
                if others
                else "look at the joint that is meant"
            )
            lead = f"from {low} to {high}" if low != high else f"to {low}"
            wait = "let the run last longer" if rates[-1] else "wait for what this one's leads to"
            clause = f"is {target / scale:.4g} {unit}, and what `{joint}` is asked for leads {lead} {unit}"
            other = f"the band of metric `{metric.name}`"
            yield Scale(
                "target beside a command",
                f"{head}.{name}",
                away,
                run.settled[f"{head}.{name}"].unit,
                band,
                other,
                0.0,
                1.0,
                usual,
                clause=clause,
                cure=f"{cure}, or {wait}",
            )

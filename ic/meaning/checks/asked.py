"""Scales of what is asked of a run: places of grapples, targets of metrics, and what a sweep varies."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ic.meaning.checks.reach import grapple_numbers
from ic.meaning.checks.run_numbers import RunNumbers
from ic.meaning.checks.scale import TURN, Scale
from ic.meaning.control.servos import unit_written
from met import models
from met.plan.defaults import INERTIA


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

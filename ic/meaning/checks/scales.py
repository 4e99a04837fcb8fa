"""Scales of a run: its numbers as multiples of others in the same run, each with the range that is usual.

A number may be possible and wrong for its arm: a centre of mass 250 m away on an arm of 1 m, a command of 60 rad, a
friction above the motor's torque. What is compared is declared as `Scale`; a multiple outside its usual range is
remarked on (D297), and `met explain DECK --scales` prints all of them.

Ranges are those of published robots where they are said to be of such, made wider by a factor of 1.8 or more: of the 43
of 67 URDF files of example-robot-data and its neighbours that are imported. Others are of what there is to buy, or of
what a motor can do by its own numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from ic.meaning.checks.bodies import booms, centres, forgotten, grapples, held, masses, shared_lines, spreads, targets
from ic.meaning.checks.idle import at_rest
from ic.meaning.checks.magnitudes import LENGTHS, MASSES, MEANT, SMALLEST_GYRATION
from ic.meaning.checks.run_numbers import RunNumbers
from ic.meaning.checks.scale import TURN, Scale, inside
from ic.meaning.control.servos import Use, unit_written
from ic.meaning.parameters.scope import Scope
from met import models
from met.plan import BASE, Structure
from met.plan.chains import way_inward
from met.plan.channel import JOINT_LIMITS
from met.plan.defaults import INERTIA
from met.servos.motor import RATIO
from met.vectors import rotation_rpy

EARTH = 9.80665
"""Acceleration of free fall on the Earth, m/s^2."""

LOAD_MOTOR = ("kt_load", "i_max", "scale.torque")
"""Numbers of a bed that limit the torque of its load motor: N m/A, A, and the scale, 1 where there is none."""

FAR = 1e4
"""Multiple of what a motor can give from which on a limit is a large number for none."""

MOST_CASES = 16
"""Largest number of cases that are looked at: the first, and those with the ends of what varies."""


def _turns(run: RunNumbers) -> Iterator[Scale]:
    """Angles of revolute joints at the start and in their commands, beside a turn; ways of prismatic ones, beside the
    arm's reach."""
    usual = "joints of published arms turn by at most 1.6 turns"
    for joint in run.structure.independent:
        if joint.kind == "revolute":
            own = max(abs(run.numbers.get(f"{joint.name}.{end}", 0.0)) for end in ("q_min", "q_max"))
            angles = run.largest(f"initial.{joint.name}.q", "rad")
            if run.is_placed(joint.name):
                angles |= run.largest(f"{joint.name}.servo.command", "rad")
            for path, angle in angles.items():
                in_rad = unit_written([run.settled[path]], "rad")[1] == 1.0  # else it was not meant in degrees
                high = max(3.0 if in_rad else 1e4, own / TURN)
                yield Scale("angle of a joint", path, abs(angle), "rad", TURN, "a turn", 0.0, high, usual, meant="rad")
        elif run.is_placed(joint.name) and run.reach > 0.0:
            for path, way in run.largest(f"{joint.name}.servo.command", "m").items():
                other, of_rails = run.reach_words, "a rail is seldom as long as 300 of its arms"
                yield Scale("way of a joint", path, abs(way), "m", run.reach, other, 0.0, 300.0, of_rails, meant="m")


def _centres(run: RunNumbers) -> Iterator[Scale]:
    """The distance of each moving link's centre of mass from its frame, beside the arm's reach or, where that is more,
    4 radii of gyration of the link. Lumped links, whose numbers are not those of a body, are left out."""
    usual = "of 470 links of published robots none is above 0.42"
    for link in run.structure.links:
        path = f"links.{link.name}.com"
        if link.name in run.moved and not link.lumped and run.reach > 0.0 and run.is_written(path):
            far, large = run.length(path), 4.0 * run.gyration(f"links.{link.name}")
            other = run.reach_words if run.reach > large else f"4 times its radius of gyration, {large:.4g} m"
            most = max(run.reach, large)
            yield Scale("centre of mass", path, far, "m", most, other, 0.0, 2.0, usual, meant="m", typical=0.2)


def _offsets(run: RunNumbers) -> Iterator[Scale]:
    """The distance of each joint from the one before, beside the lengths of the rest of its chain."""
    usual = "of 718 joints of published robots none is above 21.4"
    for joint in run.structure.joints:
        rest = run.depths.get(joint.parent, 0.0) + run.beyond.get(joint.child, 0.0)
        rest = max(rest, *(run.length(f"links.{link}.com") for link in (joint.parent, joint.child)))
        if joint.parent != BASE and rest > 0.0:
            path, far = f"{joint.name}.at", run.offsets[joint.name]
            other = f"the rest of its chain, {rest:.4g} m"
            yield Scale("place of a joint", path, far, "m", rest, other, 0.0, 60.0, usual, meant="m", typical=1.0)


def _touches(run: RunNumbers) -> Iterator[Scale]:
    """Joints, and payloads, which may hang, beside the rod, box or cylinder of the link that carries them, and payloads
    beside the joints of one without. A ball is a mass, and not a shape."""
    usual = "a joint is usually on its link, or in it"
    points = [(f"{joint.name}.at", joint.parent, 0.25, usual) for joint in run.structure.joints]
    usual = "a payload is usually at its link, or hangs from it"
    points += [(f"payloads.{payload.name}.at", payload.link, 1.0, usual) for payload in run.structure.payloads]
    for path, link, high, usual in points:
        point, hangs, verb = run.vector(path), high == 1.0, f"is beside the shape of `{link}` by"
        far = run.beside_shape(f"links.{link}", point)
        if far is None and hangs:
            far, high, verb = run.beside_link(link, point), 5.0, f"is beside the joints of `{link}` by"
        if far is not None and link != BASE and run.reach > 0.0:
            what, typical = "place beside a link", 0.1 if hangs else 0.0
            yield Scale(what, path, far, "m", run.reach, run.reach_words, 0.0, high, usual, verb=verb, typical=typical)


def _gyrations(run: RunNumbers) -> Iterator[Scale]:
    """Radii of gyration of bodies whose inertia is written, and up to 2 m none on a short arm, whose links may be test
    bodies. Small ones only beside a body of a usual one, and of bodies with equal moments (D298 is about others)."""
    usual = "of 620 links of published robots all have 0.00018 to 1.3 times their robot's reach"
    heads = [f"links.{link.name}" for link in run.structure.links if link.name in run.moved and not link.lumped]
    heads += [
        f"payloads.{payload.name}" for payload in run.structure.payloads if run.extent(f"payloads.{payload.name}")
    ]
    radii = {head: run.gyration(head) for head in heads}
    low = 1e-4 if max(radii.values(), default=0.0) > 0.01 * run.reach else 0.0
    for head, radius in radii.items():
        path, shape = f"{head}.inertia", run.extent(head)
        moments = {run.numbers.get(f"{path}.{part}") for part in INERTIA[:3]}
        beside, high = (shape, 10.0) if shape else (run.reach, max(4.0, 2.0 / run.reach if run.reach else 0.0))
        if beside > 0.0 and radius > SMALLEST_GYRATION and run.is_written(path):
            yield Scale(
                "radius of gyration",
                path,
                radius,
                "m",
                beside,
                f"the size of its shape, {shape:.4g} m" if shape else run.reach_words,
                low if len(moments) == 1 else 0.0,
                high,
                usual,
                verb="has a radius of gyration of",
                meant="kg*m^2",
                power=0.5,
                typical=0.2,
            )


def _levers(run: RunNumbers) -> Iterator[Scale]:
    """The distance of points at which models of the environment act on links, beside the arm's reach."""
    usual = "what acts on an arm acts on it, or on what it carries"
    for use in run.structure.environment:
        for parameter in models.find("environment", use.model).parameters:
            path = f"environment.{use.name}.{parameter.name}"
            if parameter.name in ("point", "at") and parameter.unit == "m" and run.reach > 0.0:
                far, other = run.length(path), run.reach_words
                yield Scale("point of a load", path, far, "m", run.reach, other, 0.0, 10.0, usual, meant="m")


def _pushes(run: RunNumbers) -> Iterator[Scale]:
    """Torques of wrenches about the joints that carry their link, where the run begins, beside the motors'. Blows,
    which act for less than a tenth of the run, are left out."""
    usual = "a motor that meets more gives way"
    begins = {joint.name: run.numbers.get(f"initial.{joint.name}.q", 0.0) for joint in run.structure.moving}
    wrenches = [use.name for use in run.structure.environment if use.model == "wrench" and _lasts(run, use.name)]
    motors = {use.joint: use for use in run.uses}
    turned, places, lines = run.poses(begins) if wrenches else ({}, {}, {})
    for name in wrenches:
        head, link = f"environment.{name}", str(run.settled[f"environment.{name}.link"].value)
        point = places.get(link, np.zeros(3)) + turned.get(link, np.eye(3)) @ run.vector(f"{head}.point")
        own = turned.get(link, np.eye(3)) if str(run.settled[f"{head}.axes"].value) == "link" else np.eye(3)
        force, moment = own @ run.vector(f"{head}.force"), own @ run.vector(f"{head}.moment")
        for joint in way_inward(run.structure.joints, link):
            use = motors.get(joint.name)
            limit, ratio = (run.largest_torque(use), run.of_motor(use, RATIO.name)) if use is not None else (None, None)
            if limit is not None and ratio is not None:
                axis, through = lines[joint.name]
                turning = np.cross(point - through, force) + moment if joint.kind == "revolute" else force
                most, unit = ratio * limit[1], "N*m" if joint.kind == "revolute" else "N"
                path, other = f"{head}.force", f"the motor's largest at joint `{joint.name}`, {most:.4g} {unit}"
                verb, size = "loads a joint by", abs(float(axis @ turning))
                yield Scale("load of a wrench", path, size, unit, most, other, 0.0, 20.0, usual, verb)


def _lasts(run: RunNumbers, name: str) -> bool:
    """True of a model of the environment that acts for a tenth of the run, or longer."""
    begins, ends = (run.numbers.get(f"environment.{name}.{end}", math.nan) for end in ("from", "until"))
    return min(ends, run.duration) - max(begins, 0.0) >= 0.1 * run.duration


def _gears(run: RunNumbers) -> Iterator[Scale]:
    """The ratio of each gear at a revolute joint."""
    usual = "gears of arms slow their motor down, by 1 to some 3,000"
    for use in run.uses:
        ratio = run.of_motor(use, RATIO.name)
        if ratio is not None and run.kinds[use.joint] == "revolute":
            path, typical = f"{use.joint}.servo.{RATIO.name}", 1.0 / ratio if 0.0 < ratio < 1.0 else 0.0
            yield Scale("gear ratio", path, ratio, "", 1.0, "", 0.2, 1e5, usual, typical=typical)


def _speeds(run: RunNumbers) -> Iterator[Scale]:
    """The commanded rate beside the one at which the motor's back-EMF is all of its voltage."""
    usual = "no motor runs faster"
    for use in run.uses:
        ratio, kt, limit = run.of_motor(use, RATIO.name), run.of_motor(use, "kt"), run.limit(use, "V")
        course = run.course(use)
        if ratio is None or kt is None or limit is None or course is None or not limit[1] * kt * ratio > 0.0:
            continue
        rates = {"rate": course[0], "position": course[1]}.get(use.command_kind)
        if rates is not None:
            unit = "rad/s" if run.kinds[use.joint] == "revolute" else "m/s"
            most = limit[1] / (kt * ratio)
            other = f"the rate at which the motor's back-EMF is all of `{limit[0]}`, {most:.4g} {unit}"
            path, fastest = f"{use.joint}.servo.command", float(np.abs(rates).max())
            yield Scale("commanded rate", path, fastest, unit, most, other, 0.0, 1.0, usual, verb="asks for")


def _limits(run: RunNumbers) -> Iterator[Scale]:
    """Commands beside the limits of their joints: positions, also where a commanded rate leads, rates and torques."""
    usual = "a limit of a joint holds nothing, and is only watched"
    t = run.instants
    for use in run.uses:
        motion, kind = run.motion(use), use.command_kind
        if motion is None:
            continue
        places, rates = motion
        own = {name: run.numbers.get(f"{use.joint}.{name}", math.nan) for name in JOINT_LIMITS}
        for name, commanded, other, beside in (
            ("q_min", places, own["q_max"], "the range of the joint"),
            ("q_max", places, own["q_min"], "the range of the joint"),
            ("tau_max" if kind == "torque" else "qd_max", np.abs(rates), 0.0, "the limit of the joint"),
        ):
            path, multiples = f"{use.joint}.{name}", (commanded - other) / (own[name] - other)
            k = int(multiples.argmax())
            if math.isfinite(multiples[k]) and kind != "acceleration":
                unit, scale = unit_written([run.settled[path]], run.settled[path].unit)
                end = f"`{path}` is {own[name] / scale:.6g} {unit}"
                clause = f"leads to {commanded[k] / scale:.6g} {unit} at {t[k]:.4g} s, and {end}"
                size, most = abs(float(commanded[k]) - other), abs(own[name] - other)
                yield Scale(
                    "command beside a limit",
                    f"{use.joint}.servo.command",
                    size,
                    run.settled[path].unit,
                    most,
                    beside,
                    0.0,
                    1.01 if kind == "rate" else 1.001,
                    usual,
                    clause=clause,
                )


def _strengths(run: RunNumbers) -> Iterator[Scale]:
    """Limits of torque and current beside what the voltage gives at a standstill; one `FAR` beyond means no limit."""
    usual = "a motor has more only where it is turned backwards, and then at most twice that"
    for use in run.uses:
        kt, resistance, volts = run.of_motor(use, "kt"), run.of_motor(use, "resistance"), run.limit(use, "V")
        for unit, constant in (("N*m", kt), ("A", 1.0)):
            limit = run.limit(use, unit)
            if limit is not None and volts is not None and constant and resistance and volts[1] < math.inf:
                path, most = f"{use.joint}.servo.{limit[0]}", constant * volts[1] / resistance
                other = f"what all of `{volts[0]}` gives at a standstill, {most:.4g} {unit}"
                if 0.0 < limit[1] < FAR * most:
                    yield Scale("limit of a motor", path, limit[1], unit, most, other, 0.0, 10.0, usual, meant=unit)


def _frictions(run: RunNumbers) -> Iterator[Scale]:
    """Dry friction of a motor beside its largest torque."""
    usual = "a motor that cannot break away moves nothing"
    for use in run.uses:
        friction, limit = run.of_motor(use, "f_c"), run.largest_torque(use)
        if friction is not None and limit is not None:
            path, other = f"{use.joint}.servo.f_c", f"the motor's largest torque, {limit[1]:.4g} N*m"
            yield Scale("dry friction", path, friction, "N*m", limit[1], other, 0.0, 1.0, usual, meant="N*m")


def _loads(run: RunNumbers) -> Iterator[Scale]:
    """The load of gravity at the start beside what motor and friction hold at the joint, and what the load motor of a
    bed can make there."""
    usual = "a motor that cannot hold its arm lets it fall"
    loads = run.loads
    for use in run.uses:
        ratio, friction, limit = run.of_motor(use, RATIO.name), run.of_motor(use, "f_c"), run.largest_torque(use)
        if use.joint in loads and ratio is not None and limit is not None and not run.is_helped(use.joint):
            unit = "N*m" if run.kinds[use.joint] == "revolute" else "N"
            most = ratio * (limit[1] + (friction or 0.0))
            path, other = f"{use.joint}.servo.{limit[0]}", f"what it holds at the joint, {most:.4g} {unit}"
            load = abs(loads[use.joint])
            torque = load / ratio - (friction or 0.0)  # of the motor
            enough = inside(run.numbers[path] * torque / limit[1], 2.0, 4)
            verb, cure = "meets a load of", f"{enough} {run.settled[path].unit} would hold it"
            yield Scale("load at the start", path, load, unit, most, other, 0.0, 1.0, usual, verb, cure=cure)
            constant, current, scale = (run.numbers.get(f"{use.joint}.bed.{name}") for name in LOAD_MOTOR)
            if constant is not None and current is not None:
                path, most = f"{use.joint}.bed.i_max", ratio * constant * current * (1.0 if scale is None else scale)
                other, weak = "what the load motor makes at the joint", "a bed brings its joint's load"
                clause = f"makes {most:.4g} {unit} at the joint, which gravity loads by {load:.4g} {unit} at the start"
                cure = f"{1.01 * current * load / most:.4g} A would bring it" if most > 0.0 else "give it a current"
                yield Scale("load of a bed", path, load, unit, most, other, 0.0, 1.0, weak, clause=clause, cure=cure)


def _brakes(run: RunNumbers) -> Iterator[Scale]:
    """Brakes that are on during a whole run in which their joint is to move."""
    usual = "a motor that cannot turn its brake moves nothing"
    for load in run.structure.environment:
        head = f"environment.{load.name}"
        whole = run.numbers.get(f"{head}.from", 0.0) <= 0.0 and run.numbers.get(f"{head}.until", 0.0) >= run.duration
        for use in run.uses if load.model == "brake" and whole else ():
            ratio, limit, course = run.of_motor(use, RATIO.name), run.largest_torque(use), run.course(use)
            named = run.settled[f"{head}.joint"].value == use.joint
            if named and ratio is not None and limit is not None and course is not None and np.ptp(course[0]) > 0.0:
                unit = "N*m" if run.kinds[use.joint] == "revolute" else "N"
                most = ratio * limit[1]
                path, other = f"{head}.torque", f"the motor's largest at the joint, {most:.4g} {unit}"
                yield Scale("torque of a brake", path, run.numbers[path], unit, most, other, 0.0, 1.0, usual)


def _falls(run: RunNumbers) -> Iterator[Scale]:
    """The fall of a free base under gravity with nothing else acting on it, beside the arm's reach."""
    base, bearing = run.structure.base, [use for use in run.structure.environment if at_rest(use) == "force"]
    for use in run.structure.environment:
        if use.model == "gravity" and base is not None and base.kind == "free" and not bearing and run.reach > 0.0:
            path, usual = f"environment.{use.name}.g", "what floats falls with its orbit, which is no gravity to it"
            fall, verb = 0.5 * run.length(path) * run.duration**2, "lets the base fall freely by"
            yield Scale("free fall", path, fall, "m", run.reach, run.reach_words, 0.0, 10.0, usual, verb=verb)


def _plays(run: RunNumbers) -> Iterator[Scale]:
    """The backlash of each gear, beside the motion that its joint is commanded."""
    usual = "within its play a gear drives nothing"
    for use in run.uses:
        path, course = f"{use.joint}.servo.backlash", run.course(use)
        if path in run.numbers and course is not None and use.command_kind == "position":
            play, span = run.numbers[path], float(np.ptp(course[0]))
            if span > 0.0:
                other = f"the motion that is commanded, {span:.4g} rad"
                yield Scale("play of a gear", path, play, "rad", span, other, 0.0, 0.5, usual)


def _sensors(run: RunNumbers) -> Iterator[Scale]:
    """Noise and steps of sensors beside the motion that is commanded."""
    usual = "a servo follows no motion that is less than what it sees"
    for use in run.uses:
        course = run.course(use)
        if course is None or use.command_kind not in ("position", "rate"):
            continue
        (values, slopes), places = course, use.command_kind == "position"
        motions = {
            "q": float(np.ptp(values)) if places else 0.0,
            "qd": float(np.abs(slopes if places else values).max()),
        }
        for quantity, motion in motions.items():
            for name in ("noise", "resolution", "step"):
                path = f"{use.joint}.servo.sensor.{quantity}.{name}"
                if run.numbers.get(path, 0.0) > 0.0 and motion > 0.0:
                    unit = run.settled[path].unit
                    size, other = run.numbers[path], f"what is commanded, {motion:.4g} {unit}"
                    yield Scale("noise or step of a sensor", path, size, unit, motion, other, 0.0, 1.0, usual)


def _bands(run: RunNumbers) -> Iterator[Scale]:
    """Steps of sensors beside the bands in which what they see is to settle."""
    usual = "a servo knows its joint no better than its sensor"
    for metric in run.structure.metrics:
        joint, _, quantity = metric.of.partition(".")
        head = f"metrics.{metric.name}"
        band = max(
            abs(run.numbers.get(f"{head}.band", 0.0) * run.numbers.get(f"{head}.target", 0.0)),
            run.numbers.get(f"{head}.within", 0.0),
        )
        for name in ("resolution", "step"):
            path = f"{joint}.servo.sensor.{quantity}.{name}"
            if run.numbers.get(path, 0.0) > 0.0 and band > 0.0:
                step, unit = run.numbers[path], run.settled[path].unit
                other = f"the band of metric `{metric.name}`, {band:.4g} {unit}"
                yield Scale("step beside a band", path, step, unit, band, other, 0.0, 2.0, usual)


def _payloads(run: RunNumbers) -> Iterator[Scale]:
    """The mass of each payload on a link that moves, as a multiple of the mass of all such links: up to 200 is usual
    under gravity, and up to 10,000 without."""
    arm = sum(run.numbers.get(f"links.{link}.mass", 0.0) for link in run.moved)
    high, typical, usual = 200.0, 0.2, "industrial robots lift a tenth to a third of their mass"
    if not run.gravity.any():
        high, typical, usual = 1e4, 70.0, "the arm of the Space Station is made for 116 t, some 70 times its mass"
    for payload in run.structure.payloads:
        path, other = f"payloads.{payload.name}.mass", f"the mass of the moved links, {arm:.4g} kg"
        if path in run.numbers and arm > 0.0 and payload.link != BASE:
            mass = run.numbers[path]
            yield Scale(
                "mass of a payload", path, mass, "kg", arm, other, 0.0, high, usual, meant="kg", typical=typical
            )


def _rotors(run: RunNumbers) -> Iterator[Scale]:
    """Inertias of rotors, as the joint feels them, beside that of all moved links at the arm's reach."""
    usual = "arms that come with MET have up to 0.2, and short stubs on a large motor far more"
    arm = sum(run.numbers.get(f"links.{link}.mass", 0.0) for link in run.moved) * (run.reach * run.reach)
    for use in run.uses:
        ratio, rotor, path = run.of_motor(use, RATIO.name), run.of_motor(use, "j_m"), f"{use.joint}.servo.j_m"
        if ratio is not None and rotor is not None and arm > 0.0 and run.kinds[use.joint] == "revolute":
            felt, other = (
                ratio * ratio * rotor,
                f"the mass of the moved links times the reach squared, {arm:.4g} kg*m^2",
            )
            yield Scale(
                "inertia of a rotor",
                path,
                felt,
                "kg*m^2",
                arm,
                other,
                0.0,
                1e9,
                usual,
                verb="is felt at the joint as",
                meant="kg*m^2",
                typical=3.0,
            )


def _gravities(run: RunNumbers) -> Iterator[Scale]:
    """The size of gravity beside the Earth's, and gravity that points up."""
    usual = "the Moon has 0.17 of it, Jupiter 2.5, the Sun 28"
    for use in run.structure.environment:
        if use.model == "gravity":
            path = f"environment.{use.name}.g"
            size, other = run.length(path), "that on the Earth"
            yield Scale("gravity", path, size, "m/s^2", EARTH, other, 0.0, 30.0, usual, meant="m/s^2", typical=1.0)
            up, feet = run.vector(path)[2], [joint for joint in run.structure.joints if joint.parent == BASE]
            upright = all(rotation_rpy(*run.vector(f"{joint.name}.rpy"))[2][2] > -0.5 for joint in feet)
            if 0.0 < size <= up and run.structure.base is None and upright:
                clause, cure = f"leads up: its z is {up:.4g} m/s^2", f"where z is up, its z is -{up:.4g} m/s^2"
                where = "z is up in most decks and robots' files"
                yield Scale(
                    "upward gravity", path, up, "m/s^2", EARTH, other, 0.0, 1e-3, where, clause=clause, cure=cure
                )


SCALES: tuple[Callable[[RunNumbers], Iterator[Scale]], ...] = (
    _turns,
    _centres,
    _offsets,
    _touches,
    masses,
    centres,
    forgotten,
    booms,
    shared_lines,
    held,
    grapples,
    spreads,
    targets,
    _gyrations,
    _levers,
    _pushes,
    _gears,
    _speeds,
    _limits,
    _strengths,
    _frictions,
    _loads,
    _brakes,
    _falls,
    _plays,
    _sensors,
    _bands,
    _payloads,
    _rotors,
    _gravities,
)


def scales(run: RunNumbers) -> list[Scale]:
    """All scales of one case of a run."""
    with np.errstate(all="ignore"):  # of a swing at 1e308 Hz there are no numbers
        return [scale for kind in SCALES for scale in kind(run)]


def check_scales(scope: Scope, structure: Structure, uses: Iterable[Use]) -> None:
    """Warn about numbers far outside what is usual beside the run's other numbers; of one kind about the worst."""
    settled = {**scope.parameters, **scope.auxiliary}
    numbers_of = {
        path: setting.value for path, setting in settled.items() if not isinstance(setting.value, (str, tuple))
    }
    place = next((setting.origin.place for setting in settled.values() if setting.origin.place is not None), None)
    if place is None:
        return

    def warn(rows: np.ndarray) -> None:
        """Warn about the number furthest outside its usual range, for each kind of scale (D297). rows: [case, number],
        SI."""
        if scope.complaints.error_count:
            return
        ranges = dict(zip(numbers_of, np.column_stack([rows.min(axis=0), rows.max(axis=0)]).tolist(), strict=True))
        worst: dict[str, tuple[Scale, int]] = {}
        others: dict[str, set[str]] = {}
        by_path: dict[tuple[str, str], set[float]] = {}
        for row in _chosen(rows):
            numbers = dict(zip(numbers_of, rows[row].tolist(), strict=True))
            of_case = scales(RunNumbers(structure.straight, uses, settled, numbers, ranges))
            scope.scales = scope.scales or of_case
            for scale in of_case:
                by_path.setdefault((scale.what, scale.path), set()).add(scale.multiple)
                if scale.nearness > 1.0 and not _is_beyond_all(scale):
                    others.setdefault(scale.what, set()).add(scale.path)
                    if scale.what not in worst or scale.nearness > worst[scale.what][0].nearness:
                        worst[scale.what] = scale, row
        for scale, row in worst.values():
            own = [
                setting for path, setting in settled.items() if path == scale.path or path.startswith(f"{scale.path}.")
            ]
            own.sort(key=lambda setting: setting.unit == "s")  # of a table rather its values than their instants
            scale_place = next((setting.origin.place for setting in own if setting.origin.place is not None), place)
            varies = len(by_path[scale.what, scale.path]) > 1
            case = scope.checks.where(row, numbers_of.values() if varies else ())
            scope.complaints.remark(
                "D297",
                scale.sentence(case, len(others[scale.what]) - 1),
                scale_place,
                help=[*scale.remedies, MEANT.format("D297")],
            )

    scope.checks.observe(tuple(numbers_of.values()), warn, place)


def _is_beyond_all(scale: Scale) -> bool:
    """True of a length or mass that is beyond all there is, which `check_magnitudes` remarks on."""
    kinds = [(LENGTHS, f"{scale.path}.x"), (MASSES, scale.path)]
    return any(kind.pattern.fullmatch(path) and scale.size > kind.high for kind, path in kinds)


def _chosen(rows: np.ndarray) -> list[int]:
    """The first case, and those in which a number that varies is smallest or largest."""
    varies = np.flatnonzero((rows != rows[0]).any(axis=0))
    ends = [int(row) for column in varies for row in (rows[:, column].argmin(), rows[:, column].argmax())]
    return list(dict.fromkeys([0, *ends]))[:MOST_CASES]

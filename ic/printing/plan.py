"""A plan in words: the arm as a tree, rates, records, number of cases or the goal of a search, and sizes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ic.printing.columns import columns, count, number, quantity, size, vector
from ic.printing.settings import kept_keys
from met import models
from met.parameter import Parameter
from met.plan import BASE, Base, Experiment, Formula, Joint, Plan, Structure
from met.plan.chains import chains
from met.plan.columns import different, span
from met.plan.defaults import OF_FREE_BASE, of_environment
from met.plan.searches import Search
from met.plan.uses import sensor_parts
from met.substitution import bed_scale
from met.unit_parser import decimals, written

CHOSEN = 88  # columns, of parameters that stand in one cell
FIXED_SPACE = "\u00a0"  # no line ends at one
COUNTED = 1_000_000  # largest number of drawn values that are compared
STEP_SIZE = "step size: "  # beginning of the compiler's note on the step size
NOT_LOOKED_AT = f"{STEP_SIZE}not looked at"  # and where the arm was too large for one


class _Values:
    """The parameters of an experiment; varied ones by their first, least and largest value."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment, self._parameters = experiment, experiment.parameters

    def array(self, path: str) -> np.ndarray | None:
        """The value; three values of a varied parameter; None where the plan has no number of that name."""
        setting = self._parameters.get(path)
        if setting is None or isinstance(setting.value, (str, tuple)):
            return None
        if isinstance(setting.value, Formula):
            column = self._experiment.column(setting.value)
            return np.array([column[0], *span(column)] if len(column) else [])
        return np.asarray(setting.value, dtype=float)

    def text(self, path: str) -> str:
        """The value with its unit, or its range over the cases."""
        values = self.array(path)
        if values is None or values.size == 0:
            return ""
        unit = self._parameters[path].unit
        low, high = float(values.min()), float(values.max())
        if self.is_computed(path):
            return quantity(low, unit) if low == high else f"{number(low)} to {quantity(high, unit)}"
        return written(low, unit) if low == high else f"{decimals([low], unit)[0]} to {written(high, unit)}"

    def is_computed(self, path: str) -> bool:
        """True for a value that follows from others: nobody writes it."""
        return self._parameters[path].origin.kind == "derived"

    def vector(self, path: str) -> tuple[float, ...] | None:
        """Three numbers `.x .y .z`; None where one of them differs between the cases."""
        return self.numbers(path, ("x", "y", "z"))

    def numbers(self, path: str, names: tuple[str, ...]) -> tuple[float, ...] | None:
        """The numbers of these names below the path; None where one of them differs between the cases."""
        parts = [self.array(f"{path}.{name}") for name in names]
        if any(part is None or part.size == 0 or (part != part.flat[0]).any() for part in parts):
            return None
        return tuple(float(part.flat[0]) for part in parts if part is not None)


def print_plan(plan: Plan, *, verbose: bool = False) -> Iterator[str]:
    """Every experiment of the plan, line by line; verbose: with centres of mass and inertias."""
    for position, experiment in enumerate(plan.experiments):
        if position:
            yield ""
        yield from print_experiment(plan.deck, experiment, verbose=verbose)
    if plan.settings:
        yield ""
        yield "Set on the command line"
        yield from (f"  {setting}" for setting in plan.settings)


def print_experiment(deck: str, experiment: Experiment, *, verbose: bool = False) -> Iterator[str]:
    """One run or sweep, line by line."""
    structure = experiment.structure
    yield f"{deck}: {experiment.name}"
    for section in (
        [*_arm(experiment), *(_bodies(experiment) if verbose else ())],
        _base(experiment, structure.base) if structure.base is not None else (),
        _payloads(experiment),
        _schedule(experiment),
        _substitutions(experiment),
        _guides(experiment),
        _sensors(experiment),
        [*_environment(experiment), *_keys(experiment)],
        _channels(structure),
        _linear(experiment),
        _metrics(experiment),
        _tolerances(experiment),
        _cases(experiment),
        [f"allowed: {allowance}" for allowance in experiment.allowances],
        _table("Notes", [(note,) for note in experiment.notes if not note.startswith(STEP_SIZE)]),
    ):
        if lines := list(section):
            yield from ["", *lines]


def _table(title: str, rows: Sequence[Sequence[str]]) -> list[str]:
    """A table with its title; nothing where it has no rows."""
    return [title, *columns(rows)] if rows else []


def _arm(experiment: Experiment) -> Iterator[str]:
    """The lines of a plan about its arm: a tree of joints, each with its place (m), turn (deg), link, mass (kg) and
    servo."""
    whole, structure = experiment.structure, experiment.structure.straight
    values, bends = _Values(experiment), chains(whole.links, whole.joints)
    servos = {use.joint: use for use in structure.servos}
    rows: list[tuple[str, ...]] = [("joint", "moves", "at", "rpy", "link", "mass", "servo"), (BASE,)]
    if any(link.name == BASE for link in structure.links):
        kind = structure.base.kind if structure.base is not None else "fixed"
        rows[-1] = (BASE, kind, "", "", "", values.text(f"links.{BASE}.mass"))

    children: dict[str, list[Joint]] = {}
    for joint in structure.joints:
        children.setdefault(joint.parent, []).append(joint)
    waiting = [(joint, "") for joint in reversed(children.get(BASE, []))]
    while waiting:
        joint, stem = waiting.pop()
        last = joint is children[joint.parent][-1]
        use = servos.get(joint.name)
        servo = "" if joint.kind == "fixed" else "passive"
        if use is not None:
            command = f": {use.command.kind}, {use.command.model or use.command.guide}" if use.command else ""
            servo = f"{use.definition} ({use.model}){command}"
        if joint.follows:
            ratios = (
                [f"{values.text(path)} {leader}" for leader, path in joint.ratio_paths.items()]
                if joint.loop is None
                else [f"{joint.loop.leader} by loop {joint.loop.name}"]
            )
            servo = f"follows {', '.join(ratios)}" + (f"; {servo}" if use is not None else "")
        position = values.vector(f"{joint.name}.at")
        place = "varies" if position is None else vector(position, "m") if any(position) else ""
        mass = values.text(f"links.{joint.child}.mass")
        branch = f"{stem}{'└─' if last else '├─'} {joint.name}"
        turned = values.vector(f"{joint.name}.rpy")
        turn = "varies" if turned is None else vector(turned, "deg") if any(turned) else ""
        link = joint.child
        if link in bends:
            link += f" (boom, {count(sum(spring.kind != 'fixed' for spring in bends[link]), 'spring')})"
        rows.append((branch, _moves(joint, values), place, turn, link, mass, servo))
        waiting += [(child, stem + ("   " if last else "│  ")) for child in reversed(children.get(joint.child, []))]
    moving = f"{count(len(structure.moving), 'joint')} that move{'s' if len(structure.moving) == 1 else ''}"
    yield f"Arm {structure.arm}: {count(len(structure.links), 'link')}, {moving}"
    used = [i for i in range(len(rows[0])) if any(i < len(row) and row[i] for row in rows[1:])]
    yield from columns([[row[i] for i in used if i < len(row)] for row in rows])


def _bodies(experiment: Experiment) -> Iterator[str]:
    """Centre of mass and inertia of each link, in its own frame."""
    values = _Values(experiment)
    rows = [("link", "mass", "com", "inertia about it: xx, yy, zz, xy, xz, yz")]
    for link in experiment.structure.straight.links:
        head = f"links.{link.name}"
        com = values.numbers(f"{head}.com", ("x", "y", "z"))
        moments = values.numbers(f"{head}.inertia", ("xx", "yy", "zz", "xy", "xz", "yz"))
        rows.append(
            (
                link.name,
                values.text(f"links.{link.name}.mass"),
                "varies" if com is None else vector(com, "m", computed=values.is_computed(f"{head}.com.x")),
                "varies"
                if moments is None
                else vector(moments, "kg*m^2", computed=values.is_computed(f"{head}.inertia.xx")),
            )
        )
    yield from columns(rows)


def _base(experiment: Experiment, base: Base) -> Iterator[str]:
    """The lines of a plan about the motion of the base: its initial state, or what moves each of its components in
    time."""
    values = _Values(experiment)
    if base.kind == "free":
        yield "Base: moves freely, at the start with"
        rows = []
        for name, unit in OF_FREE_BASE:
            components = values.vector(f"initial.{BASE}.{name}")
            if components is not None and unit.startswith("rad"):
                unit = unit.replace("rad", "deg")
            rows.append((name, "varies" if components is None else vector(components, unit)))
        yield from columns(rows)
        return
    yield "Base: moves as it is told; its other components stay 0"
    yield from columns(
        [
            (
                course.component,
                course.model,
                ", ".join(
                    _settings(experiment, f"{BASE}.{course.component}", models.find("command", course.model).parameters)
                ),
            )
            for course in base.courses
        ]
    )


def _payloads(experiment: Experiment) -> list[str]:
    """The lines of a plan about its payloads, and when they are grappled and released."""
    values = _Values(experiment)
    rows = []
    for payload in experiment.structure.payloads:
        head = f"payloads.{payload.name}"
        grappled = values.text(f"{head}.grapple") if payload.grappled else "held from the start"
        released = values.text(f"{head}.release") if payload.released else "never"
        rows.append((payload.name, values.text(f"{head}.mass"), payload.link, grappled, released))
    return _table("Payloads", [("payload", "mass", "link", "grappled", "released"), *rows] if rows else [])


def _settings(experiment: Experiment, prefix: str, parameters: Iterable[Parameter]) -> list[str]:
    """The parameters of a model in use, each as `name = value`."""
    values, words = _Values(experiment), []
    for parameter in parameters:
        path = f"{prefix}.{parameter.name}"
        if parameter.shape == "vector":
            components = values.vector(path)
            words.append(f"{parameter.name} = {'varies' if components is None else vector(components, parameter.unit)}")
        elif path in experiment.parameters:
            value = experiment.parameters[path].value
            text = f"{len(value)} numbers" if isinstance(value, tuple) else values.text(path)
            words.append(f"{parameter.name} = {value if isinstance(value, str) else text}")
    return words


def passive(structure: Structure) -> list[str]:
    """The moving joints without a servo that follow no other."""
    driven = {use.joint for use in structure.servos}
    return [joint.name for joint in structure.independent if joint.name not in driven]


def _moves(joint: Joint, values: _Values) -> str:
    """The motion of a joint in words: revolute or prismatic, its axis, and the pivot if it has one."""
    if joint.kind == "fixed":
        return "fixed"
    axis = values.vector(f"{joint.name}.axis")
    named = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
    word = "an axis that varies"
    if axis is not None:
        opposite = tuple(-part + 0.0 for part in axis)
        word = named.get(axis, "") or (f"-{named[opposite]}" if opposite in named else vector(axis, "1"))  # type: ignore
    pivot = values.vector(f"{joint.name}.pivot")
    through = f" through {vector(pivot, 'm')}" if pivot is not None else ""
    return f"{joint.kind} {'along' if joint.kind == 'prismatic' else 'about'} {word}{through}"


def _schedule(experiment: Experiment) -> Iterator[str]:
    """The lines of a plan about its schedule: the rate (Hz) and the ticks of each servo, guide and sensor, of the
    dynamics and of the record."""
    structure = experiment.structure
    schedule = structure.schedule
    base = schedule.base_hz

    def row(what: str, divisor: int, times: str) -> tuple[str, ...]:
        return what, f"{number(base / divisor)} Hz", "every tick" if divisor == 1 else f"every {divisor} ticks", times

    rows = []
    laws: dict[tuple[str, int, bool], list[str]] = {}
    for use in structure.servos:
        if models.find("servo", use.model).control is not None:
            laws.setdefault((use.definition, use.divisor, use.continuous), []).append(use.joint)
    for (definition, divisor, continuous), joints in laws.items():
        what = f"servo {definition} of {', '.join(joints)}"
        ticks = count(schedule.ticks // divisor + 1, "tick")
        rows.append((what, "continuous", "", "a part of each step") if continuous else row(what, divisor, ticks))
    for guide in structure.guides:
        if models.find("guide", guide.model).steer is not None:
            ticks = count(schedule.ticks // guide.divisor + 1, "tick")
            rows.append(row(f"guide {guide.name} of {', '.join(guide.joints)}", guide.divisor, ticks))
    for sensor in structure.sensors:
        rows.append(row(f"sensor {sensor.name}", sensor.divisor, count(schedule.ticks // sensor.divisor + 1, "tick")))
    steps = f"{count(schedule.ticks // schedule.dynamics, 'step')} of {number(schedule.step * 1e3)} ms"
    rows.append(row("dynamics", schedule.dynamics, f"{steps}, {structure.integrator}"))
    rows.append(row("record", schedule.record, count(schedule.rows, "row")))
    ticks = count(schedule.ticks, "tick")
    yield f"Schedule: {number(schedule.duration)} s, {ticks} of the base rate, {number(base)} Hz"
    yield from columns(rows, right=(1,))
    yield from (f"Step size: {note.removeprefix(STEP_SIZE)}" for note in experiment.notes if note.startswith(STEP_SIZE))


def _substitutions(experiment: Experiment) -> list[str]:
    """The lines of a plan about motors on beds, with the chosen values of each bed and law: those that are neither
    defaults nor the servo's."""
    values, parameters = _Values(experiment), experiment.parameters
    joints = ", ".join(use.joint for use in experiment.structure.substitutions)
    motors = "motor" if len(experiment.structure.substitutions) == 1 else "motors"
    rows = []
    for use in experiment.structure.substitutions:
        for joint, kind, model in (
            (use.joint, "bed", models.find("bed", use.bed)),
            ("", "law", models.find("law", use.law)),
        ):
            chosen = []
            for parameter in model.parameters:
                path, of_servo = f"{use.joint}.{kind}.{parameter.name}", f"{use.joint}.servo.{parameter.of_servo}"
                setting, servos = parameters.get(path), parameters.get(of_servo)
                if setting is None or setting.origin.kind in ("default", "derived"):
                    continue
                if servos is None or (setting.origin.place, values.text(path)) != (
                    servos.origin.place,
                    values.text(of_servo),
                ):
                    chosen.append(f"{parameter.name} = {values.text(path)}")
            whole = ", ".join(choice.replace(" ", FIXED_SPACE) for choice in chosen)
            first, *more = textwrap.wrap(whole, CHOSEN, break_on_hyphens=False) or [""]
            lines = [(joint, kind, model.name, first), *(("", "", "", line) for line in more)]
            rows += [tuple(cell.replace(FIXED_SPACE, " ") for cell in line) for line in lines]
        if use.scaled:
            names = [declared.name for declared in bed_scale.PARAMETERS]
            scales = (f"{name} = {values.text(f'{use.joint}.bed.scale.{name}')}" for name in names)
            rows.append(("", "scale", "", f"{', '.join(scales)}; the servo's is over it"))
    return _table(f"On a bed: the {motors} of {joints}; what is not told here is the servo's, or the default", rows)


def _guides(experiment: Experiment) -> list[str]:
    """The lines of a plan about its guides: the joints that they command, and all parameters."""
    rows: list[tuple[str, ...]] = []
    for use in experiment.structure.guides:
        guide, head = models.find("guide", use.model, use.place), f"guides.{use.name}"
        rows.append((use.name, use.model, ", ".join(_settings(experiment, head, guide.parameters))))
        rows += [
            ("", joint, ", ".join(_settings(experiment, f"{head}.{joint}", guide.of_joint))) for joint in use.joints
        ]
        for course in use.courses:
            settings = _settings(
                experiment, f"{head}.{course.component}", models.find("command", course.model).parameters
            )
            rows.append(("", course.component, ", ".join([course.model, *settings])))
    return _table("Guides: each commands the joints that follow it", rows)


def _sensors(experiment: Experiment) -> list[str]:
    """The sensors of links, with their parameters."""
    rows = []
    for use in experiment.structure.sensors:
        settings = _settings(experiment, f"sensors.{use.name}", sensor_parts(use, "parameters"))
        rows.append((use.name, use.model, ", ".join(settings)))
    return _table("Sensors of links", rows)


def _environment(experiment: Experiment) -> Iterator[str]:
    """The lines of a plan about the models of its environment."""
    structure = experiment.structure
    products = "with" if structure.velocity_products else "without"
    yield f"Environment: {products} velocity products (Coriolis, centrifugal, gyroscopic)" + (
        "" if structure.environment else "; no gravity, no other loads"
    )
    rows: list[tuple[str, str, str]] = []
    for use, (prefix, declared) in zip(structure.environment, of_environment(experiment), strict=True):
        settings = _settings(experiment, prefix, declared)
        rows.append((use.name, use.model, ", ".join(settings)))
    if all(name == model for name, model, _ in rows):
        yield from columns([(name, settings) for name, _, settings in rows])
    else:
        yield from columns(rows)


def _keys(experiment: Experiment) -> list[str]:
    """The lines of a plan about keys of the run that are not at their defaults."""
    rows = []
    for key, value in kept_keys(experiment):
        if key.listed and value != key.parameter.default:
            text = value if isinstance(value, str) else written(value, key.parameter.unit)
            rows.append((key.path, text, key.parameter.doc))
    return _table("Set by the run, and not the default", rows)


def _channels(structure: Structure) -> Iterator[str]:
    """The lines of a plan about what is recorded: channels, rows, and the size of a case's history."""
    width = sum(len(recorded.channels) for recorded in structure.record)
    if not width:
        yield "Recorded: nothing"
        return
    rows_ = structure.schedule.rows
    bytes_ = size(structure.history_bytes)
    yield f"Recorded: {count(width, 'channel')} in {count(rows_, 'row')}, {bytes_} a case"
    rows = []
    for recorded in structure.record:
        units = list(dict.fromkeys(recorded.unit))
        joints, components = ", ".join(recorded.joints), " ".join(recorded.components)
        along = "; ".join(words for words in (f"of {joints}" if joints else "", components) if words)
        rows.append((recorded.name, ", ".join(units), recorded.doc, along))
    yield from columns(rows)


def _linear(experiment: Experiment) -> list[str]:
    """The lines of a plan about its linear answers."""
    rows = []
    for use in experiment.linear:
        parts = [("of", use.inputs), ("to", use.outputs), ("open at", use.opened)]
        answers = "; ".join(f"{word} {', '.join(paths)}" for word, paths in parts if paths)
        rows.append((use.name, use.where, answers))
    return _table("Linear answers: `met linear` gives them", rows)


def _metrics(experiment: Experiment) -> list[str]:
    """The lines of a plan about its metrics, each with its requirements."""
    rows = []
    for use in experiment.metrics:
        required = [requirement.text for requirement in experiment.requirements if requirement.metric == use.name]
        required += [step_error.text for step_error in experiment.step_errors if step_error.metric == use.name]
        rows.append((use.name, f"{use.model} of {use.of}", ", ".join(f"require {text}" for text in required)))
    return _table("Metrics and what is required of them", rows)


def _tolerances(experiment: Experiment) -> list[str]:
    rows = [(tolerance.of, tolerance.text) for tolerance in experiment.tolerances]
    return _table("Tolerances: by how much another version may differ before `met diff` says so", rows)


def _cases(experiment: Experiment) -> Iterator[str]:
    """The lines of a plan about its cases: how many, how large their histories, and the values of each varied
    parameter; of a search those of `search_lines`."""
    cases = experiment.cases
    if experiment.search is not None and not experiment.search.complete:
        yield from search_lines(experiment, experiment.search)
        return
    case_bytes = experiment.structure.history_bytes
    histories = f"{size(cases.count * case_bytes)} of histories" if case_bytes else "metrics alone are written"
    yield f"Cases: {'at most ' * (cases.until_shown > 0)}{cases.count}, {histories}"
    rows = [(choice.path, choice.value) for choice in cases.choices]
    for coordinate in cases.coordinates:
        if not cases.count:
            continue
        many = coordinate.design == "random" and cases.count > COUNTED
        values = span(coordinate.values) if many else different(coordinate.values)
        numbers = decimals(values if len(values) <= 4 else (values[0], values[-1]), coordinate.unit)
        if many:
            several = f"drawn, from {numbers[0]} to {numbers[-1]}"
        elif len(values) <= 4:
            several = ", ".join(numbers)
        else:
            several = f"{len(values)} values from {numbers[0]} to {numbers[-1]}"
        rows.append((coordinate.path, f"{several} {coordinate.unit}" if coordinate.unit != "1" else several))
    if cases.repeats is not None:
        rows.append(("repeat", f"{different(cases.repeats).size} times each"))
    if cases.seeds == "independent":
        rows.append(("seeds", "each case has noise of its own"))
    yield from columns(rows)


def budget(search: Search) -> str:
    """The goal with the number of cases: `maximise effort, in at most 2,000 cases`."""
    return f"{search.goal}, in at most {count(search.at_most, 'case')}"


def search_lines(experiment: Experiment, search: Search) -> Iterator[str]:
    """The search in lines: its goal and its parameters."""
    case_bytes = experiment.structure.history_bytes
    histories = f"; {size(case_bytes)} of histories a case" if case_bytes else ""
    yield f"{search.kind.capitalize()}: {budget(search)}{histories}"
    rows = []
    units = {coordinate.path: coordinate.unit for coordinate in experiment.cases.coordinates}
    for each_parameter in search.parameters:
        unit = units[each_parameter.path]
        ends = f"{decimals([each_parameter.low], unit)[0]} to {written(each_parameter.high, unit)}"
        rows.append((each_parameter.path, f"{ends}{', by equal ratios' * each_parameter.logarithmic}"))
    yield from columns(rows)
    if search.against:
        borne = [coordinate.path for coordinate in experiment.cases.coordinates[len(search.parameters) :]]
        yield f"  against {count(len(search.plants), 'case')} of {search.against}: {', '.join(borne)}"
    if search.fresh:
        yield f"  confirmed by {count(len(search.fresh), 'case')} of {search.confirms}"
    if search.kind == "tune" and experiment.requirements:
        required = ", ".join(requirement.text for requirement in experiment.requirements)
        yield f"  with a margin of {100.0 * search.margin:g} % to the limits of {required}"
    if search.steers:
        yield f"  candidates keep a disk margin of {search.least_margin:g}"
    elif search.kind == "tune" and not search.least_margin:
        yield "  its stability is not judged"

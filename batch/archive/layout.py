"""The layout of an archive, by which files are written and their size is estimated.

    /                       attributes: schema, deck, and for a single experiment those of its group
      <variables>           a single experiment lies in the root
    /<experiment>           several: one group each; of a sweep of several structures, one for each structure
      verification          in each: some cases with shorter steps, where they were run so (batch/archive/verified.py)
    /provenance             source (files of the deck, whole), plan (JSON); versions and git commit as attributes
      cases.<experiment>    coordinate by case: the whole case table, where it is too large for the plan's JSON

Dimensions, each with its coordinate variable:

    case            position in the sweep's case table, which `met cases` prints
    recorded_case   the cases whose histories were kept
    time            s, of the recorded rows
    joint           names of the moving joints; a signal of some joints only has a dimension of its own, `joint_of_...`
    axis            x, y, z: components of a vector
    quaternion      w, x, y, z: of an orientation
    requirement     texts of the requirements

A variable says what it is by its attribute `role`: dimension, case, coordinate, choice (what decides the structure, in
words), limit (share of time at one), excess (the largest over one), extreme (limit that was reached at a metric's),
metric, requirement, recorded or signal. In a sweep, `recorded.case_id` and `recorded.<path>` repeat names and varied
parameters along recorded_case, for a variable has one set of dimensions only: so a signal that is taken out by itself
still says what its cases are (`q.where(q["recorded.gearbox.kp"] > 0.02, drop=True)`).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from batch.archive import limits, searched, verified
from met.frozen import frozen
from met.plan import Coordinate, Experiment, Plan, Recorded
from met.plan.channel import DIMENSIONS, channels
from met.plan.limits import extremes
from met.plan.limits import limits as limits_of
from met.plan.outputs import GRAPPLE_FIGURES, grappled_payloads, metric_units
from met.unit_parser import parse_unit

SCHEMA = "met.archive"
VERSION = 1

OfMachine = Literal["limit", "excess", "extreme", "grapple"]
Role = Literal["dimension", "case", "coordinate", "choice", OfMachine, "metric", "requirement", "recorded", "signal"]
Kind = Literal["float64", "float32", "int64", "int8", "str"]

WIDTHS: Mapping[Kind, int] = {"float64": 8, "float32": 4, "int64": 8, "int8": 1, "str": 48}
"""Bytes of a value; of a string, with HDF5's overhead."""

CHUNK_BYTES = 4 << 20
"""Largest size of a chunk: one case's signal, cut in time beyond this size."""

CHUNK_ENTRY, VARIABLE_HEAD, PARAMETER_TEXT = 56, 1500, 300
"""Measured overhead in bytes: of a chunk in its index; of a variable's head; of a parameter in the plan's JSON."""

FRAME = (
    "joint frame: the parent link's frame moved by `at`, turned by `rpy` (fixed x-y-z); a joint moves about or along "
    "its axis in it; the link's frame is the joint frame at q = 0; the world is the base"
)
WHERE_IT_MOVES = FRAME.removesuffix("the world is the base") + "the base is a link, which moves in the world"

EVENTS = {
    "splits": "steps split where a joint came to rest",
    "clamped": "crossings of zero rate that were clamped",
    "undecided": "decisions at rest that the passes left open",
}
"""Counts of friction's events in a case (`met.run.Run.events`): variables `friction_...`."""

AT_LIMIT, EXCESS, EXTREME_AT, GRAPPLE = "at_limit.", "excess.", "extreme_at.", "grapple."
"""Prefixes of variables along `case`: the share of a run's time at the limit of this path, the largest excess over it,
the limit that was reached at the extreme of this metric, and a figure of the grapple of this payload."""

LIMITED = "ticks at which the load motor of a bed was at its limit"

RESERVED = frozenset(
    {
        "case",
        "recorded_case",
        "time",
        "joint",
        "requirement",
        "case_id",
        "case_key",
        "repeat",
        "seed",
        "status",
        "cause",
        "warning",
        "n_valid",
        "met",
        "provenance",
        "verification",
        "bed_limited",
        *(f"friction_{name}" for name in EVENTS),
    }
)
"""Names of variables that MET writes into a group. A deck's name that equals one of these, or a signal's, gets a word
before it: `coordinates.seed`, `metrics.time`, and for an experiment's group `experiments.provenance`."""


@frozen
class Variable:
    """One variable of a group. dims: names of its dimensions; attributes: units, long_name and the like, in order."""

    name: str
    kind: Kind
    dims: tuple[str, ...]
    role: Role
    long_name: str
    unit: str = ""
    attributes: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""

    @property
    def key(self) -> str:
        """The engine's name of the variable."""
        return self.source or self.name

    @property
    def written_attributes(self) -> dict[str, Any]:
        """The attributes of the variable in an archive, in their order, without a code key."""
        units = {"units": self.unit} if self.unit else {}
        return {**units, "long_name": self.long_name, "role": self.role, **self.attributes}

    def code_key(self, results: Mapping[str, str]) -> dict[str, str]:
        """The attribute with the code key of a metric or signal, from `met.run.Prepared.result_keys`."""
        kind = {"metric": "metrics", "signal": "record"}.get(self.role)
        key = results.get(f"{kind}.{self.key}")
        return {} if key is None else {"code_key": key}


@frozen
class Layout:
    """The group of one experiment: sizes of its dimensions, and its variables in the order in which they are
    written."""

    sizes: Mapping[str, int]
    variables: tuple[Variable, ...]
    attributes: Mapping[str, Any]

    @cached_property
    def _by_role(self) -> dict[str, tuple[Variable, ...]]:
        by_role: dict[str, list[Variable]] = {}
        for variable in self.variables:
            by_role.setdefault(variable.role, []).append(variable)
        return {role: tuple(those) for role, those in by_role.items()}

    def role(self, role: Role) -> tuple[Variable, ...]:
        return self._by_role.get(role, ())

    def shape(self, variable: Variable) -> tuple[int, ...]:
        return tuple(self.sizes[dim] for dim in variable.dims)

    @property
    def bytes(self) -> int:
        """Approximate size of the group in the file."""
        values = sum(int(np.prod(self.shape(v), dtype=np.int64)) * WIDTHS[v.kind] for v in self.variables)
        chunks = len(self.role("signal")) * self.sizes.get("recorded_case", 0)
        return values + CHUNK_ENTRY * chunks + VARIABLE_HEAD * len(self.variables)

    def chunks(self, variable: Variable) -> tuple[int, ...] | None:
        """Shape of a signal's chunks: one case each, cut in time where that is too large."""
        if variable.role != "signal":
            return None
        _, rows, *width = self.shape(variable)
        row = WIDTHS[variable.kind] * int(np.prod(width, dtype=np.int64))
        return (1, max(1, min(rows, CHUNK_BYTES // row)), *width)


def layout(experiment: Experiment, cases: int, recorded: int, single: bool = False) -> Layout:
    """The group of an experiment with `cases` cases run and the histories of `recorded` of them kept, with numbers of
    eight bytes, or of four where `single`."""
    structure = experiment.structure
    sizes = {"case": cases, "requirement": len(experiment.requirements)}
    variables = [
        Variable("case", "int64", ("case",), "dimension", "position of the case in the case table"),
        *_case_variables(experiment),
    ]
    if recorded:
        sizes |= {"recorded_case": recorded, "time": structure.schedule.rows}
        variables += [
            Variable("recorded_case", "int64", ("recorded_case",), "dimension", "cases whose histories are kept"),
            Variable("time", "float64", ("time",), "dimension", "time", "s"),
        ]
        repeated = list(_recorded(experiment, variables)) if experiment.cases.coordinates else []
        attributes = {"coordinates": " ".join(v.name for v in repeated)}
        variables += [*repeated, *_signals(experiment, sizes, "float32" if single else "float64", attributes)]
    return Layout(sizes, tuple(variables), _attributes(experiment, variables))


def joint_dimensions(experiment: Experiment) -> dict[tuple[str, ...], str]:
    """The dimensions of joints, by the joints' names."""
    moving = tuple(joint.name for joint in experiment.structure.moving)
    dimensions = {moving: "joint"}
    for recorded in experiment.structure.record:
        if recorded.joints and recorded.joints not in dimensions:
            owner = recorded.name.partition(".jacobian.")[0]  # both jacobians of a link have the same joints
            dimensions[recorded.joints] = "joint_of_" + re.sub(r"\W", "_", owner)
    return dimensions


def component_dimensions(experiment: Experiment) -> dict[tuple[str, ...], str]:
    """The dimensions of recorded vectors' components, by the components' names."""
    recorded = [recording.components for recording in experiment.structure.record if recording.components]
    return {components: DIMENSIONS[components] for components in recorded}


def coordinate_unit(experiment: Experiment, coordinate: Coordinate) -> str:
    """SI unit of a coordinate's values: that of the parameter it sets, else of the unit the deck wrote."""
    from met import units

    try:
        written = parse_unit(coordinate.unit).dimension
    except ValueError:
        return coordinate.unit
    for path in coordinate.sets:  # a `let` may set parameters of other dimensions too
        unit = experiment.parameters[path].unit if path in experiment.parameters else ""
        if unit and units.same(parse_unit(unit).dimension, written):
            return unit
    return units.text(written)


def _case_variables(experiment: Experiment) -> list[Variable]:
    """The variables along `case`: identity, varied values, how it ended, limits and metrics."""

    def variable(name: str, kind: Kind, long_name: str, **attributes: Any) -> Variable:
        return Variable(name, kind, ("case",), "case", long_name, attributes=attributes)

    out = [
        variable("case_id", "str", "digest of all parameters of the case"),
        variable("case_key", "str", "digest of the coordinates of the case"),
        variable("repeat", "int64", "number of the repeat"),
        variable("seed", "int64", "seed of the case's noise"),
    ]
    if experiment.search is not None:
        words = "generation of the search that asked for the case, from 0"
        out.append(variable(searched.GENERATION, "int64", words))
    taken = {*RESERVED, *(variable.name for variable in out)} | {
        recorded.name for recorded in experiment.structure.record
    }
    taken |= {*joint_dimensions(experiment).values(), *component_dimensions(experiment).values()}
    paths = [coordinate.path for coordinate in experiment.cases.coordinates]
    paths += [choice.path for choice in experiment.cases.choices]
    names = {path: _apart(path, "coordinates", taken, paths) for path in paths}
    out += [
        Variable(names[c.path], "str", ("case",), "choice", f"chosen: {c.path}", attributes={"path": c.path})
        for c in experiment.cases.choices
    ]
    out += [_coordinate(experiment, c, names[c.path]) for c in experiment.cases.coordinates]
    out += [
        variable(
            "status",
            "int8",
            "how the case ended",
            flag_values=np.array([0, 1, 2, 3], np.int8),
            flag_meanings="done failed timed_out lost",
        ),
        variable("cause", "str", "why the case failed; empty where it did not"),
        variable("warning", "str", "what makes a case that is done doubtful; empty where nothing does"),
        variable("n_valid", "int64", "recorded rows before the case failed; after them, not-a-number"),
        *(variable(f"friction_{name}", "int64", words) for name, words in EVENTS.items()),
        *([variable("bed_limited", "int64", LIMITED)] if experiment.structure.substitutions else []),
    ]
    taken |= set(names.values())
    for limit_variable in (*_limits(experiment), *_grapples(experiment)):
        name = _apart(limit_variable.name, "limits", taken, ())
        taken.add(name)
        out.append(replace(limit_variable, name=name, source=limit_variable.name))
    units = metric_units(experiment.structure, experiment.linear_metrics)
    named: dict[str, str] = {}
    for use in experiment.metrics:
        name = _apart(use.name, "metrics", taken, list(units))
        unit = units[use.name]
        words = f"{use.model} of {use.of}"
        deck_word, scale = limits.deck_unit(use.name, unit, experiment.requirements)
        attributes = {"model": use.model, "of": use.of, "deck_unit": deck_word, "deck_scale": scale}
        out.append(Variable(name, "float64", ("case",), "metric", words, unit, attributes, use.name))
        named[use.name] = name
    if experiment.requirements:
        words = "the requirement, as the deck wrote it"
        wanted = {
            "metric": [named.get(r.metric, r.metric) for r in experiment.requirements],
            "comparison": [r.comparison for r in experiment.requirements],
            "limit": np.array([r.limit for r in experiment.requirements]),
            **_over_cases(experiment),
        }
        flags = {"flag_values": np.array([1, 0, -1], np.int8), "flag_meanings": "met missed unknown"}
        out += [
            Variable("requirement", "str", ("requirement",), "dimension", words, attributes=wanted),
            Variable(
                "met",
                "int8",
                ("case", "requirement"),
                "requirement",
                "whether the requirement is met",
                attributes=flags,
            ),
        ]
    return out


def _limits(experiment: Experiment) -> list[Variable]:
    """Variables of shares of time at limits, largest excesses, and limits at extremes, by their own names."""
    limits = limits_of(experiment.structure, experiment.parameters)
    variables = [
        Variable(
            AT_LIMIT + use.path,
            "float64",
            ("case",),
            "limit",
            f"share of the time {'at' if use.machine else 'beyond'} {use.path}",
            "1",
            {"of": use.path},
        )
        for use in limits
    ]
    for use in limits:
        if use.bound:
            unit, words = experiment.parameters[use.path].unit, f"largest excess over {use.path}"
            variables.append(Variable(EXCESS + use.path, "float64", ("case",), "excess", words, unit, {"of": use.path}))
    for metric, uses in extremes(experiment).items():
        attributes = {
            "of": metric,
            "flag_values": np.arange(len(uses) + 1),
            "flag_meanings": " ".join(["none", *(use.path for use in uses)]),
        }
        words = f"limit that was reached where {metric} took its value"
        variables.append(Variable(EXTREME_AT + metric, "int64", ("case",), "extreme", words, "", attributes))
    return variables


def _grapples(experiment: Experiment) -> list[Variable]:
    """Variables of figures of grapples, by their own names."""
    return [
        Variable(
            f"{GRAPPLE}{payload}.{name}", "float64", ("case",), "grapple", f"payload {payload}: {words}", unit,
            {"of": payload, "figure": name},
        )
        for payload in grappled_payloads(experiment.structure)
        for name, (unit, words) in GRAPPLE_FIGURES.items()
    ]  # fmt: skip


def _over_cases(experiment: Experiment) -> dict[str, np.ndarray]:
    """Share and confidence of each requirement, not-a-number where it has none; nothing where no requirement has
    any."""
    requirements = experiment.requirements
    if all(requirement.share is None for requirement in requirements):
        return {}
    return {
        name: np.array([getattr(requirement, name) for requirement in requirements], float)  # None is not-a-number
        for name in ("share", "confidence")
    }


def _apart(name: str, word: str, taken: Collection[str], fellows: Collection[str]) -> str:
    """A name, with one word or several before it where it is taken, so that it equals no name of its fellows either."""
    if name not in taken:
        return name
    while name in taken or name in fellows:
        name = f"{word}.{name}"
    return name


def _coordinate(experiment: Experiment, coordinate: Coordinate, name: str) -> Variable:
    """The variable of an archive that holds a varied parameter, [case]."""
    written: dict[str, Any] = {
        "deck_unit": coordinate.unit,
        "deck_scale": coordinate.scale,
        "sets": " ".join(coordinate.sets),
    }
    unit = coordinate_unit(experiment, coordinate)
    words = f"varied: {coordinate.path}"
    if name != coordinate.path:
        written["path"] = coordinate.path
    if coordinate.design:
        written["design"] = coordinate.design
    written |= searched.of_coordinate(experiment.search, coordinate.path)
    return Variable(name, "float64", ("case",), "coordinate", words, unit, written, coordinate.path)


def _recorded(experiment: Experiment, variables: list[Variable]) -> Iterator[Variable]:
    """Variables along recorded_case that repeat those that identify a case; `source` is the variable along case."""
    taken = [variable.name for variable in variables] + [recorded.name for recorded in experiment.structure.record]
    for v in variables:
        if v.role == "coordinate" or v.name == "case_id":
            name = _apart(f"recorded.{v.name}", "recorded", taken, ())
            taken.append(name)
            yield Variable(name, v.kind, ("recorded_case",), "recorded", v.long_name, v.unit, v.attributes, v.name)


def _signals(
    experiment: Experiment, sizes: dict[str, int], kind: Kind, common: Mapping[str, str]
) -> Iterator[Variable]:
    """Variables of signals. common: attributes of every signal; empty ones are left out."""
    joint_dims, component_dims = joint_dimensions(experiment), component_dimensions(experiment)
    for joints, dim in joint_dims.items():
        if any(recorded.joints == joints for recorded in experiment.structure.record):
            sizes[dim] = len(joints)
            yield Variable(dim, "str", (dim,), "dimension", "joint")
    for components, dim in component_dims.items():
        sizes[dim] = len(components)
        yield Variable(dim, "str", (dim,), "dimension", "component")
    known = channels(experiment.structure)
    for recorded in experiment.structure.record:
        dims = ["recorded_case", "time"]
        dims += [joint_dims[recorded.joints]] if recorded.joints else []
        dims += [component_dims[recorded.components]] if recorded.components else []
        unit, attributes = _signal_unit(recorded)
        frame = known[recorded.channels[0]].frame
        inner = [joint for joint in recorded.joints if joint in experiment.structure.springs]
        attributes |= {name: value for name, value in {"frame": frame, "springs": inner, **common}.items() if value}
        yield Variable(recorded.name, kind, tuple(dims), "signal", recorded.doc, unit, attributes)


def _signal_unit(recorded: Recorded) -> tuple[str, dict[str, Any]]:
    """The unit, if all joints share one, or else the attribute with each joint's unit."""
    units = recorded.unit if len(recorded.unit) > 1 else recorded.unit * max(1, len(recorded.channels))
    if len(set(units)) > 1:
        return "", {"units_by_joint": list(units[:: max(1, len(recorded.components))])}
    return units[0], {}


def _attributes(experiment: Experiment, variables: list[Variable]) -> dict[str, Any]:
    """The attributes of an experiment's group: names, integrator, rates (Hz), duration (s), key of the structure,
    allowances."""
    from met.plan import keys

    structure, schedule, search = experiment.structure, experiment.structure.schedule, experiment.search
    named = ("coordinate", "choice", "recorded")
    coordinates = ["case_id", "case_key", *(v.name for v in variables if v.role in named)]
    if experiment.cases.repeats is not None:
        coordinates.append("repeat")
    if search is not None:
        coordinates.append(searched.GENERATION)
    metrics = {variable.key: variable.name for variable in variables if variable.role == "metric"}
    errors = {verified.ATTRIBUTE: verified.written(experiment.step_errors, metrics)} if experiment.step_errors else {}
    return {
        "experiment": experiment.name,
        **({"sweep": experiment.sweep} if experiment.sweep else {}),
        "arm": structure.arm,
        "integrator": structure.integrator,
        "velocity_products": "on" if structure.velocity_products else "off",
        "base_hz": schedule.base_hz,
        "dynamics_hz": schedule.base_hz / schedule.dynamics,
        "record_hz": schedule.base_hz / schedule.record,
        "duration_s": schedule.duration,
        "structure_key": keys.structure_key(structure, keys.inputs(experiment)),
        "cases_in_table": experiment.cases.count,
        **errors,
        **({} if search is None else searched.attributes(search, metrics[search.metric])),
        "frame": FRAME if structure.base is None else WHERE_IT_MOVES,
        "coordinates": " ".join(coordinates),
        **({"allowed": "\n".join(map(str, experiment.allowances))} if experiment.allowances else {}),
    }


def group_names(plan: Plan) -> tuple[str, ...]:
    """Paths of the experiments' groups."""
    if len(plan.experiments) == 1:
        return ("/",)
    names = [experiment.name for experiment in plan.experiments]
    return tuple("/" + _apart(name, "experiments", ("provenance",), names) for name in names)

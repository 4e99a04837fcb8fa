"""Checks of a plan that its types cannot make: that its parts fit together, and that its numbers are possible.

A mistake in a plan that was written by hand, or by another program, is reported with its path in the JSON; a plan that
passes here runs. All checks raise `Damaged`.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from met import units
from met.parameter import Parameter
from met.plan import BASE, Coordinate, Experiment, Formula, Quantity
from met.plan import relations as relations
from met.plan import structure as plan_structure
from met.plan.checked_answers import check_linear, check_search
from met.plan.codec import Damaged
from met.plan.columns import CaseValues, blocks
from met.plan.defaults import INERTIA, declared, heads_of_models, related
from met.plan.judged import Requirement
from met.plan.outputs import tolerable
from met.plan.uses import ModelUse, model_uses
from met.statistics.confidence import can_be_shown
from met.trace.graph import Formulas
from met.trace.nodes import TRUTHS
from met.unit_parser import parse_unit

GROUP = re.compile(r"[\w+-]+(\.[\w+-]+)*")
"""The name of a group of a sweep, which follows the sweep's name."""

TABLES = {"table": 1, "trajectory": 2}
"""Profiles of points, with the number of points that each needs at least."""

MOST_SEED = 2**63 - 1

ROUNDING = 1e-9
"""Allowance for rounding: the error of an axis' length, and the share by which a moment of inertia may be below
zero."""

CODE = re.compile(r"[A-Z]\d{3}", re.ASCII)
"""The code of a diagnostic."""

CHUNK = 1 << 14
"""Number of cases whose varied numbers are tested at a time."""


def check(experiments: Iterable[Experiment]) -> None:
    """Check all experiments of a plan."""
    names: list[str] = []
    for index, experiment in enumerate(experiments):
        where = f"experiments[{index}]"
        _group_name(experiment, f"{where}.name", names)
        names.append(experiment.name)
        plan_structure.check(experiment.structure, f"{where}.structure")
        check_linear(experiment, where)
        _check_requirements(experiment, f"{where}.requirements")
        _check_step_errors(experiment, f"{where}.step_errors")
        _check_tolerances(experiment, f"{where}.tolerances")
        _check_allowances(experiment, f"{where}.allowances")
        _check_cases(experiment, f"{where}.cases")
        if experiment.search is not None:
            check_search(experiment, experiment.search, f"{where}.search")
        _check_formulas(experiment, where)
        _check_parameters(experiment, f"{where}.parameters")
    if not names:
        raise Damaged("experiments", "there is none")


def check_text(document: Any, where: str = "") -> None:
    """Check that no text except a source's holds a null character, or half of a surrogate pair."""
    if isinstance(document, str):
        if "\0" in document:
            raise Damaged(where, "a null character is in it")
        if not document.isascii() and any("\ud800" <= c <= "\udfff" for c in document):
            raise Damaged(where, "half of a character is in it")
    elif isinstance(document, dict):
        for key, part in document.items():
            check_text(key, where)
            if not (key == "text" and where.startswith("sources")):
                check_text(part, f"{where}.{key}".lstrip("."))
    elif isinstance(document, list):
        for index, part in enumerate(document):
            check_text(part, f"{where}[{index}]")


def _group_name(experiment: Experiment, where: str, before: Collection[str]) -> None:
    """The name of a run or sweep, or the part after it that tells a group of a sweep from the others."""
    head, _, relations = experiment.name.partition(".")
    plan_structure.check_name(head, where)
    if experiment.name in before:
        raise Damaged(where, f"`{experiment.name}` is there twice")
    if (relations or experiment.sweep) and not (GROUP.fullmatch(relations) and experiment.sweep == head):
        raise Damaged(where, f"{experiment.name!r} is no name of a group of the sweep `{experiment.sweep}`")


# Cases


def _check_requirements(experiment: Experiment, where: str) -> None:
    """Check that requirements are of metrics of the run, with sensible limits, shares and confidences."""
    metrics = {use.name for use in experiment.metrics}
    by_text: dict[str, Requirement] = {}
    for index, requirement in enumerate(experiment.requirements):
        if requirement.metric not in metrics:
            raise Damaged(f"{where}[{index}].metric", f"there is no metric `{requirement.metric}`")
        if math.isnan(requirement.limit):
            raise Damaged(f"{where}[{index}].limit", "it is not a number")
        share, confidence = requirement.share, requirement.confidence
        if share is not None and not 0.0 < share <= 1.0:
            raise Damaged(f"{where}[{index}].share", "it should be above 0 and at most 1")
        if confidence is not None and not (share is not None and can_be_shown(share) and 0.0 < confidence < 1.0):
            raise Damaged(f"{where}[{index}].confidence", "it should be between 0 and 1, of a share between 0 and 1")
        first = by_text.setdefault(requirement.text, requirement)
        if (first.metric, first.comparison, first.limit) != (
            requirement.metric,
            requirement.comparison,
            requirement.limit,
        ):
            raise Damaged(f"{where}[{index}].text", "another requirement has the same text")


def _check_step_errors(experiment: Experiment, where: str) -> None:
    """Check that limits of errors by the step are of metrics, above 0, and differ in text. Raises Damaged."""
    metrics = {use.name for use in experiment.structure.metrics}
    for index, limit in enumerate(experiment.step_errors):
        if limit.metric not in metrics:
            raise Damaged(f"{where}[{index}].metric", f"there is no metric `{limit.metric}`")
        if not 0.0 < limit.limit < math.inf:
            raise Damaged(f"{where}[{index}].limit", "it should be a finite number above 0")
    if len({step_error.text for step_error in experiment.step_errors}) < len(experiment.step_errors):
        raise Damaged(where, "two have the same text")


def _check_tolerances(experiment: Experiment, where: str) -> None:
    """Check that tolerances are of signals or metrics, at least 0, and one each. Raises Damaged."""
    known = tolerable(experiment.structure, experiment.linear_metrics) if experiment.tolerances else {}
    for index, tolerance in enumerate(experiment.tolerances):
        if tolerance.of not in known:
            raise Damaged(f"{where}[{index}].of", f"there is no signal or metric `{tolerance.of}`")
        if not 0.0 <= tolerance.value < math.inf:
            raise Damaged(f"{where}[{index}].value", "it should be a finite number, at least 0")
    if len({tolerance.of for tolerance in experiment.tolerances}) < len(experiment.tolerances):
        raise Damaged(where, "something has two tolerances")


def _check_allowances(experiment: Experiment, where: str) -> None:
    """Check that allowed warnings have codes and reasons, once each. Raises Damaged."""
    for index, allowance in enumerate(experiment.allowances):
        if not CODE.fullmatch(allowance.code):
            raise Damaged(f"{where}[{index}].code", f"{allowance.code!r} is no code of a warning")
        if not allowance.because.strip() or "\n" in allowance.because:
            raise Damaged(f"{where}[{index}].because", "a reason is one line, which is not empty")
    if len({allowance.code for allowance in experiment.allowances}) < len(experiment.allowances):
        raise Damaged(where, "a warning is allowed twice")


def _check_cases(experiment: Experiment, where: str) -> None:
    """Check the case table: its count, seed, numberings, and each coordinate."""
    cases = experiment.cases
    many = cases.coordinates or cases.repeats is not None
    plan_structure.check_whole(cases.count, 1, 2**63 - 1 if many else 1, f"{where}.count")
    plan_structure.check_whole(cases.seed, 0, MOST_SEED, f"{where}.seed")
    for name, column in (("repeats", cases.repeats), ("positions", cases.positions)):
        if column is not None:
            _check_numbering(column, cases.count, name == "positions", f"{where}.{name}")
    paths: set[str] = set()
    for index, coordinate in enumerate(cases.coordinates):
        path = f"{where}.coordinates[{index}]"
        if not all(plan_structure.NAME.fullmatch(part) for part in coordinate.path.split(".")):
            raise Damaged(f"{path}.path", f"{coordinate.path!r} is no path")
        if coordinate.path in paths:
            raise Damaged(f"{path}.path", f"`{coordinate.path}` is there twice")
        paths.add(coordinate.path)
        _check_coordinate(experiment, coordinate, path)
    if cases.until_shown:
        _check_until_shown(experiment, f"{where}.until_shown")


def _check_until_shown(experiment: Experiment, where: str) -> None:
    """Check that cases which are run until something is shown are independent draws, and that a requirement has a
    confidence to show."""
    cases = experiment.cases
    plan_structure.check_whole(cases.until_shown, 1, 2**53, where)
    designs = {coordinate.design for coordinate in cases.coordinates} - {""}
    if designs != {"random"} or cases.repeats is not None:
        raise Damaged(where, "its cases should be drawn by one `random`, without repeats")
    if all(requirement.confidence is None for requirement in experiment.requirements):
        raise Damaged(where, "no requirement has a confidence, so nothing is to be shown")


def _check_numbering(column: CaseValues, count: int, rising: bool, where: str) -> None:
    """Check a column of a case table that holds whole numbers, such as repeats. rising: whether each must be above the
    one before. Raises Damaged."""
    if column.shape != (count,):
        raise Damaged(where, f"there are {column.size} for {count} cases")
    before = -1.0
    for rows in blocks(count):
        numbers = np.asarray(column[rows])
        if not (np.isfinite(numbers).all() and (numbers == np.rint(numbers)).all()):
            raise Damaged(where, "they should be whole numbers")
        good = bool(((numbers >= 0) & (numbers < 2**32)).all())
        if not good or (rising and not (numbers[0] > before and (np.diff(numbers) > 0).all())):
            raise Damaged(where, "they should be at least 0" + (", and rise" if rising else " and below 2^32"))
        before = float(numbers[-1])


def _check_coordinate(experiment: Experiment, coordinate: Coordinate, where: str) -> None:
    """Check that a varied parameter has a value for each case and sets parameters that there are. Raises Damaged."""
    if coordinate.values.shape != (experiment.cases.count,):
        raise Damaged(f"{where}.values", f"there are {coordinate.values.size} for {experiment.cases.count} cases")
    if not 0.0 < coordinate.scale < math.inf:
        raise Damaged(f"{where}.scale", "it should be above 0, and finite")
    if coordinate.path not in experiment.formulas.inputs:
        raise Damaged(f"{where}.path", f"no formula follows `{coordinate.path}`")
    for path in coordinate.sets:
        if path not in experiment.parameters:
            raise Damaged(f"{where}.sets", f"there is no parameter `{path}`")


def _check_formulas(experiment: Experiment, where: str) -> None:
    """Check that formulas are of the coordinates, and that parameters name existing ones."""
    formulas = experiment.formulas
    paths = {coordinate.path for coordinate in experiment.cases.coordinates}
    for index, name in enumerate(formulas.inputs):
        if name not in paths:
            raise Damaged(f"{where}.formulas.inputs[{index}]", f"no coordinate is `{name}`")
    for index, node in enumerate(formulas.nodes):
        if node[0] == "input" and node[1] not in formulas.inputs:
            raise Damaged(f"{where}.formulas.nodes[{index}]", f"`{node[1]}` is none of the inputs")
    for index, reference in enumerate(formulas.outputs):
        if formulas.nodes[reference >> 1][0] in TRUTHS:
            raise Damaged(f"{where}.formulas.outputs[{index}]", "it is a truth, not a number")
    for path, quantity in experiment.parameters.items():
        if isinstance(quantity.value, Formula) and not 0 <= quantity.value.output < len(formulas.outputs):
            message = f"there is no formula {quantity.value.output}, but {len(formulas.outputs)} of them"
            raise Damaged(f"{where}.parameters.{path}.value", message)


# Parameters


def _check_parameters(experiment: Experiment, where: str) -> None:
    """Check that every parameter belongs to the arm or a model, has its unit, and is within its bounds. (Missing ones:
    E304.)"""
    structure, parameters = experiment.structure, experiment.parameters
    known: set[str] = set()
    models_of = heads_of_models(structure)
    relations.check_uses(experiment, related(experiment), where)  # first, since units depend on a model's joint
    for path, unit, _, parameter in declared(experiment):
        if path in known:
            raise Damaged(where, f"two things are called `{path}`")
        known.add(path)
        quantity = parameters.get(path)
        if quantity is not None:
            _check_quantity(quantity, unit, parameter, f"{where}.{path}")
    known |= _check_pivots(experiment, where)
    for path in parameters:
        if path not in known and not path.startswith(models_of):  # a model's own: `plan_defaults`
            raise Damaged(f"{where}.{path}", "nothing in this run has this parameter")
    for use in model_uses(structure):
        if use.kind == "command" and use.model in TABLES:
            _check_table(experiment, use.head, TABLES[use.model], where)
        for name, word in _words(use) if use.kind in ("servo", "sensor") else ():
            _is_word(parameters, f"{use.head}.{name}", word, where)
    relations.check_guided_paths(experiment, where)
    _check_bodies(experiment, where)


def _words(use: ModelUse) -> Iterator[tuple[str, str]]:
    """Every word of a servo or sensor that a structure decides: the chosen one, else the default."""
    model, chosen = use.declaration, dict(use.words)
    words = [parameter.name for parameter in model.parameters if parameter.shape == "word"]
    for parameter in model.parameters:
        if parameter.name in getattr(model, "deciding", words) and isinstance(parameter.default, str):
            yield parameter.name, chosen.get(parameter.name, parameter.default)


def _is_word(parameters: Mapping[str, Quantity], path: str, word: str, where: str) -> None:
    if path in parameters and parameters[path].value != word:
        raise Damaged(f"{where}.{path}", f"it should be {word}, as the structure says")


def _check_pivots(experiment: Experiment, where: str) -> set[str]:
    """Paths of the pivots of revolute joints, each with all three numbers or none."""
    pivots: set[str] = set()
    for joint in experiment.structure.joints:
        paths = [f"{joint.name}.pivot.{axis}" for axis in "xyz"] if joint.kind == "revolute" else []
        present = [path for path in paths if path in experiment.parameters]
        if present and len(present) < len(paths):
            raise Damaged(f"{where}.{joint.name}.pivot", "it is made of three numbers, .x .y .z")
        for path in present:
            _check_quantity(experiment.parameters[path], "m", None, f"{where}.{path}")
        pivots.update(present)
    return pivots


def _check_quantity(quantity: Quantity, unit: str, parameter: Parameter | None, where: str) -> None:
    """Check a parameter's unit, shape and bounds, as its model declares them."""
    is_word = parameter is not None and parameter.shape == "word"  # a word has no unit, however it is written
    if not is_word and quantity.unit != unit and not _same_unit(quantity.unit, unit):
        raise Damaged(f"{where}.unit", f"it should be {unit}")
    value, shape = quantity.value, parameter.shape if parameter is not None else "number"
    if shape == "word":
        assert parameter is not None
        words = () if parameter.names else parameter.words
        if not isinstance(value, str) or (words and value not in words):
            raise Damaged(f"{where}.value", "it should be a word" + (f": {', '.join(words)}" if words else ""))
    elif shape == "list":
        if not isinstance(value, tuple):
            raise Damaged(f"{where}.value", "it should be a list of numbers")
        if not all(math.isfinite(number) for number in value):
            raise Damaged(f"{where}.value", "one of its numbers is not finite")
        if parameter is not None:
            _check_bounds(value, parameter, where, "one of its numbers: ")
    elif isinstance(value, str | tuple):
        raise Damaged(f"{where}.value", "it should be a number")
    elif isinstance(value, float):
        if parameter is None and not math.isfinite(value):
            raise Damaged(f"{where}.value", "it is not finite")
        if parameter is not None:
            _check_bounds((value,), parameter, where)


def _check_bounds(values: tuple[float, ...], parameter: Parameter, where: str, head: str = "") -> None:
    for holds, message in _bounds(parameter):
        if not holds(np.array(values).reshape(-1, 1)).all():
            raise Damaged(f"{where}.value", head + message)


def _bounds(parameter: Parameter) -> list[tuple[Callable[[np.ndarray], np.ndarray], str]]:
    """Tests of values [case, 1] against each bound of a declaration, with the bound in words."""
    written: tuple[tuple[float | None, str, np.ufunc], ...] = (
        (parameter.above, "above", np.greater),
        (parameter.at_least, "at least", np.greater_equal),
        (parameter.below, "below", np.less),
        (parameter.at_most, "at most", np.less_equal),
    )
    tests: list[tuple[Callable[[np.ndarray], np.ndarray], str]] = [
        (partial(_is_finite, parameter.default), "it is not finite")
    ]
    if parameter.whole:
        tests.append((_is_whole, "it should be a whole number"))
    return tests + [
        (partial(_within, holds, limit), f"it should be {words} {limit:g}")
        for limit, words, holds in written
        if limit is not None
    ]


def _within(holds: np.ufunc, limit: float, values: np.ndarray) -> np.ndarray:
    return np.asarray(holds(values[:, 0], limit))


def _is_finite(default: object, values: np.ndarray) -> np.ndarray:
    """Check that values are finite; infinite is allowed as a model's own default, or a part of it, that stands for
    never or none."""
    numbers = [x for x in (default if isinstance(default, tuple) else (default,)) if isinstance(x, float)]
    return np.asarray(np.isfinite(values[:, 0]) | np.isin(values[:, 0], [x for x in numbers if math.isinf(x)]))


def _is_whole(values: np.ndarray) -> np.ndarray:
    """True for the cases, [case, 1], with a whole number."""
    return np.asarray(values[:, 0] == np.rint(values[:, 0]))


def _same_unit(unit: str, other: str) -> bool:
    """True if two units have the same size and dimension; False where one cannot be read."""
    try:
        mine, theirs = parse_unit(unit), parse_unit(other)
    except ValueError:
        return False
    return mine.scale == theirs.scale and units.same(mine.dimension, theirs.dimension)


def _check_table(experiment: Experiment, prefix: str, fewest: int, where: str) -> None:
    """Check that times rise, and that there are as many values, at least `fewest`."""
    quantities = [experiment.parameters.get(f"{prefix}.{name}") for name in ("times", "values")]
    times, values = (quantity.value if quantity is not None else () for quantity in quantities)
    if not isinstance(times, tuple) or not isinstance(values, tuple) or None in quantities:
        return  # missing: E304
    if len(times) < fewest or len(times) != len(values):
        needed = f", and {fewest} are needed" if len(times) == len(values) else ""
        raise Damaged(f"{where}.{prefix}.values", f"there are {len(values)} for {len(times)} times{needed}")
    if not all(before < after for before, after in itertools.pairwise(times)):
        raise Damaged(f"{where}.{prefix}.times", "they do not rise")


def _check_bodies(experiment: Experiment, where: str) -> None:
    """Check that masses are not negative, inertias are possible and axes have length 1, as written or in every case."""
    structure = experiment.structure
    tests: list[tuple[str, list[str], Callable[[np.ndarray], np.ndarray], str]] = []
    for link in structure.links:
        head = f"links.{link.name}"
        tests.append((f"{head}.mass", [f"{head}.mass"], _is_mass, "it should be at least 0"))
        inertia = [f"{head}.inertia.{entry}" for entry in INERTIA]
        no_body = (_is_inertia, "a principal moment is below 0: no body has that")
        wanted = (_are_finite, "it should be finite") if link.lumped else no_body
        tests.append((f"{head}.inertia", inertia, *wanted))
    for payload in structure.payloads:
        head = f"payloads.{payload.name}"
        inertia = [f"{head}.inertia.{entry}" for entry in INERTIA]
        if payload.flies:
            tests.append((f"{head}.mass", [f"{head}.mass"], _is_some, "what flies has mass"))
            message = "a principal moment is not above 0: what flies turns about all axes"
            tests.append((f"{head}.inertia", inertia, _is_solid, message))
        else:
            tests.append((f"{head}.mass", [f"{head}.mass"], _is_mass, "it should be at least 0"))
            tests.append((f"{head}.inertia", inertia, _is_inertia, "a principal moment is below 0: no body has that"))
        if payload.grappled and payload.released:
            times = [f"{head}.grapple", f"{head}.release"]
            tests.append((times[1], times, relations.is_less, "it is not after `grapple`"))
    for joint in structure.moving:
        axis = [f"{joint.name}.axis.{letter}" for letter in "xyz"]
        tests.append((f"{joint.name}.axis", axis, _is_axis, "its length should be 1"))
        ends = [f"{joint.name}.q_min", f"{joint.name}.q_max"]
        tests.append((ends[0], ends, relations.is_less, "it should be less than `q_max`"))
        for path in (f"{joint.name}.qd_max", f"{joint.name}.tau_max"):
            tests.append((path, [path], _is_some, "it should be above 0"))
    if structure.free:
        masses = [f"links.{name}.mass" for name in structure.ground]
        tests.append((f"links.{BASE}.mass", masses, _is_some, "the base moves freely and has no mass"))
    tests += [*relations.rest_tests(experiment), *relations.tests(experiment, related(experiment))]
    varied = []
    for path, paths, holds, message in tests:
        if any(path not in experiment.parameters for path in paths):
            continue  # missing: E304
        values = [experiment.parameters[path].value for path in paths]
        if any(isinstance(value, Formula) for value in values):
            varied.append((path, values, holds, message))
        elif not holds(np.array([values], dtype=float))[0]:
            raise Damaged(f"{where}.{path}", message)
    for path, _, _, parameter in declared(experiment):
        quantity = experiment.parameters.get(path)
        if parameter is not None and quantity is not None and isinstance(quantity.value, Formula):
            for holds, message in _bounds(parameter):
                varied.append((path, [quantity.value], holds, message))
    if varied:
        _check_varied(experiment, varied, where)


def _check_varied(
    experiment: Experiment, tests: list[tuple[str, list[Any], Callable[[np.ndarray], np.ndarray], str]], where: str
) -> None:
    """Check tests of parameters that vary, over all cases, a piece of the table at a time."""
    cases, formulas = experiment.cases, experiment.formulas
    wanted = sorted({v.output for _, values, _, _ in tests for v in values if isinstance(v, Formula)})
    some = Formulas(formulas.inputs, formulas.nodes, tuple(formulas.outputs[output] for output in wanted))
    for first in range(0, cases.count, CHUNK):
        rows = slice(first, first + CHUNK)
        columns = some.replay({coordinate.path: coordinate.values[rows] for coordinate in cases.coordinates})
        by_output = dict(zip(wanted, columns, strict=True))
        count = min(CHUNK, cases.count - first)
        for path, values, holds, message in tests:
            parts = [by_output[v.output] if isinstance(v, Formula) else v for v in values]
            good = holds(np.stack([np.broadcast_to(np.asarray(part, dtype=float), count) for part in parts], axis=-1))
            if not good.all():
                raise Damaged(f"{where}.{path}", f"{message}; in case #{first + int(np.argmin(good))}")


def _is_mass(values: np.ndarray) -> np.ndarray:
    return (values[:, 0] >= 0.0) & np.isfinite(values[:, 0])


def _is_some(values: np.ndarray) -> np.ndarray:
    """True for the cases, [case, any], whose numbers have a sum above 0."""
    return np.asarray(values.sum(axis=1) > 0.0)


def _is_axis(values: np.ndarray) -> np.ndarray:
    """True for the cases, [case, 3], with a vector of length 1, but for rounding."""
    with np.errstate(all="ignore"):
        return np.abs(np.sqrt((values * values).sum(axis=1)) - 1.0) <= ROUNDING


def _is_solid(values: np.ndarray) -> np.ndarray:
    """True for matrices that are positive definite beyond rounding, by the pivots of the matrix scaled to its largest
    entry."""
    with np.errstate(all="ignore"):
        xx, yy, zz, xy, xz, yz = values.T / np.abs(values).max(axis=1)
        second, side = yy - xy * xy / xx, yz - xy * xz / xx
        third = zz - xz * xz / xx - side * side / second
        return np.logical_and.reduce([pivot > ROUNDING for pivot in (xx, second, third)])


def _are_finite(values: np.ndarray) -> np.ndarray:
    """True for the cases, [case, any], all of whose numbers are finite."""
    return np.asarray(np.isfinite(values).all(axis=1))


def _is_inertia(values: np.ndarray) -> np.ndarray:
    """True for matrices that are positive semidefinite, by the principal minors of the matrix scaled to its largest
    entry."""
    finite = np.isfinite(values).all(axis=1)
    size = np.abs(np.where(finite[:, None], values, 0.0)).max(axis=1)
    xx, yy, zz, xy, xz, yz = np.where(finite[:, None], values, 0.0).T / np.where(size > 0.0, size, 1.0)
    minors = (
        xx,
        yy,
        zz,
        xx * yy - xy * xy,
        xx * zz - xz * xz,
        yy * zz - yz * yz,
        xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz),
    )
    return finite & np.logical_and.reduce([minor >= -ROUNDING for minor in minors])

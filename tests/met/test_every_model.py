"""What holds for every model: it declares itself, runs from a small deck, and its bits depend on the case alone.

A model that is added gets a line in `SMALLEST` (tests/met/small_models.py), or a test here fails. What its parameters
are to a deck is tested in tests/met/declarations.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from met import models
from met import run as engine
from met.backends.reference.plain import execute
from met.parameter import Parameter
from met.plan.channel import COMMAND_UNIT
from met.program import build
from met.unit_parser import parse_unit
from tests.ic.small_decks import experiment
from tests.met.small_models import EVERY, SMALLEST, Use, smallest


def parameters(model: Any) -> tuple[Parameter, ...]:
    return (*getattr(model, "parameters", ()), *getattr(model, "of_joint", ()))


def test_every_model_has_a_small_deck() -> None:
    assert sorted(SMALLEST) == sorted(EVERY)
    for (kind, name), small in SMALLEST.items():
        assert small.values.keys() <= {parameter.name for parameter in models.written(models.find(kind, name))}, name


@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_a_model_declares_what_its_numbers_are(kind: models.Kind, name: str) -> None:
    model = models.find(kind, name)
    assert model.name == name
    assert len(model.doc.split(". ")[0].split()) >= 3, "its own words begin with a sentence"
    words = {word: parse_unit("1") for word in ("joint", "effort", "command", "of")}
    held = [part for group in models.HELD for part in getattr(model, group, ())]
    for part in (*parameters(model), *held):
        assert part.doc, part.name
        parse_unit(part.unit, words)
    for parameter in parameters(model):
        if parameter.shape == "word" and parameter.words and parameter.default is not None:
            assert parameter.default in parameter.words, parameter.name
        if isinstance(parameter.default, float):
            assert parameter.above is None or parameter.default > parameter.above, parameter.name
            assert parameter.at_least is None or parameter.default >= parameter.at_least, parameter.name
    if kind == "servo":
        assert set(model.commands) <= set(COMMAND_UNIT)
        assert all(set(parameter.needed_for) <= set(model.commands) for parameter in parameters(model))
        assert (model.control is None) == (not model.outputs), "what a law gives, it has computed"
        assert model.control is not None or not model.commands, "a command reaches the law alone"
        known = {parameter.name: parameter.words for parameter in parameters(model)}
        for part in (*parameters(model), *held):
            assert part.only is None or set(part.only[1]) <= set(known[part.only[0]]), part.name


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_it_runs_from_a_small_deck_and_its_bits_depend_on_the_case_alone(
    kind: models.Kind, name: str, tmp_path: Path
) -> None:
    sweep = experiment(tmp_path, smallest(kind, name).put(tmp_path).deck(), select=["cases"])
    runs = [engine.run(sweep, threads=1, lanes=lanes) for lanes in (2, 8)]
    assert runs[0].cause == [""] * 7
    for one in runs[1:]:
        assert one.metrics["m"].tobytes() == runs[0].metrics["m"].tobytes()
        for channel, values in runs[0].signals.items():
            assert one.signals[channel].tobytes() == values.tobytes(), channel
    # plain floats: sines of the platform and no fused multiply-add, so some roundings apart, which 50 steps let grow
    inputs = {coordinate.path: float(coordinate.values[5]) for coordinate in sweep.cases.coordinates}
    rows, _ = execute(build(sweep), inputs, sweep.structure.schedule.ticks)
    kernel = np.concatenate([runs[0].signals[channel][5] for channel in ("q", "qd", "qdd", "tau")], axis=1)
    assert np.abs(kernel - rows).max() < 1e-10 * np.abs(rows).max()


@pytest.mark.release
@pytest.mark.parametrize("servo", [name for name, model in models.find_own("servo").items() if model.commands])
@pytest.mark.parametrize("course", models.find_own("command"))
def test_every_servo_takes_every_course_of_every_command_that_it_knows(servo: str, course: str, tmp_path: Path) -> None:
    for command in models.find("servo", servo).commands:
        use = Use("command", course, command=command, carrier=servo).put(tmp_path)
        deck = experiment(tmp_path, use.deck(), select=["it"])
        rows, _ = execute(build(deck), {}, deck.structure.schedule.ticks)
        assert np.isfinite(rows).all() and np.ptp(rows[:, 0]) > 0.0, command


def test_a_parameter_may_be_declared_for_each_of_several_words() -> None:
    """Never twice for one word, nor beside one that is there under all."""

    def names(*only: tuple[str, tuple[str, ...]] | None) -> list[str]:
        return models.distinct_names([Parameter(name="x", doc="a number", only=each) for each in only])

    assert names(("w", ("a",)), ("w", ("b", "c"))) == ["x"]
    assert names(("w", ("a", "b")), ("w", ("b", "c"))) == names(("w", ("a",)), None) == ["x", "x"]
    assert names(("w", ("a",)), ("v", ("b",))) == ["x", "x"]

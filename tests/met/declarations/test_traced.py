"""Every function of every model gives the same numbers whether it computes with floats or is recorded and replayed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from met import models
from met.servos.servo import Drive
from tests.ic.small_decks import experiment
from tests.met.declarations import both_ways
from tests.met.small_models import EVERY, smallest, uses

pytestmark = pytest.mark.slow

DRAWS = 10
"""Sets of random numbers for each function, under each kind of command and each choice of words."""


@pytest.fixture(autouse=True)
def one_sine(monkeypatch: pytest.MonkeyPatch) -> None:
    both_ways.use_sines_of_ones_own(monkeypatch)


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_a_models_functions_give_the_same_recorded_as_with_floats(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use in uses(kind, name):
        deck = experiment(tmp_path, use.put(tmp_path).deck(), select=["it"])
        calls = both_ways.calls(use, deck)
        assert set(calls) == both_ways.functions(kind, use.model), "each function that the model declares is called"
        for function, call in calls.items():
            for seed in range(DRAWS):
                told = both_ways.differences(call, seed)
                assert not told, (function, use.command, use.analog, dict(use.words), seed, told)


def test_a_model_that_computes_otherwise_when_it_is_recorded_is_found(tmp_path: Path) -> None:
    """The comparison can fail: by a number, by a name, and by one unit in the last place."""
    use = smallest("servo", "passive")
    deck = experiment(tmp_path, use.deck(), select=["it"])

    def found(drive: Any) -> list[str]:
        model = replace(use.model, drive=drive)
        call = both_ways.servo_calls(model, use, deck)["drive"]
        return [told for seed in range(5) for told in both_ways.differences(call, seed)]

    def honest(p: Any, held: Any, states: Any, joint: Any) -> Drive:
        return Drive(torque=p.rest + 0.1 * joint.q)

    def rounding(p: Any, held: Any, states: Any, joint: Any) -> Drive:
        recorded = not isinstance(joint.q, float)
        return Drive(torque=p.rest + (0.1 * joint.q if recorded else joint.q / 10.0))

    def names(p: Any, held: Any, states: Any, joint: Any) -> Drive:
        return Drive(signals={} if isinstance(joint.q, float) else {"extra": joint.q})

    assert not found(honest)
    assert found(rounding) and found(names)

"""Keys of what a program computes: names do not count, numbers and the order of rounding do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ic
from met.plan import Experiment, Structure
from met.program.build import build
from met.run import prepare, run
from met.trace import Real
from met.trace.identity import result_keys, state_key
from met.trace.program import CallPhase, Every, Phase, Program, RecordPhase, RunPhase, Tape, Unless0, WhileAny
from met.trace.recorder import record
from tests.met.trace.renaming import renamed

DECKS = Path(ic.__file__).parent / "decks"


def swinging(
    *,
    cell: str = "x",
    step: float = 0.125,
    phase: str = "advance",
    more: Callable[[Tape], Real] | None = None,
    turns: int = 3,
    divisor: int = 2,
) -> Program:
    """A small program with a loop, a row and two outputs; `more` gives a third, of the tape's cells."""

    def start(tape: Tape) -> None:
        tape.write(cell, tape.input("first"))

    def body(tape: Tape) -> None:
        product = tape.read(cell) * tape.input("rate")
        tape.write(cell, tape.read(cell) + product * step)
        tape.write("product", product)
        tape.write_mask("on", tape.read(cell) < 1.0)

    def again(tape: Tape) -> None:
        tape.write(cell, tape.read(cell) * 0.5)
        tape.write("most", tape.read("most") + 1.0)
        tape.write("on", 0.0)

    def end(tape: Tape) -> None:
        tape.output("state", tape.read(cell))
        tape.output("most", tape.read("most"))
        if more is not None:
            tape.output("more", more(tape))

    return Program(
        base_hz=8.0,
        start=(RunPhase(Phase("start", start)),),
        tick=(
            Unless0(
                (
                    Every(divisor, (CallPhase(Phase(phase, body)),)),
                    WhileAny("on", turns, (RunPhase(Phase("again", again)),)),
                )
            ),
            RecordPhase(Phase("row", lambda tape: tape.record(0, tape.read(cell))), 2),
        ),
        end=(RunPhase(Phase("end", end)),),
        inputs=("first", "rate"),
        columns=1,
        outputs=("state", "most", "more") if more else ("state", "most"),
        state_outputs=("state",),
    )


def keys(program: Program) -> tuple[str, ...]:
    """The state's key, and those of the second output and of the row."""
    recording = record(program)
    return state_key(recording), *result_keys(recording, {"most": "most", "row": [0]}).values()


def test_names_do_not_count() -> None:
    here = swinging()
    assert keys(swinging(cell="elsewhere", phase="another")) == keys(here)
    assert keys(renamed(here, str.upper, str.upper)) == keys(here)


@pytest.mark.parametrize("change", [{"step": 0.25}, {"turns": 4}, {"divisor": 4}])
def test_what_decides_the_state_counts(change: dict[str, float]) -> None:
    assert keys(swinging(**change))[0] != keys(swinging())[0]  # type: ignore[arg-type]


def test_a_further_output_changes_no_other_key() -> None:
    assert keys(swinging(more=lambda tape: tape.read("product") * 3.0)) == keys(swinging())
    assert keys(swinging(more=lambda tape: tape.read("most") + tape.read("product"))) == keys(swinging())


def test_a_further_output_has_a_key_of_what_it_computes() -> None:
    def more(program: Program) -> str:
        return result_keys(record(program), {"more": "more"})["more"]

    triple = more(swinging(more=lambda tape: tape.read("product") * 3.0))
    assert triple == more(swinging(cell="y", more=lambda tape: tape.read("product") * 3.0))
    assert triple != more(swinging(more=lambda tape: tape.read("product") * 5.0))


def test_a_product_that_is_also_put_out_is_fused_into_the_state_all_the_same() -> None:
    def operations(program: Program) -> list[str]:
        recording = record(program)
        (section,) = (each for each in recording.sections if each.name == "advance")
        return [section.nodes[i][0] for i in section.order]

    assert operations(swinging()).count("fma") == 1
    assert operations(swinging(more=lambda tape: tape.read("product"))).count("fma") == 1


def bare(experiment: Experiment) -> Experiment:
    """The same run, of which nothing is recorded or measured."""
    structure: Structure = replace(experiment.structure, record=(), metrics=())
    return replace(experiment, structure=structure, requirements=())


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in DECKS.glob("*.ic")))
def test_what_is_recorded_and_measured_changes_no_decks_state(name: str) -> None:
    for experiment in ic.compile(DECKS / f"{name}.ic").experiments:
        assert state_key(record(build(experiment))) == state_key(record(build(bare(experiment))))


@pytest.mark.slow
def test_what_is_recorded_and_measured_changes_no_bit() -> None:
    (whole,) = ic.compile(DECKS / "two_link.ic").experiments
    only = [each for each in whole.structure.record if each.name == "q"]
    assert {each.name for each in whole.structure.record} > {"q", "tau"}
    less = replace(whole, structure=replace(whole.structure, record=tuple(only), metrics=()), requirements=())
    assert np.array_equal(run(whole).signals["q"], run(less).signals["q"])
    assert prepare(whole).recording != prepare(less).recording

"""Every back end: the same bits of the same recording, state that stays between steps, and what is asked of it."""

from __future__ import annotations

from pathlib import Path

import assembly
import numpy as np
import pytest

import ic
from met import backends
from met.backends.backend import Kernel
from met.run import inputs, prepare
from met.trace.program import Recording
from tests.ic.small_decks import experiment
from tests.met.backends.marked import NAMES
from tests.met.program.test_followers import GROUPS
from tests.met.program.test_loops import LINKED

DECK = Path(ic.__file__).parent / "decks" / "two_link.ic"


def two_link(run: str = "nominal") -> tuple[Recording, np.ndarray]:
    """The program of a run of the paper's arm, and the inputs of some of its cases."""
    (experiment,) = ic.compile(DECK, select=[run]).experiments
    rows = np.arange(min(3, experiment.cases.count))
    return prepare(experiment).recording, inputs(experiment, rows)


def bits(numbers: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(numbers).view(np.int64)


@pytest.mark.release
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("run", ["nominal", pytest.param("hybrid", marks=pytest.mark.slow)])
def test_all_have_the_bits_of_the_default(name: str, run: str) -> None:
    recording, given = two_link(run)
    rows, outputs = backends.load(recording).run(given, 60)
    other_rows, other_outputs = backends.load(recording, name=name).run(given, 60)
    assert rows is not None and other_rows is not None and rows.any()
    assert np.array_equal(bits(rows), bits(other_rows))
    assert np.array_equal(bits(outputs), bits(other_outputs))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("text", "sweep"),
    [
        pytest.param(GROUPS, "ratios", id="ratios"),
        pytest.param(LINKED, "places", marks=pytest.mark.release, id="loops"),
    ],
)
def test_joints_that_follow_others_have_the_bits_of_the_default(
    text: str, sweep: str, name: str, tmp_path: Path
) -> None:
    made = experiment(tmp_path, text, select=[sweep])
    recording, given = prepare(made).recording, inputs(made, np.arange(3))
    rows, outputs = backends.load(recording).run(given, 60)
    other_rows, other_outputs = backends.load(recording, name=name).run(given, 60)
    assert rows is not None and other_rows is not None and rows.std() > 0.0
    assert np.array_equal(bits(rows), bits(other_rows)) and np.array_equal(bits(outputs), bits(other_outputs))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_block_goes_on_where_it_stands(name: str) -> None:
    recording, given = two_link()
    kernel: Kernel = backends.load(recording, name=name)
    whole = kernel.block(given[:1])
    rows = whole.recorded(0, 40)
    parts = kernel.block(given[:1])
    pieces = [parts.recorded(0, 13), parts.recorded(14, 14), parts.recorded(15, 40)]
    assert np.array_equal(bits(rows[:1]), bits(np.concatenate([piece[:1] for piece in pieces], axis=1)))
    assert np.array_equal(whole.outputs[:, 0], parts.outputs[:, 0])
    assert list(whole.cells()) == list(recording.cells)
    parts.cells()["shoulder.qd"][:] += 0.5
    assert parts.recorded(41, 80)[0, -1].tolist() != whole.recorded(41, 80)[0, -1].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(backends.HOMES))
def test_each_writes_the_program_as_text(name: str) -> None:
    recording, _ = two_link()
    backend = backends.find(name)
    assert backend.name == name and backend.version >= 1
    assert len(backend.emit(recording).splitlines()) > 500


@pytest.mark.slow
def test_a_script_prints_the_instructions_of_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert assembly.main("two_link.ic", ["nominal"]) == 0
    assert capsys.readouterr().out.count("\n") > 500
    assert assembly.main("two_link.ic", ["nominl"]) == 2
    assert "did you mean `nominal`?" in capsys.readouterr().err


@pytest.mark.parametrize("name", NAMES)
def test_inputs_of_another_shape_are_refused(name: str) -> None:
    recording, given = two_link()
    with pytest.raises(ValueError, match="inputs of shape"):
        backends.load(recording, name=name).run(np.zeros((1, given.shape[1] + 1)), 1)

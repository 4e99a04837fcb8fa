"""Commands from CSV files: what is read, where it is looked for, and what a servo is asked for then."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import ic
from met import models
from met import run as engine
from met.plan import Experiment
from met.plan import file as plan_file
from met.unit_parser import parse_unit
from tests.ic.meaning.control.trajectories import MOVES, servo
from tests.ic.small_decks import ARM, RUN, changed, check, experiment, messages

DEGREES = parse_unit("deg")  # rounded once, which numpy's radians are not


def parameters(made: Experiment) -> dict[str, Any]:
    head = "hinge.servo.command."
    return {path.removeprefix(head): q.value for path, q in made.parameters.items() if path.startswith(head)}


def read(folder: Path, text: str | bytes, course: str = 'trajectory(file = "moves.csv")') -> Experiment:
    (folder / "moves.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    return experiment(folder, ARM, servo(course), RUN)


# what is read


def test_the_column_of_the_joints_name_is_taken_in_si(tmp_path: Path) -> None:
    found = parameters(read(tmp_path, MOVES))
    assert found["times"] == (0.0, 0.5, 1.0)
    assert found["values"] == tuple(map(DEGREES.to_si, (0.0, 30.0, 45.0)))
    assert (found["interpolation"], found["begin"]) == ("linear", 0.0)
    assert set(found) == {"times", "values", "interpolation", "begin"}  # the file's name is none of the plan's


def test_the_files_name_may_stand_alone(tmp_path: Path) -> None:
    short = read(tmp_path, MOVES, 'trajectory("moves.csv", column = other, interpolation = cubic)')
    long = read(tmp_path, MOVES, 'trajectory(interpolation = cubic, column = other, file = "moves.csv")')
    assert parameters(short) == parameters(long)


@pytest.mark.parametrize("written", ["other", '"other"'])
def test_another_column_is_taken_by_its_name(tmp_path: Path, written: str) -> None:
    found = parameters(
        read(tmp_path, MOVES, f'trajectory(file = "moves.csv", column = {written}, interpolation = cubic)')
    )
    assert found["values"] == (1.0, 2.0, -0.3) and found["interpolation"] == "cubic"


@pytest.mark.parametrize("text", [
    pytest.param("\ufeff" + MOVES, id="byte order mark"),
    pytest.param(MOVES.replace("\n", "\r\n"), id="CRLF"),
    pytest.param(MOVES.replace("\n", "\r"), id="CR"),
    pytest.param("# recorded\n\n" + MOVES.replace("0.5,", "# pause\n \n0.5,"), id="comments and empty lines"),
    pytest.param(MOVES.replace("hinge [deg]", '"hinge [deg]"').replace("30", '" 30 "'), id="quotes"),
    pytest.param(MOVES.replace(" ", "").replace("[", " [ ").replace("]", " ] "), id="spaces"),
    pytest.param(MOVES.rstrip("\n"), id="no newline at the end"),
    pytest.param(MOVES.replace("[s]", "[ms]").replace("0.5,", "500.0,").replace("1, ", "+1e3, "), id="milliseconds"),
    pytest.param(MOVES.replace("2\n", "out\n"), id="a text in another column"),
])  # fmt: skip
def test_a_file_is_read_however_it_was_saved(tmp_path: Path, text: str) -> None:
    found = parameters(read(tmp_path, text))
    assert found["times"] == (0.0, 0.5, 1.0) and found["values"] == tuple(map(DEGREES.to_si, (0.0, 30.0, 45.0)))


def test_a_file_is_looked_for_beside_the_deck_that_names_it_then_where_i_says(tmp_path: Path) -> None:
    beside, library = tmp_path / "parts", tmp_path / "library"
    beside.mkdir()
    library.mkdir()
    (beside / "drive.ic").write_text("#pragma once\n" + servo())
    (tmp_path / "deck.ic").write_text(ARM + '#include "parts/drive.ic"\n' + RUN)
    (library / "moves.csv").write_text(MOVES)
    only = parameters(ic.compile(tmp_path / "deck.ic", include_dirs=[library]).experiments[0])
    assert only["values"][-1] == DEGREES.to_si(45.0)
    (beside / "moves.csv").write_text(MOVES.replace("45", "60"))
    (tmp_path / "moves.csv").write_text(MOVES.replace("45", "90"))
    nearer = parameters(ic.compile(tmp_path / "deck.ic", include_dirs=[library]).experiments[0])
    assert nearer["values"][-1] == DEGREES.to_si(60.0)


def test_a_file_that_a_macro_of_the_command_line_names_is_beside_the_deck(tmp_path: Path) -> None:
    (tmp_path / "moves.csv").write_text(MOVES)
    compiled = check(tmp_path, ARM, servo("trajectory(file = FILE)"), RUN, defines=['FILE="moves.csv"'])
    assert compiled.plan is not None, messages(compiled)


def test_the_file_is_kept_whole_and_the_plan_runs_without_it(tmp_path: Path) -> None:
    (tmp_path / "moves.csv").write_text(MOVES)
    (tmp_path / "deck.ic").write_text(ARM + servo() + RUN)
    plan = ic.compile(tmp_path / "deck.ic")
    assert [Path(source.name).name for source in plan.sources] == ["deck.ic", "moves.csv"]
    assert plan.sources[1].text == MOVES and len(plan.sources[1].sha256) == 64
    plan_file.write(plan, tmp_path / "plan.json")
    (tmp_path / "moves.csv").unlink()
    again = plan_file.read(tmp_path / "plan.json")
    assert again == plan
    np.testing.assert_array_equal(
        engine.run(again.experiments[0]).signals["q"], engine.run(plan.experiments[0]).signals["q"]
    )


def test_the_values_come_from_the_column(tmp_path: Path) -> None:
    origin = read(tmp_path, MOVES).parameters["hinge.servo.command.values"].origin
    assert origin.place is not None
    assert (Path(origin.place.file).name, origin.place.line, origin.place.column) == ("moves.csv", 1, 11)
    assert origin.kind == "deck" and origin.note.startswith("column `hinge` of ") and origin.note.endswith("moves.csv")


def test_a_name_of_a_file_changes_no_key(tmp_path: Path) -> None:
    from met.plan.keys import case_ids

    first = read(tmp_path, MOVES)
    (tmp_path / "other.csv").write_text(MOVES)
    second = experiment(tmp_path, ARM, servo('trajectory(file = "other.csv")'), RUN)
    assert case_ids(first) == case_ids(second)


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_a_servo_is_asked_for_the_curve_of_each_case_at_every_tick(tmp_path: Path, interpolation: str) -> None:
    """11 cases: more than a vector has lanes, and a rest."""
    run = changed(RUN, ("record = 100 Hz", "record = 1 kHz"), ("record = [q]", "record = [servo.command]"))
    (tmp_path / "moves.csv").write_text(MOVES)
    course = f'trajectory(file = "moves.csv", interpolation = {interpolation})'
    sweep = "sweep shifted of hold { vary drive.command.begin = linspace(0, 1, 11) s; }\n"
    made = experiment(tmp_path, ARM, servo(course), run, sweep, select=["shifted"])
    found = engine.run(made).signals["servo.command"].reshape(11, 1001)
    profile = models.find_own("command")["trajectory"]
    for case, begin in enumerate(np.linspace(0.0, 1.0, 11)):
        p = SimpleNamespace(**{**parameters(made), "begin": float(begin)})
        wanted = [profile.course(p, k / 1000.0)[0] for k in range(1001)]
        np.testing.assert_allclose(found[case], wanted, rtol=0.0, atol=4e-16)  # a kernel fuses multiply-adds


def test_a_sweep_may_move_the_beginning_and_nothing_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "moves.csv").write_text(MOVES)
    sweep = (
        "sweep several of hold { vary hinge.servo.command.values = [1, 2] rad; vary drive.command.begin = [0, 1] s; }\n"
    )
    assert (
        messages(check(tmp_path, ARM, servo(), RUN, sweep, select=["several"]))
        == """\
error[D122]: `hinge.servo.command.values` cannot vary
  --> deck.ic:18:30
   |
18 | sweep several of hold { vary hinge.servo.command.values = [1, 2] rad; vary drive.command.begin = [0, 1] s; }
   |                              ^^^^^^^^^^^^^^^^^^^^^^^^^^
   = help: it is read from a file: it is one for the whole sweep

1 error
"""
    )

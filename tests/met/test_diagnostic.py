"""A Problem as a traceback ends in it."""

from pathlib import Path

import pytest

import ic
from met.diagnostic import Place, Problem, error


def test_without_sources_a_problem_is_its_messages_and_helps() -> None:
    problem = Problem([error("E301", "cannot read it", help="why not"), error("E310", "no such run")])
    assert str(problem) == "E301: cannot read it; E310: no such run\n  why not"


def test_with_sources_a_problem_shows_the_line() -> None:
    found = error("D060", "a mass in metres", Place("arm.ic", 2, 8, 3), help="write `kg`")
    problem = Problem(found, {"arm.ic": "link a {\n  mass 2 m;\n}\n"})
    assert str(problem) == (
        "error[D060]: a mass in metres\n"
        " --> arm.ic:2:8\n"
        "  |\n"
        "2 |   mass 2 m;\n"
        "  |        ^^^\n"
        "  = help: write `kg`\n"
        "\n"
        "1 error"
    )


def test_a_deck_that_python_compiles_ends_its_traceback_in_the_placed_message(tmp_path: Path) -> None:
    deck = tmp_path / "bad.ic"
    arm = "arm a {\n link l { mass = 36 mm; }\n joint j revolute { parent = base; child = l; axis = z; }\n}\n"
    run = "run r { arm = a; rates { dynamics = 1 kHz; } duration = 1 s; record = [q]; }\n"
    deck.write_text(arm + run)
    with pytest.raises(Problem) as caught:
        ic.compile(deck)
    assert "mass = 36 mm;" in str(caught.value)
    assert "^^^^^" in str(caught.value)

"""A wrench that changes in time: straight lines through rows of a deck or of a file, and what is told of both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.environments.wrench_table import ENVIRONMENT, loads
from tests.ic.small_decks import changed, check, codes, experiment, messages
from tests.met.environments.worlds import Given, Link, given, turned

SLIDER = """\
arm rail {
    link block { mass = 2 kg; shape = sphere(radius = 0.1 m); }
    joint slide prismatic { parent = base; child = block; axis = x; }
}
run it {
    arm = rail;
    environment { push = wrench_table { link = block; times = [0.2, 0.4, 0.7] s; force_x = [0, 6, -3] N; begin = 0.1 s; } }
    integrator = modified_euler;  rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 1 s;  record = [q, qd, qdd];
}
"""


@pytest.mark.parametrize("axes", ["world", "link"])
def test_its_components_are_lines_between_the_rows(axes: str) -> None:
    R = turned(4)
    rng = np.random.default_rng(1)
    times = (0.5, 1.0, 3.0)
    rows = rng.standard_normal((3, 6))
    names = [f"{kind}_{axis}" for kind in ("force", "moment") for axis in "xyz"]
    lists = {name: tuple(rows[:, k]) for k, name in enumerate(names)}
    p = given(ENVIRONMENT, link="one", point=(1.0, 2.0, 3.0), axes=axes, times=times, begin=0.25, **lists)
    for t in (0.0, 0.75, 1.0, 1.25, 2.1, 3.25, 9.0):
        (force,) = loads(p, Given({"one": Link(R)}, time=t)).forces
        expected = np.array([np.interp(t - 0.25, times, rows[:, k]) for k in range(6)])
        turn = R if axes == "link" else np.eye(3)
        np.testing.assert_allclose(force.force, turn @ expected[:3], atol=1e-14)
        np.testing.assert_allclose(force.moment, turn @ expected[3:], atol=1e-14)
        assert (force.link, force.point) == ("one", (1.0, 2.0, 3.0))


@pytest.mark.parametrize("integrator", ["modified_euler", "rk4"])
def test_a_slider_gains_the_integral_of_the_table(tmp_path: Path, integrator: str) -> None:
    """Rows that lie on steps: lines are integrated exactly by the trapezoidal rule."""
    found = engine.run(experiment(tmp_path, changed(SLIDER, ("modified_euler", integrator))))
    t = np.linspace(0.0, 1.0, 100001)
    force = np.interp(t - 0.1, [0.2, 0.4, 0.7], [0.0, 6.0, -3.0])
    rate = np.concatenate([[0.0], np.cumsum((force[1:] + force[:-1]) / 2.0)]) * 1e-5 / 2.0
    np.testing.assert_allclose(found.signals["qd"][0, :, 0], rate[::1000], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.signals["qdd"][0, :, 0], force[::1000] / 2.0, rtol=0, atol=1e-12)


def test_one_row_is_a_constant(tmp_path: Path) -> None:
    text = changed(SLIDER, ("[0.2, 0.4, 0.7] s", "[3] s"), ("[0, 6, -3] N", "[6] N"))
    assert (engine.run(experiment(tmp_path, text)).signals["qdd"] == 3.0).all()


FROM_FILE = changed(SLIDER, ("times = [0.2, 0.4, 0.7] s; force_x = [0, 6, -3] N;", 'file = "loads.csv";'))


def test_rows_of_a_file_are_the_lists_of_a_deck(tmp_path: Path) -> None:
    text = "time [ms], force_x [kN], moment_y [N*m]\n200, 0, 1\n400, 6e-3, 2\n700, -3e-3, 1\n"
    (tmp_path / "loads.csv").write_text(text, encoding="utf-8")
    deck = experiment(tmp_path, FROM_FILE)
    one = engine.run(deck).signals["q"]
    assert deck.parameters["environment.push.times"].value == (0.2, 0.4, 0.7)
    assert deck.parameters["environment.push.moment_y"].value == (1.0, 2.0, 1.0)
    assert deck.parameters["environment.push.force_z"].value == ()
    np.testing.assert_array_equal(engine.run(experiment(tmp_path, SLIDER)).signals["q"], one)


def test_a_column_of_another_dimension_is_not_proposed(tmp_path: Path) -> None:
    (tmp_path / "loads.csv").write_text("time [s], torque_z [N*m]\n0, 1\n", encoding="utf-8")
    (found,) = check(tmp_path, FROM_FILE).diagnostics
    assert found.code == "D243"
    assert not any("did you mean" in each for each in found.help)


def test_what_is_wrong_with_a_file_is_told_in_it(tmp_path: Path) -> None:
    (tmp_path / "loads.csv").write_text("time [s], force_X [N]\n0, 1\n", encoding="utf-8")
    assert (
        messages(check(tmp_path, FROM_FILE))
        == """\
error[D243]: environment `push` has no use for column `force_X`
 --> loads.csv:1:11
  |
1 | time [s], force_X [N]
  |           ^^^^^^^^^^^
 ::: deck.ic:7:62  read here
  = help: did you mean `force_x`?
  = help: its columns: time, force_x, force_y, force_z, moment_x, moment_y, moment_z
  = help: or take it out

1 error
"""
    )
    for text, code in (
        ("force_x [N]\n1\n", "D192"), ("time [s], force_x [m]\n0, 1\n", "D193"), ("time [s], force_x [N]\n", "D196"),
        ("time [s], force_x [N]\n1, 1\n0, 2\n", "D195"), ("time [s], force_x [N]\n0, x\n", "D194"),
    ):  # fmt: skip
        (tmp_path / "loads.csv").write_text(text, encoding="utf-8")
        assert codes(tmp_path, FROM_FILE) == [code]


def test_lists_and_a_file_are_too_much(tmp_path: Path) -> None:
    (tmp_path / "loads.csv").write_text("time [s], force_x [N]\n0, 1\n", encoding="utf-8")
    text = changed(SLIDER, ("times = [0.2, 0.4, 0.7] s; force_x = [0, 6, -3] N;", 'file = "loads.csv"; times = [1] s;'))
    assert (
        messages(check(tmp_path, text))
        == """\
error[D242]: `times` of environment `push` stands in the file
 --> deck.ic:7:75
  |
7 |     environment { push = wrench_table { link = block; file = "loads.csv"; times = [1] s; begin = 0.1 s; } }
  |                                                                           ^^^^^
 ::: deck.ic:7:55  which is named here
  = help: leave one of the two out

1 error
"""
    )


def test_lists_that_do_not_match_are_told(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, changed(SLIDER, ("[0, 6, -3] N", "[0, 6] N"))))
        == """\
error[D154]: `force_x` of environment `push` has 2 numbers, and `times` 3
 --> deck.ic:7:92
  |
7 |     environment { push = wrench_table { link = block; times = [0.2, 0.4, 0.7] s; force_x = [0, 6] N; begin = 0.1 s; } }
  |                                                                                            ^^^^^^^^
 ::: deck.ic:7:63  `times`
  = help: they go together, one to one

1 error
"""
    )
    assert codes(tmp_path, changed(SLIDER, ("[0.2, 0.4, 0.7] s", "[0.2, 0.7, 0.4] s"))) == ["D156"]
    assert codes(tmp_path, changed(SLIDER, ("force_x = [0, 6, -3] N; ", ""))) == ["D168"]
    assert codes(tmp_path, changed(SLIDER, ("times = [0.2, 0.4, 0.7] s; ", ""))) == ["D075"]
    assert codes(tmp_path, changed(SLIDER, ("begin = 0.1 s", "file = 3"))) == ["D242", "D242", "D076"]


PULSES = {
    "between steps": ([0.4021, 0.4022, 0.4061, 0.4062], [0.0, 9.0, 9.0, 0.0]),
    "over steps": ([0.4021, 0.4022, 0.4361, 0.4362], [0.0, 9.0, 9.0, 0.0]),
    "a jump that stays": ([0.4021, 0.4022], [0.0, 9.0]),
    "a jump down": ([0.4021, 0.4022], [9.0, -1.0]),
    "many rows in a step": ([0.401 + 0.0007 * k for k in range(40)], [float((7 * k) % 5) for k in range(39)] + [0.0]),
}


@pytest.mark.release
@pytest.mark.parametrize("integrator", ["modified_euler", "midpoint", "semi_implicit_euler", "rk4"])
@pytest.mark.parametrize("name", PULSES)
def test_the_impulse_of_rows_within_steps_is_kept(tmp_path: Path, name: str, integrator: str) -> None:
    times, values = PULSES[name]
    text = changed(
        SLIDER,
        ("[0.2, 0.4, 0.7] s", f"{times} s"),
        ("[0, 6, -3] N", f"{values} N"),
        ("begin = 0.1 s", "begin = 0 s"),
        ("modified_euler", integrator),
    )
    found = engine.run(experiment(tmp_path, text)).signals["qd"][0, -1, 0]
    impulse = values[0] * times[0] + np.trapezoid(values, times) + values[-1] * (1.0 - times[-1])
    assert found == pytest.approx(impulse / 2.0, rel=1e-12, abs=1e-14)


@pytest.mark.slow
def test_a_table_whose_begin_varies_keeps_the_impulse_and_is_as_it_was_where_rows_lie_on_steps(tmp_path: Path) -> None:
    text = changed(SLIDER, ("[0.2, 0.4, 0.7] s", "[0.2, 0.201, 0.203, 0.204] s"), ("[0, 6, -3]", "[0, 6, 6, 0]"))
    sweep = "sweep some of it { vary environment.push.begin = [0, 0.1, 0.1037] s; }\n"
    late = engine.run(experiment(tmp_path, text + sweep, select="some")).signals["qd"]
    np.testing.assert_allclose(late[:, -1, 0], 0.5 * 6.0 * 0.003, rtol=1e-12)
    sweep = "sweep some of it { vary environment.push.begin = [0, 0.1] s; }\n"
    varied = engine.run(experiment(tmp_path, SLIDER + sweep, select="some")).signals
    alone = engine.run(experiment(tmp_path, SLIDER)).signals
    for name in ("q", "qd", "qdd"):
        np.testing.assert_array_equal(varied[name][1], alone[name][0])

"""What names and options mean, and what is said where they mean nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.plotting import plot
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import Coordinate
from tests.batch import plans
from tests.batch.plotting.pictures import shown
from tests.batch.report import archives

pytestmark = pytest.mark.usefixtures("engine")


def refused(**options: Any) -> str:
    """What is said of it, without the count."""
    with pytest.raises(Problem) as caught:
        plot("a.h5", **options)
    return render(caught.value.diagnostics).rpartition("\n1 error")[0]


@pytest.fixture
def sweep(here: Path) -> Path:
    """A grid of 2 gains and 3 masses, with all histories."""
    one = archives.grid([0.02, 0.03], [20.0, 21.0, 22.0])
    return archives.made(here / "a.h5", one)


@pytest.mark.release
@pytest.mark.parametrize(
    ("options", "labels"),
    [
        ({"names": ["qd"]}, {"qd  (rad/s)"}),
        ({"names": ["volts"]}, {"volts  (V)"}),
        ({"names": ["volts", "settle"]}, {"volts  (V)", "settle  (s)"}),
        ({"over": ["links.lower.mass"]}, {"settle  (s)", "volts  (V)"}),
        ({"cases": ["#3"], "names": ["shoulder.qd"]}, {"shoulder.qd\n(rad/s)"}),
        ({}, {"q  (rad)", "qd  (rad/s)", "tau  (N·m)", "servo.voltage\n(V)"}),
    ],
)
def test_names_are_those_of_signals_or_of_metrics(
    sweep: Path, figures: list[Any], options: dict[str, Any], labels: set[str]
) -> None:
    plot(sweep, **options)
    assert {ax.get_ylabel() for ax in shown(figures[0])} - {""} == labels


@pytest.mark.release
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            {"names": ["qdd"]},
            "error[E324]: no signal or metric `qdd` in `gains`\n = help: did you mean `qd`?\n"
            " = help: signals here: q, qd, tau, shoulder.servo.voltage\n = help: metrics here: settle, volts\n",
        ),
        (
            {"names": ["qd", "settle"]},
            "error[E391]: `qd` is a signal and `settle` a metric: they have no axis in common\n"
            " = help: draw two pictures, each with a name of its own: `-o FILE.png`\n",
        ),
        (
            {"names": ["qd"], "over": ["gearbox.kp"]},
            "error[E391]: `qd` is a signal, which is drawn over time, and not over `gearbox.kp`\n"
            " = help: `--over` is of metrics: settle, volts\n",
        ),
        (
            {"names": ["volts"], "cases": ["#1"]},
            "error[E391]: `--case` is of signals, and `volts` is a metric\n"
            " = help: a case's metrics are numbers: `met show --case` tells them\n",
        ),
        (
            {"over": ["gearbox.kp"], "cases": ["#1"]},
            "error[E391]: `--case` is of signals, and `--over` of metrics\n"
            " = help: a case's metrics are numbers: `met show --case` tells them\n",
        ),
        (
            {"over": ["gearbox.kq"]},
            "error[E390]: no parameter `gearbox.kq` is varied in `gains`\n = help: did you mean `gearbox.kp`?\n"
            " = help: varied here: links.lower.mass, gearbox.kp\n",
        ),
        (
            {"over": ["shoulder.servo.ki"]},
            "error[E390]: `shoulder.servo.ki` is not varied in `gains`\n"
            " = help: varied here: links.lower.mass, gearbox.kp\n",
        ),
        (
            {"over": ["volts"]},
            "error[E390]: `volts` is a metric: it is drawn over what is varied\n = help: `met plot a.h5 volts`\n"
            " = help: varied here: links.lower.mass, gearbox.kp\n",
        ),
        (
            {"over": ["gearbox.kp", "gearbox.kp"]},
            "error[E390]: `gearbox.kp` twice in `--over`\n = help: varied here: links.lower.mass, gearbox.kp\n",
        ),
        (
            {"over": ["a", "b", "c", "d"]},
            "error[E390]: 4 parameters in `--over`: 3 at most\n"
            " = help: one gives points, two a map, a third maps beside one another\n",
        ),
    ],
)
def test_what_cannot_be_drawn_is_said(sweep: Path, options: dict[str, Any], said: str) -> None:
    assert refused(**options) == said


@pytest.mark.slow
def test_a_parameter_with_one_value_is_named_with_it(here: Path) -> None:
    archives.made(here / "a.h5", archives.grid([0.02, 0.03, 0.04], [20.0]))
    assert refused(over=["links.lower.mass"]) == (
        "error[E390]: `links.lower.mass` has one value in all cases of `gains`: 20000 g\n"
        " = help: varied here: gearbox.kp\n"
    )


@pytest.mark.slow
def test_a_third_parameter_has_few_values(here: Path) -> None:
    one = archives.grid([0.02, 0.03], np.linspace(20.0, 30.0, 7).tolist())
    kp, mass = one.cases.coordinates
    other = Coordinate("gearbox.ki", "V/rad", 1.0, np.arange(14.0) % 3, ("shoulder.servo.ki",), kp.place)
    archives.made(here / "a.h5", replace(one, cases=replace(one.cases, coordinates=(kp, other, mass))))
    assert refused(over=["gearbox.kp", "gearbox.ki", "links.lower.mass"]) == (
        "error[E390]: `links.lower.mass` has 7 values: a map for each of them is more than 6\n"
        " = help: as the third take what has few values\n"
        " = help: `--over gearbox.kp,gearbox.ki` shows in each cell the worst case or the middle one\n"
    )


def test_a_misspelt_metric_where_no_histories_are(here: Path) -> None:
    archives.made(here / "a.h5", archives.grid([0.02, 0.03], [20.0, 21.0]), histories="none")
    assert refused(names=["setle"]) == (
        "error[E323]: no histories of `gains` are in the archive\n = help: did you mean `settle`?\n"
        " = help: run it again with `--histories all`, or one case alone: `--case '#0'`\n"
        " = help: metrics here: settle, volts\n"
    )


def test_one_case_has_no_metrics_to_draw(here: Path) -> None:
    archives.made(here / "a.h5", plans.nominal(), histories="none")
    assert refused() == (
        "error[E327]: nothing to draw in `nominal`: the metrics of one case are single numbers\n"
        " = help: `met show a.h5` tells them\n"
    )
    assert refused(over=["gearbox.kp"]) == "error[E390]: `nominal` is one case: nothing is varied in it\n"


def test_nothing_to_draw_is_said(here: Path) -> None:
    experiment = plans.nominal()
    bare = replace(experiment, structure=replace(experiment.structure, metrics=(), record=()), requirements=())
    archives.made(here / "a.h5", bare)
    assert refused() == (
        "error[E327]: nothing to draw in `nominal`: it has neither histories nor metrics\n"
        " = help: `--histories all` keeps histories; a `metric` in the deck gives a number a case\n"
    )

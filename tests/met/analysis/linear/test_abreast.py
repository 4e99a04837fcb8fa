"""Periods of many cases, carried side by side, are those of each case by itself: to the bit, and in the same words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest

from met import models
from met import run as engine
from met.analysis.linear import jacobian
from met.analysis.linear.abreast import together
from met.analysis.linear.answers import Linearized, LinearQuestion, of_deck
from met.analysis.linear.flow import Flow
from met.analysis.linear.jacobian import PeriodMap, at_instants, period_map, period_maps
from met.analysis.linear.period import PeriodProgram
from met.diagnostic import Problem
from met.plan.linear_signals import input_signals
from met.trace.nodes import OPERANDS
from met.trace.tangents import TangentSection
from tests.ic.small_decks import ARM, RUN, SERVO, experiment
from tests.met.analysis.linear.oracles import scattered, shipped, shipped_experiment
from tests.met.analysis.linear.test_jacobian import swing
from tests.met.small_models import EVERY, smallest

MATRICES = ("A", "B", "C", "D", "Wx", "Wu")


def said(problem: Problem) -> list[tuple[str, str]]:
    return [(each.code, each.message) for each in problem.diagnostics]


def same(found: PeriodMap | Problem, program: PeriodProgram, flow: Flow) -> bool:
    """Asserts that this is what the flow by itself has; True where that is a map."""
    try:
        alone = period_map(program, flow)
    except Problem as refused:
        assert isinstance(found, Problem) and said(found) == said(refused)
        return False
    assert isinstance(found, PeriodMap)
    assert [(name, getattr(found, name).tobytes()) for name in MATRICES] == [
        (name, getattr(alone, name).tobytes()) for name in MATRICES
    ]
    for name in ("tick", "seconds", "states", "ticks", "outputs", "held", "at_limit", "locked"):
        assert getattr(found, name) == getattr(alone, name)
    return True


def bits(flow: Flow, names: Iterable[str]) -> list[tuple[str, bytes]]:
    """The bits of cells; one that is not there yet counts as 0, as the program takes it."""
    return [(name, np.float64(flow.cells.get(name, 0.0)).tobytes()) for name in sorted(names)]


def same_memory(a: Flow, b: Flow) -> bool:
    names = {*a.cells, *b.cells}
    return a.tick == b.tick and bits(a, names) == bits(b, names)


def agree(program: PeriodProgram, flows: Sequence[Flow]) -> int:
    """The number of maps of these flows, which are as those of each by itself, and so is a period without tangents."""
    for after, flow in zip(together(flows, Flow.period), flows, strict=True):
        alone = flow.copy()
        alone.period()
        assert same_memory(after, alone)
    found = period_maps(program, [flow.copy() for flow in flows])
    return sum(same(each, program, flow) for each, flow in zip(found, flows, strict=True))


@pytest.mark.release
@pytest.mark.parametrize("count", [3, pytest.param(20, marks=pytest.mark.slow, id="of 20 states")])
@pytest.mark.parametrize(("deck", "name"), shipped())
def test_of_shipped_decks_about_scattered_states(deck: str, name: str, count: int) -> None:
    made = shipped_experiment(deck, name)
    program, rng = PeriodProgram(made), np.random.default_rng(3)
    flows = [scattered(program, rng, time=0.4 * made.structure.schedule.duration, size=0.1) for _ in range(count)]
    assert agree(program, flows) > 0


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), [each for each in EVERY if each[0] != "metric"])
def test_of_every_model_at_rest_and_on_its_way(kind: models.Kind, name: str, tmp_path: Path) -> None:
    """Cases of a sweep as the run has them, and some of their rates made 0, on kinks and where friction holds."""
    made = experiment(tmp_path, smallest(kind, name).put(tmp_path).deck(), select=["cases"])
    program = PeriodProgram(made, input_signals(made.structure))
    given = engine.inputs(made, np.arange(min(made.cases.count, 3)))
    for tick in (program.begin(0.0), program.begin(0.06)):
        flows = [flow for flow in at_instants(program, given, tick) if flow is not None]
        still = [flow.copy() for flow in flows]
        for flow in still:
            flow.cells |= dict.fromkeys(program.rates, 0.0)
        agree(program, [*flows, *still])


def test_cases_of_which_one_sticks_one_slides_one_breaks_away_and_one_is_at_its_limit(tmp_path: Path) -> None:
    rubs = SERVO.replace("command", "f_c = 0.02 N*m; command")
    swept = "sweep asked of hold { vary drive.command.value = [0, 0.1, 0.15, 1000, 0.2] rad/s; }\n"
    made = experiment(tmp_path, ARM, rubs, RUN, swept, select=["asked"])
    program = PeriodProgram(made, input_signals(made.structure))
    given = engine.inputs(made, np.arange(5))
    for tick, maps in ((0, 1), (10, 5), (200, 5)):
        flows = at_instants(program, given, tick)
        assert agree(program, [flow for flow in flows if flow is not None]) == maps
    there = [flow for flow in at_instants(program, given, 10) if flow is not None]
    assert any(isinstance(each, PeriodMap) and each.at_limit for each in period_maps(program, there))


def moved(program: PeriodProgram, cell: str, values: Sequence[float]) -> list[Flow]:
    """The first case as it begins, a cell of it with each of these."""
    (flow,) = at_instants(program, engine.inputs(program.experiment, np.array([0])), 0)
    assert flow is not None
    flows = [flow.copy() for _ in values]
    for each, value in zip(flows, values, strict=True):
        each.cells[cell] = value
    return flows


def test_an_event_or_a_kink_of_one_is_none_of_the_others(tmp_path: Path) -> None:
    """Slow cases come to rest within the period; of three places one is just at a stop."""
    slides = PeriodProgram(swing(tmp_path, MORE="f_c = 0.3 N*m;"))
    slow = moved(slides, "hinge.qd", [0.5, 1e-5, 0.4, -1e-5, 0.3])
    assert agree(slides, slow) == 3
    told = [said(each)[0][1] for each in period_maps(slides, slow) if isinstance(each, Problem)]
    assert told == ["`hold` has no derivative here: `hinge` comes to rest, t = 0.001 s"] * 2
    stop = "e = joint_stop { joint = hinge;  lower = 0.2 rad;  stiffness = 1e4 N*m/rad; }"
    stops = PeriodProgram(swing(tmp_path, SERVO="servo drive { model = passive; }", ENVIRONMENT=stop))
    assert agree(stops, moved(stops, "hinge.q", [0.25, 0.2, 0.15, 0.3])) == 3


def test_cases_that_stand_on_kinks_that_are_none_are_carried_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stop's damping goes by the sign of a rate that is 0, within the stop: both sides are looked at at once."""
    stop = "e = joint_stop { joint = hinge;  lower = -1 rad;  stiffness = 1e4 N*m/rad; }"
    stops = PeriodProgram(swing(tmp_path, SERVO="servo drive { model = passive; }", ENVIRONMENT=stop))
    flows = moved(stops, "hinge.q", [0.1, 0.2, 0.3])
    assert agree(stops, flows) == 3
    monkeypatch.setattr(jacobian, "period_map", None)  # as a case by itself is looked at
    assert all(isinstance(each, PeriodMap) for each in period_maps(stops, flows))


@pytest.mark.slow
def test_an_instant_has_the_bits_of_the_case_by_itself() -> None:
    made = shipped_experiment("panda.ic", "reach")
    program = PeriodProgram(made)
    given = np.repeat(engine.inputs(made, np.array([0])), 3, axis=0) * np.array([[1.0], [1.01], [0.99]])
    for tick in (0, 30):
        for number, flow in enumerate(at_instants(program, given, tick)):
            (alone,) = at_instants(program, given[number : number + 1], tick)
            assert flow is not None and alone is not None and same_memory(flow, alone)


def test_answers_about_all_cases_are_those_about_each(tmp_path: Path) -> None:
    """Poles, plants, what creeps, loops; in the cases of a sweep that have an answer, and the words of the others."""
    rubs = SERVO.replace("command", "f_c = 0.02 N*m; command")
    swept = "sweep asked of hold { vary drive.command.value = [0, 0.1, 0.15, 1000, 0.2] rad/s; }\n"
    made = experiment(tmp_path, ARM, rubs, RUN, swept, select=["asked"])
    opened, outputs = ("hinge.servo.voltage",), ("hinge.q",)
    for at in (0.0, 0.1):
        question = LinearQuestion(made, at, ("hinge.servo.command",), outputs, opened)
        compared = [same_answer(question, case, found) for case, found in enumerate(question.of_cases(range(5)))]
        assert any(compared)


def test_where_arms_stand_still_is_where_each_does(tmp_path: Path) -> None:
    asked = "    linear up { at = equilibrium(q = [0.3 rad]); open = hinge.servo.voltage; }\n"
    swept = "sweep asked of hold { vary drive.kp = [0.1, 0.2, 0.4] V*s/rad; }\n"
    run = RUN.removesuffix("}\n") + asked + "}\n"
    question = of_deck(experiment(tmp_path, ARM, SERVO, run, swept, select=["asked"]))
    for case, found in enumerate(question.of_cases(range(3))):
        same_answer(question, case, found)


def same_answer(question: LinearQuestion, case: int, found: Linearized | Problem) -> bool:
    try:
        alone = question.of(case)
    except Problem as refused:
        assert isinstance(found, Problem) and said(found) == said(refused)
        return False
    assert isinstance(found, Linearized)
    for name in ("A", "B", "C", "D"):
        assert getattr(found, name).tobytes() == getattr(alone, name).tobytes()
    assert found.plant.A.tobytes() == alone.plant.A.tobytes() and found.plant.B.tobytes() == alone.plant.B.tobytes()
    assert found.poles == alone.poles and found.natural == alone.natural
    for name in ("states", "held", "creeping", "at_limit", "locked", "time", "case"):
        assert getattr(found, name) == getattr(alone, name)
    assert [loop.margins for loop in found.loops] == [loop.margins for loop in alone.loops]
    return True


def test_a_number_is_kept_as_long_as_something_asks_for_it_and_no_longer(tmp_path: Path) -> None:
    """Of columns with tangents, which are large."""
    sections = PeriodProgram(swing(tmp_path)).sections.values()
    for section in sections:
        asked = {ref >> 1 for ref in section.roots}
        place = {node: number for number, node in enumerate(section.order)}
        uses = {node: max(_uses(section, node), default=-1, key=place.__getitem__) for node in section.order}
        dropped = {node: at for at, nodes in section.last_uses.items() for node in nodes}
        assert dropped == {node: at for node, at in uses.items() if node not in asked and at >= 0}


def _uses(section: TangentSection, node: int) -> list[int]:
    nodes = section.nodes
    return [i for i in section.order if node in {ref >> 1 for ref in nodes[i][1 : 1 + OPERANDS[nodes[i][0]]]}]

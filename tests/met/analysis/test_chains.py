"""Chains of a large arm that do not act on each other are looked at one by one, and nothing else is said."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import pytest

from met.analysis import audit, chains, step_size
from met.analysis.audit import idle_inputs
from met.analysis.step_size import chosen_cases
from met.plan import Experiment
from tests.ic.small_decks import experiment

SERVO = """\
servo drive { model = rigid_gearbox;  ratio = 10;  kp = 1 V*s/rad;  ki = 0 V/rad;  v_max = 1e9 V;  resistance = 1 ohm;
    kt = 0.5 N*m/A;  tau_max = 1e9 N*m;  j_m = 1e-2 kg*m^2;  command = rate(0.1 rad/s); }
servo spring { model = passive;  stiffness = 2 N*m/rad; }
"""


def deck(run: str = "", *, chain: int = 2, count: int = 2, servo: str = "drive", sweep: str = "") -> str:
    """A deck of equal chains, each of so many joints, of which the first begins elsewhere."""
    body = ""
    for k in range(chain * count):
        parent = "base" if k % chain == 0 else f"l{k - 1}"
        body += f"link l{k} {{ mass = 1 kg;  shape = rod(length = 0.2 m, along = x); }}\n"
        body += f"joint j{k} revolute {{ parent = {parent};  child = l{k};  at = [0.2, 0, 0] m;  axis = z; }}\n"
    servos = " ".join(f"j{k} = {servo if k else 'drive'};" for k in range(chain * count))
    return f"""\
{SERVO}arm many {{ {body} }}
run hold {{ arm = many;  rates {{ dynamics = 1 kHz;  servos = 1 kHz; }}  duration = 1 s;  record = [q];
    servos {{ {servos} }}  initial {{ j1.q = 0.3 rad; }} {run} }}
sweep over of hold {{ {sweep or "vary drive.ratio = [10, 20];  vary links.l1.mass = [1 kg, 2 kg];"} }}
"""


def made(tmp_path: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> Experiment:
    monkeypatch.setattr(chains, "MANY_JOINTS", 4)
    return experiment(tmp_path, text, select="over")


def names(found: tuple[Experiment, ...]) -> list[list[str]]:
    return [[joint.name for joint in each.structure.joints] for each in found]


def test_chains_on_a_base_that_stands_are_experiments_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = made(tmp_path, deck("environment { gravity = [0, 0, -9.81] m/s^2; }"), monkeypatch)
    first, second = chains.chains(whole)
    assert names((first, second)) == [["j0", "j1"], ["j2", "j3"]]
    own = {
        path for path in whole.parameters if path.startswith(("j0.", "j1.", "links.l0.", "links.l1.", "initial.j1."))
    }
    assert own <= set(first.parameters) and own.isdisjoint(second.parameters)
    assert "environment.gravity.g.z" in first.parameters.keys() & second.parameters.keys()


@pytest.mark.slow
@pytest.mark.parametrize(
    "run",
    [
        "environment { easy = joint_damping(damping = 1 N*m*s/rad); }",
        "environment { push = wrench(link = l1, force = [0, 0, 1] N); }",
        "payload box { on = l1;  mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }",
    ],
)
def test_what_may_couple_chains_makes_them_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: str) -> None:
    assert chains.chains(made(tmp_path, deck(run), monkeypatch)) == ()


@pytest.mark.slow
def test_a_small_arm_and_one_chain_are_looked_at_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert chains.chains(made(tmp_path, deck(chain=4, count=1), monkeypatch)) == ()
    monkeypatch.setattr(chains, "MANY_JOINTS", 5)
    assert chains.chains(experiment(tmp_path, deck(), select="over")) == ()


def test_equal_chains_that_are_numbered_are_equal_experiments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    of_four = chains.chains(made(tmp_path, deck(count=4), monkeypatch))
    first, second, third, _ = (chains.numbered(each)[0] for each in of_four)
    values = [{path: quantity.value for path, quantity in each.parameters.items()} for each in (first, second, third)]
    assert values[1] == values[2] != values[0]
    assert chains.numbered(of_four[2])[1] == {"0": "j4", "1": "j5"}


@pytest.mark.slow
@pytest.mark.parametrize("servo", ["drive", "spring"])
@pytest.mark.parametrize("count", [2, 3])
def test_chain_by_chain_the_same_is_found_as_of_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, servo: str, count: int
) -> None:
    whole = made(tmp_path, deck(count=count, servo=servo), monkeypatch)
    rows = chosen_cases(whole)
    found = step_size.step_size(whole, rows)
    monkeypatch.setattr(step_size, "chains", lambda _: ())
    expected = step_size.step_size(whole, rows)
    assert (found.owner, found.joint, found.cases) == (expected.owner, expected.joint, expected.cases)
    assert found.fastest == pytest.approx(expected.fastest, rel=1e-6)  # slopes are differences
    assert found.mode is not None and expected.mode is not None
    assert found.mode.root == pytest.approx(expected.mode.root, rel=1e-6)
    assert (found.faults, found.loops, expected.faults, expected.loops) == ((), (), (), ())


def test_a_chain_of_which_something_is_to_be_said_has_the_whole_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stiff = deck(servo="spring").replace("stiffness = 2 N", "stiffness = 2e6 N")
    whole = made(tmp_path, stiff, monkeypatch)
    found = step_size.step_size(whole, chosen_cases(whole))
    assert found.faults
    assert set(found.map.names) >= {"j0.q", "j3.q"}


def test_of_runs_that_differ_in_duration_alone_a_chain_is_looked_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, looks, memo = made(tmp_path, deck(), monkeypatch), [], step_size.AnalysisMemo()
    real = step_size.Linearizer

    def counted(*given: object, **named: object) -> object:
        looks.append(given)
        return real(*given, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(step_size, "Linearizer", counted)
    schedule = whole.structure.schedule
    for ticks in (schedule.ticks, 2 * schedule.ticks):
        longer = replace(whole, structure=replace(whole.structure, schedule=replace(schedule, ticks=ticks)))
        step_size.step_size(longer, chosen_cases(longer), memo)
    assert len(looks) == 2


def test_of_an_arm_in_which_a_number_has_changed_only_its_chain_is_looked_at_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, looks, memo = made(tmp_path, deck(count=3), monkeypatch), list[tuple[str, ...]](), step_size.AnalysisMemo()
    real, recording = step_size.Linearizer, audit.build

    def counted(each: Experiment, *given: object, **named: object) -> object:
        looks.append(tuple(joint.name for joint in each.structure.joints))
        return real(each, *given, **named)  # type: ignore[arg-type]

    def recorded(each: Experiment) -> object:
        looks.append(("recorded",))
        return recording(each)

    def asked(memo: step_size.AnalysisMemo) -> tuple[step_size.StepSize, tuple[str, ...]]:
        rows = chosen_cases(before)
        steps = memo.answer("steps", before, lambda: step_size.step_size(before, rows, memo), rows)
        return steps, memo.answer("idle inputs", before, lambda: idle_inputs(before, memo))

    first = asked(memo)
    monkeypatch.setattr(step_size, "Linearizer", counted)
    monkeypatch.setattr(audit, "build", recorded)
    brought = memo
    for _ in range(2):  # of what is known as a whole the parts are kept too
        brought = step_size.AnalysisMemo(pickle.loads(pickle.dumps(brought.answers)))
        again = asked(brought)
    assert (again[0].owner, again[0].fastest, again[1]) == (first[0].owner, first[0].fastest, first[1])
    assert looks == []
    quantity = before.parameters["links.l5.mass"]
    heavier = {**before.parameters, "links.l5.mass": replace(quantity, value=1.5)}
    after = replace(before, parameters=heavier)
    found = step_size.step_size(after, chosen_cases(after), brought)
    assert idle_inputs(after, brought) == ()
    assert looks == [("0", "1")]
    expected = step_size.step_size(after, chosen_cases(after))
    assert (found.owner, found.fastest) == (expected.owner, expected.fastest)


def test_no_more_than_a_chain_is_recorded_where_each_input_has_an_effect_on_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, recorded = made(tmp_path, deck(), monkeypatch), list[int]()
    real = audit.build

    def counted(each: Experiment) -> object:
        recorded.append(len(each.structure.joints))
        return real(each)

    monkeypatch.setattr(audit, "build", counted)
    assert idle_inputs(whole) == ()
    assert recorded == [2]


@pytest.mark.slow
def test_an_input_that_has_an_effect_on_no_chain_is_looked_for_in_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    varied = "vary metrics.far.target = [1 rad, 2 rad];  vary links.l1.mass = [1 kg, 2 kg];"
    whole = made(tmp_path, deck("metric far = overshoot { of = j0.q;  target = 1 rad; }", sweep=varied), monkeypatch)
    assert "metrics.far.target" in audit._idle_inputs(chains.chains(whole)[0])
    assert idle_inputs(whole) == ()
    idle = replace(whole, structure=replace(whole.structure, metrics=()))
    assert idle_inputs(idle) == ("metrics.far.target",)

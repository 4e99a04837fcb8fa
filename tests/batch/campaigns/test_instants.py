"""The step against the arm at instants that cases pass: what only a run can show, told once, by counts alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import ic
from batch.campaigns import instants
from batch.campaigns.campaign import prepare, values_sections
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.performing import Performed, perform
from batch.executors.threads import Threads
from met import run as engine
from met.passing import Memories, even_ticks, run_past
from met.plan import Plan
from tests.batch import plans
from tests.ic.small_decks import changed

SLIP = """\
arm a {
    link block { mass = 0.1 kg;  shape = sphere(radius = 1 cm); }
    joint x prismatic { parent = base;  child = block;  axis = x; }
}
servo rough {
    model = rigid_gearbox;  ratio = 1 rad/m;  kp = 0 V*s/rad;  ki = 0 V/rad;  v_max = 1 V;  resistance = 1 ohm;
    kt = 1e-9 N*m/A;  tau_max = 1 N*m;  j_m = 0.9 kg*m^2;  friction = lugre;  sigma_0 = 1e5 N*m/rad;
    sigma_1 = 316 N*m*s/rad;  f_v = 0.4 N*m*s/rad;  f_c = 1 N*m;  f_s = 1.5 N*m;  rate_s = 0.001 rad/s;
    command = torque(0 N);
}
run slide {
    arm         = a;
    servos      { x = rough; }
    initial     { x.q = -0.8 m; }
    environment { pull = spring { link = block;  to = world;  stiffness = 2 N/m; } }
    integrator  = rk4;
    rates       { dynamics = 12 kHz;  servos = 12 kHz;  record = 100 Hz; }
    duration    = 2 s;
    record      = [q, qd];
    metric fastest = max { of = x.qd; }
}
"""


def made(tmp_path: Path, deck: str, name: str | None = None) -> Plan:
    (tmp_path / "deck.ic").write_text(deck)
    return ic.compile(tmp_path / "deck.ic", select=None if name is None else [name])


def performed(plan: Plan, output: Path, threads: int = 1) -> Performed:
    return perform(prepare(plan, output=output), executor=Threads(threads))


def codes(found: Performed) -> list[str]:
    return [each.code for each in found.warned]


@pytest.mark.slow
def test_bristles_that_are_stiff_only_while_they_slide_are_told(tmp_path: Path) -> None:
    found = performed(made(tmp_path, SLIP), tmp_path / "a.h5")
    assert codes(found) == ["D317"]
    (said,) = found.warned
    assert said.message.startswith("joint `x` decays with ") and "this step of rk4 makes that grow" in said.message
    assert said.help[0] == "the slowest rate at which it does not: 24000 Hz"
    assert said.help[-1].startswith("reckoned at t = 0.") and "and so it is until " in said.help[-1]
    assert said.at is not None and said.at.place.file.endswith("deck.ic") and said.at.place.line == 11
    fine = changed(SLIP, ("dynamics = 12 kHz;  servos = 12 kHz", "dynamics = 120 kHz;  servos = 12 kHz"))
    assert codes(performed(made(tmp_path, fine), tmp_path / "b.h5")) == []


@pytest.mark.slow
def test_a_run_that_allows_it_is_not_told(tmp_path: Path) -> None:
    deck = changed(SLIP, ("duration", 'allow D317 because "it only rattles";\n    duration'))
    plan = made(tmp_path, deck)
    assert codes(performed(plan, tmp_path / "a.h5")) == []


def test_what_the_check_tells_is_not_told_again(tmp_path: Path) -> None:
    deck = """\
arm swing {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo sprung { model = passive;  stiffness = 2500 N*m/rad; }
run hold {
    arm = swing;  servos { hinge = sprung; }  initial { hinge.q = 1 deg; }  duration = 5 s;  record = [q];
    rates { dynamics = 100 Hz;  servos = 100 Hz; }
}
"""
    compiled = ic.check(tmp_path / "deck.ic") if (tmp_path / "deck.ic").write_text(deck) else None
    assert compiled is not None and [each.code for each in compiled.diagnostics] == ["D317"]
    assert codes(performed(made(tmp_path, deck), tmp_path / "a.h5")) == []


def one_of_many(bad: bool) -> str:
    """200 masses on springs, of which one swings too fast for the step: neither its mass nor its spring is extreme."""
    pick = np.random.default_rng(3)
    masses, rates = pick.uniform(1.0, 100.0, 200), pick.uniform(1.0, 20.0, 200)
    masses[50], rates[50] = 400.0, 20.0
    masses[120], rates[120] = 0.5, 1.0
    masses[77], rates[77] = 2.5, 95.0 if bad else 9.5
    stiffness = masses * rates**2
    return f"""\
arm a {{
    link b {{ mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }}
    joint x prismatic {{ parent = base;  child = b;  axis = x; }}
}}
run swing {{
    arm = a;  initial {{ x.q = 0.1 m; }}  rates {{ dynamics = 100 Hz; }}  duration = 1 s;  record = [q];
    environment {{
        pull = spring {{ link = b;  to = world;  to_point = [-10, 0, 0] m;  length = 10 m;  stiffness = 10 N/m; }}
    }}
    metric way = final {{ of = x.q; }}
}}
sweep all of swing {{
    zip {{ environment.pull.stiffness = {stiffness.tolist()} N/m;  a.links.b.mass = {masses.tolist()} kg; }}
}}
"""


@pytest.mark.slow
def test_one_row_of_many_that_goes_another_way_is_looked_at(tmp_path: Path) -> None:
    deck = one_of_many(bad=True)
    (tmp_path / "deck.ic").write_text(deck)
    assert [each.code for each in ic.check(tmp_path / "deck.ic", select=["all"]).diagnostics] == []
    found = performed(made(tmp_path, deck, "all"), tmp_path / "a.h5")
    assert codes(found) == ["D317"] and "of case #77" in found.warned[0].help[-1]
    assert codes(performed(made(tmp_path, one_of_many(bad=False), "all"), tmp_path / "b.h5")) == []


@pytest.mark.parametrize(
    ("values", "out"),
    [
        ([*range(50), 5000.0], [50]),
        ([*range(50), 200.0], []),
        ([0.0] * 30 + [1.0], [30]),
        ([1.0] * 30 + [1.0 + 1e-9], []),
        ([*range(10), 5000.0], []),
        ([*range(50), 5000.0, np.nan, np.inf], [50]),
    ],
)
def test_a_case_stands_out_where_all_others_are_alike(values: list[float], out: list[int]) -> None:
    outcomes = CaseOutcomes(plans.nominal())
    outcomes.add(np.zeros(len(values), np.int8), {"way": np.array(values, float)})
    assert instants.standing_out(outcomes) == out


def test_memory_on_the_way_changes_no_bit(tmp_path: Path) -> None:
    """Of some cases and of all, in blocks and beside them: as a run without it."""
    deck = SLIP + "sweep several of slide { vary initial.x.q = linspace(-1, 0, 7) m; }\n"
    (experiment,) = made(tmp_path, deck, "several").experiments
    prepared, rows = engine.prepare(experiment, lanes=4), np.arange(7)
    history, outputs = engine.compute(prepared, rows, threads=2)
    for cases in ({1, 5}, set(range(7))):
        memories = Memories(even_ticks(experiment.structure.schedule, 4), frozenset(cases))
        found = engine.compute(prepared, rows, threads=2, memories=memories)
        np.testing.assert_array_equal(found[0], history)
        np.testing.assert_array_equal(found[1], outputs)
        assert set(memories.by_case) == cases
    _, _, memory = run_past(
        prepared.kernel, engine.inputs(experiment, rows), 24000, (0, 1200, 24000), record=False, threads=1
    )
    assert history is not None
    q = prepared.recording.cells.index("x.q")
    np.testing.assert_array_equal(memory[:, :, q], history[:, [0, 10, 200], 0])


@pytest.mark.slow
@pytest.mark.parametrize("count", [7, 40])
def test_who_ran_the_cases_does_not_matter(count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The memory of the run itself, and cases run again: the same words, of cases in the whole table."""
    deck = SLIP + f"sweep several of slide {{ vary initial.x.q = linspace(-1, 0, {count}) m; }}\n"
    plan = made(tmp_path, deck, "several")
    found = performed(plan, tmp_path / "a.h5")
    assert codes(found) == ["D317"] and " of case #" in found.warned[0].help[-1]
    monkeypatch.setattr(
        "batch.campaigns.tasks.engine",
        SimpleNamespace(
            compute=lambda *given, memories=None, **more: engine.compute(*given, **more), inputs=engine.inputs
        ),
    )
    again = performed(plan, tmp_path / "b.h5", threads=2)
    assert again.warned == found.warned
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_of_a_large_campaign_cases_are_run_again(tmp_path: Path) -> None:
    deck = SLIP + "sweep several of slide { vary initial.x.q = linspace(-1, 0, 1200) m; }\n"
    plan = made(tmp_path, deck, "several")
    campaign = prepare(plan, output=tmp_path / "a.h5")
    (section,) = instants.with_memories(values_sections(campaign))
    assert section.memories is not None and not section.memories.cases
    short = replace(section, rows=section.rows[:1000])
    (section,) = instants.with_memories([short])
    assert section.memories is not None and 0 in section.memories.cases and len(section.memories.cases) <= 8


FOLDS = """\
arm folds {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [0.01, 0.01, 0.01] kg*m^2; }
    joint swing revolute { parent = base;  child = bar;  axis = z; }
    link out { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [0.001, 0.001, 0.001] kg*m^2; }
    joint reach prismatic { parent = bar;  child = out;  axis = x; }
}
servo turn {
    model = rigid_gearbox;  ratio = 50;  kp = 0.3 V*s/rad;  ki = 0.1 V/rad;  v_max = 30 V;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  tau_max = 3 N*m;  j_m = 1e-5 kg*m^2;  command = rate(0.01 rad/s);
}
servo slide { model = ideal;  bandwidth = 20 1/s;  command = position(table(times = [0, 2] s, values = [1, 0] m)); }
run folding {
    arm = folds;  servos { swing = turn;  reach = slide; }  initial { reach.q = 1 m; }
    rates { dynamics = 1 kHz;  servos = 100 Hz;  record = 100 Hz; }  duration = 4 s;  record = [q];
}
"""


@pytest.mark.slow
def test_a_loop_is_told_that_only_a_folded_arm_makes_unstable(tmp_path: Path) -> None:
    """The pose in which the run begins is quiet, and the check silent; the one in which it ends is not."""
    (tmp_path / "deck.ic").write_text(FOLDS)
    assert [each.code for each in ic.check(tmp_path / "deck.ic").diagnostics] == []
    found = performed(made(tmp_path, FOLDS), tmp_path / "a.h5")
    assert codes(found) == ["D320"] and "on joint `swing`" in found.warned[0].message
    assert " s, and so it is until 3.883 s, within all limits" in found.warned[0].help[-1]
    folded = changed(FOLDS, ("reach.q = 1 m", "reach.q = 0 m"), ("values = [1, 0] m", "values = [0, 0] m"))
    (tmp_path / "deck.ic").write_text(folded)
    assert [each.code for each in ic.check(tmp_path / "deck.ic").diagnostics] == ["D320"]
    assert codes(performed(made(tmp_path, folded), tmp_path / "b.h5")) == []


CARRIES = """\
arm swing {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [0.01, 0.01, 0.01] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo turn {
    model = rigid_gearbox;  ratio = 50;  kp = 0.3 V*s/rad;  ki = 0.1 V/rad;  v_max = 30 V;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  tau_max = 3 N*m;  j_m = 1e-5 kg*m^2;  command = rate(0.01 rad/s);
}
servo place like turn { kp = 0.03 V*s/rad;  ki = 3 V/rad;  k_position = 2 1/s;  RATE  command = position(0.1 rad); }
run carrying {
    arm = swing;  servos { hinge = SERVO; }
    payload box { on = bar;  mass = 20 kg;  shape = box(size = [0.1, 0.1, 0.1] m);  at = [1, 0, 0] m;  EVENT }
    rates { dynamics = 1 kHz;  servos = 100 Hz;  record = 100 Hz; }  duration = 10 s;  record = [qd];
}
"""
LATER = "position = [1, 0, 0] m;  grapple = 1 s;"


@pytest.mark.release
@pytest.mark.parametrize(
    ("servo", "rate", "event", "code"),
    [
        ("turn", "", "release = 1 s;", "D320"),
        ("place", "", LATER, "D322"),
        ("place", "rate = continuous;", LATER, "D322"),
    ],
)
def test_a_loop_is_told_that_a_payload_makes_unstable_when_it_comes_or_goes(
    servo: str, rate: str, event: str, code: str, tmp_path: Path
) -> None:
    """Ticks are too slow for the bar alone, and a loop of position swings up what is heavy."""
    deck = changed(CARRIES, ("SERVO", servo), ("RATE", rate), ("EVENT", event))
    (tmp_path / "deck.ic").write_text(deck)
    assert [each.code for each in ic.check(tmp_path / "deck.ic").diagnostics] == []
    found = performed(made(tmp_path, deck), tmp_path / "a.h5")
    assert codes(found) == [code] and "on joint `hinge`" in found.warned[0].message
    assert "as it stands at t = 1.25 s, and so it is until 9.695 s, within all limits" in found.warned[0].help[-1]
    stays = changed(CARRIES, ("SERVO", servo), ("RATE", rate), ("EVENT", ""))
    if code == "D322":
        stays = changed(stays, ("mass = 20 kg", "mass = 0.01 kg"))
    assert codes(performed(made(tmp_path, stays), tmp_path / "b.h5")) == []


@pytest.mark.slow
def test_a_bed_is_told_that_only_an_arm_which_reaches_out_makes_unstable(tmp_path: Path) -> None:
    deck = FOLDS[: FOLDS.index("servo turn")].replace("0.01, 0.01, 0.01", "700, 700, 700")
    deck = "#include <servos/rigid_gearbox.ic>\n" + deck.replace("link out { mass = 1 kg", "link out { mass = 40 kg")
    deck += """\
servo turn like rigid_gearbox { command = rate(0.03 rad/s); }
servo slide { model = ideal;  bandwidth = 20 1/s;  command = position(table(times = [0, 2] s, values = [0, 8] m)); }
run bench {
    arm = folds;  servos { swing = turn;  reach = slide; }
    substitute swing { bed = emulated;  law = measured_acceleration; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }  duration = 2 s;  record = [q];
}
"""
    (tmp_path / "deck.ic").write_text(deck)
    assert [each.code for each in ic.check(tmp_path / "deck.ic").diagnostics] == []
    found = performed(made(tmp_path, deck), tmp_path / "a.h5")
    assert codes(found) == ["D321"] and "r = 19.7, and it is stable up to 5.35" in found.warned[0].message
    assert found.warned[0].help[-1] == "reckoned with the arm as it stands at t = 1.937 s"

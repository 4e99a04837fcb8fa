"""`allow CODE because "REASON";`: what it silences and what not, where it is kept, and whole messages of wrong ones."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from met import cli
from met.diagnostic import Problem
from met.plan import Allowance, Experiment
from met.plan import file as plan_file
from met.plan.keys import case_ids, structure_key
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages

SLOW = changed(
    RUN, ("dynamics = 1 kHz; servos = 1 kHz", "dynamics = 100 Hz; servos = 100 Hz"), ("100 Hz; }", "50 Hz; }")
)
SLOW = changed(SLOW, ("record = 50 Hz", "record = 100 Hz"))
GEAR = changed(SERVO, ("j_m = 1e-4", "j_m = 3e-5"), ("kp = 0.1", "kp = 0.01"))
LIGHT = changed(ARM, ("mass = 2 kg", "mass = 2 g"))
ALLOWED = changed(SLOW, ("record = [q];", 'record = [q];\n    allow D105 because "the rates are the paper\'s";'))


def test_a_warning_that_is_allowed_is_not_given_and_the_reason_is_kept(tmp_path: Path) -> None:
    assert codes(tmp_path, LIGHT, GEAR, SLOW) == ["D105"]
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED) == []
    (allowance,) = experiment(tmp_path, LIGHT, GEAR, ALLOWED).allowances
    assert (allowance.code, allowance.because) == ("D105", "the rates are the paper's")
    assert allowance.place is not None and (allowance.place.line, allowance.place.column) == (17, 11)


def test_another_run_of_the_deck_is_warned_all_the_same(tmp_path: Path) -> None:
    other = SLOW.replace("run hold", "run other")
    for first, second in ((ALLOWED, other), (other, ALLOWED)):
        assert codes(tmp_path, LIGHT, GEAR, first, second, select="all") == ["D105"]
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED, other, select=["hold"]) == []


def test_runs_upon_one_that_allows_and_sweeps_of_it_allow_the_same(tmp_path: Path) -> None:
    like = "run other like hold { duration = 2 s; }\n"
    sweep = "sweep gains of hold { vary drive.kp = [0.01, 0.02] V*s/rad; }\n"
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED, like, sweep, select="all") == []


def test_a_sweep_allows_warnings_of_its_own(tmp_path: Path) -> None:
    sweep = "sweep gains of hold {\n    vary drive.kp = [0.01, 0.02] V*s/rad;\n    exclude when drive.kp > 9 V*s/rad;\nALLOW}\n"
    allow = '    allow D138 because "the limit is another man\'s";\n'
    assert codes(tmp_path, ARM, SERVO, RUN, sweep.replace("ALLOW", ""), select="all") == ["D138"]
    assert codes(tmp_path, ARM, SERVO, RUN, sweep.replace("ALLOW", allow), select="all") == []
    (made,) = check(tmp_path, ARM, SERVO, RUN, sweep.replace("ALLOW", allow), select="gains").plan.experiments  # type: ignore[union-attr]
    assert made.allows("D138") and not made.allows("D105")


def test_one_structure_of_a_sweep_that_needs_it_is_enough(tmp_path: Path) -> None:
    """At 1 kHz the step is short, at 100 Hz it is not."""
    sweep = "sweep rates of hold { vary rates.dynamics = [100, 1000] Hz; }\n"
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED, sweep, select=["rates"]) == []


def test_what_is_of_no_run_is_silenced_where_all_runs_allow_it(tmp_path: Path) -> None:
    macro = "#define fast 3 Hz\n"
    assert codes(tmp_path, macro, ARM, SERVO, RUN) == ["D017"]
    allowing = changed(RUN, ("record = [q];", 'record = [q]; allow D017 because "it is short";'))
    assert codes(tmp_path, macro, ARM, SERVO, allowing) == []
    other = RUN.replace("run hold", "run other")
    assert codes(tmp_path, macro, ARM, SERVO, allowing, other, select="all") == ["D017", "D333"]


def test_a_reason_of_ones_own_takes_the_place_of_that_of_the_base(tmp_path: Path) -> None:
    like = 'run other like hold { allow D105 because "ours"; }\nrun last like other { duration = 2 s; }\n'
    sweep = 'sweep gains of last { vary drive.kp = [0.01, 0.02] V*s/rad; allow D105 because "the sweep\'s"; }\n'
    made = check(tmp_path, LIGHT, GEAR, ALLOWED, like, sweep, select="all")
    assert made.plan is not None and not made.diagnostics
    assert [[each.because for each in one.allowances] for one in made.plan.experiments] == [
        ["the rates are the paper's"],
        ["ours"],
        ["ours"],
        ["the sweep's"],
    ]


def test_a_reason_is_one_line(tmp_path: Path) -> None:
    made = experiment(tmp_path, LIGHT, GEAR, ALLOWED.replace("the rates are", "the rates\\n\\tare"))
    assert made.allowances[0].because == "the rates are the paper's"


FAST = "run fast like hold { rates { dynamics = 1 kHz; servos = 1 kHz; } }\n"


def test_one_that_a_run_has_from_its_base_need_not_be_of_use_to_it(tmp_path: Path) -> None:
    """It is of use to the base; and where that is not looked at, it may be."""
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED, FAST, select="all") == []
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED, FAST, select=["fast"]) == []


def test_one_that_only_a_run_like_this_one_needs_is_of_use(tmp_path: Path) -> None:
    """It is said of the base alone that it is of no use where nothing else has it."""
    stale = changed(FAST, ("{ rates", '{ allow D105 because "ours"; rates'))
    slow = "run slow like fast { rates { dynamics = 100 Hz; servos = 100 Hz; } }\n"
    assert codes(tmp_path, LIGHT, GEAR, SLOW, stale, select=["fast"]) == ["D333"]
    assert codes(tmp_path, LIGHT, GEAR, SLOW, stale, slow, select=["fast"]) == []
    assert codes(tmp_path, LIGHT, GEAR, SLOW, stale, slow, select=["fast", "slow"]) == []
    assert codes(tmp_path, LIGHT, GEAR, SLOW, stale, slow, select="all") == ["D105"]  # of `hold`, which allows none


def test_one_of_a_run_need_not_be_of_use_to_a_sweep_of_it(tmp_path: Path) -> None:
    sweep = "sweep rates of hold { vary rates.dynamics = [500, 1000] Hz; }\n"
    both = "sweep both = hold + rates;\n"
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED, sweep, select=["rates"]) == []
    assert codes(tmp_path, LIGHT, GEAR, ALLOWED, sweep, select="all") == []
    idle = changed(ALLOWED, ("D105", "D102"))
    assert codes(tmp_path, LIGHT, GEAR, idle, sweep, select=["rates"]) == []
    assert codes(tmp_path, LIGHT, GEAR, idle, sweep, both, select=["both"]) == ["D105", "D333"]


def test_one_of_an_included_deck_need_not_be_of_use(tmp_path: Path) -> None:
    (tmp_path / "base.ic").write_text(LIGHT + GEAR + changed(ALLOWED, ("D105", "D102")), encoding="utf-8")
    include = '#include "base.ic"\n'
    assert codes(tmp_path, include, select="all") == ["D105"]
    assert codes(tmp_path, include, 'run mine like hold { allow D105 because "ours"; }\n', select=["mine"]) == []
    own = 'run mine like hold { allow D105 because "ours"; allow D138 because "ours"; }\n'
    assert codes(tmp_path, include, own, select="all") == ["D333", "D105"]


def test_one_need_not_be_of_use_to_a_deck_that_the_command_line_changes(tmp_path: Path) -> None:
    rates = changed(ALLOWED, ("dynamics = 100 Hz", "dynamics = RATE Hz"))
    deck = ("#ifndef RATE\n#define RATE 100\n#endif\n", LIGHT, GEAR, rates)
    assert not check(tmp_path, *deck).diagnostics
    assert not check(tmp_path, *deck, defines=["RATE=500"]).diagnostics
    assert not check(tmp_path, LIGHT, GEAR, ALLOWED, set=["rates.dynamics=500 Hz"]).diagnostics


def test_one_that_only_a_run_can_need_is_not_called_idle(tmp_path: Path) -> None:
    allowing = changed(RUN, ("record = [q];", 'record = [q]; allow D311 because "a blow of 1 ms";'))
    assert codes(tmp_path, ARM, SERVO, allowing) == []


def test_check_says_what_is_allowed_and_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck = tmp_path / "deck.ic"
    deck.write_text(LIGHT + GEAR + ALLOWED, encoding="utf-8")
    assert cli.main(["check", str(deck)]) == cli.YES
    assert capsys.readouterr() == (f"{deck}: 1 run, 1 case: no errors, 1 warning allowed\n", "")
    assert cli.main(["check", "-v", str(deck)]) == cli.YES
    lines = capsys.readouterr().out.splitlines()
    assert (
        "allowed: servo `drive` is fast for the dynamics' step: h * lambda = 0.833 (D105, because the rates are the paper's)"
        in lines
    )
    assert cli.main(["check", "--format", "json", str(deck)]) == cli.YES
    said = json.loads(capsys.readouterr().out)
    assert (said["warnings"], said["diagnostics"]) == (0, [])
    assert [(each["code"], each["because"]) for each in said["allowed"]] == [("D105", "the rates are the paper's")]
    sweep = 'sweep ends of hold { vary drive.kp = [0.01, 0.02] V*s/rad; allow D105 because "ours"; }\n'
    deck.write_text(LIGHT + GEAR + SLOW + sweep, encoding="utf-8")
    assert cli.main(["check", "--format", "json", str(deck)]) == cli.YES
    said = json.loads(capsys.readouterr().out)
    assert (said["warnings"], said["allowed"]) == (1, []), "its run is warned of it"


def test_it_silences_no_error_that_has_come_of_the_warning(tmp_path: Path) -> None:
    assert codes(tmp_path, LIGHT, changed(GEAR, ("j_m = 3e-5", "j_m = 1e-8")), ALLOWED) == ["D104"]


def test_it_is_in_the_plans_file_and_in_no_key(tmp_path: Path) -> None:
    made = check(tmp_path, LIGHT, GEAR, ALLOWED).plan
    assert made is not None
    (one,) = made.experiments
    assert plan_file.loads(plan_file.dumps(made)) == made
    bare = replace(one, allowances=())
    assert structure_key(one.structure) == structure_key(bare.structure)
    assert case_ids(one) == case_ids(bare)
    before = plan_file.dumps(replace(made, experiments=(bare,)))
    assert '"allowances"' not in before
    assert plan_file.loads(before).experiments[0].allowances == ()


@pytest.mark.parametrize(
    ("allowances", "message"),
    [
        ((Allowance("d105", "why"),), "experiments[0].allowances[0].code: 'd105' is no code of a warning"),
        ((Allowance("D105", "a"), Allowance("D105", "b")), "experiments[0].allowances: a warning is allowed twice"),
        ((Allowance("D105", " "),), "experiments[0].allowances[0].because: a reason is one line, which is not empty"),
        (
            (Allowance("D105", "a\nD102, because b"),),
            "experiments[0].allowances[0].because: a reason is one line, which is not empty",
        ),
    ],
)
def test_a_plans_file_with_other_ones_is_damaged(
    tmp_path: Path, allowances: tuple[Allowance, ...], message: str
) -> None:
    made = check(tmp_path, LIGHT, GEAR, ALLOWED).plan
    assert made is not None
    changed_one: Experiment = replace(made.experiments[0], allowances=allowances)
    with pytest.raises(Problem) as told:
        plan_file.loads(plan_file.dumps(replace(made, experiments=(changed_one,))))
    assert message in str(told.value)


def test_whole_messages(tmp_path: Path) -> None:
    wrong = changed(
        ALLOWED,
        (
            "the rates are the paper's\";",
            'ours";\n    allow D060 because "no";\n    allow D1O5 because "no";\n    allow D102;\n'
            '    allow D102 because "";\n    allow D105 because "again";',
        ),
    )
    assert messages(check(tmp_path, LIGHT, GEAR, wrong)) == (
        """\
error[D331]: `D060` is no warning of a run, and nothing else is allowed
  --> deck.ic:18:11
   |
18 |     allow D060 because "no";
   |           ^^^^
   = help: mend what it says, and leave this out: `met doc D060`

error[D331]: no warning has the code `D1O5`
  --> deck.ic:19:11
   |
19 |     allow D1O5 because "no";
   |           ^^^^
   = help: did you mean `D105`?
   = help: a code is printed with its warning, as in `warning[D105]`

error[D330]: an `allow` names a warning and says why
  --> deck.ic:20:11
   |
20 |     allow D102;
   |           ^^^^
   = help: write `allow D102 because "REASON";`

error[D330]: an `allow` names a warning and says why
  --> deck.ic:21:11
   |
21 |     allow D102 because "";
   |           ^^^^
   = help: write `allow D102 because "REASON";`

error[D332]: `D105` is allowed twice
  --> deck.ic:22:11
   |
22 |     allow D105 because "again";
   |           ^^^^ again
  ::: deck.ic:17:11  first
   = help: leave one of the two out

5 errors
"""
    )


def test_one_that_silences_nothing_is_said(tmp_path: Path) -> None:
    assert messages(check(tmp_path, ARM, SERVO, ALLOWED)) == (
        """\
warning[D333]: `allow D105` silences nothing here
  --> deck.ic:17:11
   |
17 |     allow D105 because "the rates are the paper's";
   |           ^^^^
   = help: leave it out: no such warning is given

1 warning
"""
    )


@pytest.mark.parametrize("block", ["servos", "initial", "rates"])
def test_one_inside_a_block_of_the_run_is_refused(block: str, tmp_path: Path) -> None:
    inside = f'run other like hold {{ {block} {{ allow D105 because "ours"; }} }}\n'
    (found,) = check(tmp_path, ARM, SERVO, RUN, inside, select="all").diagnostics
    assert (found.code, found.message) == ("D142", f"`allow` inside `{block}`")
    assert found.help == ("it belongs to a run or a sweep",)
